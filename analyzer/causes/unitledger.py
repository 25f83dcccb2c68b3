"""What happened to the exchanges of one unit: counters, spells, a few samples with their bytes.

Samples are of exchanges that went otherwise than they should, evenly over the time; what of their bytes is another
protocol's is counted by its frames.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dissectors.crc import crc16, crc_ok
from dissectors.foreign import IN_ANY_BYTES, LOOSE
from dissectors.lengths import Role, pdu_length
from dissectors.limits import EXCEPTION, OVERHEAD

from ..deframing.rules import crc_windows
from ..tables.schema import NO_GAP, Kind
from ..tables.transactions import ECHOED, NEVER
from .exchanges import Ending, Exchanges, Stretch
from .flatmemory import Spells, Thinned
from .rawbytes import is_in_ascii

_EXAMPLES: Final = 3
_SEVERAL: Final = 5
AT_ONCE_NS: Final = 40e6
_OK, _EXCEPTION, _SILENT, _GARBAGE, _UNHEARD, _ECHO = (
    int(each) for each in (Ending.OK, Ending.EXCEPTION, Ending.SILENT, Ending.GARBAGE, Ending.UNHEARD, Ending.ECHO)
)
BUSY: Final = np.isin(np.arange(256), (5, 6))  # acknowledge, server device busy


class UnitLedger:
    """One unit's exchanges."""

    unit: int
    outcomes: NDArray[np.int64]
    _counts: list[int] | None
    repeats: int
    strays: int
    unfit: int
    late: int
    doubles: int
    marked: int
    marked_bytes: int
    examples: dict[int, list[int]]
    redundant: Thinned
    heeded: Thinned
    redundant_pauses: Thinned
    last_pauses: Thinned
    redundant_turns: Thinned
    pauses: Thinned
    turns: Thinned
    echoes: int
    echo_strays: int
    echo_delays: Thinned
    echo_waits: Thinned
    strayed: int
    called: int
    behind: int
    first_answer: int | None
    first_again: int | None
    first: int
    last: int
    delays: Thinned
    waits: Thinned
    plain_waits: Thinned
    quiet_waits: Thinned
    garbage_waits: Thinned
    garbage_again: Thinned
    gaps: Thinned
    holes: Thinned
    hole_places: Counter[int]
    silences: Spells
    silences_but_echoes: Spells
    silences_but_tried: Spells
    silences_of_others: Spells
    refusals: Spells
    busy: int
    samples: Samples
    followed: Samples

    def __init__(self, unit: int) -> None:
        self.unit = unit
        self.outcomes = np.zeros(len(Ending), np.int64)
        self._counts = None  # the same, once somebody asks
        self.repeats = 0  # requests to it that repeat the one before
        self.strays = 0  # right answers of it that answer nothing, while another unit is asked
        self.unfit = 0  # and that stand where its answer was due, and are another
        self.late = 0  # that came when the master had gone on
        self.doubles = 0  # that came behind another answer to the same request
        self.marked = 0  # answers, right but for marks of the UART
        self.marked_bytes = 0
        self.examples = {}  # by outcome: indices of a few requests
        self.redundant = Thinned()  # ns, delays of good answers whose request the master repeats all the same
        self.heeded = Thinned()  # and of those whose request it does not repeat
        self.redundant_pauses = Thinned()  # ns, from the end of such an answer to the request's repetition
        self.last_pauses = Thinned()  # ns, from the end of a good answer to the last repetition to what is asked then
        self.redundant_turns = Thinned()  # ns, from their requests to the repetition, of the same
        self.pauses = Thinned()  # ns, from its good answers to the next request
        self.turns = Thinned()  # ns, from a request that is well answered to the next one
        self.echoes = 0  # answers that are their request once more
        self.echo_strays = 0  # right answers of it to nothing, or late, that could be requests as well
        self.echo_delays = Thinned()
        self.echo_waits = (
            Thinned()
        )  # ns, from a request without an answer to the same once more, where that may answer it
        self.strayed = 0  # requests without an answer behind which a byte strayed
        self.called = 0  # broadcasts that it answered, by its own address
        self.behind = 0  # good answers with something behind them before the next request
        self.first_answer = None
        self.first_again = None  # the first of its good answers whose request is repeated all the same
        self.first = 0  # ns or bytes: `Ledger.axis`
        self.last = 0
        self.delays = Thinned()  # ns
        self.waits = Thinned()  # ns, of requests that stayed without an answer, to the next request
        self.plain_waits = Thinned()  # and of those that cannot have been answered by the next one
        self.quiet_waits = Thinned()  # and of those behind which nothing at all came
        self.garbage_waits = Thinned()
        self.garbage_again = Thinned()  # and of those whose request the master repeats next
        self.gaps = Thinned()  # ns, silence between a request and its answer by the reads
        self.holes = Thinned()  # ns, the longest silence inside an answer
        self.hole_places = Counter()
        self.silences = Spells()
        self.silences_but_echoes = Spells()  # as if there were no answers that are their request once more
        self.silences_but_tried = Spells()  # and no such answers to a request that comes several times
        self.silences_of_others = Spells()  # of requests whose answer reads otherwise than they
        self.refusals = Spells()
        self.busy = 0
        self.samples = Samples()  # without a good answer
        self.followed = Samples()  # with one, and something behind it

    def count(self, *outcomes: Ending) -> int:
        """How many requests to it ended so."""
        if self._counts is None:
            self._counts = self.outcomes.tolist()
        total = 0
        for outcome in outcomes:  # suspects ask thousands of times: half the price of `sum` over a generator
            total += self._counts[outcome]
        return total

    @property
    def asked(self) -> int:
        """Requests to it of which something is known."""
        return self.count(Ending.OK, Ending.EXCEPTION, Ending.SILENT, Ending.GARBAGE)

    @property
    def echoes_itself(self) -> bool:
        """Whether what reads like requests that come again comes sooner than any master gives up: two devices of one
        address each take the other's answer for a request, where it reads like one."""
        waits = self.echo_waits
        return len(waits) >= _SEVERAL and waits.total < AT_ONCE_NS * len(waits)

    @property
    def loose(self) -> int:
        """Right answers of it that are not those to the request before them."""
        return self.strays + self.unfit + self.late + self.doubles

    @property
    def answered(self) -> int:
        """Requests that got a whole answer; an exception is one."""
        return self.count(Ending.OK, Ending.EXCEPTION)

    def add(self, mine: Exchanges, times: NDArray[np.int64], *, timed: bool, hole_ns: float) -> None:
        """Count its next exchanges; `times` tell their order, `timed` whether as time. Silences over `hole_ns` are
        holes in an answer."""
        outcome = mine.outcome
        counts = np.bincount(outcome, minlength=len(Ending))
        if not self.outcomes.any():
            self.first = int(times[0])
        self.outcomes += counts
        self._counts = None
        self.last = int(times[-1])
        self.repeats += int(np.count_nonzero(mine.repeats))
        for kind in counts.nonzero()[0].tolist():
            few = self.examples.setdefault(kind, [])
            if len(few) < _EXAMPLES:
                few += mine.request[outcome == kind][: _EXAMPLES - len(few)].tolist()
        good = (outcome == _OK) | (outcome == _EXCEPTION)
        every = int(counts[_OK] + counts[_EXCEPTION])
        if every:
            if self.first_answer is None:
                self.first_answer = int(times[np.argmax(good)])
            whole = every == len(mine)
            self._add_answers(
                mine if whole else mine[good], times if whole else times[good], timed=timed, hole_ns=hole_ns
            )
        if counts[_SILENT]:
            self.strayed += int(np.count_nonzero((outcome == _SILENT) & (mine.noise > 0)))
        if counts[_SILENT] or counts[_GARBAGE] or self.silences_but_echoes.is_open:
            heard = (outcome != _UNHEARD) & (outcome != _ECHO)  # nor does what a tap shows of its own end a silence
            _count_silences(self.silences, mine, times, heard)
            echoes = _are_echoes(mine)
            _count_silences(self.silences_but_echoes, mine, times, heard & ~echoes)
            _count_silences(self.silences_but_tried, mine, times, heard & ~(echoes & (mine.repeats | mine.next_same)))
            _count_silences(self.silences_of_others, mine, times, heard & ~ECHOED[mine.function])
        elif every:
            self.silences.pass_over(int(times[-1]))
            self.silences_but_echoes.pass_over(int(times[-1]))
            self.silences_but_tried.pass_over(int(times[-1]))
            self.silences_of_others.pass_over(int(times[-1]))
        if counts[_EXCEPTION] or self.refusals.is_open:
            busy = BUSY[mine.exception]
            self.busy += int(np.count_nonzero(busy))
            self.refusals.add(busy, times)
        if timed and counts[_SILENT] + counts[_GARBAGE]:
            waits = mine.t_next - mine.t_asked
            known = mine.t_next != NEVER
            silent = known & (outcome == _SILENT)
            self.waits.add(waits[silent])
            echo = mine.next_echoed | (ECHOED[mine.function] & mine.repeats)  # one of the two may be an answer, late
            self.quiet_waits.add(waits[silent & (mine.late + mine.strays + mine.noise == 0) & ~echo])
            again = silent & ECHOED[mine.function] & mine.next_same
            self.echo_waits.add(waits[again])
            self.plain_waits.add(waits[silent & ~again])
            garbage = known & (outcome == _GARBAGE)
            self.garbage_waits.add(waits[garbage])
            self.garbage_again.add(waits[garbage & mine.next_same])

    def add_echo(self, delay_ns: int) -> None:
        """Count an answer that is not the one to the request before it, and reads like a request; `delay_ns`: behind one
        that stayed without an answer, else -1."""
        self.echo_strays += 1
        if delay_ns >= 0:
            self.echo_delays.add(np.array((delay_ns,)))

    def _add_answers(self, good: Exchanges, times: NDArray[np.int64], *, timed: bool, hole_ns: float) -> None:
        delays, noise, strays = good.delay, good.noise, good.strays
        known, again = delays >= 0, good.next_same
        self.delays.add(delays[known])
        if again.any():
            self.redundant.add(delays[known & again])
            if self.first_again is None:
                self.first_again = int(times[np.argmax(again)])
        self.heeded.add(delays[known & ~again])
        alone = (noise == 0) & (strays == 0)
        self.behind += len(good) - int(np.count_nonzero(alone))
        if timed:
            t_next = good.t_next
            followed = alone & (t_next != NEVER)
            self.pauses.add((t_next - good.t_answered)[followed])
            self.turns.add((t_next - good.t_asked)[followed])
            if again.any():
                self.redundant_pauses.add((t_next - good.t_answered)[followed & again])
                self.redundant_turns.add((t_next - good.t_asked)[followed & again])
            if good.repeats.any():
                self.last_pauses.add((t_next - good.t_answered)[followed & good.repeats & ~again])
        marks = good.marks
        if marks.any():
            self.marked += int(np.count_nonzero(marks))
            self.marked_bytes += int(marks.sum())
        echoes = _are_echoes(good)
        if echoes.any():
            self.echoes += int(np.count_nonzero(echoes))
            self.echo_delays.add(delays[known & echoes])
        gaps, holes = good.answer_gap, good.hole
        self.gaps.add(gaps[gaps != NO_GAP])
        self.holes.add(holes)
        long = holes > hole_ns
        if long.any():
            self.hole_places.update(good.hole_at[long].tolist())


