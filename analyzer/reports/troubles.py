"""Findings counted and ranked by what they cost the bus: answers lost and time lost.

Time is what the client waited in vain, as far as the capture's times show it, and never more than its own timeout;
where nothing was measured no time is said. One counter a rule, its variant and unit, so that memory stays flat.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from ..causes.flatmemory import Thinned, densest
from ..tables.findings import Findings, Rule, codes, describe, rules
from ..tables.schema import Kind, Rows
from ..tables.transactions import NEVER, Status, TransactionRows
from .model import Counts, FindingGroup, FindingRow

_NOBODY: Final = 256  # instead of a unit: noise, requests to nobody in particular, the bus as a whole
_UNITS: Final = 8  # named in a row
_GROUPS: Final = 64  # kept of a rule
_PENDING: Final = 4096  # damaged answers whose transaction is not settled
_FEW: Final = 5  # requests that stand there twice
_OFTEN: Final = 0.4  # of all, the echoes counted: half of them are some
COUNTED_TWICE: Final = "requests", "unanswered", "retries"  # of `Counts`, where an adapter shows what it sends
_SLACK: Final = 1.3  # of the timeout: what a wait is at most


def of_echoes(findings: Findings) -> NDArray[np.bool_]:
    """Which findings speak of a request that stands there twice, one right after the other."""
    whole: NDArray[np.bool_] = np.isnan(findings.numbers[:, 1]) & (findings.rule == codes().index("echo"))
    return whole


def is_habit(echoes: int, requests: int) -> bool:
    """Whether an adapter shows what is sent through it: so many of the requests stand there twice. A client that asks
    again at once now and then does not make that many."""
    return echoes >= _FEW and echoes > _OFTEN * requests


def asked_once(counts: Counts, *, shown_twice: bool) -> Counts:
    """Counts in which what an adapter shows twice is one request; the first, which nobody answers, is none."""
    if not shown_twice:
        return replace(counts, echoes=0)
    fewer = {name: getattr(counts, name) - counts.echoes for name in COUNTED_TWICE}
    return replace(counts, **{name: max(0, number) for name, number in fewer.items()})


@dataclass(slots=True)
class _GroupTally:
    """What was found by one rule in one variant about one unit."""

    first: Findings  # one
    count: int = 0
    until: int = 0
    certain: float = 0.0  # the sum of the certainties of those that have one
    judged: int = 0  # and their number


@dataclass(slots=True)
class _RuleTally:
    """What was found by one rule."""

    first: Findings  # one
    units: NDArray[np.int64]
    answered: int = 0  # findings on a damaged request whose answer is there all the same
    groups: dict[tuple[int, float], _GroupTally] = field(default_factory=dict)
    waits: Thinned = field(default_factory=Thinned)  # ns, as far as they are known


class Troubles:
    """Counts findings as they come."""

    def __init__(self) -> None:
        self._kinds: dict[int, _RuleTally] = {}
        self._waited: dict[int, float] = {}  # damaged answers, by index: ns that the client waited
        self._damaged: dict[int, int] = {}  # the same answers: which rule speaks of them
        self._requests = np.zeros(_NOBODY + 1, np.int64)  # requests, by unit
        self._echoes = np.zeros(_NOBODY + 1, np.int64)  # and those that stand there twice

    def add(self, findings: Findings, rows: Rows, settled: TransactionRows) -> None:
        """Count findings on these rows, in the order of their frames, and take in transactions."""
        if len(settled):
            self._settle(settled)
        if not len(findings):
            return
        units, answered = _units(findings, rows), _answered(findings, rows)
        self._echoes += np.bincount(units[of_echoes(findings)], minlength=_NOBODY + 1)
        for number in np.flatnonzero(np.bincount(findings.rule)).tolist():
            own = findings.rule == number
            self._count(number, findings[own], units[own], int(answered[own].sum()))

    def _settle(self, settled: TransactionRows) -> None:
        self._requests += np.bincount(settled.unit, minlength=_NOBODY + 1)
        damaged = settled[(settled.status == Status.DAMAGED) & (settled.t_next_ns != NEVER)]
        damaged = damaged[damaged.t_request_ns > 0]
        waits = (damaged.t_next_ns - damaged.t_request_ns).tolist()
        for index, waited in zip(damaged.response.tolist(), waits, strict=True):
            self._remember(self._waited, index, float(waited))

    def _remember(self, remembered: dict[int, Any], index: int, value: float) -> None:
        remembered[index] = value
        if len(remembered) > _PENDING:
            del remembered[next(iter(remembered))]
        if index in self._waited and index in self._damaged:
            waited, number = self._waited.pop(index), self._damaged.pop(index)
            self._kinds[number].waits.add(np.array([waited]))

    def _count(self, number: int, findings: Findings, units: NDArray[np.intp], answered: int) -> None:
        rule, kind = rules()[number], self._kinds.get(number)
        if kind is None:
            kind = self._kinds[number] = _RuleTally(findings[:1].copy(), np.zeros(_NOBODY + 1, np.int64))
        kind.units += np.bincount(units, minlength=_NOBODY + 1)
        kind.answered += answered
        if rule.wastes in rule.numbers:
            wasted = findings.numbers[:, rule.numbers.index(rule.wastes)] * 1e6
            kind.waits.add(wasted[~np.isnan(wasted)])
        elif rule.loses:
            for index in findings.index[findings.index >= 0].tolist():
                self._remember(self._damaged, index, number)
        variants = _numbers(rule, findings, rule.varies)
        certain = np.nan_to_num(_numbers(rule, findings, "certainty"))
        for variant in np.unique(variants).tolist():
            for unit in np.unique(units[variants == variant]).tolist():
                mine = np.flatnonzero((variants == variant) & (units == unit))
                group = kind.groups.get((unit, variant))
                if group is None:
                    if len(kind.groups) >= _GROUPS:
                        continue
                    group = kind.groups[unit, variant] = _GroupTally(findings[mine[:1]])
                group.count += len(mine)
                group.until = max(group.until, int(findings.t_ns[mine].max()))
                judged = certain[mine][certain[mine] >= 0]
                group.certain += float(judged.sum())
                group.judged += len(judged)

    def rows(self) -> tuple[FindingRow, ...]:
        """A row a rule, those that cost most first."""
        waits = [k.waits.numbers for n, k in self._kinds.items() if rules()[n].code == "no-response" and len(k.waits)]
        timeout = densest(np.concatenate(waits)) or None if waits else None
        table = [self._row(rules()[number], kind, timeout) for number, kind in self._kinds.items()]
        rank = {"error": 0, "warning": 1, "note": 2}
        table.sort(key=lambda row: (-(row.lost_ms or 0), -row.lost_answers, rank[row.severity], -row.count, row.code))
        return tuple(table)

    def _row(self, rule: Rule, kind: _RuleTally, timeout: float | None) -> FindingRow:
        count = int(kind.units.sum())
        order = np.argsort(-kind.units[:_NOBODY], kind="stable")[:_UNITS]
        groups = sorted(kind.groups.items(), key=lambda item: -item[1].count)
        example = describe((groups[0][1] if groups else kind).first, 0)
        first = describe(kind.first, 0)
        return FindingRow(
            code=rule.code,
            severity=rule.severity.name.lower(),
            count=count,
            lost_answers=count - kind.answered if rule.loses else 0,
            lost_ms=_lost_ms(kind.waits, timeout) if rule.loses else 0.0,
            units={int(unit): int(kind.units[unit]) for unit in order.tolist() if kind.units[unit]},
            text=example.text,
            cause=example.cause,
            remedy=example.remedy,
            clause=first.clause,
            index=example.index,
            start=example.start,
            port=example.port,
            t_ns=first.t_ns,
            until_ns=max((group.until for _, group in groups), default=first.t_ns),
            groups=tuple(self._group(rule, unit, group) for (unit, _), group in groups),
        )

    def _asked(self, unit: int) -> int:
        """How many requests went to a unit."""
        echoes = self._echoes if is_habit(self._echoes.sum(), self._requests.sum()) else np.zeros_like(self._echoes)
        return int(self._requests[unit] - echoes[unit])

    def _group(self, rule: Rule, unit: int, group: _GroupTally) -> FindingGroup:
        finding = describe(group.first, 0)
        has_unit = unit < _NOBODY
        asked = self._asked(unit) if has_unit else 0  # fewer where one request has several findings
        return FindingGroup(
            unit=unit if has_unit else None,
            count=group.count,
            of=asked if has_unit and rule.about is not rule.about.BUS and asked >= group.count else None,
            text=finding.text,
            cause=finding.cause,
            remedy=finding.remedy,
            certainty=round(group.certain / group.judged, 3) if group.certain else None,
            index=finding.index,
            start=finding.start,
            t_ns=finding.t_ns,
            until_ns=group.until,
        )


def _lost_ms(waits: Thinned, timeout: float | None) -> float | None:
    """What these waits come to, none longer than the client's timeout; None where none is known."""
    if not len(waits):
        return None
    most = np.inf if timeout is None else _SLACK * timeout
    return round(float(np.clip(waits.numbers, 0, most).mean()) * len(waits) / 1e6, 3)


