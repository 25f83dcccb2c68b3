"""How this package, which knows nothing of protocols, hears of check values: who knows a protocol passes a judge in.

Without one the writing alone decides.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache, partial
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
