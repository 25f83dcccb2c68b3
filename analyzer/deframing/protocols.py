"""What a line speaks: the one place where its protocol is chosen, for files, live lines and replays alike.

A protocol is an entry of `PROTOCOLS`: how its first bytes are recognised, and its deframer. Bytes wait until one of
them is sure. The choice hangs on the bytes alone, never on how they were cut into reads: each entry says after how many
bytes it would have been sure, and the soonest wins.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np

from captures.chunks import Block, Chunk
from captures.line import LineSettings

from ..options import Options
from ..tables.batch import Batch, join_batches
from .ascii import AsciiDeframer, ascii_after
from .stream import RtuDeframer

_HEAD: Final = 2048  # bytes: by then it is plain what a line speaks
_FOREIGN: Final = re.compile(rb"[^:0-9A-Fa-f\r\n]")  # what no line in ASCII mode carries
_STRAY: Final = 2  # such bytes that a line in ASCII mode may begin with: a driver's switching, a late start
_BINARY: Final = 4  # one foreign byte in so many is no ASCII mode


class LineDeframer(Protocol):
    """What every protocol's deframer offers; see `stream.Deframer`."""

    def feed(self, chunks: Block, now_ns: int | None = None) -> Batch: ...

    def tick(self, now_ns: int) -> Batch: ...

    def close(self) -> Batch: ...


@dataclass(frozen=True, slots=True)
class LineProtocol:
    """A protocol that a line may speak.

    `sure_after` gives the number of the first bytes that make it sure, or None where they don't (yet).
    """

    name: str  # as `Options.protocol` has it
    sure_after: Callable[[bytes], int | None]
    deframer: Callable[[LineSettings, Options], LineDeframer]


def _rtu_after(head: bytes) -> int | None:
    """RTU is what has bytes that no text has, and the one that is left."""
    foreign = np.zeros(len(head), np.int64)
    foreign[[match.start() for match in _FOREIGN.finditer(head)]] = 1
    count = np.cumsum(foreign)
    sure = np.flatnonzero((count > _STRAY) & (_BINARY * count > np.arange(1, len(head) + 1)))
    if len(sure):
        return int(sure[0]) + 1
    return _HEAD if len(head) >= _HEAD else None


PROTOCOLS: Final = (
    LineProtocol("ascii", ascii_after, AsciiDeframer),
    LineProtocol("rtu", _rtu_after, RtuDeframer),
)


class Deframer:
    """Timestamped bytes in, frames and noise out, as soon as they are certain, whatever protocol the line speaks.

    `feed` chunks or blocks as they come, `tick` when the line is quiet (live), `close` at the end; each gives the rows
    that have become certain. What was given is never revised. The options may name the protocol.
    """

    def __init__(self, line: LineSettings, options: Options = Options()) -> None:  # noqa: B008 - frozen
        self._line, self._options = line, options
        named = {protocol.name: protocol for protocol in PROTOCOLS}.get(options.protocol)
        self._deframer = None if named is None else named.deframer(line, options)
        self._waiting: list[Block] = []

    def feed(self, chunks: Chunk | Block | Iterable[Chunk], now_ns: int | None = None) -> Batch:
        """Take captured bytes; give the rows that have become certain. `now_ns`: with a `tick` behind them."""
        if isinstance(chunks, Chunk):
            chunks = (chunks,)
        block = chunks if isinstance(chunks, Block) else Block.from_chunks(chunks)
        if self._deframer is None:
            self._waiting.append(block)
            block = Block.joined(self._waiting)
            if not self._choose(block.data[:_HEAD].tobytes()):
                return Batch.empty()
        assert self._deframer is not None
        return self._deframer.feed(block, now_ns)

    def tick(self, now_ns: int) -> Batch:
        """The line has been silent until `now_ns`; give what that makes certain."""
        return Batch.empty() if self._deframer is None else self._deframer.tick(now_ns)

    def close(self) -> Batch:
        """No more bytes come; give the rest."""
        if self._deframer is not None:
            return self._deframer.close()
        self._deframer = PROTOCOLS[-1].deframer(self._line, self._options)
        batches = [self._deframer.feed(Block.joined(self._waiting))] if self._waiting else []
        self._waiting = []
        return join_batches([*batches, self._deframer.close()])

    def _choose(self, head: bytes) -> bool:
        sure = [(after, i) for i, each in enumerate(PROTOCOLS) if (after := each.sure_after(head)) is not None]
        if not sure:
            return False
        self._deframer = PROTOCOLS[min(sure)[1]].deframer(self._line, self._options)
        self._waiting = []
        return True
