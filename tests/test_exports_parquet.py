"""Parquet read back says what the JSON lines say; so do the tables of a notebook."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import orjson
import pytest
from buses import LINE, adu, spaced, streams
from hypothesis import HealthCheck, given, settings
from running import environment, refused

import analyzer
import captures
from analyzer.exports import ExportOptions, export, rowgroups
from captures import Capture
from captures.samples import path
from dissectors.crc import lrc

pq = pytest.importorskip("pyarrow.parquet")
tables = pytest.importorskip("analyzer.exports.arrow")

SHARED = (
    "index", "start", "length", "t_start_ns", "t_end_ns", "protocol", "direction", "unit", "function", "name",
    "exception", "crc_ok", "request_start", "taken_for_start", "unsure", "response_time_ns",
)  # fmt: skip
SAMPLES = ["healthy.jsonl", "troubled.jsonl", "mbpoll.mcap"]


def plain_rows(table: Any) -> list[dict[str, Any]]:
    """Rows with their times as integers: Python's own times know no nanoseconds."""
    times = [name for name in table.schema.names if name in ("t_start_ns", "t_end_ns", "t_ns")]
    assert all(str(table.schema.field(name).type) == "timestamp[ns, tz=UTC]" for name in times)
    for name in times:
        table = table.set_column(table.schema.get_field_index(name), name, table[name].cast("int64"))
    rows: list[dict[str, Any]] = table.to_pylist()
    return rows


def both(capture: Any, folder: Path, **options: Any) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """The rows of the Parquet file and the JSON lines of a capture."""
    export(capture(), folder / "out.parquet", options=ExportOptions(**options))
    export(capture(), folder / "out.jsonl", options=ExportOptions(**options))
    rows = plain_rows(pq.read_table(folder / "out.parquet"))
    return rows, [orjson.loads(line) for line in (folder / "out.jsonl").read_bytes().splitlines()]


def agree(rows: list[dict[str, Any]], lines: list[dict[str, Any]]) -> None:
    assert len(rows) == len(lines)
    for row, line in zip(rows, lines, strict=True):
        assert row["bytes"].hex() == line["hex"]
        assert row["port"] == line.get("port", 0)
        if row["kind"] == "noise":
            assert line["kind"] == "noise"
            assert [row[key] for key in ("start", "length", "t_start_ns")] == [
                line[key] for key in ("start", "length", "t_start_ns")
            ]
            assert row["index"] is row["unit"] is row["protocol"] is row["crc_ok"] is row["address"] is None
            continue
        assert {key: row[key] for key in SHARED} == {key: line[key] for key in SHARED}
        assert row["confidence"] == pytest.approx(line["confidence"], abs=1e-6)
        assert row["findings"] == [finding["code"] for finding in line["findings"]]
        children = [child for field in line["fields"] for child in field.get("fields", ())]
        values = [int(child["value"]) for child in children if child["name"] in ("register", "coil", "input")]
        if values:
            assert row["values"] == values


@pytest.mark.parametrize("name", SAMPLES)
@pytest.mark.parametrize("noise", [False, True])
def test_read_back_it_is_the_lines(tmp_path: Path, name: str, noise: bool) -> None:
    rows, lines = both(lambda: captures.open(path(name)), tmp_path, noise=noise)
    agree(rows, lines)
    assert len(rows) > 10


