"""Values by their names in what people read: the report, its page and JSON, and the lines of a bus as it happens."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from running import ran

import analyzer
from analyzer.registers.watch import ValueWatch
from analyzer.simulation import Scenario, write
from dissectors.maps import shipped_map

MAPS = ("--map", "eastron-sdm630@1", "--map", "xy-md02@7")


@pytest.fixture(scope="module")
def bus(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("values") / "bus.jsonl"
    write(Scenario("clean", "precise", transactions=200, seed=1, maps=MAPS[1::2]), path)
    return path


def test_a_report_lists_the_values_of_a_map(bus: Path, capsys: pytest.CaptureFixture[str]) -> None:
    report = json.loads(ran(capsys, "report", bus, *MAPS, "--json").out)
    told = ran(capsys, "export", bus, "--table", "values", *MAPS, "--format", "jsonl", "-o", "-").out
    rows = [json.loads(line) for line in told.splitlines()]
    volts = [row["value"] for row in rows if row["name"] == "Voltage L1"]
    found = next(value for value in report["values"] if value["name"] == "Voltage L1")
    assert (found["unit"], found["area"], found["address"], found["unit_of_measure"]) == (1, "input", 0, "V")
    assert found["readings"] == len(volts)
    assert found["minimum"] == pytest.approx(min(volts)) and found["maximum"] == pytest.approx(max(volts))
    assert found["mean"] == pytest.approx(sum(volts) / len(volts))
    number, unit = found["last"].split()
    assert float(number) == pytest.approx(volts[-1], rel=1e-6)
    assert (unit, found["confidence"]) == ("V", 1)
    page = ran(capsys, "report", bus, *MAPS).out
    assert any(line.split()[:3] == ["1", "Voltage", "L1"] for line in page.splitlines())
    assert max(map(len, page.splitlines())) <= 80
    html = bus.with_suffix(".html")
    assert ran(capsys, "report", bus, *MAPS, "--html", html, "--overwrite").status == 0
    assert "<h2>Values</h2>" in html.read_text(encoding="utf-8") and found["last"] in html.read_text()


def test_without_a_map_only_what_is_sure_and_asked_for(bus: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plain = json.loads(ran(capsys, "report", bus, "--json").out)
    assert plain["values"] == []
    values = json.loads(ran(capsys, "report", bus, "--values", "--json").out)["values"]
    assert len(values) > 10 and all(value["confidence"] >= 0.95 and not value["name"] for value in values)
    mapped = json.loads(ran(capsys, "report", bus, "--values", *MAPS[2:], "--json").out)["values"]
    assert {value["name"] for value in mapped if value["unit"] == 7} == {
        row.name for row in shipped_map("xy-md02").rows if row.name in {value["name"] for value in mapped}
    }
    assert any(value["unit"] == 1 and not value["name"] for value in mapped)


def test_pieces_give_the_whole(bus: Path) -> None:
    charts = {1: shipped_map("eastron-sdm630")}
    whole, pieces = ValueWatch(charts), ValueWatch(charts)
    for batch in analyzer.open(bus).batches():
        whole.feed(batch)
        for first in range(0, len(batch), 50):
            from analyzer.filters import BatchTable

            pieces.feed(BatchTable(batch, analyzer.open(bus).line).batch(first, min(first + 50, len(batch))))
    for one, other in zip(whole.values(), pieces.values(), strict=True):
        assert (one.name, one.readings, one.minimum, one.last) == (
            other.name,
            other.readings,
            other.minimum,
            other.last,
        )


def test_lines_as_they_happen(bus: Path, capsys: pytest.CaptureFixture[str]) -> None:
    replay = ("replay", bus, "--speed", "max")
    done = ran(capsys, *replay, *MAPS)
    assert done.status == 0
    assert any("registers: Voltage L1 " in line and " V, Voltage L2 " in line for line in done.out.splitlines())
    lines = [json.loads(line) for line in ran(capsys, *replay, "--json", *MAPS).out.splitlines()]
    named = {value["name"] for line in lines for value in line.get("mapped", ())}
    assert {"Voltage L1", "Temperature"} <= named
    assert all("mapped" not in json.loads(line) for line in ran(capsys, *replay, "--json").out.splitlines())
    hot = ran(capsys, *replay, "--filter", "value(Temperature) > -100", *MAPS)
    frames = [line for line in hot.out.splitlines() if " < " in line]
    assert frames and all("Temperature" in line for line in frames)


def test_in_python_and_as_arrow(bus: Path) -> None:
    named = analyzer.open(bus).with_maps(*MAPS[1::2])
    rows = [row for row in named.records("values") if row["name"] == "Voltage L1"]
    assert rows and all(row["unit_of_measure"] == "V" for row in rows)
    assert {value.name for value in named.report().values} >= {"Voltage L1", "Temperature"}
    high = sorted(row["value"] for row in rows)[-1]
    assert len(list(named.filter(f'value("Voltage L1") >= {high:.4f} V').frames())) >= 1
    pytest.importorskip("pyarrow")
    table = named.to_arrow("values")
    assert table.column("value").to_pylist() == [row["value"] for row in named.records("values")]
    assert analyzer.open(bus).to_arrow().num_rows > 0
