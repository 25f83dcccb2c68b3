"""Units of one layout are inferred together, others are not."""

from __future__ import annotations

import numpy as np
import pytest

from analyzer.registers.inference import infer
from analyzer.registers.readings import RegisterReadings
from analyzer.registers.runs import runs_of

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
