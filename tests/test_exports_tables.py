"""The tables beside the frames: one set of names and values, whichever format or call gives them."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import orjson
import pytest
from running import ran, refused

import analyzer
from analyzer.exports.records import TABLES
from captures import samples

BUS = samples.path("troubled.jsonl")


@pytest.mark.parametrize("table", sorted(TABLES))
def test_lines_and_python_say_the_same(table: str, tmp_path: Path) -> None:
    out = tmp_path / "out.jsonl"
    analyzer.open(BUS).export(out, table=table)
    lines = [orjson.loads(line) for line in out.open("rb")]
    assert lines == list(analyzer.open(BUS).records(table))
    assert len(lines) > 20
    assert all(list(line) == list(TABLES[table].kinds) for line in lines)


@pytest.mark.parametrize("table", sorted(TABLES))
def test_csv_says_what_the_lines_say(table: str, tmp_path: Path) -> None:
    out = tmp_path / "out.csv"
    analyzer.open(BUS).export(out, table=table)
    rows = list(csv.DictReader(io.StringIO(out.read_text(encoding="utf-8"))))
    for row, line in zip(rows, analyzer.open(BUS).records(table), strict=True):
        for name, kind in TABLES[table].kinds.items():
            value = line[name]
            text = "" if value is None else str(value).lower() if kind == "flag" else str(value)
            assert row[name].removeprefix("'") == text


@pytest.mark.parametrize("table", sorted(TABLES))
def test_parquet_has_proper_types(table: str, tmp_path: Path) -> None:
    pq = pytest.importorskip("pyarrow.parquet")
    out = tmp_path / "out.parquet"
    analyzer.open(BUS).export(out, table=table)
    read = pq.read_table(out)
    for name, kind in TABLES[table].kinds.items():
        assert str(read.schema.field(name).type) == {
            "integer": "int64", "number": "double", "text": "string", "flag": "bool", "time": "timestamp[ns, tz=UTC]",
        }[kind]  # fmt: skip
        values = read[name].cast("int64").to_pylist() if kind == "time" else read[name].to_pylist()
        assert values == [line[name] for line in analyzer.open(BUS).records(table)]


def test_transactions_are_those_of_the_analysis() -> None:
    bus = analyzer.open(BUS)
    assert [line["request"] for line in bus.records("transactions")] == bus.transactions().request.tolist()


def test_a_filter_narrows_every_call() -> None:
    bus = analyzer.open(BUS).filter("unit == 2").filter("exception")
    assert {frame.unit for frame in bus.frames()} == {2}
    assert all(frame.exception for frame in bus.frames())
    assert bus.report().frames == len(list(bus.frames())) == len(bus.rows()) > 0
    assert {line["unit"] for line in bus.records("transactions")} == {2}
    assert "unit == 2" in repr(bus)


def test_a_spreadsheet_gets_its_delimiter_and_its_mark(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    for table in ("frames", "transactions"):
        plain, other = tmp_path / f"{table}.csv", tmp_path / f"{table}-other.csv"
        assert ran(capsys, "export", BUS, "--table", table, "-o", plain).status == 0
        assert ran(capsys, "export", BUS, "--table", table, "-o", other, "--delimiter", ";", "--bom").status == 0
        assert other.read_bytes().startswith(b"\xef\xbb\xbf")
        theirs = list(csv.reader(io.StringIO(other.read_text(encoding="utf-8-sig")), delimiter=";"))
        assert theirs == list(csv.reader(io.StringIO(plain.read_text(encoding="utf-8"))))


@pytest.mark.parametrize("wrong", ["", ";;", "\n", '"', "д"])
def test_a_delimiter_is_one_character(capsys: pytest.CaptureFixture[str], wrong: str) -> None:
    assert "--delimiter" in refused(capsys, "export", BUS, "--format", "csv", "--delimiter", wrong)


def test_a_table_that_no_format_can_hold_is_refused(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    said = refused(capsys, "export", BUS, "--table", "values", "-o", tmp_path / "out.pcapng")
    assert "csv, jsonl, parquet" in said


def test_csv_of_frames_has_address_quantity_values_and_a_clock(tmp_path: Path) -> None:
    out = tmp_path / "out.csv"
    analyzer.open(samples.path("healthy.jsonl")).export(out)
    rows = list(csv.DictReader(out.open()))
    read, answer = rows[0], rows[1]
    assert (read["address"], read["quantity"]) == (answer["address"], answer["quantity"])
    assert len(answer["values"].split()) == int(read["quantity"])
    assert read["time"].startswith("2026-") and read["time"].endswith("Z")
