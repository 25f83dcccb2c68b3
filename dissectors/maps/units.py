"""Which register map serves which unit."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from .model import RegisterMap


def unit_maps(names: Iterable[str]) -> UnitMaps:
    """The maps of `MAP@UNIT` or `MAP` each; of several without a unit the first serves. MapError."""
    from .files import map_for_unit

    by_unit, other = {}, None
    for text in names:
        chart, unit = map_for_unit(text)
        if unit is None:
            other = other or chart
        else:
            by_unit[unit] = chart
    return UnitMaps(by_unit, other)


class UnitMaps(dict[int, RegisterMap]):
    """Maps by unit; `other` serves every unit that has none of its own."""

    def __init__(self, by_unit: dict[int, RegisterMap] | None = None, other: RegisterMap | None = None) -> None:
        super().__init__(by_unit or {})
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

    @property
    def all(self) -> list[RegisterMap]:
        """Every map, once."""
        listed = [*self.values(), *([self.other] if self.other is not None else [])]
        return list({id(chart): chart for chart in listed}.values())

    def __bool__(self) -> bool:
        return len(self) > 0 or self.other is not None
