"""When it is bad: parts of the time that are disturbed, told from quiet ones by the most likely course of both."""

from __future__ import annotations

from collections.abc import Sequence
from math import log2
from typing import Any, Final

import numpy as np

from .bits import likelihood_bits

_SWITCH_BITS: Final = 9.0  # a change between quiet and disturbed, one of 256 parts
_ROUNDS: Final = 6
_RECURS: Final = 3  # times: two are one distance, which nothing confirms


def mean_period_s(begins_ns: Sequence[int]) -> float | None:
    """How often something comes again, by when it began each time; None where it came too few times to tell."""
    if len(begins_ns) < _RECURS:
        return None
    return round((begins_ns[-1] - begins_ns[0]) / (len(begins_ns) - 1) / 1e9, 3)


def spells_of(
    hits: np.ndarray[Any, np.dtype[np.int64]], trials: np.ndarray[Any, np.dtype[np.int64]]
) -> tuple[float, np.ndarray[Any, np.dtype[np.bool_]]]:
    """Parts of the time that are disturbed, by the most likely course of quiet and disturbed; and what it saves in bits.

    Two rates and a price for each change, refined in turns (hard EM).
    """
    trials = np.maximum(trials, hits)
    used = np.flatnonzero(trials > 0)
    inside = np.zeros(len(hits), np.bool_)
    h, n = hits[used].astype(float), trials[used].astype(float)
    if len(used) < 4 or not h.sum():
        return 0.0, inside
    rate = h.sum() / n.sum()
    quiet, loud = rate / 4, min(rate * 2.5, 0.9)
    one = likelihood_bits(float(h.sum()), float(n.sum()), rate)
    path, best = np.zeros(len(used), np.bool_), -np.inf
    for _ in range(_ROUNDS):
        path, best = _course(h, n, quiet, loud)
        if not path.any() or path.all():
            return 0.0, inside
        quiet = max((h[~path].sum() + 0.25) / (n[~path].sum() + 0.5), 1e-6)
        loud = (h[path].sum() + 0.25) / (n[path].sum() + 0.5)
    inside[used] = path
    return float(best - one - log2(max(n.sum(), 2))), inside


def _course(
    h: np.ndarray[Any, Any], n: np.ndarray[Any, Any], quiet: float, loud: float
) -> tuple[np.ndarray[Any, np.dtype[np.bool_]], float]:
    """Viterbi over two states."""
    gains = [h * log2(rate) + (n - h) * log2(1 - rate) for rate in (quiet, min(loud, 1 - 1e-6))]
    scores, back = [gains[0][0], gains[1][0] - _SWITCH_BITS], []
    for i in range(1, len(h)):
        came = [0 if scores[0] >= scores[1] - _SWITCH_BITS else 1, 1 if scores[1] >= scores[0] - _SWITCH_BITS else 0]
        scores = [
            gains[state][i] + scores[came[state]] - (_SWITCH_BITS if came[state] != state else 0.0) for state in (0, 1)
        ]
        back.append(came)
    state = int(scores[1] > scores[0])
    best = max(scores)
    path = [state]
    for came in reversed(back):
        state = came[state]
        path.append(state)
    return np.array(path[::-1], np.bool_), float(best)
