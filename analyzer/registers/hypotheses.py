"""What a run of registers may hold: the readings between which inference decides.

A hypothesis says how many registers one value takes, whether it is a float and which word comes first. Signs, bits,
states and texts are told afterwards, of the values that stand.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

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
