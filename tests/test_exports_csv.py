"""CSV: one header, one row a frame, nothing that a spreadsheet would run."""

import csv
import io

import pytest
from buses import LINE, adu, spaced
from declaring import declared
from hypothesis import given, settings
from hypothesis import strategies as st
from pdus import CASES, VENDOR, batches, vendor_batches
from running import ran

import captures
from analyzer.exports import ExportOptions
from analyzer.exports.chosen import FRAME_COLUMNS as COLUMNS
from analyzer.exports.sink import OutputStream
from analyzer.exports.targets.csv import EXPLAINED, open_sink, safe
from analyzer.tables.batch import Batch
from captures import Capture
from dissectors.functions import load_file

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


def due(batch: Batch, zero: int) -> list[dict[str, str]]:
    """The cells by way of each frame."""
    found = []
    for frame in batch.frames():
        cells: dict[str, object] = {
            "kind": "frame", "index": frame.index, "port": frame.port, "start": frame.start, "length": frame.length,
            "seconds": f"{(frame.t_start_ns - zero) / 1e9:.6f}", "t_start_ns": frame.t_start_ns,
            "t_end_ns": frame.t_end_ns, "protocol": frame.protocol, "direction": frame.direction, "unit": frame.unit,
            "function": frame.function, "name": safe(frame.name), "exception": frame.exception,
            "crc_ok": str(frame.crc_ok).lower(), "request_start": frame.request_start,
            "response_time_ns": frame.response_time_ns, "confidence": f"{frame.confidence:.6f}",
            "hex": frame.adu.data.hex(" ").upper(), "summary": safe(frame.summary()),
            "findings": "; ".join(f"{finding.code}: {finding.text}" for finding in frame.findings),
        }  # fmt: skip
        low, high = frame.response_time_bounds_ns or (None, None)
        cells |= {"response_time_low_ns": low, "response_time_high_ns": high}
        cells |= {"taken_for_start": frame.taken_for_start, "unsure": str(frame.unsure).lower()}
        found.append({key: "" if value is None else str(value) for key, value in cells.items()})
    return found


def without_contents(rows: list[dict[str, str]]) -> list[dict[str, str]]:
    """Rows without clock, address, quantity and values, which `tests/test_exports_tables.py` looks at."""
    return [{k: v for k, v in row.items() if k not in ("time", "address", "quantity", "values")} for row in rows]


def written(batch: Batch) -> list[dict[str, str]]:
    stream = io.BytesIO()
    sink = open_sink(OutputStream(stream), Capture.of(LINE, spaced([b""])), ExportOptions())
    sink.rows(batch, 0, len(batch))
    return list(csv.DictReader(io.StringIO(stream.getvalue().decode(), newline="")))


@pytest.mark.parametrize("code", sorted({code for code, _ in CASES}), ids=lambda v: f"{v:02X}")
def test_every_function_reads_as_its_frames_do(code):
    @given(batches(code))
    @settings(deadline=None, max_examples=25)
    def check(batch):
        assert without_contents(written(batch)) == due(batch, int(batch.rows.t_start_ns[0]))

    check()


@given(data=st.data())
@settings(deadline=None, max_examples=40)
def test_vendors_functions_read_as_their_frames_do(tmp_path_factory, data):
    file = tmp_path_factory.getbasetemp() / "vendor.py"
    file.write_text(VENDOR, encoding="utf-8")
    with declared():
        batch = data.draw(vendor_batches([function.code for function in load_file(file)]))
        assert without_contents(written(batch)) == due(batch, int(batch.rows.t_start_ns[0]))


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
