"""What the rest of a device says: how many of its values are of which family."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from captures.ragged import Ints

from .counting import Codes
from .hypotheses import FAMILIES, FAMILY_OF, HYPOTHESES

Floats = NDArray[np.float64]
_SHARE_EDGES = np.array([0.01, 0.04, 0.1, 0.25, 0.5, 0.75, 0.92])
_SHY = 0.3  # values that a device is taken to have beside those that were found


def device_counts(posterior: Floats, moved: NDArray[np.bool_]) -> Floats:
    """Expected values of a run: by hypothesis, of all segments and (second row) of those of which a word moved."""
    return np.stack((posterior.sum(axis=0), (posterior * moved).sum(axis=0)))


def device_codes(counts: Floats, own: Floats, moved: NDArray[np.bool_], fits: NDArray[np.bool_]) -> list[Codes]:
    """Codes of the second pass for a run (T, H): `counts` of the whole device, less what each segment itself gave.

    `own` (T, H) is the posterior of the first pass: a value must not vouch for itself.
    """
    moving = counts[1]
    found: list[Codes] = []
    families = np.array([counts[0][family == FAMILY_OF].sum() for family in range(len(FAMILIES))])
    families_moving = np.array([moving[family == FAMILY_OF].sum() for family in range(len(FAMILIES))])
    for number in range(len(HYPOTHESES)):
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
        found.append(codes)
    return found
