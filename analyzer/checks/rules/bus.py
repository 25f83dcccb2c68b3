"""The bus as a whole: its load, who is on it, that there is something to judge, and that nothing is wrong with it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from lark import Token

from captures.line import LineSettings

from ...languages import counted, page_words
from ...reports import Report
from ...reports.page import unknown_load
from ...tables.schema import Kind
from .. import CheckError
from ..model import Breaches, CheckedBatch, RuleResult, Start, comma_separated, form
from ..parsing import at
from .answers import COMPARE
from .counts import whole


@dataclass
class _Summed:
    """A rule that the report alone decides."""

    verdict: Callable[[Report], RuleResult]

    def feed(self, checked: CheckedBatch) -> None:
        pass


@form("load", '"load"i COMPARED NUMBER "%"', "share of the time in which something is on the wire", "load < 60 %")
def load(line: LineSettings, compared: Token, number: Token) -> Start:  # noqa: ARG001
    bound = float(number) / 100
    if bound > 1:
        raise CheckError("a load is at most 100 %", at(number))

    def verdict(report: Report) -> RuleResult:
        mean = report.load.mean
        if mean is None:
            return RuleResult(False, unknown_load(report))
        return RuleResult(bool(COMPARE[compared](mean, bound)), f"{mean:.1%}")

    return lambda: _Summed(verdict)


@form("at-least-frames", '"at"i "least"i NUMBER "frames"i', "the capture holds so many frames", "at least 100 frames")
def at_least_frames(line: LineSettings, number: Token) -> Start:  # noqa: ARG001
    least = whole(number)
    return lambda: _Summed(lambda report: RuleResult(report.frames >= least, counted(report.frames, "frame", "frames")))


@dataclass
class _UnitsOnBus:
    """Who speaks and who is spoken to, in frames with a right check value; broadcasts apart."""

    allowed: frozenset[int]
    all_of_them: bool

    def __post_init__(self) -> None:
        self._breaches = Breaches()
        self._heard: set[int] = set()
        self._answered: set[int] = set()

    def feed(self, checked: CheckedBatch) -> None:
        rows = checked.batch.rows
        sound = (rows.kind != Kind.NOISE) & rows.check & (rows.unit > 0)
        units, where = np.unique(rows.unit[sound], return_index=True)
        new = ~np.isin(units, list(self.allowed | self._heard))
        strange = np.sort(np.flatnonzero(sound)[where[new]])  # the first frame of each
        self._heard.update(units.tolist())
        self._answered.update(np.unique(rows.unit[sound & (rows.kind == Kind.RESPONSE)]).tolist())
        self._breaches.add(strange, lambda row: checked.place(row, page_words("unit {unit}", unit=rows.unit[row])))

    def verdict(self, report: Report) -> RuleResult:  # noqa: ARG002
        strangers = self._heard - self.allowed
        absent = self.allowed - self._answered if self.all_of_them else set()
        parts = [
            page_words("units {units}", units=comma_separated(self._heard)) if self._heard else page_words("no units")
        ]
        parts += [page_words("not expected: {units}", units=comma_separated(strangers))] if strangers else []
        parts += [page_words("never answered: {units}", units=comma_separated(absent))] if absent else []
        return RuleResult(not strangers and not absent, "; ".join(parts), tuple(self._breaches.first))


@form("units-are", '"units"i "are"i numbers', "these units answer, and no other is asked or answers",
      "units are 1, 2, 17")  # fmt: skip
def units_are(line: LineSettings, numbers: list[Token]) -> Start:  # noqa: ARG001
    allowed = frozenset(whole(number, 255) for number in numbers)
    return lambda: _UnitsOnBus(allowed, all_of_them=True)


@form("no-units-but", '"no"i "units"i "but"i numbers', "no other unit is asked or answers", "no units but 1, 2")
def no_units_but(line: LineSettings, numbers: list[Token]) -> Start:  # noqa: ARG001
    allowed = frozenset(whole(number, 255) for number in numbers)
    return lambda: _UnitsOnBus(allowed, all_of_them=False)


@dataclass
class _Causes:
    """Counts the causes that concern a unit, or all; notes are no fault."""

    needs_causes: ClassVar[bool] = True
    unit: int | None

    def feed(self, checked: CheckedBatch) -> None:
        pass

    def verdict(self, report: Report) -> RuleResult:
        causes = [cause for cause in report.causes if cause.severity != "note"]
        if self.unit is not None:
            causes = [cause for cause in causes if self.unit in cause.units]
        listed = "; ".join(
            f"{cause.cause} ({page_words('{share:.0%} sure', share=cause.confidence)}): {cause.text}"
            for cause in causes
        )
        return RuleResult(not causes, listed or page_words("none"))


@form("no-causes", '"no"i ("cause"i | "causes"i) ["of"i "unit"i NUMBER]',
      "nothing is wrong with the bus, or with one unit: no cause but notes", "no causes",
      "no cause of unit 7")  # fmt: skip
def no_causes(line: LineSettings, unit: Token | None) -> Start:  # noqa: ARG001
    number = None if unit is None else whole(unit, 255)
    return lambda: _Causes(number)
