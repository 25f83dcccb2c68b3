"""A stretch of noise that is several frames in a row, all robbed of their 11 and 13 bytes by the port's flow control.

A unit 17 or 19 never shows its address then, so that a deframer recognises none of its frames, and without silences to
go by they run together. From the left, each frame is looked for at the few lengths that its header can tell, with and
without a byte put back into it; a request that was mended tells what its answer is. All of the stretch must come out.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Final, NamedTuple

from dissectors.lengths import Role

from .case import MIN_ADU, Case
from .flow_control import XON_XOFF, swallowed
from .lengths import told
from .verdict import FRAME, Verdict

_HEADER: Final = 7  # bytes that lengths hang on
_LOST: Final = 3


class Part(NamedTuple):
    """One of the frames: where it begins in the stretch, how many bytes of it there are, what happened to it.

    `start` is negative where the stretch is but the rest of a frame that began in the row before.
    """

    start: int
    length: int
    verdict: Verdict


def divided(case: Case) -> list[Part]:
    """The frames of a stretch, if flow control explains all of it as two or more; else nothing."""
    parts: list[Part] = []
    at, pending = 0, case.request
    while at < len(case.data):
        rest = replace(case, data=case.data[at:], role=None, request=pending, errors=())
        found = [
            Part(at, length, verdict)
            for length in _lengths(rest)
            for verdict in swallowed(replace(rest, data=rest.data[:length]))
            if verdict.repaired is not None and verdict.bits >= FRAME
        ]
        if not found:
            return []
        best = max(found, key=lambda part: part.verdict.bits)
        parts.append(best)
        at += best.length
        repaired = best.verdict.repaired or b""
        asked = told(repaired, Role.REQUEST)
        answers = rest.expected is not None and rest.expected.fits(repaired)
        pending = repaired if not answers and asked is not None and asked.length == len(repaired) else None
    return parts if len(parts) > 1 else []


def _lengths(case: Case) -> list[int]:
    """How many bytes the first frame may have left, the shortest first."""
    lengths = set()
    if case.due is not None:
        lengths.add(case.due)
    for header in _headers(case.data[:_HEADER]):
        for role in Role:
            length = told(header, role)
            if length is not None and not length.least:
                lengths.add(length.length)
    left = {length - lost for length in lengths for lost in range(1, _LOST + 1)}
    return sorted(length for length in left if MIN_ADU - 1 <= length <= len(case.data))


def _headers(data: bytes) -> Iterator[bytes]:
    """A header as it stands, and with a byte put back at each place before its end."""
    yield data
    for at in range(len(data)):
        for value in XON_XOFF:
            yield data[:at] + bytes((value,)) + data[at:]
