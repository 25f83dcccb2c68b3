"""What a frame speaks of, in words and when: a JSON line has what the CSV row of the same frame has."""

from __future__ import annotations

import csv
import io
from typing import Any, Literal

import orjson
import pytest
from buses import LINE, spaced
from declaring import declared
from hypothesis import given, settings
from hypothesis import strategies as st
from pdus import CASES, VENDOR, batches, vendor_batches

import analyzer
from analyzer.core import deframe
from analyzer.exports import ExportOptions
from analyzer.exports.encoding import FrameJsonLines
from analyzer.exports.sink import OutputStream
from analyzer.exports.targets.csv import open_sink, safe
from analyzer.options import Options
from analyzer.paste import read
from analyzer.simulation import Scenario, simulate
from analyzer.tables.batch import Batch
from captures.chunks import Capture, Chunk
from captures.line import LineSettings
from captures.samples import path
from dissectors.crc import crc_bytes
from dissectors.functions import load_file

KEYS = ("address", "quantity", "values", "summary", "time")
CLOCK_NS = 1_700_000_000_123_456_789


def cells(line: dict[str, Any]) -> dict[str, str]:
    """A line's keys as a spreadsheet has them."""
    texts = {key: "" if line[key] is None else str(line[key]) for key in KEYS}
    return texts | {"values": " ".join(map(str, line["values"])), "summary": safe(line["summary"])}


def rows_of(batch: Batch, capture: Capture) -> list[dict[str, str]]:
    stream = io.BytesIO()
    open_sink(OutputStream(stream), capture, ExportOptions()).rows(batch, 0, len(batch))
    found = csv.DictReader(io.StringIO(stream.getvalue().decode(), newline=""))
    return [{key: row[key] for key in KEYS} for row in found]


def same(batch: Batch, capture: Capture | None = None) -> None:
    """Lines set from pieces, and those of each frame by itself."""
    due = rows_of(batch, capture or Capture.of(LINE, spaced([b""])))
    text = b"".join(FrameJsonLines().text(batch, 0, len(batch)))
    assert [cells(orjson.loads(line)) for line in text.splitlines()] == due
    assert [cells(frame.to_json()) for frame in batch.frames()] == due


@pytest.mark.parametrize("code", sorted({code for code, _ in CASES}), ids=lambda v: f"{v:02X}")
def test_every_function(code: int) -> None:
    @given(batches(code))
    @settings(deadline=None, max_examples=30)
    def check(batch: Batch) -> None:
        same(batch)

    check()


@given(data=st.data())
@settings(deadline=None, max_examples=40)
def test_vendors_functions(tmp_path_factory: pytest.TempPathFactory, data: st.DataObject) -> None:
    file = tmp_path_factory.getbasetemp() / "vendor_spoken.py"
    file.write_text(VENDOR, encoding="utf-8")
    with declared():
        same(data.draw(vendor_batches([function.code for function in load_file(file)])))


@pytest.mark.parametrize("name", ["healthy.jsonl", "troubled.jsonl"])
def test_samples(name: str) -> None:
    capture = analyzer.open(path(name)).capture
    for batch in deframe(capture):
        same(batch, capture)


@pytest.mark.parametrize(
    ("wire", "tap", "defect"),
    [
        ("brutal", "precise", None),
        ("vendor", "irq", None),
        ("broadcast", "untimed", None),
        ("clean", "irq", "exception"),
    ],
)
def test_simulated_buses(wire: str, tap: str, defect: str | None) -> None:
    made = simulate(Scenario(wire, tap, transactions=60, seed=8, defect=defect))
    capture = Capture.of(made.line, made.chunks)
    for batch in deframe(capture):
        same(batch, capture)


@pytest.mark.parametrize("protocol", ["ascii", "tcp"])
def test_other_envelopes(protocol: Literal["ascii", "tcp"]) -> None:
    pdus = [bytes.fromhex(text) for text in ("03006B0003", "0306AE4156524340", "03006B0003", "8302", "0500070000")]
    if protocol == "ascii":
        adus = [b"\x11" + pdu for pdu in pdus]
        frames = [b":" + (adu + bytes([-sum(adu) & 0xFF])).hex().upper().encode() + b"\r\n" for adu in adus]
    else:
        frames = [bytes([0, i // 2, 0, 0, 0, len(pdu) + 1, 17]) + pdu for i, pdu in enumerate(pdus)]
    capture = Capture.of(LineSettings(), [Chunk(CLOCK_NS + i * 50_000_000, one) for i, one in enumerate(frames)])
    found = list(deframe(capture, Options(protocol=protocol)))
    assert sum(len(list(batch.frames())) for batch in found) == len(pdus)
    for batch in found:
        same(batch, capture)


def test_what_they_say() -> None:
    bodies = [bytes.fromhex(text) for text in ("1103006B0003", "110306AE4156524340", "11050007FF00", "118501")]
    adus = [body + crc_bytes(body) for body in bodies]
    capture = Capture.of(LINE, [Chunk(CLOCK_NS + i * 50_000_000, one) for i, one in enumerate(adus)])
    lines = [frame.to_json() for batch in deframe(capture) for frame in batch.frames()]
    assert [line["address"] for line in lines] == [107, 107, 7, 7]
    assert [line["quantity"] for line in lines] == [3, 3, 1, None]
    assert [line["values"] for line in lines] == [[], [0xAE41, 0x5652, 0x4340], [1], []]
    assert lines[0]["summary"] == "read 3 holding registers from 107 (40108)"
    assert lines[0]["time"].startswith("2023-11-14T22:13:20.") and lines[0]["time"].endswith("Z")


@pytest.mark.parametrize("name", ["healthy.jsonl", "troubled.jsonl"])
def test_a_paste_says_the_same(name: str) -> None:
    """Each frame, with its request where it answers one, pasted by itself."""
    frames = [frame for batch in deframe(analyzer.open(path(name)).capture) for frame in batch.frames()]
    pasted = 0
    for frame in frames[:200]:
        if frame.request_bytes is None or not frame.crc_ok:
            continue
        lines = list(read(f"{frame.request_bytes.hex(' ')}\n{frame.adu.data.hex(' ')}").to_json())
        if len(lines) == 2 and lines[1]["request_start"] == 0:
            assert {key: lines[1][key] for key in KEYS[:4]} == {key: frame.to_json()[key] for key in KEYS[:4]}
            assert lines[1]["time"] is None
            pasted += 1
    assert pasted > 20


def test_a_time_before_clocks_and_none() -> None:
    lines = list(read("11 03 00 6B 00 03 76 87").to_json())
    assert {key: lines[0][key] for key in KEYS} == {
        "address": 107, "quantity": 3, "values": [], "summary": "read 3 holding registers from 107 (40108)",
        "time": None,
    }  # fmt: skip
    assert lines[0]["t_start_ns"] is None
