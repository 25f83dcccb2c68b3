"""What registers look like by themselves tells what they hold.

What a word looks like tells whether another one belongs before it. Integers of 32 bits of which both words move: by
scatter, over a carry, about zero, as fast counters. Values of four registers: two of two registers side by side, a
float among others. Texts among registers that never move: names are read, floats whose bytes happen to be printable are
not.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest

from analyzer.registers.counting import Counting
from analyzer.registers.evidence import block_evidence
from analyzer.registers.hypotheses import HYPOTHESES
from analyzer.registers.inference import infer
from analyzer.registers.looks import change_lengths, evenness, is_epoch, sign_classes
from analyzer.registers.readings import RegisterReadings
from analyzer.registers.roles import RegisterValue

POLLS = 60
RNG = np.random.default_rng(3)


def walk(level: float, reach: float) -> np.ndarray:
    return level + np.cumsum(RNG.normal(0, reach / 8, POLLS)).clip(-reach, reach)


def registers(*columns: np.ndarray | int) -> np.ndarray:
    """Readings of registers side by side, each a series or what it holds all the time."""
    series = [np.broadcast_to(column, POLLS) for column in columns]
    return np.stack(series, axis=1).astype(np.int64).astype(np.uint16)


def told(words: np.ndarray) -> dict[int, RegisterValue]:
    """What is told of a block of one unit, by register."""
    readings = RegisterReadings()
    readings.put(1, "input", 100, words)
    return {value.address - 100: value for value in infer(readings)}


@cache
def grid() -> np.ndarray:
    """A number below zero whose high word stands still, before one that is not; registers of their own before both."""
    sold, used = walk(-2900, 300), walk(2600, 700)
    return registers(walk(4900, 200), 7, 89, walk(353, 4), 0xFFFF, sold, 0, used, 0, walk(1200, 500))


@pytest.mark.parametrize("order", ["ABCD", "CDAB"])
def test_what_stays_below_ffff_is_negative(order: str) -> None:
    words = grid() if order == "ABCD" else grid()[:, ::-1]
    values = told(words)
    value = values[4]
    assert (value.words, value.order, value.signed) == (2, order, True)
    assert {values[at].order for at in ((6, 8) if order == "ABCD" else (0, 2))} == {order}


def test_what_crosses_zero_takes_no_high_word_along() -> None:
    words = registers(walk(2301, 9), 0xFFFF, walk(0, 40), 0xFFFF, walk(0, 60))
    assert sign_classes(words, np.array([True, False, True, False, True])).tolist() == [0, 0, 2, 0, 2]
    assert all(told(words)[at].words == 1 for at in (1, 2, 3, 4))


def test_signs_are_of_what_moves_near_zero() -> None:
    words = registers(walk(-500, 100), walk(500, 100), walk(0, 9), RNG.integers(0, 0x10000, POLLS), 0xFF00)
    moved = (words != words[0]).any(axis=0)
    assert sign_classes(words, moved).tolist() == [1, 0, 2, 0, 0]


@pytest.mark.parametrize("order", ["ABCD", "CDAB"])
def test_seconds_since_1970_are_one_number(order: str) -> None:
    seconds = 1_751_371_000 + 5 * np.arange(POLLS)
    words = registers(walk(2301, 9), walk(417, 30), seconds >> 16, seconds & 0xFFFF, walk(880, 9), walk(95, 4))
    words = words if order == "ABCD" else words[:, ::-1]
    assert (seconds >> 16 == seconds[0] >> 16).all() and is_epoch(words)[2 if order == "ABCD" else 3]
    value = told(words)[2]
    assert (value.words, value.order) == (2, order)


Motion = Callable[[np.random.Generator], np.ndarray]
SEEDS = range(12)


def pair_of(numbers: np.ndarray, order: str) -> np.ndarray:
    """Registers of whole numbers, a row a number."""
    patterns = np.asarray(numbers).astype(np.int64).astype(np.uint32)
    words = np.stack((patterns >> 16, patterns & 0xFFFF), axis=1).astype(np.uint16)
    return words if order == "ABCD" else words[:, ::-1]


def meter(random: np.random.Generator, motion: Motion, order: str) -> RegisterReadings:
    """Three such numbers from register 42 on, registers of their own at the side of the high words."""
    singles = [level + random.normal(0, spread, POLLS).round() for level, spread in ((2301, 9), (417, 30))]
    columns = [column.astype(np.int64).astype(np.uint16)[:, None] for column in singles]
    pairs = [pair_of(motion(random), order) for _ in range(3)]
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
        columns = [singles, pair_of(power, "ABCD"), *(pair_of(energy, "ABCD") for energy in energies), singles]
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


READINGS = 60
CHANCE = np.random.default_rng(5)
COUNTER = 40_000 + np.cumsum(CHANCE.integers(1, 60, READINGS))


def words_of(numbers, form):
    """A series as registers, high words first."""
    return np.asarray(numbers).astype(f">{form}").view(">u2").reshape(READINGS, -1).astype(np.uint16)


def absurd(words, *, is_float, order="ABCD"):
    (found,) = block_evidence([(words if order == "ABCD" else words[:, ::-1], READINGS)])
    wide = next(n for n, h in enumerate(HYPOTHESES) if (h.words, h.is_float, h.order) == (4, is_float, order))
    return bool(found.absurd[wide][0])


@pytest.mark.parametrize("order", ["ABCD", "CDAB"])
@pytest.mark.parametrize(
    ("numbers", "form", "is_one"),
    [
        (COUNTER, "u8", True),
        (COUNTER * 90_000, "u8", True),
        (-COUNTER, "i8", True),
        ((19 << 32) + COUNTER % 40_000, "u8", False),  # two of 32 bits, of which the first stands still
        ((COUNTER // 50 << 32) + 7, "u8", False),
    ],
)
def test_a_word_at_zero_or_at_rest_below_another_is_of_two_numbers(numbers, form, is_one, order):
    assert absurd(words_of(numbers, form), is_float=False, order=order) == (not is_one)


@pytest.mark.parametrize("order", ["ABCD", "CDAB"])
def test_digits_behind_those_that_change_are_anything(order):
    smooth = 230 + np.cumsum(CHANCE.normal(0, 0.3, READINGS))
    assert not absurd(words_of(smooth, "f8"), is_float=True, order=order)
    assert not absurd(words_of(np.round(smooth * 4) / 4, "f8"), is_float=True, order=order)
    beside = words_of(smooth * 1e6, "f8")
    beside[:, 2] = 65_470  # a register of its own that stands still, and one that moves a little
    beside[:, 3] = CHANCE.integers(0, 4, READINGS)
    assert absurd(beside, is_float=True, order=order)


def texts_of(still):
    """What is read as text where these bytes stand behind two floats that move."""
    volts = 230 + np.cumsum(np.random.default_rng(1).normal(0, 0.3, (POLLS, 2)), axis=0)
    moving = volts.astype(">f4").view(">u2").astype(np.uint16)
    words = np.tile(np.frombuffer(still, ">u2").astype(np.uint16), (POLLS, 1))
    readings = RegisterReadings()
    readings.put(1, "input", 0, np.hstack((moving, words)), np.arange(POLLS, dtype=np.int64) * 1_000_000_000)
    return [value.last for value in infer(readings) if value.kind == "text"]


@pytest.mark.parametrize(
    "numbers", [[0.9, 0.8], [15.2], [230.4], [0.9, 0.7, 15.2], [0.6, 0.9, 50.2, 0.1], [3.3, 9.7, 0.7, 0.9, 15.2]]
)
def test_floats_that_stand_still_are_no_text(numbers):
    assert texts_of(np.array(numbers, ">f4").tobytes()) == []


@pytest.mark.parametrize(
    "text", ["SDM630", "XY-MD02 ", "v1.33 (b2)", "ABB B23 112-100 ", "SN33X1", "Pump No. 33/left", "Ver=2.0 build 17"]
)
def test_names_are_text(text):
    assert texts_of(text.encode()) == [text.rstrip()]
