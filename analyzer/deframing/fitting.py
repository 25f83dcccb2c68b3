"""Whether the protocol that was chosen for a port fits: where nothing was a frame for long, the choice is made again.

Few frames make a choice young: then what fits nothing is held back until something does, or another protocol is found
in it, or it is long or a silence of seconds parts it. Where the next engine is to begin hangs on bytes and times alone.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from typing import Final, NamedTuple

import numpy as np

from captures.chunks import Block

from .segments import NOISE, StreamSegments, cut_segments
from .weighing import PortWeights

_MISFIT: Final = 256  # bytes without a frame, after which the choice is looked at again,
_DOUBLINGS: Final = 12  # then after twice as many, and so on
_LOOKED_AT: Final = 2048  # the last of them
_YOUNG: Final = 8  # frames that have fitted, up to which what does not fit is held back


class OtherProtocol(NamedTuple):
    """From this byte of the engine's stream on the port speaks another protocol."""

    at: int
    protocol: str


class Fit:
    """What a port's engine decided, watched. Bytes are counted from the first that the engine was given."""

    _protocol: str
    _serial: bool
    _cut_ns: int
    _blocks: list[tuple[int, Block]]
    _heard: int
    _framed: int
    _frames: int
    _looked: int
    _since: int
    _held: list[StreamSegments]

    def __init__(self, protocol: str, cut_ns: int, heard: int = 0, *, serial: bool) -> None:
        """`heard`: bytes that the engine was given before it was chosen; `serial` as of `PortWeights`."""
        self._protocol, self._serial, self._cut_ns = protocol, serial, cut_ns
        self._blocks = []  # what was heard from the last frame on, by its first byte
        self._heard = self._framed = heard  # bytes so far, and the end of the last frame,
        self._frames = 0  # and how many there were
        self._looked = 0  # times that the choice was looked at again,
        self._since = 0  # of which so many since the last frame
        self._held = []

    @property
    def held_ns(self) -> int | None:
        """When the first byte was heard that is held back; None where none is."""
        return int(self._held[0].reads.heard[0]) if self._held else None

    def heard(self, block: Block) -> None:
        """Bytes that the engine is given."""
        self._blocks.append((self._heard, block))
        self._heard += len(block.data)

    def judged(
        self, parts: Sequence[StreamSegments], tried: Collection[str] = ()
    ) -> tuple[list[StreamSegments], OtherProtocol | None]:
        """What may be given away of what the engine decided, up to where another protocol begins, if one does.

        `tried`: those that did not fit from the engine's first byte on.
        """
        given: list[StreamSegments] = []
        for part in parts:
            if (other := self._other_in(part, tried)) is not None:
                self._held.append(part)
                given += _divided(self._held, other.at)[0]
                return given, other
            given += self._let_go(part)
        return given, None

    def quiet(self, now_ns: int) -> list[StreamSegments]:
        """What was held back, where it was silent for so long up to now that it is given all the same."""
        silent = self._blocks and now_ns - int(self._blocks[-1][1].t_ns[-1]) >= self._cut_ns
        return self.rest() if silent else []

    def rest(self) -> list[StreamSegments]:
        """What is held back."""
        held, self._held = self._held, []
        return held

    def blocks_from(self, at: int) -> Iterator[Block]:
        """What was heard from this byte on."""
        for begin, block in self._blocks:
            if begin + len(block.data) > at:
                yield block if begin >= at else _from(block, at - begin)

    def _other_in(self, part: StreamSegments, tried: Collection[str]) -> OtherProtocol | None:
        """Look at each stretch without a frame that is long enough, in order; remember where the last frame ends."""
        start, end, role, check, *_ = part.decided
        right = ((role != NOISE) & check).nonzero()[0]
        begins = [*(start[right] + part.offset), part.offset + len(part.data)]
        ends = end[right] + part.offset
        bounds = np.append(self._framed, ends)
        for i in (np.array(begins) - bounds >= self._limit).nonzero()[0].tolist():
            if i:
                self._since = 0
            young = self._frames + i < _YOUNG
            while begins[i] - bounds[i] >= self._limit and self._looked < _DOUBLINGS:
                window = int(bounds[i]), int(bounds[i]) + self._limit
                found = self._looked_at(*window)
                held = young and not self._since and not self._parted(*window)
                self._looked, self._since = self._looked + 1, self._since + 1
                if found and not (held and found in tried and window[0] == 0):
                    return OtherProtocol(window[0] if held else _segment_end(part, window[1]), found)
        if len(right):
            self._frames, self._framed, self._since = self._frames + len(right), int(ends[-1]), 0
            self._blocks = [(at, block) for at, block in self._blocks if at + len(block.data) > self._framed]
        return None

    @property
    def _limit(self) -> int:
        return _MISFIT << self._looked

    def _looked_at(self, first: int, last: int) -> str:
        """The other protocol that these bytes prove; nothing for none."""
        weights = PortWeights(serial=self._serial)
        octets = b"".join(block.data.tobytes() for block in self.blocks_from(max(first, last - _LOOKED_AT)))
        weights.feed(octets[: min(last - first, _LOOKED_AT)])
        proven = weights.proven
        return proven if proven not in (None, self._protocol) else ""

    def _parted(self, first: int, last: int) -> bool:
        """Whether a silence stands in these bytes behind which what stood before was given away."""
        times, left = [], last - first
        for block in self.blocks_from(first):
            times.append(block.t_ns[: int(block.offsets[:-1].searchsorted(left))])
            left = max(left - len(block.data), 0)
        return bool((np.diff(np.concatenate(times)) >= self._cut_ns).any())

    def _let_go(self, part: StreamSegments) -> list[StreamSegments]:
        """This part, and what was held before it, as far as it need not be held back."""
        held, self._held = [*self._held, part], []
        if self._frames >= _YOUNG or self._since:
            return held
        given, self._held = _divided(held, self._framed)
        return given


def _divided(parts: Sequence[StreamSegments], at: int) -> tuple[list[StreamSegments], list[StreamSegments]]:
    """The segments that end at this byte or before, and those behind it."""
    before: list[StreamSegments] = []
    behind: list[StreamSegments] = []
    for part in parts:
        count = int((part.decided.end + part.offset).searchsorted(at, side="right"))
        if 0 < count < len(part.decided.end):
            first, part = cut_segments(part, count)
            before.append(first)
        (before if count and part.offset < at else behind).append(part)
    return before, behind


def _segment_end(part: StreamSegments, at: int) -> int:
    """Where the segment of a part ends that holds the byte before this one."""
    ends = part.decided.end + part.offset
    return int(ends[min(int(ends.searchsorted(at)), len(ends) - 1)])


def _from(block: Block, at: int) -> Block:
    """The bytes of a block from this one on; the chunk that holds it begins there."""
    first = int(block.offsets.searchsorted(at, side="right")) - 1
    rest = block.slice(first, len(block))
    cut = at - int(block.offsets[first])
    offsets = np.maximum(rest.offsets - cut, 0)
    errors = rest.errors[rest.errors >= cut] - cut
    return Block(rest.data[cut:], offsets, rest.t_ns, rest.port, rest.mark, errors, timed=rest.timed)
