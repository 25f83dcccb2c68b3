"""Texts among registers that never move: names are read, floats whose bytes happen to be printable are not."""

import numpy as np
import pytest

from analyzer.registers.inference import infer
from analyzer.registers.readings import RegisterReadings

POLLS = 60


def texts_of(still):
    """What is read as text where these bytes stand behind two floats that move."""
    volts = 230 + np.cumsum(np.random.default_rng(1).normal(0, 0.3, (POLLS, 2)), axis=0)
    moving = volts.astype(">f4").view(">u2").astype(np.uint16)
    words = np.tile(np.frombuffer(still, ">u2").astype(np.uint16), (POLLS, 1))
    readings = RegisterReadings()
    readings.put(1, "input", 0, np.hstack((moving, words)), np.arange(POLLS) * 1_000_000_000)
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