@settings(deadline=None, max_examples=15, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(chunks=streams())
def test_any_bytes(tmp_path: Path, chunks: Any) -> None:
    agree(*both(lambda: Capture.of(LINE, chunks), tmp_path, noise=True, explain=True))


def test_reasons_are_columns(tmp_path: Path) -> None:
    rows, lines = both(lambda: captures.open(path("troubled.jsonl")), tmp_path, noise=True, explain=True)
    assert any(row["kind"] == "frame" for row in rows)
    for row, line in zip(rows, lines, strict=True):
        if row["kind"] == "frame":
            why = line["explain"]
            found = [row[f"bits_{key}"] for key in ("length", "crc", "silence", "conversation")] + [row["margin"]]
            due = [why[key] for key in ("length", "crc", "silence", "conversation", "margin")]
            assert found == pytest.approx(due, abs=0.006)
            rival = {key: row[f"runner_up_{key}"] for key in ("start", "length")} | {"kind": row["runner_up"]}
            assert rival == why["runner_up"]


def test_ascii_bytes_are_what_the_digits_stand_for(tmp_path: Path) -> None:
    text = b""
    for body in map(bytes.fromhex, ("1103006B0003", "110306AE4156524340")):
        text += b":" + (body + bytes([lrc(body)])).hex().upper().encode() + b"\r\n"
    rows, lines = both(lambda: Capture.of(LINE, spaced([text])), tmp_path)
    agree(rows, lines)
    assert [row["protocol"] for row in rows] == ["ascii", "ascii"]
    assert rows[1]["values"] == [0xAE41, 0x5652, 0x4340]


def test_row_groups_end_with_so_many_rows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rowgroups, "GROUP", 100)
    request, answer = adu("1103006b0003"), bytes.fromhex("110306ae415652434049ad")
    chunks = spaced([request, answer] * 40_000)
    export(Capture.of(LINE, chunks), tmp_path / "out.parquet")
    file = pq.ParquetFile(tmp_path / "out.parquet")
    assert file.metadata.num_rows == 80_000
    assert file.metadata.num_row_groups > 1
    assert file.read(["index"]).column("index").to_pylist() == list(range(80_000))


def test_stopped_it_is_complete_as_far_as_it_came(tmp_path: Path) -> None:
    asked: list[int] = []
    done = export(
        captures.open(path("healthy.jsonl")),
        tmp_path / "out.parquet",
        progress=lambda frames, _octets: asked.append(frames),
        stop=lambda: bool(asked),
    )
    assert done.partial
    assert pq.read_table(tmp_path / "out.parquet").num_rows == done.frames == asked[-1]


def test_without_pyarrow_one_line_says_what_to_install(
    capsys: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    said = refused(capsys, "export", path("healthy.jsonl"), "-o", tmp_path / "out.parquet")
    assert said.startswith("parquet needs pyarrow: ")
    assert "[columns]" in said
    assert list(tmp_path.iterdir()) == []


def test_a_notebooks_tables() -> None:
    bus = analyzer.open(path("healthy.jsonl"))
    made = bus.to_arrow()
    assert made.schema == tables.SCHEMA
    assert made.column("index").to_pylist() == [frame.index for frame in bus.frames()]
    assert bus.to_arrow(noise=True).num_rows == len(bus.rows())


def test_tables_do_without_pandas() -> None:
    """It costs 0.3 s and 40 MiB, and pyarrow imports it to look whether an array is one of its series."""
    code = f"""
import sys, analyzer
print(analyzer.open({str(path("troubled.jsonl"))!r}).to_arrow(noise=True).num_rows > 100, "pandas" in sys.modules)
"""
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env=environment(), timeout=60, check=True
    )
    assert done.stdout.split() == ["True", "False"]


@pytest.mark.parametrize("name", ["polars", "pandas"])
def test_data_frames(name: str) -> None:
    pytest.importorskip(name)
    bus = analyzer.open(path("healthy.jsonl"))
    made = getattr(bus, f"to_{name}")()
    assert list(made["name"]) == [frame.name for frame in bus.frames()]


@pytest.mark.parametrize(("name", "said"), [("pyarrow", "[columns]"), ("polars", "pip install polars")])
def test_what_is_missing_is_said(name: str, said: str) -> None:
    code = f"""
import sys
sys.modules[{name!r}] = None
import analyzer
try:
    analyzer.open({str(path("mbpoll.mcap"))!r}).to_{"arrow" if name == "pyarrow" else name}()
except ImportError as error:
    print(error)
"""
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env=environment(), timeout=60, check=True
    )
    assert said in done.stdout