def _numbers(rule: Rule, findings: Findings, name: str) -> NDArray[np.float64]:
    """One figure of the evidence of each finding; -1 where the rule has none of that name."""
    if name not in rule.numbers:
        return np.full(len(findings), -1.0)
    figures: NDArray[np.float64] = np.nan_to_num(findings.numbers[:, rule.numbers.index(name)], nan=-1.0)
    return figures


def _answered(findings: Findings, rows: Rows) -> NDArray[np.bool_]:
    """Which findings are on a damaged request that is answered all the same: so it arrived whole."""
    frames = rows[rows.index >= 0]
    asks = np.flatnonzero((frames.kind[:-1] == Kind.REQUEST) & ~frames.check[:-1])
    asks = asks[(frames.kind[asks + 1] == Kind.RESPONSE) & frames.check[asks + 1]]
    asks = asks[(frames.unit[asks] == frames.unit[asks + 1]) & (frames.function[asks] == frames.function[asks + 1])]
    return np.isin(findings.index, frames.index[asks])


def _units(findings: Findings, rows: Rows) -> NDArray[np.intp]:
    """The unit that each finding is about."""
    units = np.full(len(findings), _NOBODY, np.intp)
    frames = np.flatnonzero(rows.index >= 0)
    position = np.searchsorted(rows.index[frames], findings.index)
    identified = (findings.index >= 0) & (position < len(frames))
    place = frames[position[identified]]
    # of a damaged frame the unit may be what is wrong
    identified[identified] = (rows.index[place] == findings.index[identified]) & rows.check[place]
    units[identified] = rows.unit[frames[position[identified]]]
    for number in np.flatnonzero(np.bincount(findings.rule)).tolist():
        if "unit" in rules()[number].numbers:
            selected = (findings.rule == number) & ~identified
            named = findings.numbers[selected, rules()[number].numbers.index("unit")]
            units[selected] = np.where(np.isnan(named), _NOBODY, np.nan_to_num(named)).astype(np.intp)
    return units
