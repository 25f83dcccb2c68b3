"""How often something may happen: findings by code or severity, plain words for what people ask for most, and whatever
the display filter can tell that has no form of its own.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from lark import Token
from numpy.typing import NDArray

from captures.line import LineSettings
from dissectors.values import harmless

from ...filters import Filter, FilterError, compile_filter, meant
from ...filters.literals import spelled
from ...languages import counted, page_words
from ...reports import Report
from ...tables.findings import Findings, Severity, codes, describe, rules
from .. import CheckError
from ..model import CHARTS, Breach, Breaches, CheckedBatch, RuleResult, Start, form
from ..parsing import at

# Plain words, and the display filter that they stand for.
WORDS: Final = {
    "crc-errors": "crc_ok == false or finding in (bit-flip, byte-extra, byte-missing, bytes-repeated, collision, "
    "crc-error, crc-variant, flow-control-loss, truncated)",  # damaged ones lie in noise, too
    "timeouts": "finding == no-response",
    "retries": "retry",
    "exceptions": "exception",
    "noise": "noise",
}


@dataclass
class _FindingCount:
    """Counts findings of some rules."""

    wanted: NDArray[np.bool_]  # by the number of the rule
    most: int

    def __post_init__(self) -> None:
        self._breaches = Breaches()

    def feed(self, checked: CheckedBatch) -> None:
        findings = checked.findings
        self._breaches.add(np.flatnonzero(self.wanted[findings.rule]), lambda number: _breach_of(findings, number))

    def verdict(self, report: Report) -> RuleResult:  # noqa: ARG002
        count = self._breaches.count
        return RuleResult(count <= self.most, counted(count, "finding", "findings"), *self._breaches.told)


def _breach_of(findings: Findings, number: int) -> Breach:
    finding = describe(findings, number)
    text = harmless(f"{finding.code}: {finding.text}")
    return Breach(text, finding.index, finding.start, finding.length, finding.port, finding.t_ns)


@dataclass
class PassingCount:
    """Counts rows that pass one filter, and of those the ones that do not pass another."""

    chosen: Filter
    most: int | None = 0
    due: Filter | None = None

    def __post_init__(self) -> None:
        self._breaches = Breaches()
        self._chosen = 0

    def feed(self, checked: CheckedBatch) -> None:
        mask = self.chosen.mask(checked.table)
        self._chosen += int(mask.sum())
        if self.due is not None:
            mask &= ~self.due.mask(checked.table)
        self._breaches.add(np.flatnonzero(mask), checked.place)

    def verdict(self, report: Report) -> RuleResult:  # noqa: ARG002
        count, told = self._breaches.count, self._breaches.told
        if self.due is None:
            return RuleResult(count <= (self.most or 0), page_words("{count:,} found", count=count), *told)
        words = page_words("{some:,} of {all:,} match", some=self._chosen - count, all=self._chosen)
        return RuleResult(
            not count and self._chosen > 0, words if self._chosen else page_words("none passes the first filter"), *told
        )


def _at_most(words: list[Token], most: int, line: LineSettings) -> Start:
    """At most so many of what these words name."""
    name = spelled(" ".join(words))
    if len(words) > 1 and f"{name}s" in WORDS:  # "no crc error": all that damage frames, not one finding's code
        name += "s"
    if name in WORDS:
        wanted = compile_filter(WORDS[name], line)
        return lambda: PassingCount(wanted, most)
    if name not in codes():
        near = meant(name, [*WORDS, *codes()]).replace("crc-errors", "crc errors")
        raise CheckError(
            f"{' '.join(words)!r} is unknown{near or '; rtuscope help findings lists all codes'}", at(words[0])
        )
    mask = np.array([code == name for code in codes()])
    return lambda: _FindingCount(mask, most)


@form("no-findings", '"no"i "findings"i ["of"i "severity"i WORD]', "no findings, or none of this severity or above",
      "no findings", "no findings of severity warning")  # fmt: skip
def no_findings(line: LineSettings, severity: Token | None) -> Start:  # noqa: ARG001
    grades = {grade.name.lower(): grade for grade in Severity}
    if severity is not None and severity.lower() not in grades:
        raise CheckError(f"severity must be {', '.join(grades)}, not {str(severity)!r}", at(severity))
    least = Severity.NOTE if severity is None else grades[severity.lower()]
    mask = np.array([rule.severity >= least for rule in rules()])
    return lambda: _FindingCount(mask, 0)


@form("no", '"no"i thing', "this never happens", "no crc errors", "no late-response")
def none_of(line: LineSettings, thing: list[Token]) -> Start:
    return _at_most(thing, 0, line)


@form("at-most", '"at"i "most"i NUMBER thing', "this happens at most N times", "at most 3 retries")
def at_most(line: LineSettings, number: Token, thing: list[Token]) -> Start:
    return _at_most(thing, whole_number(number), line)


def whole_number(number: Token, most: int = 1 << 62) -> int:
    """A terminal as a whole number."""
    if not number.isdigit() or int(number) > most:
        raise CheckError(f"a whole number{'' if most >> 60 else f' up to {most}'} is needed, not {number}", at(number))
    return int(number)


def _filter(text: Token, line: LineSettings) -> Filter:
    try:
        return compile_filter(text, line, CHARTS.get())
    except FilterError as error:
        raise CheckError(error.message, at(text) + error.column) from error


@form(
    "none-where",
    '"none"i "where"i FILTER',
    "no row matches a display filter",
    "none where unit == 17 and exception == 4",
)
def none_where(line: LineSettings, text: Token) -> Start:
    wanted = _filter(text, line)
    return lambda: PassingCount(wanted)


@form("all-where", '"all"i "where"i FILTER ":" FILTER',
      "every row that matches the first filter matches the second, and there is at least one",
      "all where function == 3 and request: quantity <= 50")  # fmt: skip
def all_where(line: LineSettings, chosen: Token, due: Token) -> Start:
    first, second = _filter(chosen, line), _filter(due, line)
    return lambda: PassingCount(first, None, second)
