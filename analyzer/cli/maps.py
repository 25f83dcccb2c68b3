"""--map MAP[@UNIT]: which register map serves which unit."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dissectors.maps.units import UnitMaps


def add_map_argument(parser: argparse.ArgumentParser) -> None:
    """--map."""
    parser.add_argument(
        "--map",
        metavar="MAP[@UNIT]",
        action="append",
        default=[],
        help="a register map, a file or one of `rtuscope map list`, for a unit or for all; may be given again",
    )


def chosen_charts(arguments: argparse.Namespace) -> UnitMaps:
    """The maps that were given."""
    from dissectors.maps.units import UnitMaps

    if not arguments.map:
        return UnitMaps()
    from dissectors.maps import map_for_unit

    by_unit, other = {}, None
    for text in arguments.map:
        chart, unit = map_for_unit(text)
        if unit is None:
            other = other or chart
        else:
            by_unit[unit] = chart
    return UnitMaps(by_unit, other)
