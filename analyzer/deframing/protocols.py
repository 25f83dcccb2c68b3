"""What a line speaks: the one place where the protocol of each port is chosen, for files, live lines and replays alike.

A protocol is an entry of `PROTOCOLS`: how it is recognised, and the engine of a port that speaks it. A capture may name
the protocols of its ports; else a port's bytes wait until one of them is sure. The choice hangs on the bytes and their
times alone, never on how they were cut into reads: each entry says after how many bytes it would have been sure, and
the soonest wins. Bytes behind which nothing came for seconds are judged as all there is.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np

from captures.chunks import Block
from captures.line import PROTOCOLS_NOTE, LineSettings

from ..options import Options
from .ascii import STRAY, AsciiEngine, ascii_after, begins_ascii, is_ascii
from .directions import port_role, told_by_marks
from .engine import Engine
from .mbap import MbapEngine, is_mbap, mbap_after
from .segments import StreamSegments
from .stream import PortEngine, PortsDeframer, character_time

_HEAD: Final = 2048  # bytes: by then it is plain what a line speaks
_FOREIGN: Final = re.compile(rb"[^:0-9A-Fa-f\r\n]")  # what no line in ASCII mode carries
_BINARY: Final = 4  # one foreign byte in so many is no ASCII mode


@dataclass(frozen=True, slots=True)
class LineProtocol:
    """A protocol that a port may speak.

    `sure_after` gives the number of the first bytes that make it sure, or None where they don't (yet); `is_all` says it
    of bytes that are all there is.
    """

    name: str  # as `Options.protocol` has it
    sure_after: Callable[[bytes], int | None]
    is_all: Callable[[bytes], bool]
    engine: Callable[[LineSettings, Options, int], PortEngine]  # of a port


def _foreign_after(head: bytes) -> int | None:
    """After how many bytes there are too many that no text has."""
    foreign = np.zeros(len(head), np.int64)
    foreign[[match.start() for match in _FOREIGN.finditer(head)]] = 1
    count = np.cumsum(foreign)
    sure = np.flatnonzero((count > STRAY) & (_BINARY * count > np.arange(1, len(head) + 1)))
    return int(sure[0]) + 1 if len(sure) else None


def _rtu_after(head: bytes) -> int | None:
    """RTU is what has bytes that no text has, begins with no ASCII frame nor MBAP header, and the one that is left."""
    binary, (_, no_header) = _foreign_after(head), mbap_after(head)
    if begins_ascii(head):
        binary = None
    if binary is not None and no_header is not None:
        return max(binary, no_header)
    return _HEAD if len(head) >= _HEAD else None


PROTOCOLS: Final = (
    LineProtocol(
        "ascii",
        ascii_after,
        is_ascii,
        lambda line, options, port: AsciiEngine(character_time(line), options, port_role(line, port)),
    ),
    LineProtocol(
        "tcp",
        lambda head: mbap_after(head)[0],
        is_mbap,
        lambda line, options, port: MbapEngine(options, port_role(line, port), marked=told_by_marks(line, port)),
    ),
    LineProtocol(
        "rtu",
        _rtu_after,
        lambda data: _foreign_after(data) is not None,
        lambda line, options, port: Engine(character_time(line), options, port_role(line, port)),
    ),
)
_BY_NAME: Final = {protocol.name: protocol for protocol in PROTOCOLS}


class Deframer(PortsDeframer):
    """Timestamped bytes in, frames and noise out, as soon as they are certain, whatever protocol each port speaks.

    `feed` chunks or blocks as they come, `tick` when the line is quiet (live), `close` at the end; each gives the rows
    that have become certain. What was given is never revised. The options may name the protocol.
    """

    def __init__(self, line: LineSettings, options: Options = Options()) -> None:  # noqa: B008 - frozen
        super().__init__(line, options, _EngineOfPort(line, options))


@dataclass(frozen=True, slots=True)
class _EngineOfPort:
    """Makes the engine of a port, of the protocol that the options or the line's notes name, if they do.

    No closure: a deframer is kept between the slices of a recording (`analyzer.fleet`).
    """

    line: LineSettings
    options: Options

    def __call__(self, port: int) -> PortEngine:
        named = self.line.notes.get(PROTOCOLS_NOTE, "").split(",")
        noted = named[port].strip() if port < len(named) else ""
        known = _BY_NAME.get(self.options.protocol, _BY_NAME.get(noted))
        if known is None:
            return _UndecidedPort(self.line, self.options, port)
        return known.engine(self.line, self.options, port)


class _UndecidedPort:
    """A port whose protocol its bytes have yet to show; then that protocol's engine.

    Few bytes behind which nothing came for seconds, and that show none, are given as RTU would have them; where RTU
    follows, it knows of these and of the silence.
    """

    def __init__(self, line: LineSettings, options: Options, port: int) -> None:
        self._line, self._options, self._port = line, options, port
        self._engine: PortEngine | None = None
        self._waiting: list[Block] = []
        self._unknown: PortEngine | None = None  # of what showed no protocol: RTU's
        self._out: list[StreamSegments] = []
        self._bytes = self._reads = 0  # given to that one

    @property
    def undecided_ns(self) -> int | None:
        """The time of the first byte that is not decided, or None."""
        if self._engine is not None:
            return self._engine.undecided_ns
        known = [int(block.t_ns[0]) for block in self._waiting]
        if self._unknown is not None and (undecided := self._unknown.undecided_ns) is not None:
            known.append(undecided)
        return min(known, default=None)

    def feed(self, block: Block, now_ns: int | None = None) -> None:
        """Chunks of this port; see `engine.Engine.feed`."""
        if self._engine is None:
            self._wait(block)
            if now_ns is not None:
                self.tick(now_ns)
        else:
            self._engine.feed(block, now_ns)

    def tick(self, now_ns: int) -> None:
        """The line has been silent up to now."""
        if self._engine is None and self._waiting and now_ns - int(self._waiting[-1].t_ns[-1]) >= self._options.cut_ns:
            self._decide_on_all()
        if self._engine is not None:
            self._engine.tick(now_ns)

    def close(self) -> None:
        """No more bytes come."""
        if self._engine is None and self._waiting:
            self._decide_on_all()
        for engine in (self._unknown, self._engine):
            if engine is not None:
                engine.close()

    def take(self) -> list[StreamSegments]:
        """What was decided since the last call."""
        out, self._out = self._out, []
        if self._unknown is not None:
            out += self._unknown.take()
        if self._engine is None:
            return out
        parts = self._engine.take()
        return out + (list(map(self._shifted, parts)) if self._bytes else parts)

    def _wait(self, block: Block) -> None:
        """Take chunks while nothing is decided; what stands before a silence of seconds is judged by itself."""
        before = int(self._waiting[-1].t_ns[-1]) if self._waiting else int(block.t_ns[0])
        quiet = np.flatnonzero(np.diff(block.t_ns, prepend=before) >= self._options.cut_ns)
        for first, last in pairwise([0, *quiet.tolist(), len(block)]):
            if first in quiet and self._waiting:
                self._decide_on_all()
            if self._engine is not None:  # the rest is its own
                self._engine.feed(block.slice(first, len(block)))
                return
            if last > first:
                self._waiting.append(block.slice(first, last))
                self._decide()

    def _head(self) -> bytes:
        head = b""
        for block in self._waiting:
            head += block.data[: _HEAD - len(head)].tobytes()
        return head

    def _decide(self) -> None:
        """Choose the protocol that these bytes make sure first, if any."""
        head = self._head()
        sure = [(after, i) for i, each in enumerate(PROTOCOLS) if (after := each.sure_after(head)) is not None]
        if sure:
            self._begin(PROTOCOLS[min(sure)[1]])

    def _decide_on_all(self) -> None:
        """Choose by bytes of which no more come; else give them away."""
        data = b"".join(block.data.tobytes() for block in self._waiting)
        known = next((each for each in PROTOCOLS if each.is_all(data)), None)
        if known is not None:
            self._begin(known)
            return
        if self._unknown is None:
            self._unknown = PROTOCOLS[-1].engine(self._line, self._options, self._port)
        for block in self._waiting:
            self._unknown.feed(block)
        self._unknown.tick(int(self._waiting[-1].t_ns[-1]) + self._options.cut_ns)
        self._bytes += len(data)
        self._reads += sum(map(len, self._waiting))
        self._waiting = []

    def _begin(self, protocol: LineProtocol) -> None:
        if protocol is PROTOCOLS[-1] and self._unknown is not None:
            self._engine, self._unknown, self._bytes, self._reads = self._unknown, None, 0, 0
        else:
            self._engine = protocol.engine(self._line, self._options, self._port)
            if self._unknown is not None:
                self._unknown.close()
                self._out += self._unknown.take()
                self._unknown = None
        for block in self._waiting:
            self._engine.feed(block)
        self._waiting = []

    def _shifted(self, part: StreamSegments) -> StreamSegments:
        """The same behind what was given before the engine was chosen."""
        reads = part.reads._replace(head=part.reads.head + self._reads, tail=part.reads.tail + self._reads)
        return part._replace(offset=part.offset + self._bytes, reads=reads)
