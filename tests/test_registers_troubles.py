"""Values that tell trouble: what is planted is found, and a healthy device is never accused."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from buses import adu
from running import ran

from analyzer.registers.limits import limit_breaches
from analyzer.registers.readings import RegisterReadings
from dissectors.maps import RegisterMap
from dissectors.maps.model import MappedValue

ROWS = 120


def words_of(values: np.ndarray, form: str) -> np.ndarray:
    return np.asarray(values).astype(form).view(">u2").reshape(len(values), -1).astype(np.uint16)


def walk(seed: int, level: float, step: float) -> np.ndarray:
    return level + np.cumsum(np.random.default_rng(seed).normal(0, step, ROWS))


def meter(*, frozen: int | None = None, torn: bool = False, swapped: bool = False, seed: int = 0) -> np.ndarray:
    """Three floats, a 16-bit value and a counter of 32 bits."""
    floats = [walk(seed + n, 230 + n, 0.4) for n in range(3)]
    counter = 65_536 * 7 - 300 + 11 * np.arange(ROWS)
    counted = words_of(counter, ">u4")
    if torn:
        carry = int(np.flatnonzero(np.diff(counted[:, 0].astype(int)))[0]) + 1
        counted[carry, 0] -= 1
    columns = [words_of(series, ">f4") for series in floats] + [counted]
    if swapped:
        columns = [column[:, ::-1] for column in columns]
    table = np.concatenate([*columns, words_of(walk(seed + 9, 4000, 30), ">u2")], axis=1)
    if frozen is not None:
        table[frozen:] = table[frozen]
    return table


def readings_of(**units: np.ndarray) -> RegisterReadings:
    readings = RegisterReadings()
    for name, table in units.items():
        readings.put(int(name[1:]), "input", 100, table, np.arange(ROWS) * 1_000_000_000)
    return readings


def test_numbers_out_of_a_maps_limits() -> None:
    rows = (MappedValue("input", 100, "Voltage", "f32", length=2, unit="V", maximum=200.0),)
    (found,) = limit_breaches(readings_of(u1=meter()), {1: RegisterMap("x", rows)})
    assert found.unit == 1 and "Voltage" in found.text and "greatest value 200" in found.text


def test_troubles_are_causes_in_the_report(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A unit that hangs, polled with another that lives; a healthy pair has no cause."""
    for name, frozen in (("sick", 70), ("well", None)):
        tables = {1: meter(frozen=frozen), 2: meter(seed=5)}
        reads, now = [], 0
        for row in range(ROWS):
            for unit, table in tables.items():
                data = table[row].astype(">u2").tobytes()
                for frame in (bytes((unit, 4, 0, 100, 0, 9)), bytes((unit, 4, len(data))) + data):
                    now += 20_000_000
                    reads.append({"t_ns": now, "hex": adu(frame.hex()).hex()})
        path = tmp_path / f"{name}.jsonl"
        header = {"format": "serial-chunks", "version": 1, "baud": 19200, "char_bits": 11}
        path.write_text("".join(f"{json.dumps(line)}\n" for line in (header, *reads)))
        report = json.loads(ran(capsys, "report", path, "--values", "--json").out)
        causes = [(cause["cause"], cause["units"]) for cause in report["causes"]]
        assert causes == ([("frozen-values", [1])] if frozen else []), causes
