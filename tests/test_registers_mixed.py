"""Readings in each other's places give no type: certainty comes from what would look otherwise if it were wrong."""

from __future__ import annotations

import math
from collections.abc import Sequence
from random import Random

import numpy as np
import pytest

from analyzer.core import analyse
from analyzer.registers.inference import infer
from analyzer.registers.mixed import UNSURE_AT_MOST
from analyzer.registers.readings import RegisterReadings
from analyzer.registers.roles import RegisterValue
from captures import Capture, Chunk, LineSettings
from dissectors.crc import crc_bytes

MS = 1_000_000
LINE = LineSettings(baud=19200, char_bits=11)
POLLS = 4
WORDS = 4


def adu(body: bytes) -> bytes:
    return body + crc_bytes(body)


def series(count: int) -> list[list[bytes]]:
    """Of each poll its answers: a level that wanders, a counter of 32 bits, one that stands still."""
    found = []
    for poll in range(POLLS):
        answers = []
        for n in range(count):
            level = round(2000 + 4000 * poll + 80 * math.sin(n / 9 + poll))
            counter = (poll + 1) * 70_000 + n * (poll + 3)
            answers.append(level.to_bytes(2) + counter.to_bytes(4) + (500 + 9 * poll).to_bytes(2))
        found.append(answers)
    return found


def values_of(answers: Sequence[Sequence[bytes]]) -> list[RegisterValue]:
    chunks, now = [], 0
    for row in zip(*answers, strict=True):
        for poll, data in enumerate(row):
            for body in (bytes((7, 3, 0, 16 * poll, 0, WORDS)), bytes((7, 3, len(data))) + data):
                now += 20 * MS
                chunks.append(Chunk(now, adu(body)))
    readings = RegisterReadings()
    for part in analyse(Capture.of(LINE, chunks)):
        readings.feed(part.batch)
    return infer(readings)


def test_a_shuffled_capture_gives_no_type_above_a_half() -> None:
    every = series(80)
    random = Random(5)
    for row in range(80):
        moment = [answers[row] for answers in every]
        random.shuffle(moment)
        for answers, data in zip(every, moment, strict=True):
            answers[row] = data
    found = values_of(every)
    assert found
    assert max(value.confidence for value in found) <= UNSURE_AT_MOST


def test_the_same_readings_in_their_places_give_types() -> None:
    assert sum(value.confidence > UNSURE_AT_MOST for value in values_of(series(80))) > POLLS


@pytest.mark.parametrize("count", [2, 6])
def test_a_few_readings_make_nothing_sure(count: int) -> None:
    assert all(value.confidence <= UNSURE_AT_MOST for value in values_of(series(count)))


@pytest.mark.parametrize("whole", [True, False])
def test_readings_in_no_order_of_time_give_no_type_above_a_half(whole: bool) -> None:
    """Each poll's answers shuffled in time, as a whole or register by register."""
    rng, found = np.random.default_rng(7), RegisterReadings()
    for poll, answers in enumerate(series(80)):
        words = np.array([np.frombuffer(data, ">u2") for data in answers]).astype(np.uint16)
        found.put(7, "holding", 16 * poll, rng.permutation(words) if whole else rng.permuted(words, axis=0))
    values = infer(found)
    assert max(value.confidence for value in values) <= UNSURE_AT_MOST


def test_what_never_moved_is_no_type() -> None:
    readings = RegisterReadings()
    readings.put(7, "holding", 0, np.tile(np.array([0, 230, 0, 17000, 65535], np.uint16), (60, 1)))
    values = infer(readings)
    assert len(values) == 5
    assert max(value.confidence for value in values) <= UNSURE_AT_MOST


def test_two_counters_side_by_side_are_two() -> None:
    rng, readings = np.random.default_rng(3), RegisterReadings()
    counted = [start + np.cumsum(rng.poisson(pace, 80)) for start, pace in ((61_000, 40), (1200, 130), (30_000, 9))]
    readings.put(7, "holding", 0, np.stack(counted, axis=1).astype(np.uint16))
    assert [value.words for value in infer(readings)] == [1, 1, 1]
