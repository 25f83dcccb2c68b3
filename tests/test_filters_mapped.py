"""Filters and rules on values that register maps name."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from buses import adu, table
from running import ran, refused

import analyzer
import captures
from analyzer.filters import BatchTable, FilterError, compile_filter
from analyzer.simulation import Scenario, write
from captures.chunks import Capture, Chunk
from captures.line import LineSettings
from dissectors.maps import RegisterMap, shipped_map
from dissectors.maps.files import UnitMaps
from dissectors.maps.model import MappedValue, factor_between, readings_by_map

MAPS = ("eastron-sdm630@1", "xy-md02@7")
CHARTS = UnitMaps({1: shipped_map("eastron-sdm630"), 7: shipped_map("xy-md02")})


@pytest.fixture(scope="module")
def bus(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("mapped") / "bus.jsonl"
    write(Scenario("clean", "precise", transactions=200, seed=1, maps=MAPS), path)
    return path


def passing(bus: Path, text: str) -> set[int]:
    """The frames that pass."""
    chosen, found = compile_filter(text, charts=CHARTS), set()
    opened = analyzer.open(bus)
    for batch in opened.batches():
        found |= set(batch.rows.index[chosen.mask(BatchTable(batch, opened.line))].tolist())
    return found


def told(bus: Path, name: str) -> dict[int, float]:
    """The value of this name by frame, read one by one."""
    found = {}
    for frame in analyzer.open(bus).frames():
        request = frame.request_bytes
        if frame.direction != "response" or frame.exception or request is None:
            continue
        area = {3: "holding", 4: "input"}.get(frame.function)
        chart = CHARTS.get(frame.unit)
        if area is None or chart is None:
            continue
        first, data = int.from_bytes(request[2:4], "big"), frame.captured[3:-2]
        words = {first + n: int.from_bytes(data[2 * n : 2 * n + 2], "big") for n in range(len(data) // 2)}
        for reading in readings_by_map(chart, area, words):
            if reading.row.name == name:
                assert isinstance(reading.value, int | float)
                found[frame.index] = reading.value
    return found


def test_a_value_by_its_name_as_one_reads_it(bus: Path) -> None:
    volts = told(bus, "Voltage L1")
    middle = float(np.mean(list(volts.values())))
    assert passing(bus, 'value("Voltage L1")') == set(volts)
    for text in (f"> {middle:.4f}", f"> {middle / 1000:.7f} kV", f">= {middle:.4f} V"):
        expected = {index for index, value in volts.items() if value > round(middle, 4)}
        assert passing(bus, f'value("voltage l1") {text}') == expected and expected
    assert passing(bus, 'value("Voltage L1") in 0 V..1 kV') == set(volts)
    assert passing(bus, f'unit == 1 and not value("Voltage L1") > {middle:.4f}') & set(volts)
    warm = told(bus, "Temperature")
    one = next(iter(warm.values()))
    assert passing(bus, f'value("Temperature") == {one:g} degC') == {i for i, v in warm.items() if v == one}
    assert passing(bus, f'value("Temperature") != {one:g}') == {i for i, v in warm.items() if v != one}


def test_names_and_patterns(bus: Path) -> None:
    every = set().union(*(told(bus, f"Voltage L{n}") for n in (1, 2, 3)))
    assert passing(bus, 'value("Voltage L?") > 100') == every
    assert passing(bus, 'name contains "voltage l"') >= every
    assert passing(bus, "value(Temperature) and value(Humidity)") <= passing(bus, "name == temperature")
    assert passing(bus, "name") == passing(bus, "name matches '*'")


def test_states_by_their_names_and_wide_numbers() -> None:
    rows = (
        MappedValue("holding", 0, "Mode", "enum", values={0: "off", 2: "stand by"}),
        MappedValue("holding", 1, "Energy", "u32", "CDAB", 2, scale=0.01, unit="kWh"),
    )
    charts = UnitMaps(other=RegisterMap("x", rows))
    frames = [adu("030300000003"), adu("030306000286A00001")]
    reads = [Chunk(20_000_000 * (n + 1), frame) for n, frame in enumerate(frames)]
    seen = table(Capture.of(LineSettings(baud=19200, char_bits=11, tap="irq"), reads))
    for text, expected in (
        ('value("Mode") == "Stand by"', [False, True]),
        ('value("Mode") == off', [False, False]),
        ('value("Energy") == 1 MWh', [False, True]),
        ('value("Energy") > 1000000.1 Wh', [False, False]),
        ('value("Energy") in (5 kWh, 1 MWh..2 MWh)', [False, True]),
    ):
        assert compile_filter(text, charts=charts).mask(seen).tolist() == expected, text


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ('value("Voltag L1") > 3', "no map has a value 'Voltag L1'; did you mean voltage l1"),
        ('value("Voltage L1") > 3 kW', "kW does not measure it: it is in V"),
        ('power("x") > 1', 'only value("NAME") takes a name'),
        ('value("Voltage L1") contains 3', "expected"),
        ('value("Voltage L1") == blue', "no state 'blue'"),
        ('value("Voltage L1") in 5 V..3 W', "does not measure it"),
    ],
)
def test_mistakes_are_told_at_once(text: str, expected: str) -> None:
    with pytest.raises(FilterError, match=expected.replace("(", r"\(").replace(")", r"\)")):
        compile_filter(text, charts=CHARTS)
    with pytest.raises(FilterError):
        compile_filter(text)


def test_units_of_measure() -> None:
    for one, other, factor in (
        ("kW", "W", 1000), ("V", "V", 1), ("mA", "A", 0.001), ("kwh", "Wh", 1000), ("MWh", "kWh", 1000),
        ("°C", "degC", 1), ("m3/h", "m3/h", 1), ("kvar", "VAr", 1000), ("W", "V", None), ("", "V", None), ("", "", 1),
    ):  # fmt: skip
        assert factor_between(one, other) == (None if factor is None else pytest.approx(factor)), (one, other)


def test_in_commands(bus: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    maps = [part for text in MAPS for part in ("--map", text)]
    done = ran(capsys, "export", bus, *maps, "--filter", 'value("Voltage L1")', "-o", "-")
    assert done.status == 0 and len(done.out.splitlines()) == len(told(bus, "Voltage L1"))
    assert "needs a register map: --map" in refused(capsys, "export", bus, "--filter", "value(x) > 3", "-o", "-")
    rules = ["--rule", 'all where value("Voltage L1"): value("Voltage L1") in 1..1000 V']
    assert ran(capsys, "check", bus, *maps, *rules).status == 0
    assert ran(capsys, "check", bus, *maps, "--rule", 'none where value("Voltage L1") > 1 V').status == 1
    limits = ["--rule", "values in their limits"]
    assert "unknown: it needs a register map" in ran(capsys, "check", bus, *limits).out
    mine = tmp_path / "mine.csv"
    for most, status, text in ((1000, 0, "0 readings outside"), (2, 1, "Voltage is ")):
        mine.write_text(f"area,address,name,type,unit,min,max\ninput,0,Voltage,f32,V,0,{most}\n")
        done = ran(capsys, "check", bus, "--map", f"{mine}@1", *limits)
        assert done.status == status and text in done.out, done
    rule = tmp_path / "rules.toml"
    rule.write_text('[[rule]]\ncheck = "none where value(Temperature) > 200"\n')
    assert ran(capsys, "check", bus, *maps, "--rules", rule).status == 0


def test_in_the_model_of_the_interface(bus: Path) -> None:
    """The interface's filter on its own columns passes the same rows as that of the exports."""
    from analyzer.model.bus import Bus
    from analyzer.model.selection import compiled
    from analyzer.model.source import CaptureSource

    capture = captures.open(bus)
    source = CaptureSource(capture, "bus")
    model = Bus.of(source)
    for analysed in source.steps(lambda: False):
        model.feed(analysed)
    model.close()
    for text in ('value("Frequency") > 10', 'name contains "Voltage"', 'unit == 7 and value("Humidity") < 1000 %'):
        test, found = compiled(text, source.line, CHARTS).test, set()
        for number, low, high in model.table.slices(0, model.count):
            rows = np.flatnonzero(test(model, number, low, high)) + low
            found |= set(model.table.column(number, "frame")[rows].tolist())
        assert found == passing(bus, text) and found, text
    with pytest.raises(FilterError, match="map"):
        compiled('value("Frequency") > 10', source.line)
