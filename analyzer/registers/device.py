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
ZERO_CODES: Final = (len(_ZERO_EDGES) + 1) ** 2
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


def device_codes(
    counts: Floats, own: Floats, moved: NDArray[np.bool_], fits: NDArray[np.bool_], zeros: Sequence[Ints]
) -> list[Codes]:
    """Codes of the second pass for a run (T, H): `counts` of the whole device, less what each segment itself gave;
    `zeros` of pairs in either order (`zero_codes`).

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
        found.append(codes)
    return found


def padded(codes: Ints, length: int) -> Ints:
    filled = np.full(length, NONE, np.int64)
    filled[: len(codes)] = codes
    return filled
