"""The bus as a whole: units that are slow, polls that one request could do, a master that never pauses.

Said at the end, of all that was seen. Times count only as far as the tap's clock carries them.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping
from functools import cache
from statistics import median
from typing import Final

import numpy as np
from numpy.typing import NDArray

from dissectors.functions import function_name
from dissectors.length_rules import Role
from dissectors.lengths import RULES, layout, relations, rule
from dissectors.limits import Bound, RequestedByteCount
from dissectors.registry import revision

from ...deframing.tap_clock import UNKNOWN
from ...languages import phrase
from ...tables.bins import ColumnQueue, Histogram, Spread
from ...tables.findings import About, Findings, Rule, Severity, looks_for
from ...tables.schema import Kind, Protocol
from ...tables.transactions import OF_GATEWAYS
from ..view import DiagnosisStep, where

_ANSWERS: Final = 10  # of a unit, from which its times are compared
_TIMES_SLOWER: Final = 4.0
_SLOWER_NS: Final = 40e6
_EARLY: Final = 64  # answers that are a unit's past
_RECENT: Final = 512  # and of late, after which older ones count half
_POLLS: Final = 4096  # distinct ones remembered
_ROUNDS: Final = 5  # a poll that came so often recurs
_AT_ONCE: Final = 8192  # polls, or response times, that are counted in one pass
_ALIKE: Final = 2.0  # and as often as the one beside it
_MOST: Final = 8  # findings of one kind
_LOADED: Final = 0.6
_IDLE: Final = 0.25
_SPAN_NS: Final = 1_000_000_000
_REQUESTS: Final = 50

SLOW: Final = Rule(
    "slow-device",
    Severity.WARNING,
    About.BUS,
    when="a unit's response time stands out against the others or its own past",
    numbers=("unit", "p50_ms", "p95_ms", "usual_ms", "own_past"),
    varies="own_past",
    text=lambda numbers: phrase(
        "unit {unit:.0f} answers in {p50_ms:ms} (median; 95% within {p95_ms:ms}), at first it took {usual_ms:ms}"
        if numbers["own_past"]
        else "unit {unit:.0f} answers in {p50_ms:ms} (median; 95% within {p95_ms:ms}), the other units take "
        "{usual_ms:ms}",
        numbers,
    ),
    cause="a slow processor, a gateway or radio behind this unit, or a device that is busy with something else",
    remedy="poll it less often or fewer registers at once; set the timeout longer than its slowest answer",
)
WASTE: Final = Rule(
    "poll-waste",
    Severity.NOTE,
    About.BUS,
    when="several reads cover addresses that one request could read",
    numbers=("unit", "function", "requests", "first_address", "quantity", "saved_ms"),
    text=lambda numbers: (
        phrase(
            "{requests:.0f} polls of unit {unit:.0f} ({name}) read adjacent addresses {first_address:.0f} to {last:.0f}"
            "; one could",
            numbers,
            name=function_name(int(numbers["function"])),
            last=numbers["first_address"] + numbers["quantity"] - 1,
        )
        + (phrase(", saving {saved_ms:ms} a cycle", numbers) if "saved_ms" in numbers else "")
    ),
    cause="the client polls each value separately",
    remedy="read the block in one request",
)
SATURATED: Final = Rule(
    "bus-saturated",
    Severity.WARNING,
    About.BUS,
    when="the load leaves the client hardly any idle time",
    numbers=("load_percent", "idle_percent"),
    text="the line carries bytes {load_percent:.0f}% of the time, and the client pauses for only {idle_percent:.0f}%",
    cause="the client polls more than the line can carry at this speed",
    remedy="raise the baud rate, join polls into blocks, poll slow values less often",
)


@looks_for(SLOW)
class Pace:
    """Response times by unit: all of them, the first ones, and those of late."""

    _all: dict[int, Histogram]
    _early: dict[int, Spread]
    _late: dict[int, Spread]
    _waiting: ColumnQueue

    def __init__(self) -> None:
        self._all = {}
        self._early = {}
        self._late = {}
        self._waiting = ColumnQueue()  # units and response times

    def __call__(self, view: DiagnosisStep) -> Iterator[Findings]:
        if len(view.transactions):
            own = ~view.transactions.late & ~np.isin(view.transactions.exception, OF_GATEWAYS)
            measured = where((view.transactions.response_ns >= 0) & own)
            self._waiting.add(view.transactions.unit[measured], view.transactions.response_ns[measured])
            if len(self._waiting) >= _AT_ONCE:
                self._count()
        return iter(())

    def _count(self) -> None:
        """Count in what waits."""
        if not len(self._waiting):
            return
        units, times = self._waiting.take_rows()
        bins = Spread.bins(times)
        for unit in where(np.bincount(units)).tolist():
            own = bins[units == unit]
            self._all.setdefault(unit, Histogram()).add(times[units == unit])
            early = self._early.setdefault(unit, Spread())
            first = max(0, _EARLY - len(early))
            early.count(own[:first])
            self._recent(unit, own[first:])

    def _recent(self, unit: int, bins: NDArray[np.intp]) -> None:
        """Count in times that fade as others come, in steps that do not hang on the batches."""
        late = self._late.setdefault(unit, Spread())
        counted = len(self._all[unit]) - len(bins)
        while len(bins):
            room = _RECENT - counted % _RECENT
            late.count(bins[:room])
            counted += len(bins[:room])
            bins = bins[room:]
            if counted % _RECENT == 0:
                late.fade()

    def close(self, view: DiagnosisStep) -> Iterator[Findings]:
        """Units that stand out."""
        self._count()
        off = view.clock.newest().wait_ns
        medians: dict[int, float] = {
            unit: times.quantiles(0.5)[0] for unit, times in self._all.items() if len(times) >= _ANSWERS
        }
        for unit, own in sorted(medians.items()):
            others = [value for peer, value in medians.items() if peer != unit]
            usual, past = (median(others), False) if others else (UNKNOWN, False)
            if not _slower(own, usual, off):
                own = self._late[unit].quantile(0.5) or 0.0
                usual, past = self._early[unit].quantile(0.5) or UNKNOWN, True
                if self._late[unit].weight < _EARLY / 2 or not _slower(own, usual, off):
                    continue
            slow = (self._late[unit].quantile(0.95) or own) if past else self._all[unit].quantiles(0.95)[0]
            yield SLOW.of_bus(view.now, unit, own / 1e6, slow / 1e6, usual / 1e6, past)


def _slower(own: float, usual: float, off: float) -> bool:
    return own > _TIMES_SLOWER * usual and own - usual > _SLOWER_NS and own - usual > 4 * off


@looks_for(WASTE)
class Polls:
    """Reads by unit, function, address and quantity."""

    _count: Counter[tuple[int, int, int, int]]
    _waiting: defaultdict[tuple[int, int], ColumnQueue]

    def __init__(self) -> None:
        self._count = Counter()
        self._waiting = defaultdict(ColumnQueue)

    def __call__(self, view: DiagnosisStep) -> Iterator[Findings]:
        for (address, quantity), functions in _layouts(revision()).items():
            if not functions.isdisjoint(view.asked_functions):
                waiting = self._waiting[address, quantity]
                units = view.rows.unit[view.requests]
                waiting.add(units, view.requested, view.numbers(address, 2), view.numbers(quantity, 2))
                if len(waiting) >= _AT_ONCE:
                    self._add(waiting, functions)
        return iter(())

    def _add(self, waiting: ColumnQueue, functions: set[int]) -> None:
        """Count in what waits, of these functions."""
        if not len(waiting):
            return
        units, codes, addresses, quantities = waiting.take_rows()
        reading = where(np.isin(codes, list(functions)) & (addresses >= 0) & (quantities >= 0))
        keys = (units.astype(np.int64) << 40 | codes.astype(np.int64) << 32 | addresses << 16 | quantities)[reading]
        for key, count in zip(*(part.tolist() for part in np.unique(keys, return_counts=True)), strict=True):
            poll = (key >> 40, key >> 32 & 0xFF, key >> 16 & 0xFFFF, key & 0xFFFF)
            if poll in self._count or len(self._count) < _POLLS:
                self._count[poll] += count

    def close(self, view: DiagnosisStep) -> Iterator[Findings]:
        """Blocks of polls that one could do."""
        for at, functions in _layouts(revision()).items():
            self._add(self._waiting[at], functions)
        mergeable = []
        for (unit, code), polls in self._recurring().items():
            most = next(check.high for check in _bounds(code))
            for block in _blocks(polls, most):
                first, last = block[0], block[-1]
                saved = (len(block) - 1) * _overhead_ns(view)
                mergeable.append((unit, code, len(block), first[0], last[0] + last[1] - first[0], saved))
        for unit, code, count, address, quantity, saved in sorted(mergeable, key=lambda each: -each[2])[:_MOST]:
            saved_ms = saved / 1e6 if saved < UNKNOWN else np.nan
            yield WASTE.of_bus(view.now, unit, code, count, address, quantity, saved_ms)

    def _recurring(self) -> dict[tuple[int, int], list[tuple[int, int, int]]]:
        """(address, quantity, count) of polls that recur, by unit and function."""
        recurring: dict[tuple[int, int], list[tuple[int, int, int]]] = {}
        for (unit, code, address, quantity), count in sorted(self._count.items()):
            if count >= _ROUNDS and quantity:
                recurring.setdefault((unit, code), []).append((address, quantity, count))
        return recurring


@cache
def _layouts(_revision: int) -> Mapping[tuple[int, int], set[int]]:
    """Where requests that read, and do nothing else, have address and quantity: which functions have them so."""
    functions: defaultdict[tuple[int, int], set[int]] = defaultdict(set)
    for code, role in RULES:
        fields = layout(code, role)
        if role is not Role.REQUEST or set(fields) != {"starting_address", "quantity"}:
            continue
        if any(isinstance(relation, RequestedByteCount) for relation in relations(code)):
            functions[fields["starting_address"][0], fields["quantity"][0]].add(code)
    return functions


def _bounds(code: int) -> list[Bound]:
    declared = rule(code, Role.REQUEST)
    return [check for check in declared.checks if isinstance(check, Bound)] if declared is not None else []


def _blocks(polls: list[tuple[int, int, int]], most: int) -> Iterator[list[tuple[int, int, int]]]:
    """Runs of polls that follow on each other, as often each, and fit one request."""
    block = polls[:1]
    for poll in polls[1:]:
        end = block[-1][0] + block[-1][1]
        alike = max(poll[2], block[-1][2]) <= _ALIKE * min(poll[2], block[-1][2])
        if poll[0] == end and alike and poll[0] + poll[1] - block[0][0] <= most:
            block.append(poll)
        else:
            if len(block) > 1:
                yield block
            block = [poll]
    if len(block) > 1:
        yield block


def _overhead_ns(view: DiagnosisStep) -> float:
    """What one more read takes besides its values: 13 bytes and two silences."""
    character_ns = view.line.character_ns
    return UNKNOWN if character_ns is None else (13 + 2 * 3.5) * character_ns


@looks_for(SATURATED)
class Busy:
    """How long bytes were on the line, and how long the master paused before its requests."""

    _octets: int
    _paused: int
    _requests: int
    _first: int | None
    _last: int
    _waiting: ColumnQueue

    def __init__(self) -> None:
        self._octets = self._paused = self._requests = 0
        self._first = None
        self._last = 0
        self._waiting = ColumnQueue()  # kinds, units, starts and ends

    def __call__(self, view: DiagnosisStep) -> Iterator[Findings]:
        if len(view.rows) and view.timed:
            names = ("t_start_ns", "t_end_ns", "unit", "length")
            starts, ends, units, sizes = (view.rows.column(name) for name in names)
            kinds = view.kind
            if (networked := view.rows.protocol == Protocol.TCP).any():  # that is no load of a line
                starts, ends, kinds, units, sizes = (each[~networked] for each in (starts, ends, kinds, units, sizes))
                if not len(starts):
                    return iter(())
            self._waiting.add(kinds, units, starts, ends)
            self._octets += int(sizes.sum())
            self._first = int(starts[0]) if self._first is None else self._first
            self._last = int(ends[-1])
            if len(self._waiting) >= _AT_ONCE:
                self._count()
        return iter(())

    def _count(self) -> None:
        """Count in the pauses between what waits; its last row waits for the next one."""
        if len(self._waiting):
            kind, unit, starts, ends = self._waiting.take_rows()
            ended = (kind[:-1] == Kind.RESPONSE) | ((kind[:-1] == Kind.REQUEST) & (unit[:-1] == 0))  # or sent to all
            asks = where((kind[1:] == Kind.REQUEST) & ended)
            self._paused += int(np.maximum(starts[asks + 1] - ends[asks], 0).sum())
            self._requests += len(asks)
            self._waiting.add(*(column[-1:].copy() for column in (kind, unit, starts, ends)))

    def close(self, view: DiagnosisStep) -> Iterator[Findings]:
        """Whether the line is full."""
        self._count()
        span = self._last - (self._first or 0)
        character_ns = view.line.character_ns
        if character_ns is None or span < _SPAN_NS or self._requests < _REQUESTS:
            return
        load = self._octets * character_ns / span
        idle = self._paused / span
        off = view.clock.newest().wait_ns * self._requests / span  # by which the pauses may be wrong
        if load > _LOADED and idle + off < _IDLE and load <= 1.05:
            yield SATURATED.of_bus(view.now, 100 * min(load, 1.0), 100 * idle)
