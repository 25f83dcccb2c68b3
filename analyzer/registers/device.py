"""What the rest of a device says: how many of its values are of which family."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from captures.ragged import Ints

from .counting import NONE, Codes
from .hypotheses import FAMILIES, FAMILY_OF, HYPOTHESES

Floats = NDArray[np.float64]
_SHARE_EDGES = np.array([0.01, 0.04, 0.1, 0.25, 0.5, 0.75, 0.92])
_ZERO_EDGES: Final = np.array([0.05, 0.15, 0.35, 0.6, 0.85])
DEVICE_ORDERS: Final = ("ABCD", "CDAB")
ZERO_CODES: Final = (len(_ZERO_EDGES) + 1) ** 2
_WAY_EDGES: Final = np.array([0.2, 0.45, 0.7, 0.9])
_GRADES: Final = len(_WAY_EDGES) + 2
WAY_CODES: Final = 2 * _GRADES**2
_SHY = 0.3  # values that a device is taken to have beside those that were found


def device_counts(posterior: Floats, moved: NDArray[np.bool_]) -> Floats:
    """Expected values of a run: by hypothesis, of all segments and (second row) of those of which a word moved."""
    return np.stack((posterior.sum(axis=0), (posterior * moved).sum(axis=0)))


def zero_counts(words: Ints, moved: NDArray[np.bool_]) -> Ints:
    """Of a run: registers that stand at zero, those before a moving one, those behind one; registers that moved."""
    zero = ~moved & (words == 0)
    before, behind = zero[:-1] & moved[1:], zero[1:] & moved[:-1]
    return np.array([zero.sum(), before.sum(), behind.sum(), moved.sum()])


def zero_codes(zeros: Ints, words: Ints, moved: NDArray[np.bool_], order: str) -> Ints:
    """Of each two registers, one that stands at zero and one that moves as the low word of this order: how many of the
    device's zeros stand so, and of how many of its moving registers. NONE elsewhere."""
    zero = ~moved & (words == 0)
    pair = zero[:-1] & moved[1:] if order == "ABCD" else zero[1:] & moved[:-1]
    so = zeros[1 if order == "ABCD" else 2] - 1
    of_zeros = int(np.digitize((so + 0.5) / max(zeros[0], 1), _ZERO_EDGES))
    of_moving = int(np.digitize((so + 0.5) / max(zeros[3], 1), _ZERO_EDGES))
    return np.where(pair, of_zeros * (len(_ZERO_EDGES) + 1) + of_moving, NONE)


def way_counts(words: Ints, moved: NDArray[np.bool_], counts_up: NDArray[np.bool_]) -> Ints:
    """Of a run (2, 2, 2), by word order: of registers that move to and fro, and of those that count up, how many have
    a zero where their high word would stand, and how many there are."""
    zero = ~moved & (words == 0)
    counts = np.zeros((2, 2, 2), np.int64)
    for way, mine in enumerate((moved & ~counts_up, moved & counts_up)):
        counts[:, way, 1] = mine.sum()
        counts[0, way, 0] = (zero[:-1] & mine[1:]).sum()
        counts[1, way, 0] = (zero[1:] & mine[:-1]).sum()
    return counts


def way_codes(counts: Ints, words: Ints, moved: NDArray[np.bool_], counts_up: NDArray[np.bool_], order: str) -> Ints:
    """Of each two registers, one that stands at zero and one that moves as the low word of this order: in which way it
    moves, how many of the device's others that move so stand beside a zero, and how many of those that do not. NONE
    elsewhere."""
    zero = ~moved & (words == 0)
    high, low = (slice(-1), slice(1, None)) if order == "ABCD" else (slice(1, None), slice(-1))
    pair = zero[high] & moved[low]
    mine = counts[DEVICE_ORDERS.index(order)]
    codes = [(way * _GRADES + _grade(*(mine[way] - 1))) * _GRADES + _grade(*mine[1 - way]) for way in range(2)]
    return np.where(pair, np.where(counts_up[low], codes[1], codes[0]), NONE)


def _grade(beside: int, count: int) -> int:
    """0 of none, then from hardly any to nearly all."""
    return 0 if count < 1 else 1 + int(np.digitize((beside + 0.5) / (count + 1), _WAY_EDGES))


def device_codes(
    counts: Floats,
    own: Floats,
    moved: NDArray[np.bool_],
    fits: NDArray[np.bool_],
    zeros: Sequence[Ints],
    by_way: Sequence[Ints],
) -> list[Codes]:
    """Codes of the second pass for a run (T, H): `counts` of the whole device, less what each segment itself gave;
    `zeros` and `by_way` of pairs in either order (`zero_codes`, `way_codes`).

    `own` (T, H) is the posterior of the first pass: a value must not vouch for itself.
    """
    moving = counts[1]
    found: list[Codes] = []
    families = np.array([counts[0][family == FAMILY_OF].sum() for family in range(len(FAMILIES))])
    families_moving = np.array([moving[family == FAMILY_OF].sum() for family in range(len(FAMILIES))])
    for number, hypothesis in enumerate(HYPOTHESES):
        if not fits[:, number].any():
            found.append({})
            continue
        mine = own[:, number]
        family = int(FAMILY_OF[number])
        share = (families[family] - mine + 0.02) / (families.sum() - mine + _SHY)
        mine_moving = mine * moved[:, number]
        share_moving = (families_moving[family] - mine_moving + 0.02) / (families_moving.sum() - mine_moving + _SHY)
        codes: dict[str, Ints] = {
            "device family": family * 8 + np.digitize(share, _SHARE_EDGES),
            "device family moved": family * 8 + np.digitize(share_moving, _SHARE_EDGES),
        }
        if hypothesis.family == "i32":
            codes["device zeros"] = padded(zeros[hypothesis.order == "CDAB"], len(own))
            codes["device zeros by way"] = padded(by_way[hypothesis.order == "CDAB"], len(own))
        found.append(codes)
    return found


def padded(codes: Ints, length: int) -> Ints:
    filled = np.full(length, NONE, np.int64)
    filled[: len(codes)] = codes
    return filled
