"""--map MAP[@UNIT]: which register map serves which unit."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dissectors.maps.units import UnitMaps


def add_map_argument(parser: argparse.ArgumentParser | argparse._ArgumentGroup) -> None:
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
    from dissectors.maps.units import unit_maps

    return unit_maps(arguments.map)
