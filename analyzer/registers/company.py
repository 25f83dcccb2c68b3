"""What stands beside a pair of registers, or four, in its block: a row of values alike, or single registers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from captures.ragged import Ints

from .readings import Words

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
_MARKS: Final = (0, 0xFFFF, 0x7FFF, 0x8000)  # high words of small numbers, and of what a device lacks


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
