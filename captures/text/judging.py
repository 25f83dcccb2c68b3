"""How this package, which knows nothing of protocols, hears of check values: who knows a protocol passes a judge in.

Without one the writing alone decides.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Sequence
from functools import lru_cache, partial
from itertools import accumulate, groupby
from typing import Final, Protocol, cast

from ..checked import Checked

_REMEMBERED: Final = 1024  # stretches of bytes


class ByteJudge(Protocol):
    """Says which stretches of some bytes have right check values.

    `damaged`: also which bytes are, end to end, as long as their headers say, whatever the check values are.
    """

    def __call__(self, data: bytes, *, damaged: bool = False) -> Sequence[Checked]: ...


def no_judge(data: bytes, *, damaged: bool = False) -> Sequence[Checked]:  # noqa: ARG001 - as judges are called
    """For those who know no protocol."""
    return ()


def remembered(judge: ByteJudge) -> ByteJudge:
    """A judge who is asked once about the same bytes: a text is read again once it is known what it is like."""
    return cast(ByteJudge, lru_cache(maxsize=_REMEMBERED)(judge))


def unturned(judge: ByteJudge) -> ByteJudge:
    """A judge to whom a check value the wrong way round is none: numbers apart have the high byte first."""

    def strict(data: bytes, *, damaged: bool = False) -> Sequence[Checked]:
        spans = judge(data, damaged=True) if damaged else judge(data)  # a lenient judge stays one
        return [span for span in spans if not span.turned]

    return strict


def lenient(judge: ByteJudge) -> ByteJudge:
    """A judge of a text in which no check value is right."""
    return cast(ByteJudge, partial(judge, damaged=True))


# Frames over several parts: cells of a column, reads in pieces.

_REACH: Final = 520  # bytes that are looked at together
_LOOKED_AT: Final = 20  # bytes at whose beginnings a judge looks for a frame
_LEAST: Final = 4  # bytes that can hold a check value
FrameOver = tuple[Checked, int, int]  # with the first part that it is in, and the first behind it


def frames_over(parts: Sequence[bytes], judge: ByteJudge) -> Iterator[FrameOver]:
    """Frames that are parts [first, end) together; an empty part is in none."""
    at = 0
    for filled, group in groupby(parts, bool):
        stretch = list(group)
        for span, first, end in _frames_in(stretch, judge) if filled else ():
            yield span, at + first, at + end
        at += len(stretch)


def _frames_in(parts: Sequence[bytes], judge: ByteJudge) -> Iterator[FrameOver]:
    """The same of parts none of which is empty."""
    data, edges = b"".join(parts), [*accumulate(map(len, parts), initial=0)]
    at = 0
    while len(data) - edges[at] >= _LEAST:
        begin, last = edges[at], max(bisect_right(edges, edges[at] + _REACH) - 1, at + 1)
        right = begin
        for span in judge(data[begin : min(edges[last], begin + _REACH)]):
            first, end = (bisect_left(edges, begin + place) for place in (span.start, span.end))
            if (edges[first], edges[end]) == (begin + span.start, begin + span.end):
                yield span, first, end
                right = edges[end]
        next_ = bisect_left(edges, right if right > begin else begin + _LOOKED_AT)
        at = max(at + 1, min(next_, last))
