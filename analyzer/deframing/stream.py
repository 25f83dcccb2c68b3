"""The deframer as its users see it: chunks in, batches of rows out.

One engine a port, for every port is a stream of bytes of its own, and may speak a protocol of its own; the rows of all
ports are put in wire order, numbered and paired here. Nothing is kept but what is undecided and the requests that are
still open.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final, Protocol

import numpy as np

from captures.chunks import Block, Chunk
from captures.line import LineSettings
from dissectors.length_rules import Role
from dissectors.lengths import pdu_length

from ..options import Options
from ..tables.batch import Batch
from ..tables.schema import Kind
from ..tables.schema import Protocol as Envelope
from .arrival import ArrivalClock
from .buffer import CharacterTime
from .clockskew import ClockSkew
from .directions import port_role
from .envelopedpairing import EnvelopedPairer
from .foreign import ForeignTalk
from .segments import StreamSegments, UnorderedRows
from .tap_clock import TapClock
from .wireorder import Across, WireOrder
from .witness import AnswerWitness
from .writes import WriteDirections

_UNKNOWN_CHARACTER_NS: Final = 1e6  # 10 bits at 9600 bit/s, about: only the scale of the silence classes hangs on it


def character_time(line: LineSettings) -> CharacterTime:
    """The time of one character by a line's settings."""
    character_ns = line.nominal_character_ns
    return CharacterTime(character_ns or _UNKNOWN_CHARACTER_NS, known=character_ns is not None)


class PortEngine(Protocol):
    """What decides, in stream order, what every byte of one port is; see `engine.Engine`."""

    def feed(self, block: Block, now_ns: int | None = None) -> None: ...

    def tick(self, now_ns: int) -> None: ...

    def close(self) -> None: ...

    def take_segments(self) -> list[StreamSegments]: ...

    @property
    def undecided_ns(self) -> int | None: ...


class EngineMaker(Protocol):
    """Makes the engine of a port. No closure: a deframer is kept between the slices of a recording."""

    def __call__(self, port: int) -> PortEngine: ...