def _are_echoes(mine: Exchanges) -> NDArray[np.bool_]:
    """Which exchanges are answered by what reads like their request once more."""
    found: NDArray[np.bool_] = ECHOED[mine.function] & (mine.outcome == _OK) & (mine.answer_bytes == mine.asked_bytes)
    return found


def _count_silences(spells: Spells, mine: Exchanges, times: NDArray[np.int64], counted: NDArray[np.bool_]) -> None:
    """Those of these exchanges that count, into spells of silence."""
    outcome = mine.outcome[counted]
    spells.add(outcome == _SILENT, times[counted], outcome == _GARBAGE, mine.repeats[counted])


_MOST: Final = 96  # of a unit
_PIECES: Final = 12  # of a sample
_BYTES: Final = 600
READ_REQUEST: Final = 8  # bytes of a request to read, or to write one value: the shortest


class SampleRow(NamedTuple):
    """A row behind a request: what the deframer took it for, and whether the exchange's good answer is it."""

    kind: int
    check: bool
    answers: bool
    unit: int
    t_start: int
    t_end: int
    marks: int
    data: bytes


@dataclass(frozen=True, slots=True)
class Sample:
    """One exchange. `index` is that of the request's frame, `usual` a good answer to the same poll from before, or None;
    `next_same`: the master repeated its request; `t_next` as in `Exchanges`."""

    unit: int
    function: int
    request: bytes
    poll: int
    outcome: Ending
    due: int
    index: int
    t_asked: int
    t_next: int
    place: int
    pieces: tuple[SampleRow, ...]
    usual: bytes | None
    next_same: bool
    next_unit: int


