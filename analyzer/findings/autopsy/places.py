"""Several places that explain the same bytes: one verdict, all of them said, the likeliest first."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import log2

from .verdict import Place, Verdict

_EQUAL = 6.0  # bits below the likeliest, within which a place is still named


def gathered(code: str, fits: Sequence[tuple[float, Place, bytes]]) -> Iterator[Verdict]:
    """The verdict over all places that fit, as (bits, place, repaired frame); none where nothing fits."""
    if not fits:
        return
    ranked = sorted(fits, key=lambda fit: -fit[0])
    best, _, frame = ranked[0]
    near = [fit for fit in ranked if fit[0] >= best - _EQUAL]
    bits = best + log2(sum(2.0 ** (fit[0] - best) for fit in near))
    yield Verdict(code, bits, repaired=frame, places=tuple(place for _, place, _ in near))
