"""--map MAP[@UNIT]: which register map serves which unit."""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dissectors.maps import RegisterMap


def add_map_argument(parser: argparse.ArgumentParser) -> None:
    """--map."""
    parser.add_argument(
        "--map",
        metavar="MAP[@UNIT]",
        action="append",
        default=[],
        help="a register map, a file or one of `rtuscope map list`, for a unit or for all; may be given again",
    )


class UnitCharts(dict[int, "RegisterMap"]):
    """Maps by unit; one that was given without a unit serves every unit that has none of its own."""

    def __init__(self, by_unit: dict[int, RegisterMap], other: RegisterMap | None) -> None:
        super().__init__(by_unit)
        self.other = other

    def __missing__(self, unit: int) -> RegisterMap:
        if self.other is None:
            raise KeyError(unit)
        return self.other

    def get(self, unit: int, default: Any = None) -> Any:
        """The map of a unit."""
        return dict.get(self, unit, self.other if self.other is not None else default)

    def of(self, units: Iterable[int]) -> dict[int, RegisterMap]:
        """The maps of these units, those without one left out."""
        return {unit: self[unit] for unit in units if unit in self or self.other is not None}

    def __bool__(self) -> bool:
        return len(self) > 0 or self.other is not None


def chosen_charts(arguments: argparse.Namespace) -> UnitCharts:
    """The maps that were given."""
    if not arguments.map:
        return UnitCharts({}, None)
    from dissectors.maps import map_for_unit

    by_unit, other = {}, None
    for text in arguments.map:
        chart, unit = map_for_unit(text)
        if unit is None:
            other = other or chart
        else:
            by_unit[unit] = chart
    return UnitCharts(by_unit, other)
