"""The two devices whose register maps are known whole, in `parse` and in MCAP, where ten lines plot a named value."""

from __future__ import annotations

import re
import struct
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from running import ran

from analyzer.simulation import Scenario, write
from analyzer.simulation.conversation import adu
from dissectors.maps import RegisterMap, shipped_map
from dissectors.maps.model import READ_FUNCTIONS

mcap_reader = pytest.importorskip("mcap.reader")
decoder = pytest.importorskip("mcap_protobuf.decoder")

DEVICES = {"el-psu": 1, "nl-16di": 2}
DOCS = Path(__file__).parents[1] / "docs" / "mcap.md"


def polls(chart: RegisterMap) -> list[tuple[str, int, int]]:
    """Blocks that hold every value of a map."""
    blocks: list[list[Any]] = []
    for row in sorted(chart.rows, key=lambda row: (row.area, row.address)):
        if blocks and blocks[-1][0] == row.area and row.address <= blocks[-1][2] and row.end - blocks[-1][1] <= 20:
            blocks[-1][2] = max(blocks[-1][2], row.end)
        else:
            blocks.append([row.area, row.address, row.end])
    return [(area, begin, end - begin) for area, begin, end in blocks]


@pytest.mark.parametrize("name", DEVICES)
def test_parse_shows_every_value_of_the_map(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    chart, frames = shipped_map(name), b""
    for area, address, quantity in polls(chart):
        function = READ_FUNCTIONS[area]  # type: ignore[index]
        size = (quantity + 7) // 8 if area in ("coil", "discrete") else 2 * quantity
        frames += adu(7, struct.pack(">BHH", function, address, quantity))
        frames += adu(7, bytes((function, size)) + b"\x41" * size)
    shown = ran(capsys, "parse", "--map", name, frames.hex()).out
    for row in chart.rows:
        assert re.search(rf"\b{re.escape(row.name)}\b", shown), row.name


@pytest.mark.parametrize("name", DEVICES)
def test_the_limits_and_remarks_of_a_map_are_shown(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    shown = ran(capsys, "map", "show", name).out.splitlines()
    bounded = [row for row in shipped_map(name).rows if row.maximum is not None and not row.values]
    remarked = [row for row in shipped_map(name).rows if row.description]
    assert bounded and remarked
    for row in bounded:
        assert any(row.name in line and f"{row.minimum:g} to {row.maximum:g}" in line for line in shown), row.name
    for row in remarked:
        assert any(row.name in line and line.endswith(row.description) for line in shown), row.name


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("two")
    maps = tuple(f"{name}@{unit}" for name, unit in DEVICES.items())
    write(Scenario("clean", "precise", transactions=400, seed=3, maps=maps), folder / "bus.jsonl")
    return folder / "bus.jsonl"


def test_every_value_that_was_asked_for_is_a_topic_in_its_unit(
    exported: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "bus.mcap"
    maps = [text for name, unit in DEVICES.items() for text in ("--map", f"{name}@{unit}")]
    assert ran(capsys, "export", exported, *maps, "-o", out).status == 0
    with out.open("rb") as file:
        reader = mcap_reader.make_reader(file, decoder_factories=[decoder.DecoderFactory()])
        topics = {channel.topic: schema.name for schema, channel, _, _ in reader.iter_decoded_messages()}
    asked = [
        line for line in (exported.parent / "bus.registers.jsonl").read_text(encoding="utf-8").splitlines() if line
    ]
    assert asked
    for name, unit in DEVICES.items():
        for row in shipped_map(name).rows:
            polled = any(f'"unit":{unit},' in line.replace(" ", "") and f'"{row.name}"' in line for line in asked)
            if row.type != "text" and polled:
                assert f"/unit/{unit}/values/{row.name.replace(' ', '_').replace('-', '_')}" in topics, row.name


def test_the_ten_lines_of_the_docs_plot_a_named_value(
    exported: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert ran(capsys, "export", exported, "--map", "el-psu@1", "-o", tmp_path / "bus.mcap").status == 0
    lines = DOCS.read_text(encoding="utf-8").rpartition("```python\n")[2].partition("```")[0]
    assert len([line for line in lines.splitlines() if line.strip()]) <= 10
    drawn: list[tuple[tuple[float, ...], tuple[float, ...]]] = []
    pyplot = ModuleType("matplotlib.pyplot")
    pyplot.plot = lambda times, values: drawn.append((times, values))  # type: ignore[attr-defined]
    pyplot.show = lambda: None  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "matplotlib", ModuleType("matplotlib"))
    monkeypatch.setitem(sys.modules, "matplotlib.pyplot", pyplot)
    sys.modules["matplotlib"].pyplot = pyplot  # type: ignore[attr-defined]
    monkeypatch.chdir(tmp_path)
    exec(lines, {})
    ((times, values),) = drawn
    assert len(times) > 10 and list(times) == sorted(times) and all(0 <= value <= 0xFFFF for value in values)
