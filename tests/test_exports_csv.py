"""CSV: one header, one row a frame, nothing that a spreadsheet would run."""

import csv

import pytest
from buses import LINE, adu, spaced
from running import ran

import captures
from analyzer.exports.targets.csv import COLUMNS, EXPLAINED, safe

REQUEST = adu("1103006b0003")
ANSWER = bytes.fromhex("110306ae415652434049ad")


def table(capsys, tmp_path, frames, *options):
    bus, out = tmp_path / "bus.jsonl", tmp_path / "frames.csv"
    captures.write(bus, spaced(frames), line=LINE)
    assert ran(capsys, "export", bus, "-o", out, *options).status == 0
    with out.open(newline="") as file:
        rows = list(csv.reader(file))
    return rows[0], [dict(zip(rows[0], row, strict=True)) for row in rows[1:]]


def test_a_row_a_frame(capsys, tmp_path):
    header, rows = table(capsys, tmp_path, [REQUEST, ANSWER, b"\xff\x00\xff", REQUEST, adu("118302")])
    assert tuple(header) == COLUMNS
    assert [row["direction"] for row in rows] == ["request", "response", "request", "response"]
    assert [row["exception"] for row in rows] == ["", "", "", "2"]
    assert rows[0]["seconds"] == "0.000000"
    assert rows[1]["hex"] == ANSWER.hex(" ").upper()
    assert (rows[1]["unit"], rows[1]["function"], rows[1]["crc_ok"]) == ("17", "3", "true")
    assert rows[1]["request_start"] == "0"


def test_noise_and_explain_only_add(capsys, tmp_path):
    header, rows = table(capsys, tmp_path, [REQUEST, ANSWER, b"\xff\x00\xff"], "--noise", "--explain")
    assert tuple(header) == COLUMNS + EXPLAINED
    assert [row["kind"] for row in rows] == ["frame", "frame", "noise"]
    assert (rows[2]["hex"], rows[2]["index"], rows[2]["unit"]) == ("FF 00 FF", "", "")
    assert float(rows[0]["margin"]) > 0


@pytest.mark.parametrize("text", ["=1+1", "+1", "-1", "@SUM(A1)", "\t=1", "\r=1"])
def test_a_formula_gets_an_apostrophe(text):
    assert safe(text) == "'" + text


def test_a_devices_string_is_no_formula(capsys, tmp_path):
    evil = b'=HYPERLINK("http://evil","x")'
    _, rows = table(capsys, tmp_path, [adu("1111"), adu("1111" + f"{len(evil):02x}" + evil.hex())])
    assert len(rows) == 2
    assert not any(cell.startswith(("=", "+", "-", "@")) for row in rows for cell in row.values())


def test_an_untimed_capture_has_no_times(capsys, tmp_path):
    log, out = tmp_path / "log.txt", tmp_path / "frames.csv"
    log.write_text(f"{REQUEST.hex(' ')}\n{ANSWER.hex(' ')}\n")
    assert ran(capsys, "export", log, "-o", out).status == 0
    row = next(csv.DictReader(out.read_text().splitlines()))
    assert (row["seconds"], row["t_start_ns"], row["t_end_ns"]) == ("", "", "")
