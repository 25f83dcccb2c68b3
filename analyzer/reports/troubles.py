"""Findings counted and ranked by what they cost the bus: answers lost and time lost.

A lost answer costs at least what the master waits for it; where a finding does not say how long that was, the usual
wait of this bus is taken. One counter a rule and unit, so that memory stays flat.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ..tables.findings import Findings, Rule, describe, rules
from ..tables.schema import Rows
from .model import FindingRow

_NOBODY: Final = 256  # instead of a unit: noise, requests to nobody in particular, the bus as a whole
_USUAL_MS: Final = 200.0  # that a master waits, where this bus has not shown it
_UNITS: Final = 8  # named in a row


@dataclass(slots=True)
class _RuleTally:
    """What was found by one rule."""

    first: np.void
    units: NDArray[np.int64]
    lost_ms: float = 0.0
    silent: int = 0  # findings that do not say how long


class Troubles:
    """Counts findings as they come."""

    def __init__(self) -> None:
        self._kinds: dict[int, _RuleTally] = {}

    def add(self, findings: Findings, rows: Rows) -> None:
        """Count findings on these rows."""
        if not len(findings):
            return
        units = _units(findings, rows)
        for number in np.flatnonzero(np.bincount(findings["rule"])).tolist():
            here = findings["rule"] == number
            kind = self._kinds.get(number)
            if kind is None:
                first = findings[here][:1].copy()[0]
                kind = self._kinds[number] = _RuleTally(first, np.zeros(_NOBODY + 1, np.int64))
            kind.units += np.bincount(units[here], minlength=_NOBODY + 1)
            known = _wasted_ms(rules()[number], findings[here])
            kind.lost_ms += float(np.nansum(known))
            kind.silent += int(np.isnan(known).sum())

    def rows(self) -> tuple[FindingRow, ...]:
        """A row a rule, those that cost most first."""
        wait = self._usual_wait_ms()
        made = [_row(rules()[number], kind, wait) for number, kind in self._kinds.items()]
        rank = {"error": 0, "warning": 1, "note": 2}
        made.sort(key=lambda row: (-row.lost_ms, -row.lost_answers, rank[row.severity], -row.count, row.code))
        return tuple(made)

    def _usual_wait_ms(self) -> float:
        for number, kind in self._kinds.items():
            said = int(kind.units.sum()) - kind.silent
            if rules()[number].code == "no-response" and said:
                return kind.lost_ms / said
        return _USUAL_MS


def _row(rule: Rule, kind: _RuleTally, wait_ms: float) -> FindingRow:
    count = int(kind.units.sum())
    lost = count if rule.loses else 0
    example = describe(kind.first)
    order = np.argsort(-kind.units[:_NOBODY], kind="stable")[:_UNITS]
    return FindingRow(
        code=rule.code,
        severity=rule.severity.name.lower(),
        count=count,
        lost_answers=lost,
        lost_ms=round(kind.lost_ms + (kind.silent * wait_ms if rule.loses else 0.0), 3),
        units={int(unit): int(kind.units[unit]) for unit in order.tolist() if kind.units[unit]},
        text=example.text,
        cause=example.cause,
        remedy=example.remedy,
        clause=example.clause,
        index=example.index,
        start=example.start,
        port=example.port,
        t_ns=example.t_ns,
    )


def _wasted_ms(rule: Rule, findings: Findings) -> NDArray[np.float64]:
    """The time that each finding cost, as far as it says; NaN where it does not."""
    if rule.wastes in rule.numbers:
        wasted: NDArray[np.float64] = findings["numbers"][:, rule.numbers.index(rule.wastes)]
        return wasted
    return np.full(len(findings), np.nan if rule.loses else 0.0)


def _units(findings: Findings, rows: Rows) -> NDArray[np.intp]:
    """The unit that each finding is about."""
    units = np.full(len(findings), _NOBODY, np.intp)
    frames = np.flatnonzero(rows["index"] >= 0)
    first = int(rows["index"][frames[0]]) if len(frames) else 0
    place = findings["index"] - first
    known = (findings["index"] >= 0) & (place >= 0) & (place < len(frames))
    known[known] = rows["check"][frames[place[known]]]  # of a damaged frame the unit may be what is wrong
    units[known] = rows["unit"][frames[place[known]]]
    for number in np.flatnonzero(np.bincount(findings["rule"])).tolist():
        if "unit" in rules()[number].numbers:
            here = (findings["rule"] == number) & ~known
            said = findings["numbers"][here, rules()[number].numbers.index("unit")]
            units[here] = np.where(np.isnan(said), _NOBODY, np.nan_to_num(said)).astype(np.intp)
    return units
