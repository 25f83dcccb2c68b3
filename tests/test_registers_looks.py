"""What a word looks like by itself tells whether another one belongs before it."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from analyzer.registers.inference import infer
from analyzer.registers.looks import is_epoch, sign_classes
from analyzer.registers.readings import RegisterReadings
from analyzer.registers.values import RegisterValue

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
