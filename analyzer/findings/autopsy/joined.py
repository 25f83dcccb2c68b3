"""Where does the damaged frame begin and end? Damage moves its boundaries, and a deframer can't always follow.

A byte too many leaves the last one over as noise; a flipped byte count cuts a frame short or long. So the noise that
touches a damaged frame is tried as part of it: an explanation of more bytes is worth more, bytes left over cost a
little, being noise.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final, NamedTuple

from .case import Case
from .verdict import Verdict
from .whole import autopsy

_LEFT_OVER: Final = -3.0  # bits, for each stretch that stays noise


class Joined(NamedTuple):
    """A verdict on more than the bytes of the case: with so many of the noise before, and of the noise after them."""

    verdict: Verdict
    before: int
    after: int


def joined(case: Case, before: bytes = b"", after: bytes = b"") -> Joined:
    """The likeliest explanation of a damaged frame alone, or with the noise before it, after it, or both.

    Offsets in the verdict count from the first byte that it speaks of.
    """
    found = []
    for head in dict.fromkeys((b"", before)):
        for tail in dict.fromkeys((b"", after)):
            errors = tuple(at + len(head) for at in case.errors)
            verdict = autopsy(replace(case, data=head + case.data + tail, errors=errors))
            left = (head != before) + (tail != after)
            found.append((verdict.bits + left * _LEFT_OVER, -left, Joined(verdict, len(head), len(tail))))
    return max(found, key=lambda one: one[:2])[2]
