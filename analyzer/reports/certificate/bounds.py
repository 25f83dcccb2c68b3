"""Confidence bounds of a share and of a quantile, and how many trials they need.

A share: by the tails of the binomial distribution, of which what was seen itself counts half (mid-P: Lancaster 1961,
Berry and Armitage 1995). A quantile: order statistics by the same tails, which suppose nothing of how the values are
distributed. Both hold so often as they say on the average over lines, where Clopper and Pearson's, of which what was
seen counts whole, hold in 98 of a hundred instead of 95 as long as few trials hit. Trials are supposed to be
independent.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

_TINY: Final = 1e-300
_CLOSE: Final = 1e-14
_MOST_TERMS: Final = 200_000
_HALVINGS: Final = 60


def beta_share(x: float, a: float, b: float) -> float:
    """The regularized incomplete beta function I_x(a, b) for positive a and b, 0 <= x <= 1.

    By its continued fraction (DLMF 8.17.22), evaluated after Lentz.
    """
    if x <= 0 or x >= 1:
        return float(x >= 1)
    if x > (a + 1) / (a + b + 2):
        return 1 - beta_share(1 - x, b, a)
    front = math.lgamma(a + b) - math.lgamma(a) - math.lgamma(b) + a * math.log(x) + b * math.log1p(-x)
    c, d = 1.0, 1 / _held(1 - (a + b) * x / (a + 1))
    product = d
    for m in range(1, _MOST_TERMS):
        even = m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m))
        odd = -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1))
        for term in (even, odd):
            d, c = 1 / _held(1 + term * d), _held(1 + term / c)
            product *= c * d
        if abs(c * d - 1) < _CLOSE:
            break
    return min(math.exp(front) * product / a, 1.0)


def _held(number: float) -> float:
    """A number that may be divided by."""
    return number if abs(number) > _TINY else _TINY


def at_most(hits: int, of: int, share: float) -> float:
    """The chance of so many hits or fewer in `of` trials, each of which hits with the chance `share`."""
    if hits < 0:
        return 0.0
    return 1.0 if hits >= of else beta_share(1 - share, of - hits, hits + 1)


def below(hits: int, of: int, share: float) -> float:
    """The same of fewer hits, and of so many by half."""
    return (at_most(hits - 1, of, share) + at_most(hits, of, share)) / 2


def share_bounds(hits: int, of: int, confidence: float) -> tuple[float, float]:
    """Between what the true share lies, each end by half of what `confidence` leaves; (0, 1) without trials."""
    if of <= 0:
        return 0.0, 1.0
    tail = (1 - confidence) / 2
    if hits == 0:
        return 0.0, -math.expm1(math.log(2 * tail) / of)
    if hits == of:
        return math.exp(math.log(2 * tail) / of), 1.0
    low = _crossing(lambda share: 1 - below(hits, of, share) < tail, 0.0, hits / of)
    return low, _crossing(lambda share: below(hits, of, share) > tail, hits / of, 1.0)


def _crossing(before: Callable[[float], bool], low: float, high: float) -> float:
    """Where `before`, which holds up to some point, ends to hold."""
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        low, high = (middle, high) if before(middle) else (low, middle)
    return (low + high) / 2


def trials_for_share(limit: float, confidence: float) -> int:
    """The fewest trials of which none hits that bound the share by `limit` (0 < limit < 1)."""
    return math.ceil(math.log(1 - confidence) / math.log1p(-limit))


def trials_for_quantile(quantile: float, confidence: float) -> int:
    """The fewest values of which the greatest bounds a quantile from above (0 < quantile < 1)."""
    return math.ceil(math.log(1 - confidence) / math.log(quantile))


def quantile_ranks(count: int, quantile: float, confidence: float) -> tuple[int | None, int | None]:
    """The ranks, from 1, of the values between which a quantile lies; None where no value bounds it on that side."""
    tail = (1 - confidence) / 2
    low = _first(lambda rank: below(rank, count, quantile) > tail, count)
    high = _first(lambda rank: below(rank, count, quantile) >= 1 - tail, count + 1)
    return low or None, high if high <= count else None


def _first(holds: Callable[[int], bool], last: int) -> int:
    """The first whole number from 0 on from which on `holds`; `last` where it does not before."""
    least = 0
    while least < last:
        middle = (least + last) // 2
        least, last = (least, middle) if holds(middle) else (middle + 1, last)
    return least
