"""The deframer as its users see it: chunks in, batches of rows out.

One engine a port, for every port is a stream of bytes of its own, and may speak a protocol of its own; the rows of all
ports are put in wire order, numbered and paired here. Nothing is kept but what is undecided and the requests that are
still open.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from captures.chunks import Block, Chunk
from captures.line import LineSettings
from captures.ragged import copy_pieces, sums
from dissectors.length_rules import Role
from dissectors.lengths import pdu_length

from ..options import Options
from ..tables.batch import Batch
from ..tables.schema import ROW, Kind, Rows, join_rows, take_rows
from ..tables.schema import Protocol as Envelope
from .buffer import GAPS, CharacterTime, Times, positions_among
from .engine import Engine
from .enveloped import EnvelopedPairer
from .foreign import ForeignTalk
from .rules import Bytes, Index
from .segments import StreamSegments, evidence_rows

DIRECTIONS_NOTE: Final = "directions"  # of a line: the direction of each port, in order: `request,response`
_ROLES: Final = {"request": Role.REQUEST, "response": Role.RESPONSE}
_KIND_OF_ROLE: Final = np.array([Kind.REQUEST, Kind.RESPONSE, Kind.NOISE], np.uint8)
_UNKNOWN_CHARACTER_NS: Final = 1e6  # 10 bits at 9600 bit/s, about: only the scale of the silence classes hangs on it


def character_time(line: LineSettings) -> CharacterTime:
    """The time of one character by a line's settings."""
    character_ns = line.nominal_character_ns
    return CharacterTime(character_ns or _UNKNOWN_CHARACTER_NS, known=character_ns is not None)


class PortEngine(Protocol):
    """What decides, in stream order, what every byte of one port is; see `engine.Engine`."""

    def feed(
        self,
        data: Bytes,
        sizes: Index,
        times: Times,
        marks: NDArray[np.uint8],
        errors: Index,
        now_ns: int | None = None,
    ) -> None: ...

    def tick(self, now_ns: int) -> None: ...

    def close(self) -> None: ...

    def take(self) -> list[StreamSegments]: ...

    @property
    def undecided_ns(self) -> int | None: ...


class PortsDeframer:
    """Timestamped bytes in, frames and noise out, as soon as they are certain.

    `feed` chunks or blocks as they come, `tick` when the line is quiet (live), `close` at the end; each gives the rows
    that have become certain. What was given is never revised.
    """

    def __init__(self, line: LineSettings, options: Options, engine: Callable[[int], PortEngine]) -> None:
        """`engine` makes that of a port."""
        self._line, self._options = line, options
        self._make = engine
        self._engines: dict[int, PortEngine] = {}
        self._foreign = ForeignTalk()
        self._pairer = EnvelopedPairer()
        self._frames = 0
        self._held = _UnorderedRows.nothing()
        self._now: int | None = None
        self._timed = True

    def feed(self, chunks: Chunk | Block | Iterable[Chunk], now_ns: int | None = None) -> Batch:
        """Take captured bytes; give what has become certain. `now_ns`: with a `tick` behind them."""
        if isinstance(chunks, Chunk):
            chunks = (chunks,)
        block = chunks if isinstance(chunks, Block) else Block.from_chunks(chunks)
        self._timed = self._timed and block.timed
        if len(block):
            sizes = block.offsets[1:] - block.offsets[:-1]
            self._now = int(block.t_ns[-1])
            ports = np.bincount(block.port).nonzero()[0].tolist()
            for port in ports:
                if len(ports) == 1:
                    self._engine(port).feed(block.data, sizes, block.t_ns, block.mark, block.errors, now_ns)
                else:
                    mine = block.port == port
                    octets = np.repeat(mine, sizes)
                    errors = positions_among(block.errors, octets)
                    self._engine(port).feed(
                        block.data[octets], sizes[mine], block.t_ns[mine], block.mark[mine], errors, now_ns
                    )
        return self._give(last=False) if now_ns is None or len(self._engines) < 2 else self.tick(now_ns)

    def tick(self, now_ns: int) -> Batch:
        """The line has been silent until `now_ns` (same clock as the chunks); give what that makes certain."""
        self._now = now_ns
        for engine in self._engines.values():
            engine.tick(now_ns)
        return self._give(last=False)

    def close(self) -> Batch:
        """No more bytes come; give the rest."""
        for engine in self._engines.values():
            engine.close()
        return self._give(last=True)

    def _engine(self, port: int) -> PortEngine:
        if port not in self._engines:
            self._engines[port] = self._make(port)
        return self._engines[port]

    def _give(self, *, last: bool) -> Batch:
        taken = [
            _UnorderedRows.of(port, segments)
            for port, engine in sorted(self._engines.items())
            for segments in engine.take()
        ]
        if len(self._engines) < 2 and not len(self._held.rows):
            return self._batch(_UnorderedRows.joined(taken))
        loose = _UnorderedRows.joined([self._held, *taken])
        undecided = [t for t in (e.undecided_ns for e in self._engines.values()) if t is not None]
        until = None if last else min([*undecided, *([] if self._now is None else [self._now])], default=None)
        ready, self._held = loose.in_wire_order(until)
        return self._batch(ready)

    def _batch(self, loose: _UnorderedRows) -> Batch:
        rows = loose.rows
        self._foreign.mark(rows, loose.data)
        frames = rows["kind"].nonzero()[0]  # all but NOISE
        count = len(frames)
        rows["index"][frames] = np.arange(self._frames, self._frames + count)
        self._frames += count
        self._ask_all(loose)
        earlier = self._pairer.pair(rows, loose.data, loose.head, loose.tail)
        if not self._timed:  # a source without a clock: better no times than made-up ones
            rows["t_start"] = rows["t_end"] = 0
            rows["response_ns"] = -1
        return Batch(rows, loose.data, earlier, loose.why if self._options.explain else None)

    def _ask_all(self, loose: _UnorderedRows) -> None:
        """A frame to unit 0 that reads as a request is one: nobody may answer a broadcast, and clients repeat them."""
        rows = loose.rows
        said = (
            (rows["kind"] == Kind.RESPONSE) & (rows["unit"] == 0) & rows["check"] & (rows["protocol"] == Envelope.RTU)
        )
        for row in said.nonzero()[0].tolist():
            at, length = int(rows["at"][row]), int(rows["length"][row])
            reads = pdu_length(loose.data[at + 1 : at + length - 2].tobytes(), Role.REQUEST) == length - 3
            if reads and port_role(self._line, int(rows["port"][row])) is not Role.RESPONSE:
                rows["kind"][row] = Kind.REQUEST


