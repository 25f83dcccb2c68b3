"""Register maps of people one does not know: what is wrong in them is one clear line, at once, and nothing else."""

from __future__ import annotations

import io
import json
import zipfile
from pathlib import Path

import pytest
from running import ran, refused
from scripts import package

from analyzer.simulation import Scenario, write
from dissectors.maps import MapError, read_map
from dissectors.maps.importers import import_maps

ALIASES = "a: &a [x,x,x,x,x,x,x,x,x]\n" + "".join(
    f"{chr(98 + n)}: &{chr(98 + n)} [{','.join(['*' + chr(97 + n)] * 9)}]\n" for n in range(9)
)


@pytest.mark.parametrize("only", ["register maps", "map workbooks", "panels"])
def test_no_input_of_the_fuzz_harms(only: str) -> None:
    pytest.importorskip("resource", reason="processes are weighed as POSIX does")
    outcome = package("attack.fuzz").attack(11, 300 if only != "map workbooks" else 20, only=only, patience=10)
    assert not outcome.failures, outcome.failures[0]
    assert outcome.tried


HARMS = {
    "aliases.yaml": (f"{ALIASES}registers:\n - {{area: input, address: 1, name: *j}}", "written out"),
    "cycle.yaml": ("registers: &a [{area: input, address: 1, name: *a}]", "written out"),
    "deep.yaml": ("registers: " + "[" * 100_000, "nested too deeply"),
    "deep.json": ('{"id": 1, "group": ' + "[" * 100_000, "nested too deeply"),
    "deep.toml": ("a = " + "[" * 100_000, "nested too deeply"),
    "date.yaml": ("registers: [{area: input, address: 1, name: 2026-13-45}]", "cannot be read|month"),
    "digits.yaml": (f"registers: [{{area: input, address: {'9' * 5000}, name: a}}]", "digit|whole number"),
    "nested.yaml": ("registers: [{area: input, address: 1, name: [a, b]}]", "row 1: name is 'list': expected a text"),
    "comments.json": ('{"a":' + "/*" * 1_000_000, "no JSON: line 1"),
    "quotes.json": ('{"a":' + '"\\' * 1_000_000, "no JSON: line 1"),
    "quotes.py": ('"\\' * 500_000, "no(t a known| JSON)"),
    "brackets.py": ("([" * 500_000, "not a known register map"),
    "tabs.txt": (("a" + "\t" * 290 + "\n") * 300, "not a known register map"),
    "newlines.txt": ("\n" * 1_000_000, "not a known register map"),
    "blanks.txt": (" " * 1_000_000, "not a known register map"),
    "words.txt": ("and register 1 " * 70_000, "not a known register map"),
    "entities.xml": ('<!DOCTYPE a [<!ENTITY b "x">]><a>&b;</a>', "not a known register map"),
    "deep.xml": ("<a>" * 100_000, "not a known register map"),
    "state.csv": ("area,address,name,values\ninput,1,a," + "9" * 30 + "=x\n", "row 2: values is '9+': expected states"),
    "none.csv": ("modbus register,name\nnothing,Voltage\n", "it has no registers: row 2: 'nothing' is not an address"),
}  # fmt: skip


@pytest.mark.parametrize("file", HARMS)
def test_what_would_harm_is_one_line(file: str, tmp_path: Path) -> None:
    text, expected = HARMS[file]
    path = tmp_path / file
    path.write_text(text, encoding="utf-8")
    with pytest.raises(MapError, match=expected) as raised:
        if path.suffix in (".json", ".toml", ".py", ".txt", ".xml") or file == "none.csv":
            import_maps(file, text.encode())
        else:
            read_map(path)
    assert "\n" not in str(raised.value) and file in str(raised.value)


def test_what_repeats_without_end_ends() -> None:
    group = {"name": "g", "count": 10**9, "points": [], "groups": [{"name": "h", "count": 10**9}]}
    model = {"id": 1, "group": {"points": [{"name": "a", "type": "uint16"}], "groups": [group]}}
    assert len(import_maps("x.json", json.dumps(model).encode())[0].chart.rows) == 1
    hub = b"modbus: [{name: h, sensors: [{name: a, address: 65530, virtual_count: 1000000000}]}]"
    (found,) = import_maps("x.yaml", hub)
    assert len(found.chart.rows) == 6 and any("expected 0 to 65535" in note for note in found.notes)


def test_a_workbook_that_grows_is_refused() -> None:
    pytest.importorskip("openpyxl")
    good, bad = package("attack.mapfiles").workbook([["Address", "Name"], [5, "x"]]), io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(good)) as packed, zipfile.ZipFile(bad, "w", zipfile.ZIP_DEFLATED) as out:
        for name in packed.namelist():
            out.writestr(name, packed.read(name) if "sheet1" not in name else b" " * (257 << 20))
    assert import_maps("x.xlsx", good)[0].chart.rows[0].address == 5
    with pytest.raises(MapError, match="too large once unpacked"):
        import_maps("x.xlsx", bad.getvalue())


def test_a_cell_of_several_lines_is_one_line() -> None:
    text = 'area,address,name,values\ninput,1,"Voltage\nof L1","0=off\n1=on"\n'
    (row,) = import_maps("x.csv", text.encode())[0].chart.rows
    assert (row.name, row.values) == ("Voltage of L1", {0: "off", 1: "on"})


def test_no_map_is_written_over_unasked(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bus, out, source = tmp_path / "bus.jsonl", tmp_path / "out.csv", tmp_path / "mine.csv"
    write(Scenario("clean", "precise", transactions=40, seed=5, maps=("xy-md02@4",)), bus)
    source.write_text("area,address,name\ninput,1,Voltage\n")
    for command in (("import", source), ("infer", bus)):
        out.write_text("mine")
        assert "already exists: give another name, or --overwrite" in refused(capsys, "map", *command, "-o", out)
        assert out.read_text() == "mine"
        assert "being read" in refused(capsys, "map", *command, "-o", command[1], "--overwrite")
        done = ran(capsys, "map", *command, "-o", out, "--overwrite")
        assert done.status == 0 and read_map(out).rows, done
