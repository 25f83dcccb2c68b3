"""The report broken down, in flat memory: a card a unit, a row a poll of the client's list, an hour, a sender's clock.

A card says what became of a unit's requests, where its answers are damaged, how long it takes, when that changed. How
fast a clock is shows where edges were captured: its rate against that of the line's settings.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from ..causes.bits import spells_of
from ..causes.evidence import Evidence
from ..causes.exchanges import Ending
from ..causes.ledger import ASKED, BAD, DELAY, Ledger
from ..causes.signatures import AnswerDamage, Signature
from ..causes.unitledger import UnitLedger
from ..languages import grouped, page_words
from ..tables.findings import Severity, described
from ..tables.schema import Kind, Rows
from ..tables.transactions import Status
from ..words import between, is_clock, moment
from .model import Counts, HourRow, PollRow, RateRow, Times, UnitCard, UnitChange, UnitRow
from .troubles import asked_once, is_habit, of_echoes

if TYPE_CHECKING:
    from captures.edges.source import BitSpans
    from captures.line import LineSettings

    from ..core import Analysed

_SURE_BITS: Final = 16.0  # that a change of outcomes must be worth
_SLOWER: Final = 1.5  # times: that a change of delays must be
_PARTS: Final = 4  # of the time on either side of it, at the least
_ANSWERS: Final = 20
_CHANGES: Final = 4
_REGIONS: Final = {
    AnswerDamage.HEAD: "head", AnswerDamage.TAIL: "tail", AnswerDamage.CUT: "cut short",
    AnswerDamage.LONG: "too long", AnswerDamage.CONVENTION: "check value", AnswerDamage.COUNT: "byte count",
    AnswerDamage.CROSSED: "next request inside", AnswerDamage.OTHER: "another answer", AnswerDamage.WHOLE: "all of it",
}  # fmt: skip


def unit_cards(ledger: Ledger, rows: Iterable[UnitRow]) -> tuple[UnitCard, ...]:
    """The cards of all units that were asked for something. `rows`: the same units as tables have them."""
    evidence, by_unit = Evidence(ledger), {row.unit: row for row in rows}
    return tuple(
        _card(evidence, unit, by_unit.get(unit.unit) or UnitRow(unit.unit, Counts(), Times()))
        for unit in evidence.units
    )


def _card(evidence: Evidence, unit: UnitLedger, row: UnitRow) -> UnitCard:
    """What was answered, and when, is as the table has it; what was heard of the rest is the ledger's."""
    counts, times = row.counts, row.times
    lost = counts.unanswered + counts.damaged  # an answer that came late is none of them
    silent = max(min(unit.count(Ending.SILENT), lost) - unit.unfit_alone, 0)
    garbage = min(unit.count(Ending.GARBAGE) + unit.unfit_alone, lost - silent)
    regions = Counter(map(_region, evidence.readings(unit)))
    read = sum(regions.values())
    least, most = times.bounds("min"), times.bounds("p95")
    bounds = None if least is None or most is None or not evidence.ledger.timed else (least[0], most[1])
    return UnitCard(
        unit.unit,
        counts.answered + counts.exceptions + silent + garbage,
        counts.answered,
        counts.exceptions,
        silent,
        garbage,
        counts.late,
        unit.doubles,
        {region: round(garbage * count / read) for region, count in regions.most_common()},
        bounds,
        tuple(_changes(evidence.ledger, unit))[:_CHANGES],
    )


