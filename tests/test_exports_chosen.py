"""Columns on demand: what `--fields` writes is what the whole row has, in every format, under every known name."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import Any

import orjson
import pytest
from running import ran, refused, spawned

import analyzer
from analyzer.exports.arrow import SCHEMA
from analyzer.exports.chosen import FRAME_COLUMNS
from analyzer.exports.records import TABLES
from captures import samples

BUS = samples.path("troubled.jsonl")


def _lines(capsys: pytest.CaptureFixture[str], *options: str | Path) -> list[dict[str, Any]]:
    done = ran(capsys, "export", BUS, *options)
    assert done.status == 0
    return [orjson.loads(line) for line in done.out.splitlines()]


def _rows(capsys: pytest.CaptureFixture[str], *options: str | Path) -> list[list[str]]:
    done = ran(capsys, "export", BUS, "--format", "csv", *options)
    assert done.status == 0
    return list(csv.reader(io.StringIO(done.out)))


def test_every_column_is_in_csv_and_in_json_and_says_the_same(capsys: pytest.CaptureFixture[str]) -> None:
    every = ",".join(FRAME_COLUMNS)
    names, *rows = _rows(capsys, "--fields", every)
    assert names == list(FRAME_COLUMNS)
    assert [names, *rows] == _rows(capsys)
    lines = _lines(capsys, "--fields", every)
    assert len(lines) == len(rows) > 100
    for line, row in zip(lines, rows, strict=True):
        assert list(line) == names
        for name, cell in zip(names, row, strict=True):
            assert _as_cell(name, line[name]) == cell.removeprefix("'"), name


def _as_cell(name: str, value: Any) -> str:
    match name:
        case "hex":
            return bytes.fromhex(value).hex(" ").upper()
        case "values":
            return " ".join(map(str, value))
        case "findings":
            return "; ".join(f"{finding['code']}: {finding['text']}" for finding in value)
        case "seconds" | "confidence":
            return f"{value:.6f}"
    return "" if value is None else str(value).lower() if isinstance(value, bool) else str(value)


@pytest.mark.parametrize(
    ("asked", "column"),
    [
        ("slave", "unit"),
        ("FC", "function"),
        ("modbus.func_code", "function"),
        ("mbrtu.unit_id", "unit"),
        ("modbus.reference_num", "address"),
        ("modbus.word_cnt", "quantity"),
        ("modbus.regval_uint16", "values"),
        ("frame.number", "index"),
        ("frame.time_relative", "seconds"),
        ("response-time", "response_time_ns"),
    ],
)
def test_names_of_the_filter_and_of_wireshark_are_understood(
    capsys: pytest.CaptureFixture[str], asked: str, column: str
) -> None:
    assert _rows(capsys, "--fields", asked) == _rows(capsys, "--fields", column)


@pytest.mark.parametrize("table", sorted(TABLES))
def test_other_tables_too(capsys: pytest.CaptureFixture[str], table: str) -> None:
    first, *_, last = TABLES[table].kinds
    lines = _lines(capsys, "--table", table, "--fields", f"{last},time,{first}", "-c", "7")
    whole = _lines(capsys, "--table", table)[:7]
    assert [(line[last], line[first]) for line in lines] == [(line[last], line[first]) for line in whole]
    assert all(list(line) == [last, "time", first] and line["time"].endswith("Z") for line in lines)
    assert _rows(capsys, "--table", table, "--fields", first, "-c", "7")[0] == [first]


def test_parquet_holds_the_chosen_columns_alone(tmp_path: Path) -> None:
    pq = pytest.importorskip("pyarrow.parquet")
    out = tmp_path / "out.parquet"
    analyzer.open(BUS).export(out, fields=("time", "unit", "hex", "values", "findings"))
    read = pq.read_table(out)
    assert read.column_names == ["t_start_ns", "unit", "bytes", "values", "findings"]
    whole = analyzer.open(BUS).to_arrow().select(read.column_names)
    assert read["values"].to_pylist() == whole["values"].to_pylist()
    assert {*SCHEMA.names} - {*FRAME_COLUMNS} == {"bytes", "area", "value_address"}


@pytest.mark.parametrize("count", [1, 7, 100])
@pytest.mark.parametrize("form", ["csv", "jsonl", "pcapng"])
def test_so_many_frames(tmp_path: Path, form: str, count: int) -> None:
    out = tmp_path / f"out.{form}"
    done = analyzer.open(BUS).export(out, count=count)
    assert done.frames == count
    if form != "pcapng":
        whole = tmp_path / f"whole.{form}"
        analyzer.open(BUS).export(whole)
        lines = out.read_bytes().splitlines()
        assert lines == whole.read_bytes().splitlines()[: count + (form == "csv")]


def test_a_count_is_of_what_passes(capsys: pytest.CaptureFixture[str]) -> None:
    lines = _lines(capsys, "--filter", "modbus.func_code in {3 4}", "-c", "3", "--fields", "function")
    assert len(lines) == 3
    assert {line["function"] for line in lines} <= {3, 4}


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--fields", "unti"), "did you mean unit?"),
        (("--fields", "colour"), "choose from kind, index, port"),
        (("--fields", ","), "name a column"),
        (("-c", "0"), "not a number of at least 1"),
        (("-c", "many"), "not a number of at least 1"),
        (("--fields", "unit", "--format", "pcapng", "-o", "x.pcapng"), "csv, jsonl and parquet"),
        (("-c", "3", "--format", "mcap", "-o", "x.mcap"), "cannot store a part"),
        (("--table", "findings", "--fields", "unit"), "choose from code, severity"),
        (("--table", "transactions", "--format", "csv", "--noise"), "--noise works with --table frames"),
        (("--table", "values", "--format", "csv", "--explain"), "--explain works with --table frames"),
        (("--format", "jsonl", "--delimiter", ";"), "--delimiter works with csv"),
        (("--table", "values", "--format", "jsonl", "--bom"), "--bom works with csv"),
    ],
)
def test_what_cannot_be_is_refused_in_a_line(
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    options: tuple[str, ...],
    words: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert words in refused(capsys, "export", BUS, *options)
    assert not list(tmp_path.iterdir())


def test_live_lines_have_columns_between_tabs() -> None:
    command: list[str | Path] = [
        "replay",
        BUS,
        "--speed",
        "max",
        "-c",
        "5",
        "--fields",
        "unit,modbus.func_code,summary",
    ]
    text, objects = spawned(*command).out, spawned(*command, "--json").out.splitlines()
    assert [line.split("\t") for line in text.splitlines()] == [
        [str(value) for value in orjson.loads(line).values()] for line in objects
    ]
    assert len(objects) == 5


@pytest.mark.parametrize("form", ["csv", "jsonl"])
def test_seconds_count_from_the_first_row_of_all_whatever_is_left_out(
    form: str, capsys: pytest.CaptureFixture[str]
) -> None:
    def seconds(*options: str) -> list[tuple[str, str]]:
        done = ran(capsys, "export", BUS, "--format", form, "--fields", "index,seconds", *options)
        if form == "csv":
            return [(row[0], row[1]) for row in csv.reader(io.StringIO(done.out))][1:]
        lines = map(orjson.loads, done.out.splitlines())
        return [(str(line["index"]), f"{line['seconds']:.6f}") for line in lines]

    every = dict(seconds())
    some = seconds("--filter", "index in (7, 40)")
    assert some == [(index, every[index]) for index in ("7", "40")] and float(some[0][1]) > 0
    assert every == {index: second for index, second in seconds("--noise") if index not in ("", "None")}