class RtuDeframer(PortsDeframer):
    """The same where all ports are known to speak RTU."""

    def __init__(self, line: LineSettings, options: Options = Options()) -> None:  # noqa: B008 - frozen
        super().__init__(line, options, lambda port: Engine(character_time(line), options, port_role(line, port)))


class _UnorderedRows:
    """Rows that are not numbered yet, with what belongs to them."""

    def __init__(self, rows: Rows, data: Bytes, head: NDArray[np.int64], tail: NDArray[np.int64], why: Rows) -> None:
        self.rows, self.data, self.head, self.tail, self.why = rows, data, head, tail, why

    @classmethod
    def nothing(cls) -> _UnorderedRows:
        none = np.empty(0, np.int64)
        return cls(np.empty(0, ROW), np.empty(0, np.uint8), none, none, evidence_rows(0))

    @classmethod
    def of(cls, port: int, segments: StreamSegments) -> _UnorderedRows:
        data, decided, reads = segments.data, segments.decided, segments.reads
        at, length = decided.start, decided.end - decided.start
        kind = _KIND_OF_ROLE.take(decided.role)
        framed = kind != 0  # NOISE
        if segments.heads is None:
            last = len(data) - 1
            unit, function, code = (data.take(np.minimum(at + i, last)) for i in range(3))
        else:
            unit, function, code = segments.heads.T
        failed = (framed & (function > 0x7F) & (length >= 3)).nonzero()[0]
        rows = np.zeros(len(at), ROW)
        rows["start"], rows["length"], rows["at"] = at + segments.offset, length, at
        rows["t_start"], rows["t_end"] = reads.t_start, reads.t_end
        rows["index"] = rows["request"] = rows["request_start"] = rows["response_ns"] = -1
        rows["kind"], rows["check"], rows["port"], rows["contested"] = kind, decided.check, port, decided.contested
        for name in GAPS:
            rows[name] = getattr(reads, name)
        rows["confidence"] = 1.0 / (1.0 + np.exp2(-np.maximum(decided.margin, 0.0)))
        rows["unit"], rows["function"] = unit * framed, (function & 0x7F) * framed
        rows["exception"][failed] = code[failed]
        rows["protocol"] = segments.protocol
        return cls(rows, data, reads.head, reads.tail, evidence_rows(0) if decided.why is None else decided.why)

    @classmethod
    def joined(cls, parts: list[_UnorderedRows]) -> _UnorderedRows:
        if len(parts) < 2:
            return parts[0] if parts else cls.nothing()
        shift = 0
        for part in parts:
            part.rows["at"] += shift
            shift += len(part.data)
        return cls(
            join_rows([p.rows for p in parts]),
            np.concatenate([p.data for p in parts]),
            np.concatenate([p.head for p in parts]),
            np.concatenate([p.tail for p in parts]),
            np.concatenate([p.why for p in parts]),
        )

    def in_wire_order(self, until: int | None) -> tuple[_UnorderedRows, _UnorderedRows]:
        """Those that began before time `until` (None: all), in wire order, and the rest."""
        order = np.lexsort((self.rows["port"], self.rows["t_start"]))
        early = np.ones(len(order), np.bool_) if until is None else self.rows["t_end"][order] < until
        if not early.all():  # nothing may overtake its port's rows before it
            early[int(np.argmin(early)) :] = False
        return self._picked(order[early]), self._picked(order[~early])

    def _picked(self, which: NDArray[np.intp]) -> _UnorderedRows:
        rows = take_rows(self.rows, which)
        starts, lengths = rows["at"].copy(), rows["length"].copy()
        ends = sums(lengths)
        data = np.empty(int(ends[-1]), np.uint8)
        copy_pieces(data, ends[:-1], self.data, starts, lengths)
        rows["at"] = ends[:-1]
        why = self.why[which] if len(self.why) else self.why  # there is none where nobody wants it
        return _UnorderedRows(rows, data, self.head[which], self.tail[which], why)


def port_role(line: LineSettings, port: int) -> Role | None:
    """The only role that frames of a port have; None where it hears both directions."""
    words = line.notes.get(DIRECTIONS_NOTE, "").split(",")
    return _ROLES.get(words[port].strip()) if port < len(words) else None
