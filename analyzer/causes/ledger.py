"""What happened to the exchanges of a bus, unit by unit: counters, spells, a few samples with their bytes.

The ledger is all that suspects see. It grows with the units and polls of a bus, not with its frames.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from captures.line import LineSettings
from dissectors.foreign import NAMES

from ..deframing.tap_clock import TapClock
from ..diagnosis.damage.flow_control import IS_FLOW
from ..options import Options
from ..requests.history import RequestHistory
from ..requests.reasons import Unserved
from ..tables.batch import Batch
from ..tables.schema import NO_GAP, Kind, Protocol
from ..tables.transactions import ECHOED, NEVER, Status, TransactionRows
from ..tables.verdict import ModbusVerdict
from .exchanges import Ending, ExchangeBuilder, Exchanges, Stretch, Unowned
from .exchangetable import ExchangeTable
from .flatmemory import CrowdedTimes, Thinned, TimeGrid
from .polls import PollTable, SuccessorTable
from .portcounts import count_by_port
from .registerstates import StateTable, ValueTable
from .requestledger import enter_requests
from .rowcolumns import RowColumns
from .samples import sampled
from .shifts import ShiftLedger
from .strayanswers import count_others
from .unitledger import UnitLedger

if TYPE_CHECKING:
    from ..registers.checking import LimitBreach

_Octets = bytes  # where `bytes` is a ledger's count of them
ASKED, BAD, DELAY = "asked", "bad", "delay"  # of a unit, in the grid of the time
_CHAR_NS: Final = 1e6  # where the line's speed is not known
_NOISE_SAMPLES: Final = 64
_NOISE_BYTES: Final = 512
_EXAMPLES: Final = 3
STRAY: Final = 3  # bytes that one spike makes
_HOLE: Final = 1.5  # characters
_ECHOES: Final = 5
_OF_ALL: Final = 0.48
_ECHO_NS: Final = 40e6
_NEARLY_ALL: Final = 0.8
_NOISE, _REQUEST, _RESPONSE = int(Kind.NOISE), int(Kind.REQUEST), int(Kind.RESPONSE)
_OK, _EXCEPTION, _SILENT, _GARBAGE, _BROADCAST = (
    int(each) for each in (Ending.OK, Ending.EXCEPTION, Ending.SILENT, Ending.GARBAGE, Ending.BROADCAST)
)


class Ledger:
    """Batches in; what they come to."""

    line: LineSettings
    char_ns: float
    options: Options
    timed: bool
    clock: TapClock
    units: dict[int, UnitLedger]
    polls: PollTable
    requests_of: RequestHistory
    table: ExchangeTable
    states: StateTable
    values: ValueTable
    grid: TimeGrid
    pauses: Thinned
    request_gaps: Thinned
    turnarounds: Thinned
    frames: int
    requests: int
    responses: int
    right_bytes: int
    noise_bytes: int
    bytes: int
    loose_responses: int
    functions: NDArray[np.int64]
    function_bytes: NDArray[np.int64]
    broadcasts: int
    broadcast_runs: int
    broadcasts_again: int
    broadcasts_answered: int
    called_examples: list[int]
    repeat_waits: Thinned
    repeats_answered: int
    foreign: NDArray[np.int64]
    verdict: ModbusVerdict
    shifts: ShiftLedger
    noise: list[tuple[int, int, _Octets]]
    spoilt: list[_Octets]
    spoilt_requests: int
    stray_times: CrowdedTimes
    marked_bytes: int
    flow_bytes: int
    ports: dict[int, Counter[str]]
    begin: int | None
    end: int
    exchanges: int
    successors: SuccessorTable
    breaches: Sequence[LimitBreach]
    answered: int
    _echo_before: bool
    _echo_repeats: bool
    _repeating: bool
    _builder: ExchangeBuilder

    def __init__(self, line: LineSettings, options: Options = Options()) -> None:  # noqa: B008 - frozen
        self.line = line
        self.char_ns = (line.char_bits or 11) * 1e9 / line.baud if line.baud else _CHAR_NS
        self.options = options
        self.timed = False
        self.clock = TapClock(line)
        self.units = {}
        self.polls = PollTable()
        self.requests_of = RequestHistory()
        self.table = ExchangeTable()
        self.states = StateTable()
        self.values = ValueTable()
        self.shifts = ShiftLedger()
        self.grid = TimeGrid()
        self.pauses = Thinned()  # ns, end of a good answer to the next request
        self.request_gaps = Thinned()  # ns, silence before requests that follow a good answer, by the reads
        self.turnarounds = Thinned()  # ns, broadcast to the next request
        self.frames = self.requests = self.responses = self.right_bytes = self.noise_bytes = self.bytes = 0
        self.loose_responses = 0  # right ones that answer nothing
        self.functions, self.function_bytes = (np.zeros(256, np.int64) for _ in range(2))  # of right frames
        self.broadcasts = 0
        self.broadcast_runs = 0  # broadcasts right behind another
        self.broadcasts_again = 0  # and the same once more
        self.broadcasts_answered = 0
        self.called_examples = []
        self.repeat_waits = Thinned()  # ns, from a request without an answer to the same one again
        self.repeats_answered = 0  # requests that came twice and were answered then
        self.foreign = np.zeros(len(NAMES), np.int64)  # stretches that are another protocol's, by its number
        self.verdict = ModbusVerdict()
        self.noise = []  # a few stretches outside frames: time, port, bytes
        self.spoilt = []  # a few requests whose check value is wrong
        self.spoilt_requests = 0
        self.stray_times = CrowdedTimes()  # ns, of short stretches in no frame
        self.marked_bytes = 0  # by the UART
        self.flow_bytes = 0  # that are XON or XOFF
        self.ports = defaultdict(Counter)
        self.begin = None
        self.end = 0
        self.exchanges = 0
        self.successors = SuccessorTable()
        self.breaches = ()  # of a map's limits, where values were looked at
        self.answered = 0
        self._echo_before = False  # the newest request is to come once more
        self._echo_repeats = False
        self._repeating = False  # the newest request got no answer, and the next one is the same
        self._builder = ExchangeBuilder()

    def feed(self, batch: Batch, transactions: TransactionRows) -> None:
        """The next rows, with the transactions that began among them."""
        if (networked := batch.rows.protocol == Protocol.TCP).any():  # what happens there has no wire for a cause
            batch = replace(batch, rows=batch.rows[~networked])
        if not len(batch):
            return
        table = RowColumns.of(batch)
        unheard = transactions.request[transactions.status == Status.UNHEARD].tolist()
        self._count_rows(table)
        self.shifts.feed(batch)
        for part in self._builder.feed(table, unheard):
            self._take(part)

    def close(self) -> None:
        """No more rows come."""
        self.clock.close()
        for part in self._builder.close():
            self._take(part)

    def unit(self, number: int) -> UnitLedger:
        """The ledger of one unit."""
        if number not in self.units:
            self.units[number] = UnitLedger(number)
        return self.units[number]

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

    def axis(self, exchanges: Exchanges) -> NDArray[np.int64]:
        """By what the order of things is told: time, or bytes where there are no times."""
        return exchanges.t_start if self.timed else exchanges.place

    def _count_rows(self, table: RowColumns) -> None:
        rows = table.rows
        kind, check, length = rows.kind, rows.check, rows.length
        self.verdict.feed(rows)
        self.timed = self.timed or bool(rows.t_end_ns.any())
        framed, asks = kind != _NOISE, kind == _REQUEST
        right = framed & check
        frames = framed.nonzero()[0]
        self.frames += len(frames)
        requests = int(np.count_nonzero(right & asks))
        self.requests += requests
        self.responses += int(np.count_nonzero(right)) - requests
        self.bytes += int(length.sum())
        self.marked_bytes += int(rows.errors.sum())
        self.flow_bytes += int(np.count_nonzero(IS_FLOW.take(table.data)))
        if self.begin is None:
            self.begin = int(rows.t_start_ns[0])
        self.end = max(self.end, int(rows.t_end_ns.max()))
        self.clock.feed(rows)
        functions, weights = rows.function[right], length[right]
        self.right_bytes += int(weights.sum())
        self.functions += np.bincount(functions, minlength=256)
        self.function_bytes += np.bincount(functions, weights, 256).astype(np.int64)
        loose = right & ~asks & (rows.request < 0)
        self.loose_responses += int(np.count_nonzero(loose))
        if len(frames) > int(np.count_nonzero(right)):
            self._count_spoilt(table, (framed & ~check & asks).nonzero()[0])
        if len(frames) < len(rows):
            self._count_noise(table, (~framed).nonzero()[0])
        count_by_port(self.ports, table)

    def _count_noise(self, table: RowColumns, noise: NDArray[np.intp]) -> None:
        length, begins = table.rows.length[noise], table.rows.t_start_ns[noise]
        self.noise_bytes += int(length.sum())
        self.foreign += np.bincount(table.rows.foreign[noise], minlength=len(NAMES))
        self.stray_times.add(begins[length <= STRAY])
        for row in noise[: max(_NOISE_SAMPLES - len(self.noise), 0)].tolist():
            port = int(table.rows.port[row])
            self.noise.append((int(table.rows.t_start_ns[row]), port, table.bytes_of(row)[:_NOISE_BYTES]))

    def _count_spoilt(self, table: RowColumns, spoilt: NDArray[np.intp]) -> None:
        self.spoilt_requests += len(spoilt)
        self.spoilt += [table.bytes_of(row) for row in spoilt[: max(_NOISE_SAMPLES - len(self.spoilt), 0)].tolist()]

    def _take(self, part: Stretch | Unowned) -> None:
        if isinstance(part, Unowned):
            self._count_unowned(part)
            return
        exchanges = part.exchanges
        self.exchanges += len(exchanges)
        self._count_echoes(exchanges)
        odd = (exchanges.noise > 0) | (exchanges.strays > 0) | (exchanges.late > 0)
        times = self.axis(exchanges)
        self._sample(part, odd)
        self.polls.add(part)
        enter_requests(self.requests_of, part)
        self.__dict__.pop("reasons", None)
        self.table.add(exchanges, times)
        self.states.add(part)
        self.values.add(part, times)
        self._count_bus(exchanges, odd, times)
        self._count_units(exchanges, times)
        count_others(part, self.unit, timed=self.timed)

    def _count_unowned(self, part: Unowned) -> None:
        rows = part.table.rows
        units = np.bincount(rows.unit[(rows.kind == _RESPONSE) & rows.check], minlength=1)
        for number in units.nonzero()[0].tolist():
            self.unit(number).strays += int(units[number])

    def _count_units(self, exchanges: Exchanges, times: NDArray[np.int64]) -> None:
        order = np.argsort(exchanges.unit, kind="stable")
        ordered, times = exchanges[order], times[order]
        units = exchanges.unit[order]
        begins = np.flatnonzero(np.concatenate(([True], units[1:] != units[:-1]))).tolist()
        for begin, end in zip(begins, [*begins[1:], len(units)], strict=True):
            if units[begin]:
                unit = self.unit(int(units[begin]))
                mine = ordered[begin:end]
                unit.add(mine, times[begin:end], timed=self.timed, hole_ns=_HOLE * self.char_ns)
                self._time_unit(unit.unit, mine, times[begin:end])

    def _time_unit(self, unit: int, mine: Exchanges, times: NDArray[np.int64]) -> None:
        """When a unit was asked, did not answer well, and how long it took."""
        outcome, delays = mine.outcome, mine.delay
        bad = (outcome == _SILENT) | (outcome == _GARBAGE)
        self.grid.add((ASKED, unit), times)
        if bad.any():
            self.grid.add((BAD, unit), times[bad])
        if self.timed:
            known = delays >= 0
            self.grid.add((DELAY, unit), times[known], delays[known])

    def _count_bus(self, exchanges: Exchanges, odd: NDArray[np.bool_], times: NDArray[np.int64]) -> None:
        outcome, t_next = exchanges.outcome, exchanges.t_next
        clean = (exchanges.t_answered != NEVER) & (t_next != NEVER) & ~odd
        if self.timed:
            self.pauses.add((t_next - exchanges.t_answered)[clean])
        gaps = exchanges.gap_before[1:][clean[:-1]]
        self.request_gaps.add(gaps[gaps != NO_GAP])
        self._count_broadcasts(exchanges, outcome == _BROADCAST)
        waits = np.where(t_next == NEVER, 0, t_next - exchanges.t_asked)
        silent = outcome == _SILENT
        unsure = silent & ECHOED[exchanges.function] & exchanges.next_same  # one of two echoes reads like a request
        silent &= ~unsure
        self.successors.add(exchanges.unit, silent, unsure, odd, exchanges.t_asked, exchanges.delay, waits)
        self.grid.add("asked", times)
        self.grid.add("damage", times[(outcome == _GARBAGE) | (exchanges.noise > 0)])

    def _count_broadcasts(self, exchanges: Exchanges, to_all: NDArray[np.bool_]) -> None:
        if not to_all.any():
            return
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

    def _count_echoes(self, exchanges: Exchanges) -> None:
        """Requests without an answer that come again at once and are answered then; and let go of them, where nearly
        every request that is answered came so."""
        outcome = exchanges.outcome
        answered = outcome <= _EXCEPTION
        self.answered += int(np.count_nonzero(answered))
        silent = (outcome == _SILENT) & exchanges.next_same
        again = np.concatenate(([self._repeating], silent[:-1])) & answered
        self._repeating = bool(silent[-1])
        self.repeats_answered += int(np.count_nonzero(again))
        if self.timed and silent.any():
            self.repeat_waits.add((exchanges.t_next - exchanges.t_asked)[silent])
        if not self.echoing:
            self._echo_before = False
            return
        repeats = exchanges.repeats
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

    def _sample(self, part: Stretch, odd: NDArray[np.bool_]) -> None:
        exchanges = part.exchanges
        if not odd.any():
            return
        polls, good = exchanges.poll, exchanges.outcome == _OK
        for i in odd.nonzero()[0].tolist():
            unit = self.unit(int(exchanges.unit[i]))
            samples = unit.followed if exchanges.outcome[i] <= _EXCEPTION else unit.samples
            if samples.wants():
                samples.keep(sampled(part, i, self._usual(part, polls, good, i)))

    def _usual(self, part: Stretch, polls: NDArray[np.int64], good: NDArray[np.bool_], i: int) -> _Octets | None:
        """The newest good answer to the same poll before exchange i."""
        before = ((polls[:i] == polls[i]) & good[:i]).nonzero()[0]
        if len(before):
            return part.table.bytes_of(int(part.exchanges.answer[before[-1]]))
        return self.polls.usual.get(int(polls[i]))


def ledger_of(parts: Iterable[tuple[Batch, Any]], line: LineSettings) -> Ledger:
    """The ledger of batches with their transactions."""
    ledger = Ledger(line)
    for batch, transactions in parts:
        ledger.feed(batch, transactions)
    ledger.close()
    return ledger
