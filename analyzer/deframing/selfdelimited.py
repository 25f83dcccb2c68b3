"""What ports have in common whose protocol says itself where its frames end: bytes in, segments out."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import NDArray

from captures.chunks import Block
from dissectors.length_rules import Role

from ..options import Options
from ..tables.schema import Protocol
from .buffer import ByteBuffer, CharacterTime
from .rules import Bytes, Index, Mask
from .segments import StreamSegments, whole_segments


class SelfDelimitedEngine(ABC):
    """The same contract as `engine.Engine`. `role`: the only one that frames of this port have, where that is known."""

    buffer: ByteBuffer
    _options: Options
    _role: Role | None
    _out: list[StreamSegments]

    def __init__(self, character: CharacterTime, options: Options, role: Role | None) -> None:
        self.buffer = ByteBuffer(character)
        self._options = options
        self._role = role
        self._out = []

    def feed(self, block: Block, now_ns: int | None = None) -> None:
        """Chunks of one port; see `engine.Engine.feed`."""
        self.buffer.append(block)
        self.buffer.close(over=False)
        if now_ns is None:
            self._work()
        else:
            self.tick(now_ns)

    def tick(self, now_ns: int) -> None:
        """The line has been silent until `now_ns`."""
        silence = now_ns - self.buffer.last_time
        if silence > 0:
            self.buffer.close(over=True)
        self._work(silence_ns=silence)

    def close(self) -> None:
        """No more bytes come."""
        self.buffer.close(over=True)
        self._work(last=True)

    def take_segments(self) -> list[StreamSegments]:
        """What was decided since the last call."""
        out, self._out = self._out, []
        return out

    @property
    def undecided_ns(self) -> int | None:
        """The time of the first byte that is not decided, or None."""
        return int(self.buffer.time[0]) if len(self.buffer) else None

    @abstractmethod
    def _work(self, *, last: bool = False, silence_ns: int = 0) -> None:
        """Decide what is certain of the bytes that are ready, and `_give` it. `silence_ns`: nothing has come since."""

    def _give(
        self,
        protocol: Protocol,
        start: Index,
        end: Index,
        roles: NDArray[np.uint8],
        check: Mask,
        heads: Bytes,
        done: int,
    ) -> None:
        """Segments that cover the first `done` bytes, which are decided; `heads` as in StreamSegments."""
        buffer = self.buffer
        decided = whole_segments(start, end, roles, check, explain=self._options.explain)
        reads = buffer.reads(start, end)
        self._out.append(StreamSegments(buffer.base, buffer.data[:done].copy(), decided, reads, protocol, heads))
        buffer.drop(done)
