"""Sister units: those of one bus that are read with the same requests and answer alike have one layout, and what the
registers of one say of it counts for all. Where a high word stands still in each but is not the same in all, it is no
spare register.

Who asks the same of two units need not have two of a kind before him: they are sisters only where their words agree far
more often than those of two devices would by chance, and only so far: where the words of a stretch differ, each unit
speaks for itself there.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from captures.ragged import Ints
from dissectors.maps.model import MapArea

from .hypotheses import LONGEST
from .looks import WORD_CLASSES, word_classes
from .readings import BlockReadings

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]
_SAME: Final = 0.6  # of the registers of two sisters hold words of one class, though they measure different things
_ENOUGH: Final = 12.0  # bits for one layout
_LIKELY: Final = 5.0  # where a third unit is a sister of both
_AROUND: Final = 4  # registers to either side in which words must not speak against it
_AGAINST: Final = -1.0  # bits
_CONTRARY: Final = (
    6.0  # log odds of one reading against another, further apart than what one layout makes of two series
)
_NEVER: Final = -1e8
_SIZES: Final = 2 ** np.arange(1, 16)
_APART: Final = 0x2000
_MOST: Final = 8  # sisters of a unit, those most alike
_UNITS: Final = 256
PAIR_CODES: Final = 12


class RunOfUnit(Protocol):
    """What is asked of a run here."""

    unit: int
    area: MapArea
    address: int
    blocks: list[BlockReadings]
    moved: Mask
    words: Ints


def asked_alike(blocks: Iterable[BlockReadings], units: Iterable[int]) -> set[int]:
    """These units, and those that are read with the same requests as one of them."""
    asked: dict[int, set[tuple[str, int, int]]] = {}
    for block in blocks:
        if not block.written:
            asked.setdefault(block.unit, set()).add((block.area, block.address, block.quantity))
    wanted = {frozenset(asked.get(unit, ())) for unit in units}
    return {*units, *(unit for unit, requests in asked.items() if requests in wanted)}


def sister_runs(runs: Sequence[RunOfUnit]) -> list[list[tuple[int, Mask]]]:
    """Of each run those of its unit's sisters that cover the same registers, by number, and in which registers their
    words do not speak against it."""
    groups: dict[tuple[object, ...], list[int]] = {}
    for number, run in enumerate(runs):
        asked = sorted((block.address, block.quantity) for block in run.blocks if not block.written)
        groups.setdefault((run.area, run.address, len(run.moved), *asked), []).append(number)
    shared = [members for members in groups.values() if len({runs[number].unit for number in members}) > 1]
    total = np.zeros((_UNITS, _UNITS))
    bits: list[Floats] = []
    for members in shared:
        bits.append(_agreement(np.stack([_symbols(runs[number]) for number in members])))
        units = np.array([runs[number].unit for number in members])
        np.add.at(total, (units[:, None], units), bits[-1].sum(axis=2))
    alike = _sister_pairs(total)
    found: list[list[tuple[int, Mask]]] = [[] for _ in runs]
    for members, mine in zip(shared, bits, strict=True):
        units = np.array([runs[number].unit for number in members])
        for one, left in enumerate(members):
            sisters = np.flatnonzero(alike[units[one], units] & (units != units[one]))
            likest = sisters[np.argsort(-total[units[one], units[sisters]], kind="stable")][:_MOST]
            found[left] = [(members[other], _around(mine[one, other]) > _AGAINST) for other in sorted(likest.tolist())]
    return found


def _sister_pairs(total: Floats) -> Mask:
    """Which units are sisters (256, 256): those alike beyond doubt, and those likely alike that have such a sister in
    common."""
    sure = total >= _ENOUGH
    common = (sure.astype(np.float32) @ sure.astype(np.float32)) > 0
    alike: Mask = sure | (common & (total >= _LIKELY))
    return alike


def pair_codes(run: RunOfUnit, sisters: Sequence[RunOfUnit], *, reverse: bool) -> Ints:
    """Of each two registers, what sisters hold in them: high words that are all zero (0), all the same (1), zero and
    FFFF (2), different small (3), middling (4) or large ones (5); and 6 more where the low words lie far apart."""
    words = np.stack([one.words for one in (run, *sisters)])
    high, low = (words[:, 1:], words[:, :-1]) if reverse else (words[:, :-1], words[:, 1:])
    least, most = high.min(axis=0), high.max(axis=0)
    kinds = np.digitize(most, (128, 0x4000)) + 3
    kinds = np.where(((high == 0) | (high == 0xFFFF)).all(axis=0), 2, kinds)
    kinds = np.where(least == most, np.where(most == 0, 0, 1), kinds)
    codes: Ints = kinds + 6 * (np.ptp(low, axis=0) > _APART)
    return codes


def pooled(scores: Sequence[Floats], sisters: Sequence[Sequence[tuple[int, Mask]]]) -> list[Floats]:
    """The log odds of segments (T, H) of each run, as it and its sisters have them on the average."""
    together = []
    for mine, kin in zip(scores, sisters, strict=True):
        total, count = mine.copy(), np.ones(len(mine))
        for number, alike in kin:
            agreed = alike & ~_contrary(mine, scores[number])
            total[agreed] += scores[number][agreed]
            count += agreed
        together.append(total / count[:, None] if kin else mine)
    return together


def _contrary(mine: Floats, other: Floats) -> Mask:
    """Where two units' own series speak so differently that they cannot be of one value."""
    both = (mine > _NEVER) & (other > _NEVER)
    apart = np.where(both, np.abs((mine - mine[:, :1]) - (other - other[:, :1])), 0.0).max(axis=1) > _CONTRARY
    near = np.convolve(apart, np.ones(2 * LONGEST - 1), mode="same")[: len(mine)] > 0
    contrary: Mask = near if len(mine) >= 2 * LONGEST - 1 else np.full(len(mine), bool(apart.any()))
    return contrary


def _symbols(run: RunOfUnit) -> Ints:
    """What each register looks like: the class of a word that stands still, the size of one that moves."""
    size = np.minimum(run.words, 0x10000 - run.words)  # of a signed number
    sizes = WORD_CLASSES + np.digitize(size, _SIZES)
    symbols: Ints = np.where(run.moved, sizes, word_classes(run.words.astype(np.uint16)))
    return symbols


def _agreement(symbols: Ints) -> Floats:
    """Bits for one layout (K, K, T) of each two units, register by register; `symbols` (K, T)."""
    seen = np.bincount(symbols.ravel(), minlength=WORD_CLASSES + len(_SIZES) + 1) + 0.5
    share = seen / seen.sum()
    same = np.log2((_SAME + (1 - _SAME) * share) / share)
    bits: Floats = np.where(symbols[:, None] == symbols[None], same[symbols][:, None], np.log2(1 - _SAME))
    return bits


def _around(bits: Floats) -> Floats:
    """The sum of what stands near each register."""
    sums = np.concatenate(([0.0], np.cumsum(bits)))
    at = np.arange(len(bits))
    near: Floats = sums[np.minimum(at + _AROUND + 1, len(bits))] - sums[np.maximum(at - _AROUND, 0)]
    return near
