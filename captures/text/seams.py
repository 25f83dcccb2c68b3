"""Frames over several parts: cells of a column, reads in pieces."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Sequence
from itertools import accumulate, takewhile
from typing import Final

from ..checked import Checked
from .judging import ByteJudge

_REACH: Final = 520  # bytes that are looked at together
_LOOKED_AT: Final = 20  # bytes at whose beginnings a judge looks for a frame


def frames_over(parts: Sequence[bytes], judge: ByteJudge) -> Iterator[tuple[Checked, int, int]]:
    """Frames that are parts [first, end) together, with their first and end; an empty part is in none."""
    at = 0
    while at < len(parts):
        starts = [0, *accumulate(map(len, takewhile(len, parts[at : at + _REACH])))]
        starts = starts[: bisect_right(starts, _REACH)]
        spans = judge(b"".join(parts[at : at + len(starts) - 1]))
        right = [span for span in spans if {span.start, span.end} <= {*starts}]
        for span in right:
            yield span, at + starts.index(span.start), at + starts.index(span.end)
        at += max(1, min(bisect_left(starts, right[-1].end if right else _LOOKED_AT), len(starts) - 1))
