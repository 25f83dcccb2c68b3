"""What stands beside registers tells what they hold: in their block, and in sister units.

What stands beside a pair tells whether its quiet word is a high word or a register to spare. Units of one layout are
inferred together, others are not.
"""

from __future__ import annotations

import numpy as np
import pytest

from analyzer.registers.company import Company, around, company_of, kin, single_kin
from analyzer.registers.evidence import way_codes, way_counts
from analyzer.registers.inference import infer
from analyzer.registers.looks import evenness
from analyzer.registers.readings import RegisterReadings, Words
from analyzer.registers.runs import runs_of

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


POLLS = 60


def meter(seed: int, energies: list[int]) -> np.ndarray:
    """Three voltages, three currents, a frequency and a state, then counters of 32 bits."""
    random = np.random.default_rng(seed)
    volts = random.normal(2300, 12, (POLLS, 3))
    amperes = 400 + np.cumsum(random.normal(0, 3, (POLLS, 3)), axis=0)
    rest = np.stack([random.normal(5000, 2, POLLS), np.full(POLLS, 3)], axis=1)
    columns = [np.concatenate([volts, amperes, rest], axis=1).astype(np.uint16)]
    for energy in energies:
        counted = energy + np.cumsum(random.integers(0, 4, POLLS))
        columns.append(counted.astype(">u4").view(">u2").reshape(POLLS, 2).astype(np.uint16))
    return np.concatenate(columns, axis=1)


def heard(*tables: np.ndarray, area: str = "input") -> RegisterReadings:
    readings = RegisterReadings()
    for unit, table in enumerate(tables, 1):
        readings.put(unit, area, 100, table)  # type: ignore[arg-type]
    return readings


def sisters_of(readings: RegisterReadings) -> list[set[int]]:
    runs = runs_of(readings)
    return [{runs[number].unit for number, _ in run.sisters} for run in runs]


def test_a_high_word_that_differs_between_sisters_makes_a_wide_value() -> None:
    young, old = meter(1, [3000, 41_000]), meter(2, [7 * 65536 + 20_009, 3 * 65536 + 40_000])
    older = meter(3, [2 * 65536 + 31_000, 9 * 65536 + 2000])

    def wide(readings: RegisterReadings) -> float:
        return max(
            value.confidence if value.words == 2 else 1 - value.confidence
            for value in infer(readings, units=[1])
            if value.changes and value.address <= 109 < value.address + value.words
        )

    lonely, together = wide(heard(young)), wide(heard(young, old, older))
    assert together > lonely
    values = [v for v in infer(heard(young, old, older)) if v.changes]
    layouts = [[(v.address, v.words, v.kind) for v in values if v.unit == unit] for unit in (1, 2, 3)]
    assert layouts[0] == layouts[1] == layouts[2]
    assert all("weighed together with units 2, 3" in v.why for v in values if v.unit == 1)
    assert all("weighed together" not in v.why for v in infer(heard(young), units=[1]))


def test_what_a_unit_is_said_to_be_does_not_depend_on_which_units_are_shown() -> None:
    readings = heard(meter(1, [3000]), meter(2, [7 * 65536]), meter(3, [70_000]))
    everything = infer(readings)
    for unit in (1, 2, 3):
        assert infer(readings, units=[unit]) == [value for value in everything if value.unit == unit]
    assert sisters_of(readings) == [{2, 3}, {1, 3}, {1, 2}]


@pytest.mark.parametrize("seed", range(6))
def test_units_that_differ_are_not_joined(seed: int) -> None:
    random = np.random.default_rng(seed)
    mine, floats = meter(seed, [3000, 500_000]), random.normal(50, 20, (POLLS, 6)).astype(">f4")
    others = floats.view(">u2").reshape(POLLS, 12).astype(np.uint16)
    assert sisters_of(heard(mine, others)) == [set(), set()]
    assert sisters_of(heard(mine, mine[:, ::-1])) == [set(), set()]
    assert sisters_of(heard(mine, mine[:, :-1])) == [set(), set()]  # other requests
    still = np.zeros((POLLS, 12), np.uint16)
    assert sisters_of(heard(still, still)) == [set(), set()]  # nothing that could be alike


def test_where_sisters_differ_each_speaks_for_itself() -> None:
    one, two = meter(1, [3000, 4000, 5000, 6000]), meter(2, [3500, 4400, 5100, 6200])
    random = np.random.default_rng(5)
    two[:, 8:16] = random.normal(80, 30, (POLLS, 4)).astype(">f4").view(">u2").reshape(POLLS, 8)
    readings = heard(one, two)
    for unit in (1, 2):
        readings.put(unit, "input", 300, meter(unit + 10, [70_000]))
    assert {2} in sisters_of(readings)
    values = [v for v in infer(readings) if v.changes and 108 <= v.address < 300]
    assert {v.kind for v in values if v.unit == 2} == {"float"}
    assert {v.kind for v in values if v.unit == 1} == {"int"}
