"""SunSpec devices by the chain of their models, wherever it stands."""

from __future__ import annotations

import numpy as np
import pytest

from analyzer.registers.inference import infer
from analyzer.registers.readings import RegisterReadings
from analyzer.registers.recognition import ChainModel, UnitTexts, recognised, sunspec_chain

ROWS = 60


def device(base: int, *models: tuple[int, int], cut: int | None = None) -> RegisterReadings:
    """A device whose chain begins at `base`, its registers all read; currents move."""
    words = [0x5375, 0x6E53]
    places = {}
    for number, length in models:
        places[number] = len(words)
        words += [number, length, *([0] * length)]
    words += [0xFFFF, 0]
    table = np.tile(np.array(words, np.uint16), (ROWS, 1))
    for number, at in places.items():
        if number != 1:
            table[:, at + 2] = 400 + np.arange(ROWS) % 37
            table[:, at + 6] = np.uint16(-2 & 0xFFFF)  # A_SF
    readings = RegisterReadings()
    whole = table if cut is None else table[:, :cut]
    for first in range(0, whole.shape[1], 100):
        readings.put(3, "holding", base + first, whole[:, first : first + 100])
    return readings


@pytest.mark.parametrize("base", [40000, 50000, 0])
def test_models_are_put_where_the_chain_has_them(base: int) -> None:
    readings = device(base, (1, 66), (160, 48), (103, 50))
    chain = sunspec_chain(list(readings))
    assert chain == [
        ChainModel(1, base + 2, 66), ChainModel(160, base + 70, 48), ChainModel(103, base + 120, 50)
    ]  # fmt: skip
    (found,) = recognised(readings, UnitTexts(), infer(readings))
    assert found.name == "" and found.confidence > 0.95 and "model 103 at" in found.why
    current = next(row for row in found.chart.rows if row.name == "Current")
    assert (current.address, current.scale_address) == (base + 122, base + 126)
    named = {value.name: value for value in infer(readings, charts={3: found.chart})}
    assert named["Current"].last == int(400 + (ROWS - 1) % 37)


def test_a_chain_that_was_read_in_part_ends_there() -> None:
    readings = device(40000, (1, 66), (103, 50), cut=60)
    assert [model.number for model in sunspec_chain(list(readings))] == [1]
    assert recognised(readings, UnitTexts(), infer(readings)) == []


def test_no_chain_without_its_mark() -> None:
    random = np.random.default_rng(1)
    readings = RegisterReadings()
    readings.put(1, "holding", 40000, random.integers(0, 65536, (ROWS, 60)).astype(np.uint16))
    assert sunspec_chain(list(readings)) == []
