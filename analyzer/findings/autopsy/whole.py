"""All explanations tried against each other: the likeliest is the verdict.

Each says how likely it makes the captured bytes, as log2 of a probability over bytes that nothing predicts: the price
of the damage (how often it happens, in how many ways it could have), and what is gained by the frame that it takes to
have been sent (`sent.likelihood`) with its two bytes of CRC, which then are no accident. "Nothing simple explains it"
(crc-error) is one of them and must be beaten. A new explanation is a file and an entry in `_EXPLANATIONS`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from math import inf
from typing import Final

from .case import Case
from .collision import collided
from .extra import extra
from .flips import flipped
from .flow_control import swallowed
from .missing import missing
from .repeated import repeated
from .truncated import truncated
from .unexplained import unexplained
from .variants import other_conventions
from .verdict import Verdict

_EXPLANATIONS: Final[tuple[Callable[[Case], Iterator[Verdict]], ...]] = (
    unexplained,
    flipped,
    missing,
    extra,
    repeated,
    swallowed,
    truncated,
    other_conventions,
    collided,
)
_NEAR: Final = 10.0  # bits below the verdict: further ones are not worth telling


def autopsy(case: Case) -> Verdict:
    """The likeliest explanation, with its `certainty` and the `rivals` that come near, the nearest first.

    For bytes whose CRC is wrong; what is right needs no autopsy and comes out as crc-error with certainty 0.
    """
    if not case.data or not case.before[-1]:
        return Verdict("crc-error", -inf)
    found = [verdict for explain in _EXPLANATIONS for verdict in explain(case) if verdict.bits > -inf]
    found.sort(key=lambda verdict: -verdict.bits)
    best = found[0]
    weights = [2.0 ** (verdict.bits - best.bits) for verdict in found]
    total = sum(weights)
    told = [replace(verdict, certainty=weight / total) for verdict, weight in zip(found, weights, strict=True)]
    return replace(told[0], rivals=tuple(verdict for verdict in told[1:] if verdict.bits >= best.bits - _NEAR))