def _region(reading: Signature) -> str:
    if reading.damage in (AnswerDamage.BITS, AnswerDamage.MIDDLE) and reading.due > 0 and reading.at >= 0:
        thirds = ("head", "middle", "tail")
        return thirds[min(3 * reading.at // reading.due, 2)]
    return _REGIONS.get(reading.damage, "middle")


def _changes(ledger: Ledger, unit: UnitLedger) -> list[UnitChange]:
    grid = ledger.grid
    if not ledger.timed or grid.begin_ns is None:
        return []
    requests, bad = grid.counts((ASKED, unit.unit)), grid.counts((BAD, unit.unit))
    bits, inside = spells_of(bad, requests)
    changes = []
    if bits >= _SURE_BITS:
        rest = ~inside
        usual = page_words(", {bad} of {all} otherwise", bad=int(bad[rest].sum()), all=int(requests[rest].sum()))
        asked = np.flatnonzero(requests)  # a part of the time without requests ends nothing
        edges = np.flatnonzero(np.diff(np.concatenate(([0], inside[asked].astype(np.int8), [0]))))
        for begin, end in zip(asked[edges[::2]].tolist(), (asked[edges[1::2] - 1] + 1).tolist(), strict=True):
            words = "{bad} of {all} requests without a good answer"
            hits = page_words(words, bad=int(bad[begin:end].sum()), all=int(requests[begin:end].sum()))
            until = min(grid.begin_ns + end * grid.width_ns, ledger.end)
            changes.append(UnitChange(grid.begin_ns + begin * grid.width_ns, until, hits + usual))
    slower = _slower(requests - bad, grid.counts((DELAY, unit.unit)))
    if slower is not None:
        at, before, after = slower
        words = page_words(
            "mean response {before} before, {after} from then on",
            before=between(before, before), after=between(after, after),
        )  # fmt: skip
        changes.append(UnitChange(grid.begin_ns + at * grid.width_ns, ledger.end, words))
    return changes


def _slower(answers: NDArray[np.int64], delays: NDArray[np.int64]) -> tuple[int, int, int] | None:
    """Where the mean delay changes most, and what it is before and after; None where it does not by much."""
    used = np.flatnonzero(answers > 0)
    if len(used) < 2 * _PARTS or answers.sum() < _ANSWERS:
        return None
    counts, sums = np.cumsum(answers[used]), np.cumsum(delays[used])
    before = sums[:-1] / counts[:-1]
    after = (sums[-1] - sums[:-1]) / np.maximum(counts[-1] - counts[:-1], 1)
    weight = np.minimum(counts[:-1], counts[-1] - counts[:-1])
    apart = np.abs(np.log(np.maximum(after, 1) / np.maximum(before, 1))) * np.sqrt(weight)
    apart[: _PARTS - 1], apart[len(apart) - _PARTS + 1 :] = 0, 0
    at = int(np.argmax(apart))
    first, last = round(float(before[at])), round(float(after[at]))
    spread = _spread(delays[used] / answers[used])
    if max(first, last) < _SLOWER * max(min(first, last), 1) or abs(last - first) < 2 * spread:
        return None
    return int(used[at + 1]), first, last


def _spread(means: NDArray[np.float64]) -> float:
    """How far the mean delays of neighbouring parts of the time are apart, as a rule."""
    return float(np.median(np.abs(np.diff(means)))) if len(means) > 1 else 0.0


_RECURS: Final = 3  # requests that make a poll of it
_MOST_POLLS: Final = 1000
_MOST_JOINED: Final = {1: 2000, 2: 2000, 3: 125, 4: 125}  # of one request, by the specification
_GAP: Final = {1: 16, 2: 16, 3: 4, 4: 4}  # things between, that one request would ask for in vain
_AROUND: Final = 13  # bytes of a request, and around what an answer holds
_ALIKE: Final = 0.1


def poll_rows(ledger: Ledger) -> tuple[PollRow, ...]:
    """What is asked for again and again, what is asked most first."""
    rows = []
    for poll in ledger.polls.polls():
        asked = poll.asked - poll.count(Ending.UNHEARD)  # nobody knows what became of those
        if asked < _RECURS:
            continue
        period = jitter = None
        if ledger.timed and len(poll.intervals):
            period = int(np.median(poll.intervals))
            jitter = int(np.quantile(np.abs(poll.intervals - period), 0.9))
        rows.append(
            PollRow(
                poll.unit,
                poll.function,
                poll.address,
                poll.quantity,
                asked,
                poll.count(Ending.OK),
                poll.count(Ending.EXCEPTION),
                poll.count(Ending.SILENT),
                poll.count(Ending.GARBAGE),
                period,
                jitter,
            )
        )
    rows = _mergeable(rows)
    rows.sort(key=lambda row: (-row.asked, row.unit, row.function, row.address))
    return tuple(rows[:_MOST_POLLS])


def _mergeable(rows: list[PollRow]) -> list[PollRow]:
    """The same, with what one request could ask for as two do now: of one unit and function, side by side, as often."""
    ordered = sorted(rows, key=lambda row: (row.unit, row.function, row.address, row.quantity))
    joined = list(ordered)
    for i, (one, two) in enumerate(pairwise(ordered)):
        most = _MOST_JOINED.get(one.function)
        if most is None or (one.unit, one.function) != (two.unit, two.function) or not (one.ok and two.ok):
            continue
        gap, end = two.address - one.address - one.quantity, max(one.address + one.quantity, two.address + two.quantity)
        if gap > _GAP[one.function] or end - one.address > most or not _as_often(one, two):
            continue
        saved = _AROUND - max(gap, 0) * 2 if one.function in (3, 4) else _AROUND - max(gap, 0) // 8
        joined[i] = replace(one, joins=two.address, saves_bytes=saved)
    return joined


def _as_often(one: PollRow, two: PollRow) -> bool:
    if one.period_ns is None or two.period_ns is None:
        return 0.8 < one.asked / two.asked < 1.25
    return abs(one.period_ns - two.period_ns) <= _ALIKE * max(one.period_ns, two.period_ns)


_HOUR_NS: Final = 3_600_000_000_000
_MOST_HOURS: Final = 10_000  # hours: more than a year
_BY_STATUS: Final = {
    Status.ANSWERED: "answered",
    Status.EXCEPTION: "exceptions",
    Status.UNANSWERED: "unanswered",
    Status.BROADCAST: "broadcasts",
    Status.DAMAGED: "damaged",
    Status.UNHEARD: "unheard",
}


class HourTable:
    """Batches in, rows of hours out; hours in which nothing was recorded have none."""

    def __init__(self, line: LineSettings) -> None:
        self._character_ns = line.character_ns
        self._counts: defaultdict[int, Counter[str]] = defaultdict(Counter)
        self._findings: defaultdict[int, Counter[str]] = defaultdict(Counter)
        self._bytes: Counter[int] = Counter()
        self._begin: int | None = None
        self._end = 0

    def feed(self, analysed: Analysed) -> None:
        """The next batch with what was said of it."""
        rows, settled = analysed.batch.rows, analysed.transactions
        if len(rows):
            times = rows.t_end_ns
            if self._begin is None:
                self._begin = int(rows.t_start_ns[0])
            self._end = max(self._end, int(times.max()))
            hours, where = np.unique(times // _HOUR_NS, return_inverse=True)
            octets = np.bincount(where, rows.length)
            for hour, count in zip(hours[:_MOST_HOURS].tolist(), octets.tolist(), strict=False):
                self._bytes[hour] += int(count)
        hours_of = settled.t_start_ns // _HOUR_NS
        for hour in np.unique(hours_of).tolist() if len(self._counts) < _MOST_HOURS else ():
            mine, counts = settled[hours_of == hour], self._counts[hour]
            counts["requests"] += len(mine)
            counts["retries"] += int(mine.retry.sum())
            counts["late"] += int(mine.late.sum())
            for status, name in _BY_STATUS.items():
                counts[name] += int(np.count_nonzero(mine.status == status))
        shown_twice = analysed.findings.t_ns[of_echoes(analysed.findings)] // _HOUR_NS
        for hour in shown_twice.tolist():
            if hour in self._counts:
                self._counts[hour]["echoes"] += 1
        for finding in described(analysed.findings):
            if finding.severity is not Severity.NOTE and finding.start >= 0:
                self._findings[finding.t_ns // _HOUR_NS][finding.code] += 1

    def rows(self) -> tuple[HourRow, ...]:
        """The hours, in order."""
        echoes, requests = (sum(counts[name] for counts in self._counts.values()) for name in ("echoes", "requests"))
        shown_twice = is_habit(echoes, requests)
        hours = []
        for hour in sorted(set(self._bytes) | set(self._counts)):
            begin = max(hour * _HOUR_NS, self._begin or 0)
            span = min((hour + 1) * _HOUR_NS, self._end) - begin
            load = self._bytes[hour] * self._character_ns / span if self._character_ns and span > 0 else None
            commonest = self._findings[hour].most_common(1)
            finding = f"{commonest[0][0]} x {grouped(commonest[0][1])}" if commonest else ""
            counts = asked_once(Counts(**dict(self._counts[hour])), shown_twice=shown_twice)
            hours.append(HourRow(self._name(hour), begin, counts, None if load is None else min(load, 1.0), finding))
        return tuple(hours)

    def _name(self, hour: int) -> str:
        if is_clock(hour * _HOUR_NS):
            return moment(hour * _HOUR_NS)[:13] + ":00"
        return page_words("hour {number}", number=hour - (self._begin or 0) // _HOUR_NS + 1)


_CLIENT: Final = 256  # behind the units
_LEAST: Final = 200  # bits that a rate is told of: each edge is seen a sample late at the most


def bit_times(spans: BitSpans, rows: Rows) -> NDArray[np.int64]:
    """(2, n): in how many ns so many bits of each of these rows came; rows of a port must be given in order."""
    taken = np.zeros((2, len(rows)), np.int64)
    for port in np.bincount(rows.port).nonzero()[0].tolist():
        of_port = rows.port == port
        taken[:, of_port] = spans.take_stretches(port, rows.start[of_port], rows.length[of_port])
    return taken


class RateTable:
    """Time and bits of all frames with a right check value, by who sent them: the client, or a unit."""

    def __init__(self, bauds: Mapping[int, float]) -> None:
        """`bauds`: the rate of each port by its settings, bit/s."""
        self._bauds = bauds
        self._took, self._due, self._bits = (np.zeros(_CLIENT + 1) for _ in range(3))  # ns, ns, bits

    def feed(self, rows: Rows, taken: NDArray[np.int64]) -> None:
        """Frames and noise, and what `bit_times` has of them."""
        for port in np.bincount(rows.port).nonzero()[0].tolist():
            good = (rows.port == port) & rows.check & (rows.kind != Kind.NOISE)
            sender = np.where(rows.kind == Kind.REQUEST, _CLIENT, rows.unit.astype(np.int64))[good]
            ns, bits = taken[:, good]
            self._took += self._by(sender, ns)
            self._due += self._by(sender, bits) * 1e9 / self._bauds[port]
            self._bits += self._by(sender, bits)

    def rows(self) -> tuple[RateRow, ...]:
        """Each sender of which enough was seen: the client first, then the units."""
        senders = [_CLIENT, *range(_CLIENT)]
        return tuple(
            RateRow(
                None if sender == _CLIENT else sender,
                float(self._bits[sender] * 1e9 / self._took[sender]),
                float(self._due[sender] / self._took[sender]) - 1,
            )
            for sender in senders
            if self._bits[sender] >= _LEAST
        )

    @staticmethod
    def _by(senders: NDArray[np.int64], numbers: NDArray[np.int64]) -> NDArray[np.float64]:
        return np.bincount(senders, numbers, _CLIENT + 1).astype(np.float64)
