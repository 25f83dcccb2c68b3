"""What a run of registers may hold: the readings between which inference decides, and how likely each way to cut it is.

A hypothesis says how many registers one value takes, whether it is a float and which word comes first. Signs, bits,
states and texts are told afterwards, of the values that stand.

A way to cut a run into values is a chain of segments that tile it; its score is the sum of the log odds of each
segment and of each neighbourhood of two. The posterior of a segment is its share in the sum over all ways, which is
what confidence means. Worked out forward and backward, on many runs at once, of different lengths.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from captures.ragged import Ints
from dissectors.values import Order


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """`words` registers as an integer or a float; `order` None for one register."""

    words: int
    is_float: bool = False
    order: Order | None = None

    @property
    def family(self) -> str:
        """`i16`, `i32`, `f32`, `i64` or `f64`."""
        return f"{'f' if self.is_float else 'i'}{16 * self.words}"


FAMILIES: Final = ("i16", "i32", "f32", "i64", "f64")
HYPOTHESES: Final = (
    Hypothesis(1),
    Hypothesis(2, order="ABCD"),
    Hypothesis(2, order="CDAB"),
    Hypothesis(2, is_float=True, order="ABCD"),
    Hypothesis(2, is_float=True, order="CDAB"),
    Hypothesis(4, order="ABCD"),
    Hypothesis(4, order="CDAB"),
    Hypothesis(4, is_float=True, order="ABCD"),
    Hypothesis(4, is_float=True, order="CDAB"),
)
WORDS: Final = np.array([hypothesis.words for hypothesis in HYPOTHESES])
FAMILY_OF: Final = np.array([FAMILIES.index(hypothesis.family) for hypothesis in HYPOTHESES])
LONGEST: Final = int(WORDS.max())


def patterns(words: NDArray[np.uint16], order: Order) -> NDArray[np.uint64]:
    """Each row's registers as one unsigned number; `words` has the registers in its last axis, 1, 2 or 4 of them."""
    if order in ("BADC", "DCBA"):
        words = words.byteswap()
    if order in ("CDAB", "DCBA"):
        words = words[..., ::-1]
    total = np.zeros(words.shape[:-1], np.uint64)
    for column in range(words.shape[-1]):
        total <<= np.uint64(16)
        total |= words[..., column]
    return total


def numbers(words: NDArray[np.uint16], order: Order, *, is_float: bool, signed: bool = False) -> NDArray[np.float64]:
    """Each row's registers as the value that they are; `words` has the registers in its last axis."""
    width = words.shape[-1]
    total = patterns(words, order)
    if is_float:
        with np.errstate(invalid="ignore"):  # a signalling NaN becomes a quiet one
            return total.astype(np.uint32).view(np.float32).astype(np.float64) if width == 2 else total.view(np.float64)
    if not signed:
        return total.astype(np.float64)
    return total.astype(f"u{2 * width}").view(f"i{2 * width}").astype(np.float64)


def moved_registers(moved: NDArray[np.bool_]) -> NDArray[np.float64]:
    """How many registers of each segment of a run moved (T, H)."""
    sums = np.concatenate(([0], np.cumsum(moved)))
    counts = np.zeros((len(moved), len(HYPOTHESES)))
    for number, hypothesis in enumerate(HYPOTHESES):
        reach = len(moved) - hypothesis.words + 1
        if reach > 0:
            counts[:reach, number] = sums[hypothesis.words :] - sums[:reach]
    return counts


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
