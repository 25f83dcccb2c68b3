"""How likely each way to cut a run of registers into values is: sums over all ways, forward and backward.

A way is a chain of segments that tile the run; its score is the sum of the log odds of each segment and of each
neighbourhood of two. The posterior of a segment is its share in the sum over all ways, which is what confidence means.
Works on many runs at once, of different lengths.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from captures.ragged import Ints

from .hypotheses import HYPOTHESES, LONGEST, WORDS

Floats = NDArray[np.float64]
IMPOSSIBLE: Final = -1e9


@dataclass(frozen=True, slots=True, eq=False)
class ChainSums:
    """Of B runs of at most T registers: `posterior` (B, T, H) of a segment that begins at a register under each
    hypothesis; `log_total` (B) of all ways; `neighbours` (B, H, H) expected pairs of segments, where asked for."""

    posterior: Floats
    log_total: Floats
    neighbours: Floats


def chain_sums(scores: Floats, lengths: Ints, transitions: Floats, begin: Floats, end: Floats) -> ChainSums:
    """`scores` (B, T, H) of segments, IMPOSSIBLE where none fits; `transitions` (H, H), `begin` and `end` (H)."""
    runs, longest, count = scores.shape
    odds = np.exp(transitions)
    ahead = np.full((longest + LONGEST + 1, runs, count), IMPOSSIBLE)
    before = np.full((longest + 1, runs, count), IMPOSSIBLE)  # of a segment that begins here, all that came before
    before[0] = begin
    for at in range(longest):
        for number in range(count):
            width = int(WORDS[number])
            ahead[at + width, :, number] = before[at, :, number] + scores[:, at, number]
        before[at + 1] = _log_product(ahead[at + 1], odds)
    finals = ahead[lengths, np.arange(runs)] + end
    log_total = _log_sum(finals)
    behind = np.full((longest + LONGEST + 1, runs, count), IMPOSSIBLE)
    posterior = np.zeros((runs, longest, count))
    neighbours = np.zeros((runs, count, count))
    for at in range(longest, -1, -1):
        if at < longest:
            onward = np.stack([scores[:, at, n] + behind[at + int(WORDS[n]), :, n] for n in range(count)], axis=-1)
            inside = at < lengths
            share = np.exp(np.minimum(before[at] + onward - log_total[:, None], 0))
            posterior[:, at] = np.where(inside[:, None], share, 0)
            behind[at] = _log_product(onward, odds.T)
            if at:
                top = ahead[at].max(axis=1, keepdims=True)
                left = np.exp(ahead[at] - top)
                right = np.where(inside[:, None], np.exp(np.minimum(onward + top - log_total[:, None], 50)), 0)
                neighbours += left[:, :, None] * right[:, None, :] * odds
        behind[at] = np.where((lengths == at)[:, None], end, behind[at])
    return ChainSums(posterior, log_total, neighbours)


def best_cut(gains: Floats) -> list[tuple[int, int]]:
    """Segments (register, hypothesis) that tile one run with the greatest sum of `gains` (T, H); -inf never stands."""
    longest = len(gains)
    best = np.full(longest + 1, -np.inf)
    best[0] = 0.0
    chosen = [0] * (longest + 1)
    for at in range(longest):
        for number, hypothesis in enumerate(HYPOTHESES):
            until = at + hypothesis.words
            if until <= longest and best[at] + gains[at, number] > best[until]:
                best[until] = best[at] + gains[at, number]
                chosen[until] = number
    cut = []
    until = longest
    while until:
        number = chosen[until]
        until -= HYPOTHESES[number].words
        cut.append((until, number))
    return cut[::-1]


def _log_sum(values: Floats) -> Floats:
    top = values.max(axis=-1)
    log_sums: Floats = top + np.log(np.exp(values - top[..., None]).sum(axis=-1))
    return log_sums


def _log_product(values: Floats, odds: Floats) -> Floats:
    """The logarithm of exp(values) @ odds."""
    top = values.max(axis=-1, keepdims=True)
    log_products: Floats = top + np.log(np.exp(values - top) @ odds + 1e-300)
    return log_products
