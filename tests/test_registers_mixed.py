"""Readings in each other's places give no type: certainty comes from what would look otherwise if it were wrong."""

from __future__ import annotations

import math
from collections.abc import Sequence
from random import Random

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


def test_two_readings_make_nothing_sure() -> None:
    assert all(value.confidence <= UNSURE_AT_MOST for value in values_of(series(2)))
