"""What values may be: within the limits of their register maps, written by no request or by those that may.

Requests that write carry values or masks, which the functions' declarations tell. `4x108` and `40108` count from 1, as
everywhere; a range that begins with 0 (`4x0-100`) can only count from 0 and does.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Final

import numpy as np
from lark import Token
from numpy.typing import NDArray

from captures.line import LineSettings
from dissectors.declaration import Mask
from dissectors.functions import function
from dissectors.layout import contents
from dissectors.length_rules import Role, shape
from dissectors.values import Area, ValueFormError, physical

from ...languages import counted, page_words
from ...registers.readings import limits_broken, mapped_columns
from ...reports import Report
from ...reports.page import unknown
from ...tables.columns import AREA_CODES
from ...tables.schema import Kind
from .. import CheckError
from ..model import CHARTS, Breaches, CheckedBatch, RuleResult, Start, form
from ..parsing import at

if TYPE_CHECKING:
    from dissectors.maps.files import UnitMaps


class _Limits:
    """Counts readings that lie outside the least and the greatest value of their map."""

    def __init__(self, charts: UnitMaps | None) -> None:
        self._charts = charts
        self._breaches = Breaches()
        self._examined = 0

    def feed(self, checked: CheckedBatch) -> None:
        for column in mapped_columns(checked.batch, checked.decoded, self._charts or {}):
            row = column.row
            if row.minimum is None and row.maximum is None:
                continue
            self._examined += len(column.answers)
            for number in np.flatnonzero(limits_broken(column)).tolist():
                text = page_words(
                    "{name} is {value:g} {unit}", name=row.name, value=column.values[number], unit=row.unit
                )
                text = text.rstrip()
                self._breaches.add(column.answers[number : number + 1], partial(checked.place, text=text))

    def verdict(self, report: Report) -> RuleResult:  # noqa: ARG002
        if not self._charts:
            return RuleResult(False, unknown("it needs a register map (--map)"))
        if not self._examined:
            return RuleResult(False, unknown("no value that has limits was read"))
        count = self._breaches.count
        return RuleResult(
            not count,
            page_words("{readings} outside", readings=counted(count, "reading", "readings")),
            *self._breaches.told,
        )


@form("values-in-limits", '"values"i "in"i "their"i "limits"i',
      "every value with limits in its register map (--map) is within them", "values in their limits")  # fmt: skip
def values_in_limits(line: LineSettings) -> Start:  # noqa: ARG001
    charts = CHARTS.get()
    return lambda: _Limits(charts)


_ENDS: Final = re.compile(r"\s*(?:-|\.\.)\s*")
_FROM_ZERO: Final = re.compile(r"([0134]x)0+", re.IGNORECASE)
_LAST: Final = 0xFFFF


@dataclass(frozen=True, slots=True)
class _AddressRange:
    area: Area
    low: int
    high: int


@dataclass
class _Writes:
    """Counts writes; of `ranges` those that touch them, or with `outside` those that leave them."""

    ranges: tuple[_AddressRange, ...]
    outside: bool

    def __post_init__(self) -> None:
        self._breaches = Breaches()
        self._writes = 0

    def feed(self, checked: CheckedBatch) -> None:
        rows = checked.batch.rows
        requests = (rows.kind == Kind.REQUEST) & rows.check
        writing = np.flatnonzero(requests & np.isin(rows.function, _writing()))
        self._writes += len(writing)
        if self.ranges:
            writing = writing[self._broken(checked, writing)]
        self._breaches.add(writing, checked.place)

    def _broken(self, checked: CheckedBatch, writing: NDArray[np.intp]) -> NDArray[np.bool_]:
        decoded = checked.decoded
        low = np.where(decoded.value_address >= 0, decoded.value_address, decoded.address)[writing].astype(np.int64)
        high = low + np.maximum(np.diff(decoded.offsets)[writing], 1) - 1
        areas, addressed = decoded.area[writing], low >= 0
        touched = np.zeros(len(writing), np.bool_)
        covered = np.zeros(len(writing), np.int64)  # how many of its addresses lie in the ranges, which are disjoint
        for each in self.ranges:
            common = np.minimum(high, each.high) - np.maximum(low, each.low) + 1
            common = np.where(addressed & (areas == AREA_CODES[each.area]), np.maximum(common, 0), 0)
            touched |= common > 0
            covered += common
        return (covered < high - low + 1) if self.outside else touched

    def verdict(self, report: Report) -> RuleResult:  # noqa: ARG002
        count, told = self._breaches.count, self._breaches.told
        words = counted(self._writes, "write", "writes")
        if self.ranges:
            where = ", ".join(
                page_words("{area} addresses {low} to {high}", area=each.area, low=each.low, high=each.high)
                for each in self.ranges
            )
            words += page_words(
                ", {count:,} outside {where} (counted from 0)"
                if self.outside
                else ", {count:,} inside {where} (counted from 0)",
                count=count, where=where,
            )  # fmt: skip
        return RuleResult(not count, words, *told)


@form("no-writes", '"no"i "writes"i', "nothing is written", "no writes")
def no_writes(line: LineSettings) -> Start:  # noqa: ARG001
    return lambda: _Writes((), outside=False)


@form("no-writes-outside", '"no"i "writes"i "outside"i ranges',
      "only these addresses are written; file records have no addresses", "no writes outside 4x0-100",
      "no writes outside 40001-40100, 00001-00016")  # fmt: skip
def no_writes_outside(line: LineSettings, ranges: list[Token]) -> Start:  # noqa: ARG001
    wanted = _disjoint(ranges)
    return lambda: _Writes(wanted, outside=True)


@form("no-writes-inside", '"no"i "writes"i "inside"i ranges', "nothing is written to these addresses",
      "no writes inside 41000-41999")  # fmt: skip
def no_writes_inside(line: LineSettings, ranges: list[Token]) -> Start:  # noqa: ARG001
    wanted = _disjoint(ranges)
    return lambda: _Writes(wanted, outside=False)


def _writing() -> list[int]:
    """Codes of the functions whose requests carry values or masks."""
    codes = []
    for (code, role), content in contents().items():
        declared = function(code)
        if role is Role.REQUEST and declared is not None:
            masks = any(isinstance(number, Mask) for number in shape(declared.request).numbers.values())
            if content.held is not None or content.listed or masks:
                codes.append(code)
    return codes


def _disjoint(tokens: list[Token]) -> tuple[_AddressRange, ...]:
    """Ranges in order; those that touch are one."""
    joined: list[_AddressRange] = []
    for each in sorted(map(_range, tokens), key=lambda one: (one.area, one.low)):
        if joined and joined[-1].area == each.area and each.low <= joined[-1].high + 1:
            joined[-1] = _AddressRange(each.area, joined[-1].low, max(joined[-1].high, each.high))
        else:
            joined.append(each)
    return tuple(joined)


def _range(token: Token) -> _AddressRange:
    """`4x0-100`, `4x1-4x100`, `40001-40100`, `40001`: area and physical addresses."""
    ends = _ENDS.split(str(token))
    try:
        if zero := _FROM_ZERO.fullmatch(ends[0]):
            area, low = physical(f"{zero[1]}1")
            last = ends[-1].lower().removeprefix(zero[1].lower()) if len(ends) > 1 else "0"
            if "x" in last or int(last) > _LAST:
                raise ValueFormError(f"{ends[-1]!r} is not an address up to {_LAST} in area {zero[1]}")
            high = int(last)
        else:
            area, low = physical(ends[0])
            short = "x" in ends[0].lower() and "x" not in ends[-1].lower()
            last_area, high = physical(f"{area}{ends[-1]}" if short else ends[-1])
            if last_area != area:
                raise ValueFormError("both ends of a range must be in the same area")
    except ValueFormError as error:
        raise CheckError(str(error), at(token)) from error
    if high < low:
        raise CheckError(f"the range runs backwards: {ends[-1]}-{ends[0]}", at(token))
    return _AddressRange(area, low, high)
