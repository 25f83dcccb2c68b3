"""What happened to the exchanges of a bus, unit by unit: counters, spells, a few samples with their bytes.

The ledger is all that suspects see. It grows with the units and polls of a bus, not with its frames.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from captures.line import LineSettings
from dissectors.foreign import NAMES

from ..deframing.tap_clock import TapClock
from ..diagnosis.damage.flow_control import IS_FLOW
from ..options import Options
from ..requests.reasons import Unserved
from ..tables.batch import Batch
from ..tables.schema import NO_GAP, Bools, Int64s, Kind, Protocol, Rows
from ..tables.separatelines import SeparateLines
from ..tables.transactions import NEVER, Status, TransactionRows
from ..tables.verdict import ModbusVerdict
from .exchanges import Ending, ExchangeBuilder, Exchanges, Stretch
from .exchangetable import ExchangeTable
from .flatmemory import CrowdedTimes, Thinned, TimeGrid
from .polls import PollTable
from .registerstates import StateTable, ValueTable
from .rowcounts import BACK, count_by_port, count_others
from .samples import sampled
from .shifts import ShiftLedger
from .successors import Successors
from .unitledger import UnitLedger

if TYPE_CHECKING:
    from ..registers.checking import LimitBreach

_Octets = bytes  # where `bytes` is a ledger's count of them
ASKED, BAD, DELAY, DAMAGE = "asked", "bad", "delay", "damage"  # in the grid of the time, of a unit or the bus
_CHAR_NS: Final = 1e6  # where the line's speed is not known
_NOISE_SAMPLES: Final = 64
_NOISE_BYTES: Final = 512
_EXAMPLES: Final = 3
STRAY: Final = 3  # bytes that one spike makes
_ECHOES: Final = 5
_OF_ALL: Final = 0.48
_ECHO_NS: Final = 40e6
_NEARLY_ALL: Final = 0.8
_NOISE, _REQUEST, _RESPONSE = int(Kind.NOISE), int(Kind.REQUEST), int(Kind.RESPONSE)


def _by_function() -> Int64s:
    return np.zeros(256, np.int64)


@dataclass(eq=False, repr=False)
class Ledger:
    """Batches in; what they come to. Times in ns."""

    line: LineSettings
    options: Options = field(default_factory=Options)
    timed: bool = False
    begin: int | None = None
    end: int = 0
    clock: TapClock = field(init=False)
    verdict: ModbusVerdict = field(default_factory=ModbusVerdict)
    lines: SeparateLines = field(default_factory=SeparateLines)
    units: dict[int, UnitLedger] = field(default_factory=dict)
    polls: PollTable = field(default_factory=PollTable)
    table: ExchangeTable = field(default_factory=ExchangeTable)
    states: StateTable = field(default_factory=StateTable)
    values: ValueTable = field(default_factory=ValueTable)
    breaches: Sequence[LimitBreach] = ()  # of a map's limits, where values were looked at
    shifts: ShiftLedger = field(default_factory=ShiftLedger)
    ports: defaultdict[int, Counter[str]] = field(default_factory=lambda: defaultdict(Counter))
    grid: TimeGrid = field(default_factory=TimeGrid)
    request_gaps: Thinned = field(default_factory=Thinned)  # before requests behind a good answer, by the reads
    joined: int = 0  # requests behind a good answer that came in one read with its end,
    pauses_most: Thinned = field(default_factory=Thinned)  # and the pause before at the most, where that is known
    turnarounds: Thinned = field(default_factory=Thinned)  # broadcast to the next request
    exchanges: int = 0
    answered: int = 0
    frames: int = 0
    enveloped: int = 0  # requests of Modbus TCP, of which nothing else is known here
    enveloped_answers: int = 0
    requests: int = 0
    responses: int = 0
    loose_responses: int = 0  # right ones that answer nothing
    bytes: int = 0
    right_bytes: int = 0
    noise_bytes: int = 0
    marked_bytes: int = 0  # by the UART
    flow_bytes: int = 0  # that are XON or XOFF
    functions: Int64s = field(default_factory=_by_function)  # of right frames
    function_bytes: Int64s = field(default_factory=_by_function)
    broadcasts: int = 0
    broadcast_runs: int = 0  # broadcasts right behind another
    broadcasts_again: int = 0  # and the same once more
    broadcast_repeats: Thinned = field(default_factory=Thinned)  # broadcast to the same once more (ns)
    broadcasts_answered: int = 0
    called_examples: list[int] = field(default_factory=list)
    foreign: Int64s = field(default_factory=lambda: np.zeros(len(NAMES), np.int64))  # stretches by protocol
    noise: list[tuple[int, int, _Octets]] = field(default_factory=list)  # a few outside frames: time, port, bytes
    stray_times: CrowdedTimes = field(default_factory=CrowdedTimes)  # of short ones
    spoilt: list[_Octets] = field(default_factory=list)  # a few requests whose check value is wrong
    repeat_waits: Thinned = field(default_factory=Thinned)  # from a request without an answer to the same one again
    repeats_answered: int = 0  # requests that came twice and were answered then
    _repeating: bool = False  # the newest request got no answer, and the next one is the same
    _echo_before: bool = False  # the newest request is to come once more
    _echo_repeats: bool = False
    _newest: Exchanges = field(default_factory=lambda: Exchanges.zeros(0))
    _builder: ExchangeBuilder = field(default_factory=ExchangeBuilder)

    def __post_init__(self) -> None:
        self.clock = TapClock(self.line)

    def feed(self, batch: Batch, transactions: TransactionRows) -> None:
        """The next rows, with the transactions that began among them."""
        if (networked := batch.rows.protocol == Protocol.TCP).any():  # what happens there has no wire for a cause
            kinds = batch.rows.kind[networked]
            self.enveloped += int(np.count_nonzero(kinds == _REQUEST))
            self.enveloped_answers += int(np.count_nonzero(kinds == _RESPONSE))
            batch = replace(batch, rows=batch.rows[~networked])
        if not len(batch):
            return
        unheard = transactions.request[transactions.status == Status.UNHEARD].tolist()
        self._count_rows(batch)
        self.shifts.feed(batch)
        for part in self._builder.feed(batch, unheard):
            self._take(part)

    def close(self) -> None:
        """No more rows come."""
        self.clock.close()
        for part in self._builder.close():
            self._take(part)

    def unit(self, number: int) -> UnitLedger:
        """The ledger of one unit."""
        if number not in self.units:
            self.units[number] = UnitLedger(number, self.table)
        return self.units[number]

    @cached_property
    def char_ns(self) -> float:
        """How long a character takes; a millisecond where nobody knows."""
        return (self.line.char_bits or 11) * 1e9 / self.line.baud if self.line.baud else _CHAR_NS

    @cached_property
    def reasons(self) -> dict[int, list[Unserved]]:
        """Why units do not serve some requests, of those that somebody asked for since the newest exchange."""
        return {}

    @property
    def span_ns(self) -> int:
        """From the first byte to the last; 0 without times."""
        return self.end - self.begin if self.begin is not None and self.timed else 0

    @property
    def polled(self) -> list[UnitLedger]:
        """The units that were asked for something, broadcasts apart."""
        return [unit for number, unit in sorted(self.units.items()) if number and unit.asked]

    @property
    def pauses(self) -> Thinned:
        """From the end of good answers that nothing else follows to the next request (ns)."""
        return self.table.known("pauses", self._pauses)

    def _pauses(self) -> Thinned:
        rows = self.table.kept
        return self.table.numbers(rows[rows.good & ~rows.odd & (rows.wait != NO_GAP) & self.timed], "rested")

    @property
    def successors(self) -> Successors:
        """How units fare behind others."""
        return self.table.known("successors", lambda: Successors(self.table))

    def _count_rows(self, batch: Batch) -> None:
        rows = batch.rows
        kind, length = rows.kind, rows.length
        self.verdict.feed(rows)
        self.clock.feed(rows)
        self.timed = self.timed or bool(rows.t_end_ns.any())
        self.begin = int(rows.t_start_ns[0]) if self.begin is None else self.begin
        self.end = max(self.end, int(rows.t_end_ns.max()))
        framed, asks = kind != _NOISE, kind == _REQUEST
        right = framed & rows.check
        requests = int(np.count_nonzero(right & asks))
        self.frames += int(np.count_nonzero(framed))
        self.requests += requests
        self.responses += int(np.count_nonzero(right)) - requests
        self.loose_responses += int(np.count_nonzero(right & ~asks & (rows.request < 0)))
        functions, weights = rows.function[right], length[right]
        self.functions += np.bincount(functions, minlength=256)
        self.function_bytes += np.bincount(functions, weights, 256).astype(np.int64)
        self.bytes += int(length.sum())
        self.right_bytes += int(weights.sum())
        self.marked_bytes += int(rows.errors.sum())
        self.flow_bytes += int(np.count_nonzero(IS_FLOW.take(batch.data)))
        spoilt = (framed & ~rows.check & asks).nonzero()[0]
        self.spoilt += [batch.bytes_of(row) for row in spoilt[: max(_NOISE_SAMPLES - len(self.spoilt), 0)].tolist()]
        self._count_noise(batch, (~framed).nonzero()[0])
        count_by_port(self.ports, batch)
        self.lines.feed(rows)

    def _count_noise(self, batch: Batch, noise: NDArray[np.intp]) -> None:
        length, begins = batch.rows.length[noise], batch.rows.t_start_ns[noise]
        self.noise_bytes += int(length.sum())
        self.foreign += np.bincount(batch.rows.foreign[noise], minlength=len(NAMES))
        self.stray_times.add(begins[length <= STRAY])
        for row in noise[: max(_NOISE_SAMPLES - len(self.noise), 0)].tolist():
            port = int(batch.rows.port[row])
            self.noise.append((int(batch.rows.t_start_ns[row]), port, batch.bytes_of(row)[:_NOISE_BYTES]))

    def _take(self, part: Stretch | Rows) -> None:
        if isinstance(part, Rows):
            units = np.bincount(part.unit[(part.kind == _RESPONSE) & part.check], minlength=1)
            for number in units.nonzero()[0].tolist():
                self.unit(number).strays += int(units[number])
            return
        exchanges = part.exchanges
        self.exchanges += len(exchanges)
        self._count_echoes(exchanges)
        odd = (exchanges.noise > 0) | (exchanges.strays > 0) | (exchanges.late > 0)
        times = exchanges.t_start if self.timed else exchanges.place  # the axis on which things have their order
        self._sample(part, odd)
        self.polls.add(part)
        self.__dict__.pop("reasons", None)
        self.table.timed = self.timed
        self.table.add(exchanges, times)
        self.states.add(part)
        self.values.add(part, times)
        self._count_bus(exchanges, odd, times)
        self._count_units(exchanges, times)
        count_others(part, self._newest, self.unit, timed=self.timed)
        self._newest = Exchanges.joined((self._newest, exchanges[-BACK:]))[-BACK:].copy()

    def _count_units(self, exchanges: Exchanges, times: Int64s) -> None:
        order = np.argsort(exchanges.unit, kind="stable")
        exchanges, times = exchanges[order], times[order]
        begins = np.flatnonzero(np.diff(exchanges.unit, prepend=np.int16(-1))).tolist()
        for begin, end in zip(begins, [*begins[1:], len(exchanges)], strict=True):
            number = int(exchanges.unit[begin])
            if number:
                mine, when = exchanges[begin:end], times[begin:end]
                self.unit(number).add(mine, when)
                known = mine.delay >= 0
                self.grid.add((ASKED, number), when[mine.outcome != Ending.UNHEARD])
                self.grid.add((BAD, number), when[(mine.outcome == Ending.SILENT) | (mine.outcome == Ending.GARBAGE)])
                self.grid.add((DELAY, number), when[known & self.timed], mine.delay[known & self.timed])

    def _count_bus(self, exchanges: Exchanges, odd: Bools, times: Int64s) -> None:
        clean = (exchanges.t_answered != NEVER) & (exchanges.t_next != NEVER) & ~odd
        gaps, holes = exchanges.gap_before[1:][clean[:-1]], exchanges.hole[:-1][clean[:-1]]
        joined = gaps == NO_GAP
        self.request_gaps.add(gaps[~joined])
        self.joined += int(np.count_nonzero(joined))
        known = joined & (holes > 0)  # from a read amid the answer on: its last byte was on time
        self.pauses_most.add(holes[known])
        self._count_broadcasts(exchanges, exchanges.outcome == Ending.BROADCAST)
        self.grid.add(ASKED, times)
        self.grid.add(DAMAGE, times[(exchanges.outcome == Ending.GARBAGE) | (exchanges.noise > 0)])

    def _count_broadcasts(self, exchanges: Exchanges, to_all: Bools) -> None:
        self.broadcasts += int(np.count_nonzero(to_all))
        self.broadcast_runs += int(np.count_nonzero(to_all[1:] & to_all[:-1]))
        self.broadcasts_again += int(np.count_nonzero(to_all & exchanges.repeats))
        called = to_all & exchanges.called
        self.broadcasts_answered += int(np.count_nonzero(called))
        self.called_examples += exchanges.request[called][: _EXAMPLES - len(self.called_examples)].tolist()
        for number in exchanges.unit[exchanges.outcome == Ending.NO_REQUEST].tolist():
            self.unit(number).called += 1
        if self.timed:
            known = to_all & (exchanges.t_next != NEVER)
            self.turnarounds.add((exchanges.t_next - exchanges.t_asked)[known])
            self.broadcast_repeats.add((exchanges.t_next - exchanges.t_asked)[known & exchanges.next_same])

    def _count_echoes(self, exchanges: Exchanges) -> None:
        """Requests without an answer that come again at once and are answered then; and let go of them, where nearly
        every request that is answered came so."""
        outcome, repeats = exchanges.outcome, exchanges.repeats
        answered, silent = outcome <= Ending.EXCEPTION, (outcome == Ending.SILENT) & exchanges.next_same
        again = np.concatenate(([self._repeating], silent[:-1])) & answered
        self._repeating = bool(silent[-1])
        self.answered += int(np.count_nonzero(answered))
        self.repeats_answered += int(np.count_nonzero(again))
        if self.timed:
            self.repeat_waits.add((exchanges.t_next - exchanges.t_asked)[silent])
        if not self.echoing:
            self._echo_before = False
            return
        echo, again_before = self._echo_before, self._echo_repeats
        for i in range(len(outcome)):  # of a request that comes again and again, every other one is an echo
            if echo:
                repeats[i] = again_before
            echo = bool(silent[i]) and not echo
            if echo:
                outcome[i], again_before, repeats[i] = Ending.ECHO, bool(repeats[i]), False
        self._echo_before, self._echo_repeats = echo, again_before

    @property
    def echoing(self) -> bool:
        """Whether an adapter shows what it sends: nearly every request that is answered came twice, at once."""
        if self.repeats_answered < _ECHOES or self.repeats_answered < _NEARLY_ALL * self.answered:
            return False
        if self.broadcasts >= _ECHOES and self.broadcasts_again < _OF_ALL * self.broadcasts:
            return False  # an adapter shows those as well
        wait = self.repeat_waits.quantile(0.25)
        off = self.clock.newest().wait_ns if wait is not None and wait > _ECHO_NS else 0.0
        return wait is None or wait <= _ECHO_NS + (off if np.isfinite(off) else 0.0)

    def _sample(self, part: Stretch, odd: Bools) -> None:
        exchanges = part.exchanges
        for i in odd.nonzero()[0].tolist():
            unit = self.unit(int(exchanges.unit[i]))
            samples = unit.followed if exchanges.outcome[i] <= Ending.EXCEPTION else unit.samples
            if samples.wants():
                samples.keep(sampled(part, i, self._usual(part, i)))

    def _usual(self, part: Stretch, i: int) -> _Octets | None:
        """The newest good answer to the same poll before exchange i."""
        exchanges, poll = part.exchanges, int(part.exchanges.poll[i])
        good = ((exchanges.poll[:i] == poll) & (exchanges.outcome[:i] == Ending.OK)).nonzero()[0]
        return part.table.bytes_of(int(exchanges.answer[good[-1]])) if len(good) else self.polls.usual.get(poll)


def ledger_of(parts: Iterable[tuple[Batch, Any]], line: LineSettings) -> Ledger:
    """The ledger of batches with their transactions."""
    ledger = Ledger(line)
    for batch, transactions in parts:
        ledger.feed(batch, transactions)
    ledger.close()
    return ledger
