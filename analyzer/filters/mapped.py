"""Values by register maps in filters: `value("Active power") > 5 kW`, `name contains "voltage"`.

Which map serves which unit is given when the filter is compiled: so a name that no map has, and a unit that does not
measure the same, are told at once. A value is looked at in its map's unit; bounds are brought to it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from typing import Any, Final

import numpy as np

from dissectors.maps.files import UnitMaps
from dissectors.maps.model import MappedValue, factor_between

from ..languages import tr
from ..registers.readings import MappedColumn, mapped_columns
from . import FilterError, meant
from .fields import Cost, FilterField, by_name
from .kinds import EQUAL, ORDER, Suggestion
from .literals import Item, Literal, plain_number, spelled, typed_name
from .slices import FieldSlice, Mask, TableSlice, says
from .tree import MeasuredSpan, MeasuresWanted, TextWanted, Wanted

_EXACT, _EXACT_FLOAT = 1e-9, 5.1e-7  # shares of a number: what scales, and seven digits of a float, make of its last
_MOST_SHOWN: Final = 6


def named_value(name: str, column: int, charts: UnitMaps | None) -> FilterField:
    """The field `value("NAME")`; * and ? in the name stand for any characters and for one. Raises FilterError."""
    if not charts:
        raise FilterError(tr("{name!r} needs a register map: --map MAP[@UNIT]", name=name), column)
    rows = [row for chart in charts.all for row in chart.rows if _is_called(row, name)]
    if not rows:
        names = {row.name.casefold(): None for chart in charts.all for row in chart.rows}
        near = meant(name.casefold(), names)
        raise FilterError(tr("no map has a value {name!r}", name=name) + near, column)
    numbers = [row for row in rows if row.type != "text"]
    if not numbers:
        raise FilterError(tr("{name!r} is a text: name == {name!r} tells which rows have it", name=name), column)

    def get(section: TableSlice, _: Mask | None) -> FieldSlice:
        columns = mapped_columns(section.batch, section.decoded, charts, lambda row: _is_called(row, name))
        return _MeasuredSlice([one for one in columns if one.row.type != "text"], len(section))

    return FilterField(
        f'value("{name}")', MeasureKind(tuple(numbers)), f"the value {name} of a register map", "", get, Cost.CONTENTS
    )


def field_of_names(charts: UnitMaps | None, column: int) -> FilterField:
    """The field `name`: the names of the mapped values that a row holds. Raises FilterError without maps."""
    if not charts:
        raise FilterError(tr("names come from a register map: --map MAP[@UNIT]"), column)

    def get(section: TableSlice, _: Mask | None) -> FieldSlice:
        return _NameSlice(list(mapped_columns(section.batch, section.decoded, charts)), len(section))

    return replace(by_name()["name"], get=get)


@dataclass(frozen=True)
class MeasureKind:
    """A number of a map's value, with a unit of measure or in the map's own; of an enum also the name of a state."""

    rows: tuple[MappedValue, ...]
    operators = EQUAL + ORDER

    @property
    def values(self) -> str:
        units = ", ".join(dict.fromkeys(row.unit for row in self.rows if row.unit))
        return f"number, in {units} if it has no unit" if units else "number"

    def choices(self) -> Iterable[Suggestion]:
        states = {state: text for row in self.rows for state, text in row.values.items() if row.type != "bits"}
        return [Suggestion(typed_name(text), tr("state {number}", number=state)) for state, text in states.items()]

    def wanted(self, operator: str, items: Sequence[Item]) -> Wanted:
        return MeasuresWanted(tuple(self._span(operator, low, high) for low, high in items))

    def _span(self, operator: str, low: Literal, high: Literal | None) -> MeasuredSpan:
        number, unit = self._bound(low)
        if high is not None:
            last, its_unit = self._bound(high)
            factor = factor_between(unit, its_unit) if unit and its_unit else 1.0
            if factor is None:
                raise FilterError(tr("{one} does not measure what {other} does", one=its_unit, other=unit), high.column)
            number *= factor
            return MeasuredSpan(number, last, False, its_unit or unit)
        if operator in ORDER:
            strict = operator in ("<", ">")
            above = operator[0] == ">"
            return MeasuredSpan(number if above else None, None if above else number, strict, unit)
        return MeasuredSpan(number, number, False, unit)

    def _bound(self, literal: Literal) -> tuple[float, str]:
        if literal.form in ("string", "word"):
            states = {spelled(text): state for row in self.rows for state, text in row.values.items()}
            state = states.get(spelled(literal.text))
            if state is None:
                near = meant(spelled(literal.text), states)
                raise FilterError(tr("no state {name!r}", name=literal.text) + near, literal.column)
            return float(state), ""
        unit = literal.unit
        if unit and all(factor_between(unit, row.unit) is None for row in self.rows):
            units = list(dict.fromkeys(row.unit or tr("no unit") for row in self.rows))[:_MOST_SHOWN]
            message = tr("{unit} does not measure it: it is in {units}", unit=unit, units=", ".join(units))
            raise FilterError(message, literal.column)
        return float(plain_number(Literal(literal.form, literal.text, literal.column), tr("a number"))), unit


@dataclass(frozen=True, slots=True, eq=False)
class _MeasuredSlice:
    """The readings of mapped values in some rows, of `count`."""

    columns: list[MappedColumn]
    count: int

    def valid(self) -> Mask:
        return self._rows(lambda one: ~np.isnan(one.values))

    def passing(self, wanted: Wanted) -> Mask:
        assert isinstance(wanted, MeasuresWanted)
        return self._rows(lambda one: _within(one, wanted.spans))

    def _rows(self, good: Callable[[MappedColumn], Mask]) -> Mask:
        mask = np.zeros(self.count, np.bool_)
        for one in self.columns:
            mask[one.answers[good(one)]] = True
        return mask


@dataclass(frozen=True, slots=True, eq=False)
class _NameSlice:
    """The names of what rows hold, of `count` rows."""

    columns: list[MappedColumn]
    count: int

    def valid(self) -> Mask:
        return self._of(self.columns)

    def passing(self, wanted: Wanted) -> Mask:
        assert isinstance(wanted, TextWanted)
        return self._of(one for one in self.columns if says(one.row.name, wanted))

    def _of(self, columns: Iterable[MappedColumn]) -> Mask:
        mask = np.zeros(self.count, np.bool_)
        for one in columns:
            mask[one.answers] = True
        return mask


def _within(column: MappedColumn, spans: Sequence[MeasuredSpan]) -> Mask:
    """Which readings lie in any of the spans, brought to the value's own unit."""
    values: Any = column.values
    inside = np.zeros(len(values), np.bool_)
    slack = _EXACT_FLOAT if column.row.type == "f32" else _EXACT
    for span in spans:
        factor = factor_between(span.unit, column.row.unit) if span.unit else 1.0
        if factor is None:
            continue
        good = ~np.isnan(values)
        if span.low is not None:
            low = span.low * factor
            good &= values > low + slack * abs(low) if span.strict else values >= low - slack * abs(low)
        if span.high is not None:
            high = span.high * factor
            good &= values < high - slack * abs(high) if span.strict else values <= high + slack * abs(high)
        inside |= good
    return inside


def _is_called(row: MappedValue, name: str) -> bool:
    return spelled(row.name) == spelled(name) or fnmatchcase(row.name.casefold(), name.casefold())