@dataclass(slots=True)
class Samples:
    """Some of the exchanges offered, spread evenly; `offered` counts all of them."""

    kept: list[Sample] = field(default_factory=list)
    offered: int = 0
    _stride: int = 1

    def wants(self) -> bool:
        """Whether the next one offered is to be kept; counts it."""
        self.offered += 1
        return (self.offered - 1) % self._stride == 0

    def keep(self, sample: Sample) -> None:
        """Keep one that was wanted."""
        self.kept.append(sample)
        if len(self.kept) > _MOST:
            self.kept = self.kept[::2]
            self._stride *= 2

    @property
    def weight(self) -> float:
        """How many of those offered each kept one stands for."""
        return self.offered / len(self.kept) if self.kept else 0.0


def asked_in_pieces(between: bytes, answer: bytes) -> bool:
    """Whether the bytes between two answers end with a whole request that the second one may answer: a tap held a part
    of it back, and no silence that long is inside a frame."""
    if len(answer) < 2:  # a sample's bytes end here
        return False
    header = bytes((answer[0], answer[1] & ~EXCEPTION))
    at = between.find(header)
    while 0 <= at <= len(between) - READ_REQUEST:
        if crc16(between[at:]) == 0:
            return True
        at = between.find(header, at + 1)
    return False


