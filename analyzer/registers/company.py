"""What speaks for a register besides itself: those beside it in its block, and the same one of sister units.

Beside a pair of registers, or four, stands a row of values alike, or single registers.

Sister units are those of one bus that are read with the same requests and answer alike: they have one layout, and what
the registers of one say of it counts for all. Where a high word stands still in each but is not the same in all, it is
no spare register. Who asks the same of two units need not have two of a kind before him: they are sisters only where
their words agree far more often than those of two devices would by chance, and only so far: where the words of a
stretch differ, each unit speaks for itself there.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from captures.ragged import Ints
from dissectors.maps.model import MapArea

from .hypotheses import LONGEST
from .looks import NO_VALUE, WORD_CLASSES, word_classes
from .readings import BlockReadings, Words

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]
RHYTHMS: Final = 5 * 5
ROWS: Final = 6 * 4
FOURS: Final = 4 * 3
AROUND: Final = 5 * 5
KIN: Final = 4 * 4
_ALONG: Final = 0.8  # correlation
_LIKE: Final = 0.25  # natural logarithm of one size over the other
_BESIDE: Final = (-8, -6, -4, -2, 2, 4, 6, 8)
_IN_LINE: Final = (-12, -10, *_BESIDE, 10, 12)
_FOURS: Final = (-12, -8, -4, 4, 8, 12)
_MARKS: Final = (0, *NO_VALUE)  # high words of small numbers, and of what a device lacks


@dataclass(frozen=True, slots=True, eq=False)
class Company:
    """Registers side by side: `words` they held at first, `zero` those that always were zero, those that `moved`, of
    each the `first` and the `last` register of its block; and as what each is kin (1 not, 2 of like size, 3 it goes
    along) to the `next` one and to the one `after` that."""

    words: NDArray[np.uint16]
    zero: Mask
    moved: Mask
    first: Ints
    last: Ints
    next: Ints
    after: Ints


def company_of(words: Words, moved: Mask, first: Ints, last: Ints) -> Company:
    """Of the readings (rows) of registers (columns)."""
    signed = words.view(np.int16)
    plain = np.where(np.ptp(signed.astype(np.int32), axis=0) < np.ptp(words, axis=0), signed, words).astype(np.float32)
    size = np.log(np.abs(plain).mean(axis=0) + 1)
    centred = plain - plain.mean(axis=0)
    normal = centred / np.maximum(np.sqrt((centred**2).sum(axis=0)), np.float32(1e-6))
    kin = []
    for away in (1, 2):
        along = np.abs((normal[:, :-away] * normal[:, away:]).sum(axis=0)) > _ALONG
        like = np.abs(size[:-away] - size[away:]) < _LIKE
        kin.append(np.append(np.where(along, 3, np.where(like, 2, 1)), [1] * away)[: len(moved)])
    return Company(words[0], (words == 0).all(axis=0), moved, first, last, *kin)


def rhythm(company: Company, high: Ints, low: Ints) -> Ints:
    """Of every second register to either side of a pair: how many in line with its high word stand at zero, and
    how many in line with its low word do not (of either 0 there are none, 1 to 4 from few to all)."""
    seen, zeros, others = (np.zeros(len(high), np.int64) for _ in range(3))
    for present, top, bottom in _pairs_beside(company, high, low, _BESIDE):
        seen += present
        zeros += present & company.zero[top]
        others += present & ~company.zero[bottom]
    shares = [np.digitize(count / np.maximum(seen, 1), (0.2, 0.6, 0.9)) + 1 for count in (zeros, others)]
    return np.where(seen > 0, shares[0] * 5 + shares[1], 0)


def pairs_in_line(company: Company, high: Ints, low: Ints) -> Ints:
    """Of every second register to either side of a pair: how many pairs there are alike, of the same quiet high
    word or one that says nothing, and of a low word that says something (0 to 3, 4 and 5, more), and how many
    cannot be so (0 to 2, more)."""
    words, moved = company.words, company.moved
    says_nothing = np.isin(words, _MARKS)
    alike, against = (np.zeros(len(high), np.int64) for _ in range(2))
    for present, top, bottom in _pairs_beside(company, high, low, _IN_LINE):
        fits = ~moved[top] & (says_nothing[top] | (words[top] == words[high]))
        alike += present & fits & (moved[bottom] | (words[bottom] != 0))
        against += present & ~fits & ~(moved[top] & moved[bottom])
    rows: Ints = np.digitize(alike, (1, 2, 3, 4, 6)) * 4 + np.minimum(against, 3)
    return rows


def fours_in_line(company: Company, columns: Ints) -> Ints:
    """Of the fours to either side of four registers: how many are alike, with nothing in their upper half and
    something below (0 to 2, more), and how many are otherwise (0, 1, more)."""
    words, moved = company.words, company.moved
    nothing: Mask = np.isin(words, (0, 0xFFFF)) & ~moved
    something: Mask = moved | (words != 0)
    fits: Mask = np.all(nothing[columns[:, :2]], axis=1)
    says: Mask = np.any(something[columns[:, 2:]], axis=1)
    alike, against = (np.zeros(len(columns), np.int64) for _ in range(2))
    begins = np.arange(len(columns))
    for away in _FOURS:
        present = begins + away >= company.first[: len(begins)]
        present &= begins + away + 3 <= company.last[: len(begins)]
        slot = np.where(present, begins + away, 0)
        alike += present & fits[slot] & says[slot]
        against += present & ~fits[slot]
    grades: Ints = np.minimum(alike, 3) * 3 + np.minimum(against, 2)
    return grades


def around(company: Company, high: Ints, low: Ints) -> Ints:
    """What stands on the high word's side of a pair, and on the low word's: 0 nothing, it is the block's edge, 1 a
    register at zero, 2 one at something, 3 one that moves, 4 one that moves behind one that moves too."""
    away = np.sign(high - low)
    return 5 * _stands(company, high, away) + _stands(company, low, -away)


def kin(company: Company, high: Ints, low: Ints) -> Ints:
    """As what the low word of a pair is kin to the register beyond the high word, and to that beside itself: 0 there is
    none that moves, 1 to 3 as in `Company`. Values alike stand side by side, and nothing in between but a high word."""
    away = np.sign(high - low)
    return 4 * _is_kin(company, low, 2 * away) + _is_kin(company, low, -away)


def single_kin(company: Company) -> Ints:
    """Of each register that moves what it is kin to behind and before it: 0 nothing that moves, 1 another that it is
    not kin to, 2 the next register, 3 one beyond a zero, which would belong to neither."""
    at = np.arange(len(company.moved))
    sides = []
    for away in (1, -1):
        near, far = _is_kin(company, at, np.full(len(at), away)), _is_kin(company, at, np.full(len(at), 2 * away))
        zero = company.zero[np.clip(at + away, 0, len(at) - 1)]
        sides.append(
            np.where(near > 1, 2, np.where(zero & (far > 1), 3, np.where((near == 1) | (zero & (far == 1)), 1, 0)))
        )
    return 4 * sides[0] + sides[1]


def _is_kin(company: Company, at: Ints, away: Ints) -> Ints:
    to = at + away
    present = (to >= company.first[at]) & (to <= company.last[at])
    to = np.where(present, to, 0)
    by_distance = np.where(np.abs(away) == 1, company.next[np.minimum(at, to)], company.after[np.minimum(at, to)])
    return np.where(present & company.moved[to], by_distance, 0)


def _stands(company: Company, at: Ints, away: Ints) -> Ints:
    beside, beyond = at + away, at + 2 * away
    inside, far = ((to >= company.first[at]) & (to <= company.last[at]) for to in (beside, beyond))
    beside, beyond = np.where(inside, beside, 0), np.where(far, beyond, 0)
    moves = company.moved[beside]
    kinds = np.where(company.zero[beside], 1, np.where(moves, np.where(far & company.moved[beyond], 4, 3), 2))
    return np.where(inside, kinds, 0)


def _pairs_beside(
    company: Company, high: Ints, low: Ints, distances: tuple[int, ...]
) -> Iterator[tuple[Mask, Ints, Ints]]:
    """At each distance: where there is such a pair in the block, its high words, its low words."""
    for away in distances:
        present = (low + away >= company.first[low]) & (high + away >= company.first[high])
        present &= (low + away <= company.last[low]) & (high + away <= company.last[high])
        yield present, np.where(present, high + away, 0), np.where(present, low + away, 0)


_SAME: Final = 0.6  # of the registers of two sisters hold words of one class, though they measure different things
_ENOUGH: Final = 12.0  # bits for one layout
_LIKELY: Final = 5.0  # where a third unit is a sister of both
_AROUND: Final = 4  # registers to either side in which words must not speak against it
_AGAINST: Final = -1.0  # bits
_CONTRARY: Final = 6.0  # log odds of two readings: further apart than what one layout makes of two series
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
