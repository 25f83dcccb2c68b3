"""Integers of 32 bits of which both words move: by scatter, over a carry, about zero, as fast counters."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from analyzer.registers.counting import Counting
from analyzer.registers.inference import infer
from analyzer.registers.looks import change_lengths, evenness
from analyzer.registers.readings import RegisterReadings

Motion = Callable[[np.random.Generator], np.ndarray]
POLLS = 60
SEEDS = range(12)


def pair(numbers: np.ndarray, order: str) -> np.ndarray:
    """Registers of whole numbers, a row a number."""
    patterns = np.asarray(numbers).astype(np.int64).astype(np.uint32)
    words = np.stack((patterns >> 16, patterns & 0xFFFF), axis=1).astype(np.uint16)
    return words if order == "ABCD" else words[:, ::-1]


def meter(random: np.random.Generator, motion: Motion, order: str) -> RegisterReadings:
    """Three such numbers from register 42 on, registers of their own at the side of the high words."""
    singles = [level + random.normal(0, spread, POLLS).round() for level, spread in ((2301, 9), (417, 30))]
    columns = [column.astype(np.int64).astype(np.uint16)[:, None] for column in singles]
    pairs = [pair(motion(random), order) for _ in range(3)]
    readings = RegisterReadings()
    words = np.concatenate((*columns, *pairs) if order == "ABCD" else (*pairs, *columns), axis=1)
    readings.put(1, "holding", 40 if order == "ABCD" else 42, words)
    return readings


MOTIONS: dict[str, Motion] = {
    "scatter": lambda random: 6.2e8 * (1 + random.normal(0, 0.08, POLLS)),
    "carry": lambda random: 23 * 0x10000 + random.normal(0, 150, POLLS),
    "zero": lambda random: np.round(random.normal(0, 400, POLLS)),
    "count": lambda random: 3.1e6 + np.cumsum(random.exponential(90_000, POLLS)),
}


@pytest.mark.parametrize("order", ["ABCD", "CDAB"])
@pytest.mark.parametrize("motion", MOTIONS)
def test_an_integer_whose_words_both_move_is_one_number(motion: str, order: str) -> None:
    right = 0
    for seed in SEEDS:
        random = np.random.default_rng(seed)
        found = {value.address: value for value in infer(meter(random, MOTIONS[motion], order))}
        pairs = [found[address] for address in (42, 44, 46) if address in found]
        right += sum((value.words, value.kind, value.order) == (2, "int", order) for value in pairs)
    assert right >= 0.95 * 3 * len(SEEDS)


@pytest.mark.parametrize("spread", [0.002, 0.02])
def test_a_lone_float_among_whole_numbers_is_no_huge_one_that_carries(spread: float) -> None:
    right = 0
    for seed in SEEDS:
        random = np.random.default_rng(seed)
        power = (2.7 * (1 + np.cumsum(random.normal(0, spread, POLLS)))).astype(np.float32).view(np.uint32)
        energies = [23 * 0x10000 + k * 7000 + np.cumsum(random.exponential(9000, POLLS)) for k in range(3)]
        singles = (2301 + random.normal(0, 9, (POLLS, 4))).astype(np.uint16)
        columns = [singles, pair(power, "ABCD"), *(pair(energy, "ABCD") for energy in energies), singles]
        readings = RegisterReadings()
        readings.put(1, "holding", 10, np.concatenate(columns, axis=1))
        found = {value.address: value for value in infer(readings)}
        right += 14 in found and (found[14].kind, found[14].order) == ("float", "ABCD")
        assert all(found[address].kind == "int" for address in (16, 18, 20))
    assert right == len(SEEDS)


def test_scatter_over_all_that_a_word_holds_is_even_and_no_quantity_is() -> None:
    random = np.random.default_rng(1)
    even = random.integers(0, 0x10000, POLLS)
    counter = (np.arange(POLLS) * 4099) & 0xFFFF
    narrow, halves = random.normal(30_000, 3000, POLLS), random.normal(0, 1500, POLLS) + 0x8000 * (np.arange(POLLS) % 2)
    words = np.stack([column.astype(np.int64) & 0xFFFF for column in (even, counter, narrow, halves)], axis=1)
    words = words.astype(np.uint16)
    grades = evenness(words, (words[1:] != words[:-1]).sum(axis=0))
    assert grades.tolist()[:2] == [4, 4] and (grades[2:] < 3).all()


def test_two_registers_that_scatter_apart_are_shorter_apart() -> None:
    random = np.random.default_rng(2)
    readings = random.normal(0, 600, (POLLS, 2)).round().astype(np.int64)
    steps = readings[1:] - readings[:-1]
    apart = change_lengths(steps, 17).sum()
    together = change_lengths((steps[:, :1] << 16) + steps[:, 1:], 33).sum()
    assert together > apart + POLLS


def test_a_single_reading_is_counted_too() -> None:
    (_, moved, _), = Counting([np.zeros((1, 3), np.uint16)], 1).blocks()  # fmt: skip
    assert not moved.any()