class PortsDeframer:
    """Timestamped bytes in, frames and noise out, as soon as they are certain.

    `feed` chunks or blocks as they come, `tick` when the line is quiet (live), `close` at the end; each gives the rows
    that have become certain. What was given is never revised.
    """

    _line: LineSettings
    _options: Options
    _make: EngineMaker
    _engines: dict[int, PortEngine]
    _foreign: ForeignTalk
    _pairer: EnvelopedPairer
    _witness: AnswerWitness
    _clock: TapClock
    _off_ns: float
    _frames: int
    _order: WireOrder
    _writes: WriteDirections
    _arrival: ArrivalClock
    _given: dict[int, int]
    _timed: bool

    def __init__(self, line: LineSettings, options: Options, engine: EngineMaker) -> None:
        """`engine` makes that of a port."""
        self._line, self._options = line, options
        self._make = engine
        self._engines = {}
        self._foreign = ForeignTalk()
        self._pairer = EnvelopedPairer()
        self._witness = AnswerWitness()
        self._clock = TapClock(line)
        self._off_ns = 0.0
        self._frames = 0
        self._order = WireOrder(line)
        self._writes = WriteDirections()
        self._arrival = ArrivalClock()
        self._given = {}  # bytes of each port in rows so far
        self._timed = True

    def feed(self, chunks: Chunk | Block | Iterable[Chunk], now_ns: int | None = None) -> Batch:
        """Take captured bytes; give what has become certain. `now_ns`: with a `tick` behind them."""
        if isinstance(chunks, Chunk):
            chunks = (chunks,)
        block = chunks if isinstance(chunks, Block) else Block.from_chunks(chunks)
        self._timed = self._timed and block.timed
        if len(block):
            self._arrival.feed(block)
            ports = np.bincount(block.port).nonzero()[0].tolist() if np.count_nonzero(block.port) else [0]
            if len(ports) > 1:
                ports.sort(key=lambda port: int(np.argmax(block.port == port)))  # as they came
            for port in ports:
                mine = block if len(ports) == 1 else block.taken(np.flatnonzero(block.port == port))
                self._engine(port, int(mine.t_ns[0])).feed(mine, now_ns)
        return self._give(last=False) if now_ns is None or len(self._engines) < 2 else self.tick(now_ns)

    def tick(self, now_ns: int) -> Batch:
        """The line has been silent until `now_ns` (same clock as the chunks); give what that makes certain."""
        self._arrival.passed(now_ns)
        for engine in self._engines.values():
            engine.tick(now_ns)
        return self._give(last=False)

    @property
    def skew(self) -> ClockSkew | None:
        """What is known of the clocks of two taps, one a direction; None where there are not two, or nothing is."""
        return self._order.skew if self._timed else None

    def close(self) -> Batch:
        """No more bytes come; give the rest."""
        for engine in self._engines.values():
            engine.close()
        return self._give(last=True)

    def _engine(self, port: int, first_ns: int) -> PortEngine:
        if port not in self._engines:
            self._order.joins(port, self._arrival.came(port, 0, first_ns))
            self._engines[port] = self._make(port)
        return self._engines[port]

    def _give(self, *, last: bool) -> Batch:
        taken: list[UnorderedRows] = []
        arrival = self._arrival
        bounds = [] if arrival.now_ns is None else [arrival.now_ns]
        for port, engine in sorted(self._engines.items()):
            for segments in engine.take_segments():
                rows = UnorderedRows.of(port, segments)
                rows.heard = arrival.come(port, rows.rows.start, rows.heard)
                self._given[port] = segments.offset + len(segments.data)
                taken.append(rows)
            if (undecided := engine.undecided_ns) is not None:
                given = self._given.get(port, 0)
                bounds.append(arrival.came(port, given, undecided))
                arrival.decided(port, given)
        until = None if last else min(bounds, default=None)
        loose, across = self._order.put_in_order(taken, until)
        since = self._order.since_ns
        if since is None:
            return self._batch(self._writes.settle(loose, until, timed=self._timed), across, until)
        held, alone = self._writes.held, int(np.count_nonzero(loose.heard < since))
        if held or alone:  # the last of what was heard of one port; then nothing but their ports tells writes apart
            first, rest = loose.picked(np.arange(alone)), loose.picked(np.arange(alone, len(loose.rows)))
            settled = self._writes.settle(first, since if until is None else min(until, since), timed=self._timed)
            loose = UnorderedRows.joined([settled, self._writes.release(), rest])
            across = across and across.behind(held)
        return self._batch(loose, across, until)

    def _batch(self, loose: UnorderedRows, across: Across | None, until: int | None) -> Batch:
        rows = loose.rows
        self._foreign.mark(rows, loose.data)
        frames = rows.kind.nonzero()[0]  # all but NOISE
        count = len(frames)
        rows.index[frames] = np.arange(self._frames, self._frames + count)
        self._frames += count
        self._ask_all(loose)
        earlier = self._pairer.pair(rows, loose.data, loose.head, loose.tail, across)
        loose, earlier = self._witness.settle(loose, across, earlier, until, timed=self._timed)
        rows = loose.rows
        if not self._timed:  # a source without a clock: better no times than made-up ones
            rows.t_start_ns[:] = rows.t_end_ns[:] = 0
            rows.response_ns[:] = -1
        if len(rows):
            self._clock.feed(rows)
            self._off_ns = self._clock.off_ns
        return Batch(rows, loose.data, earlier, loose.why if self._options.explain else None, off_ns=self._off_ns)

    def _ask_all(self, loose: UnorderedRows) -> None:
        """A frame to unit 0 that reads as a request is one: nobody may answer a broadcast, and clients repeat them."""
        rows = loose.rows
        if np.count_nonzero(rows.unit) == len(rows):
            return
        said = (rows.kind == Kind.RESPONSE) & (rows.unit == 0) & rows.check & (rows.protocol == Envelope.RTU)
        for row in said.nonzero()[0].tolist():
            at, length = int(rows.at[row]), int(rows.length[row])
            reads = pdu_length(loose.data[at + 1 : at + length - 2].tobytes(), Role.REQUEST) == length - 3
            if reads and port_role(self._line, int(rows.port[row])) is not Role.RESPONSE:
                rows.kind[row] = Kind.REQUEST