def _told_length(request: bytes, usual: bytes | None, pieces: Sequence[SampleRow]) -> int:
    """The bytes of an answer whose length its request does not tell: those of a good one before, or by its own first
    bytes; 0 where nobody knows."""
    if is_in_ascii(request):
        return 0
    if usual is not None:
        return len(usual)
    data = b"".join(piece.data for piece in pieces)
    length = pdu_length(data[1:], Role.RESPONSE) if data[:2] == request[:2] else None
    return length + OVERHEAD if length is not None and length > 0 else 0


def sampled(stretch: Stretch, i: int, usual: bytes | None) -> Sample:
    """The sample of one exchange of a stretch."""
    exchanges, table = stretch.exchanges, stretch.table
    rows, pieces, room = table.rows, [], _BYTES
    for row in stretch.rows_of(i)[:_PIECES]:
        if room <= 0:
            break
        data = table.bytes_of(row)[:room]
        room -= len(data)
        kind = int(rows.kind[row])
        pieces.append(
            SampleRow(
                kind,
                bool(rows.check[row]) and kind != Kind.NOISE,
                row == exchanges.answer[i],
                int(rows.unit[row]),
                int(rows.t_start_ns[row]),
                int(rows.t_end_ns[row]),
                int(rows.errors[row]),
                data,
            )
        )
    request = table.bytes_of(int(exchanges.row[i]))
    return Sample(
        int(exchanges.unit[i]),
        int(exchanges.function[i]),
        request,
        int(exchanges.poll[i]),
        Ending(int(exchanges.outcome[i])),
        int(exchanges.due[i]) or _told_length(request, usual, pieces),
        int(exchanges.request[i]),
        int(exchanges.t_asked[i]),
        int(exchanges.t_next[i]),
        int(exchanges.place[i]),
        tuple(pieces),
        usual,
        bool(exchanges.next_same[i]),
        int(exchanges.next_unit[i]),
    )


_LENGTHS: Final = (7, 8, 9, 10, 11, 14, 22)  # bytes of a meter's frames
_SHORTEST: Final = _LENGTHS[0]
_SHARE: Final = 0.05  # of the bytes, at the least
_READS: Final = (1, 2, 3, 4)
_MODBUS: Final = (1, 2, 3, 4, 5, 6, 7, 8, 15, 16, 17, 22, 23, 43)


def _serial_number(data: bytes) -> int:
    """Meters with an address of four bytes, a command, and the CRC of Modbus: the same first four bytes, and it checks,
    of frames that differ: garbage that comes again and again checks as often as once."""
    heads: defaultdict[bytes, Counter[bytes]] = defaultdict(Counter)
    crc = crc_windows(np.frombuffer(data, np.uint8))
    for length in _LENGTHS:
        if length <= len(data):
            for at in np.flatnonzero(crc.heads[:-length] == crc.tails[length:]).tolist():
                frame = data[at : at + length]
                if any(frame[-2:]):  # FF FF and zeros check, as long as they last
                    heads[frame[:4]][frame] += 1
    counts = (found.total() for head, found in heads.items() if head[1] & 0x7F not in _MODBUS and len(found) > 1)
    return max((count for count in counts if count >= max(4, _SHARE * len(data) / _SHORTEST)), default=0)


def rtu_frames(stretches: Iterable[bytes]) -> int:
    """Right requests of Modbus RTU to read, where a line is in ASCII mode."""
    return sum(
        stretch[at + 1] in _READS and not any(stretch[at + 4 : at + 5]) and crc_ok(stretch[at : at + READ_REQUEST])
        for stretch in stretches
        for at in range(len(stretch) - READ_REQUEST + 1)
    )


def _counted(name: str) -> Callable[[bytes], int]:
    find = IN_ANY_BYTES[name]
    return lambda data: sum(1 for _ in find(data))


PROTOCOLS: Final[Mapping[str, Callable[[bytes], int]]] = {
    **{name: _counted(name) for name in IN_ANY_BYTES if name not in LOOSE},
    "a meter's own protocol with the CRC of Modbus": _serial_number,
}
