"""What stands beside a pair of registers tells whether its quiet word is a high word or a register to spare."""

from __future__ import annotations

import numpy as np
import pytest

from analyzer.registers.company import Company, around, company_of, kin, single_kin
from analyzer.registers.evidence import way_codes, way_counts
from analyzer.registers.looks import evenness
from analyzer.registers.readings import Words

READINGS = 60
RNG = np.random.default_rng(8)


def series(level: float, reach: float) -> np.ndarray:
    return level + RNG.normal(0, reach, READINGS)


def company(*columns: np.ndarray | int) -> Company:
    numbers = np.stack([np.broadcast_to(column, READINGS) for column in columns], axis=1)
    words: Words = numbers.astype(np.int64).astype(np.uint16)
    size = words.shape[1]
    moved = (words != words[0]).any(axis=0)
    return company_of(words, moved, np.zeros(size, np.int64), np.full(size, size - 1))


@pytest.mark.parametrize("reverse", [False, True])
def test_values_alike_have_nothing_between_them_but_a_high_word(reverse: bool) -> None:
    columns: list[np.ndarray | int] = [series(2310, 5), 0, series(2290, 5), series(40, 9), series(5000, 2)]
    beside = company(*(columns[::-1] if reverse else columns))
    high, low = (np.array([3]), np.array([2])) if reverse else (np.array([1]), np.array([2]))
    assert kin(beside, high, low).tolist() == [4 * 2 + 1]  # of like size beyond the zero, not so beside
    assert around(beside, high, low).tolist() == [5 * 3 + 4]


def test_what_goes_along_is_kin() -> None:
    load = series(700, 90)
    beside = company(load, 0, load * 0.23, 0)
    assert kin(beside, np.array([1]), np.array([2])).tolist() == [4 * 3]
    assert single_kin(beside)[[0, 2]].tolist() == [4 * 3, 3]
    assert single_kin(company(load, load * 0.23, 0))[:2].tolist() == [4 * 2, 2]


def test_a_block_of_one_register_has_no_company() -> None:
    assert single_kin(company(series(700, 90))).tolist() == [0]


def test_counters_beside_zeros_are_told_from_other_values() -> None:
    words = np.array([2300, 2310, 0, 77, 0, 912, 0, 5])
    moved = words > 0
    counts_up = np.isin(words, (77, 912, 5))
    counts = way_counts(words, moved, counts_up)
    assert counts.tolist() == [[[0, 2], [3, 3]], [[1, 2], [2, 3]]]
    high_first = way_codes(counts, words, moved, counts_up, "ABCD")
    low_first = way_codes(counts, words, moved, counts_up, "CDAB")
    assert (high_first >= 0).tolist() == [False, False, True, False, True, False, True]
    assert len(set(high_first[[2, 4, 6]].tolist())) == 1
    assert (low_first >= 0).tolist() == [False, True, False, True, False, True, False]
    assert not set(high_first.tolist()) & set(low_first[[3, 5]].tolist())


def test_four_digits_of_a_decimal_number_keep_to_9999() -> None:
    digits = RNG.integers(0, 10_000, (READINGS, 6))
    binary = RNG.integers(0, 0x10000, (READINGS, 6))
    some = np.clip(series(5000, 1800), 0, 9999).astype(np.int64)[:, None]
    words = np.concatenate([digits, binary, some], axis=1).astype(np.uint16)
    grades = evenness(words, np.full(words.shape[1], READINGS - 1))
    assert (grades[:6] == 5).sum() >= 5 and 5 not in grades[6:]
