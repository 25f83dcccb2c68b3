"""What a line speaks: the one place where each port gets the engine of its protocol, for files, live lines and replays.

A protocol is an entry of `PROTOCOLS`: the engine of a port that speaks it. A capture may name the protocols of its
ports, as one of a network does; else a port's bytes wait until `weighing` is sure of one of them, or a silence of
seconds says that they are all there is. While nothing fits any more, the choice is looked at again (`fitting`). All of
it hangs on the bytes and their times alone, never on how they were cut into reads.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np

from captures.chunks import Block
from captures.line import PROTOCOLS_NOTE, LineSettings

from ..options import Options
from .ascii import AsciiEngine
from .directions import port_role, told_by_marks
from .engine import Engine
from .fitting import Fit
from .mbap import MbapEngine
from .segments import StreamSegments
from .stream import PortEngine, PortsDeframer, character_time
from .weighing import PortWeights

MakeEngine = Callable[[LineSettings, Options, int], PortEngine]
_LONG_AGO: Final = -(1 << 62)
_UNKNOWN: Final = "rtu"  # what bytes are given as that show nothing

PROTOCOLS: Final[Mapping[str, MakeEngine]] = {  # by their names, as `Options.protocol` has them
    "ascii": lambda line, options, port: AsciiEngine(character_time(line), options, port_role(line, port)),
    "tcp": lambda line, options, port: MbapEngine(options, port_role(line, port), marked=told_by_marks(line, port)),
    "rtu": lambda line, options, port: Engine(character_time(line), options, port_role(line, port)),
}


class Deframer(PortsDeframer):
    """Timestamped bytes in, frames and noise out, as soon as they are certain, whatever protocol each port speaks.

    `feed` chunks or blocks as they come, `tick` when the line is quiet (live), `close` at the end; each gives the rows
    that have become certain. What was given is never revised. The options may name the protocol.
    """

    def __init__(self, line: LineSettings, options: Options = Options()) -> None:  # noqa: B008 - frozen
        super().__init__(line, options, EngineOfPort(line, options))


@dataclass(frozen=True, slots=True)
class EngineOfPort:
    """Makes the engine of a port, of the protocol that the options or the line's notes name, if they do.

    No closure: a deframer is kept between the slices of a recording (`analyzer.fleet`).
    """

    line: LineSettings
    options: Options

    def __call__(self, port: int) -> PortEngine:
        named = self.line.notes.get(PROTOCOLS_NOTE, "").split(",")
        noted = named[port].strip() if port < len(named) else ""
        known = PROTOCOLS.get(self.options.protocol, PROTOCOLS.get(noted))
        return WeighedPort(self.line, self.options, port) if known is None else known(self.line, self.options, port)


class WeighedPort:
    """A port whose protocol its bytes have yet to show, then that protocol's engine, as long as it fits.

    Few bytes behind which nothing came for seconds, and that show none, are given as RTU would have them; where RTU
    follows, it knows of these and of the silence.
    """

    _line: LineSettings
    _options: Options
    _port: int
    _engine: PortEngine | None
    _protocol: str
    _weights: PortWeights
    _waiting: list[Block]
    _out: list[StreamSegments]
    _bytes: int
    _reads: int
    _given: tuple[int, int]
    _fed: int
    _now_ns: int
    _tried: set[str]
    _fit: Fit

    def __init__(self, line: LineSettings, options: Options, port: int) -> None:
        self._line, self._options, self._port = line, options, port
        self._engine = None
        self._protocol = ""  # of the engine, once it is chosen
        self._weights = self._fresh()
        self._waiting = []
        self._out = []
        self._bytes = self._reads = 0  # given before the engine's first,
        self._given = (0, 0)  # and in all
        self._fed = 0  # bytes that an engine was given before any was chosen
        self._now_ns = _LONG_AGO
        self._tried = set()  # protocols that did not fit from where the engine began
        self._fit = self._fitting("")

    def _fresh(self) -> PortWeights:
        return PortWeights(serial=self._line.baud is not None)

    def _fitting(self, protocol: str, heard: int = 0) -> Fit:
        return Fit(protocol, self._options.cut_ns, heard, serial=self._line.baud is not None)

    @property
    def undecided_ns(self) -> int | None:
        """The time of the first byte that is not decided, or None."""
        known = [int(block.t_ns[0]) for block in self._waiting[:1]]
        if (held := self._fit.held_ns) is not None:
            known.append(held)
        if self._engine is not None and (undecided := self._engine.undecided_ns) is not None:
            known.append(undecided)
        return min(known, default=None)

    def feed(self, block: Block, now_ns: int | None = None) -> None:
        """Chunks of this port; see `engine.Engine.feed`."""
        if self._protocol and self._engine is not None:
            self._fit.heard(block)
            self._engine.feed(block, now_ns)
            return
        self._wait(block)
        if now_ns is not None:
            self.tick(now_ns)

    def tick(self, now_ns: int) -> None:
        """The line has been silent up to now."""
        self._now_ns = now_ns
        if self._waiting and now_ns - int(self._waiting[-1].t_ns[-1]) >= self._options.cut_ns:
            self._decide_on_all()
        if self._engine is not None:
            self._engine.tick(now_ns)

    def close(self) -> None:
        """No more bytes come."""
        if self._waiting:
            self._decide_on_all()
        while self._engine is not None:
            self._engine.close()
            if not self._taken():
                self._put(self._fit.rest())
                return

    def take_segments(self) -> list[StreamSegments]:
        """What was decided since the last call."""
        while self._taken():
            pass
        out, self._out = self._out, []
        return out

    def _taken(self) -> bool:
        """Take what the engine decided; whether another one has its place now, with what was heard since."""
        if self._engine is None:
            return False
        parts = self._engine.take_segments()
        if not self._protocol:
            self._put(parts)
            return False
        given, other = self._fit.judged(parts, self._tried)
        self._put(given)
        if other is None:
            self._put(self._fit.quiet(self._now_ns))
            return False
        blocks = list(self._fit.blocks_from(other.at))
        tried = {*self._tried, self._protocol} if not other.at else set()
        self._replace(other.protocol)
        self._tried = tried
        for block in blocks:
            self.feed(block)
        return True

    def _wait(self, block: Block) -> None:
        """Take chunks while nothing is decided; what stands before a silence of seconds is judged by itself."""
        before = int(self._waiting[-1].t_ns[-1]) if self._waiting else int(block.t_ns[0])
        quiet = np.flatnonzero(np.diff(block.t_ns, prepend=before) >= self._options.cut_ns)
        for first, last in pairwise([0, *quiet.tolist(), len(block)]):
            if first in quiet and self._waiting:
                self._decide_on_all()
            if self._protocol:  # the rest is its own
                self.feed(block.slice(first, len(block)))
                return
            if last > first:
                part = block.slice(first, last)
                self._waiting.append(part)
                self._weights.feed(part.data.tobytes())
                if self._weights.sure is not None:
                    self._begin(self._weights.sure[1])

    def _decide_on_all(self) -> None:
        """Choose by bytes of which no more come; else give them away."""
        likeliest = self._weights.of_all()
        if likeliest is not None:
            self._begin(likeliest)
            return
        if self._engine is None:
            self._engine = PROTOCOLS[_UNKNOWN](self._line, self._options, self._port)
        waiting, self._waiting = self._waiting, []
        for block in waiting:
            self._fed += len(block.data)
            self._engine.feed(block)
        self._engine.tick(int(waiting[-1].t_ns[-1]) + self._options.cut_ns)
        self._weights = self._fresh()

    def _begin(self, protocol: str) -> None:
        """The bytes that wait are of this protocol, and what follows them."""
        if self._engine is not None and protocol != _UNKNOWN:
            self._engine.close()
        if self._engine is not None:
            self._put(self._engine.take_segments())
        if self._engine is None or protocol != _UNKNOWN:
            self._replace(protocol)
        else:
            self._protocol = protocol
            self._fit = self._fitting(protocol, self._fed)
        waiting, self._waiting = self._waiting, []
        for block in waiting:
            self.feed(block)

    def _replace(self, protocol: str) -> None:
        """Another engine, for the bytes from the first on that were not given yet."""
        self._bytes, self._reads = self._given
        self._engine = PROTOCOLS[protocol](self._line, self._options, self._port)
        self._protocol, self._fit = protocol, self._fitting(protocol)

    def _put(self, parts: Sequence[StreamSegments]) -> None:
        """Give segments, behind what was given before their engine was chosen."""
        shifted = [self._shifted(part) for part in parts] if self._bytes else parts
        if shifted:
            last = shifted[-1]
            self._given = last.offset + len(last.data), int(last.reads.tail[-1]) + 1
            self._out += shifted

    def _shifted(self, part: StreamSegments) -> StreamSegments:
        reads = part.reads._replace(head=part.reads.head + self._reads, tail=part.reads.tail + self._reads)
        return part._replace(offset=part.offset + self._bytes, reads=reads)
