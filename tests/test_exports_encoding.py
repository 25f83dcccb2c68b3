"""Lines put together from pieces are, byte for byte, what annotation of each frame gives."""

from __future__ import annotations

import gc

import numpy as np
import orjson
import pytest
from declaring import declared
from hypothesis import given, settings
from hypothesis import strategies as st
from made import VENDOR, batches, vendor_batches
from pdus import CASES

import analyzer
from analyzer.core import deframe
from analyzer.deframing.protocols import Deframer
from analyzer.exports.encoding import FrameJsonLines, explain_json, noise_json
from analyzer.exports.encoding.blocks import BitPieces, RegisterPieces
from analyzer.exports.encoding.pieces import Store
from analyzer.options import Options
from analyzer.tables.batch import Batch
from analyzer.tables.schema import Kind, Rows
from captures.chunks import Capture, Chunk
from captures.line import LineSettings
from captures.samples import path
from dissectors.crc import crc_bytes, lrc
from dissectors.functions import load_file

READ_COILS = bytes.fromhex("110100130025") + crc_bytes(bytes.fromhex("110100130025"))
COILS = bytes.fromhex("110105cd6bb20e1b") + crc_bytes(bytes.fromhex("110105cd6bb20e1b"))
ENCODER = FrameJsonLines()  # one for all: what it keeps of some frames is used for others


def due(batch: Batch, *, noise: bool = False, explain: bool = False) -> list[bytes]:
    """The lines by way of each frame's annotation."""
    lines = []
    for row in range(len(batch)):
        if batch.rows.kind[row] == Kind.NOISE:
            lines += [orjson.dumps(noise_json(batch, row))] if noise else []
        else:
            frame = batch.frame(row)
            line = frame.to_json()
            if explain:
                line["explain"] = explain_json(frame)
            lines.append(orjson.dumps(line))
    return lines


def written(batch: Batch, encoder: FrameJsonLines, rows: int = 0) -> list[bytes]:
    """The lines as they are exported, so many rows at once."""
    step = rows or max(len(batch), 1)
    text = b"".join(
        part
        for first in range(0, len(batch), step)
        for part in encoder.text(batch, first, min(first + step, len(batch)))
    )
    assert not text or text.endswith(b"\n")
    return text.splitlines()


def same(batch: Batch, encoder: FrameJsonLines = ENCODER, rows: int = 0) -> None:
    assert written(batch, encoder, rows) == due(batch)


@pytest.mark.parametrize("code", sorted({code for code, _ in CASES}), ids=lambda v: f"{v:02X}")
def test_every_function_reads_as_annotated(code: int) -> None:
    @given(batches(code))
    @settings(deadline=None, max_examples=60)
    def check(batch: Batch) -> None:
        same(batch)

    check()


@given(data=st.data())
@settings(deadline=None, max_examples=150)
def test_vendors_functions_read_as_annotated(tmp_path_factory: pytest.TempPathFactory, data: st.DataObject) -> None:
    file = tmp_path_factory.getbasetemp() / "vendor.py"
    file.write_text(VENDOR, encoding="utf-8")
    with declared():
        codes = [function.code for function in load_file(file)]
        same(data.draw(vendor_batches(codes)), FrameJsonLines())


@given(st.lists(st.tuples(st.integers(0, 255), st.binary(max_size=12)), min_size=1, max_size=5), st.integers(1, 2))
@settings(deadline=None)
def test_unknown_functions_and_scraps_read_as_annotated(frames: list[tuple[int, bytes]], kind: int) -> None:
    rows, octets = list[Rows](), b""
    for code, body in frames:
        adu = bytes([9, code]) + body
        adu = (adu + crc_bytes(adu)) if body else adu
        row = Rows.zeros(1)
        row.index[:], row.length[:], row.at[:] = len(rows), len(adu), len(octets)
        row.request[:] = row.request_start[:] = row.response_ns[:] = -1
        row.kind[:], row.unit[:], row.function[:], row.check[:] = kind, 9, code & 0x7F, len(adu) >= 4
        rows.append(row)
        octets += adu
    same(Batch(Rows.joined(rows), np.frombuffer(octets, np.uint8)))


@pytest.mark.parametrize("name", ["healthy.jsonl", "troubled.jsonl"])
@pytest.mark.parametrize("rows", [0, 1, 7])
def test_samples_with_noise_and_reasons(name: str, rows: int) -> None:
    encoder = FrameJsonLines(explain=True, noise=True)
    batches = list(deframe(analyzer.open(path(name)).capture, Options(explain=True)))
    assert batches
    for batch in batches:
        assert written(batch, encoder, rows) == due(batch, noise=True, explain=True)


def test_ascii_mode() -> None:
    text = b"".join(
        b":" + (body + bytes([lrc(body)])).hex().upper().encode() + b"\r\n"
        for body in map(bytes.fromhex, ("1103006B0003", "110306AE4156524340", "1103006B0003", "118302"))
    )
    deframer = Deframer(LineSettings(), Options(protocol="ascii"))
    for batch in (deframer.feed(Chunk(0, text + b"noise")), deframer.close()):
        same(batch)


def test_what_is_kept_is_bounded_and_forgotten_without_a_trace(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("analyzer.exports.encoding.lines.Store", lambda: Store(kept=5_000))
    encoder = FrameJsonLines()
    for batch in deframe(analyzer.open(path("healthy.jsonl")).capture):
        same(batch, encoder, rows=5)


def test_an_encoder_that_is_gone_leaves_nothing_in_memory() -> None:
    def exported() -> None:
        capture = Capture.of(LineSettings(baud=9600), [Chunk(0, READ_COILS), Chunk(10_000_000, COILS)])
        for batch in deframe(capture):
            same(batch, FrameJsonLines())

    def kept() -> int:
        gc.collect()
        return sum(isinstance(one, (BitPieces, RegisterPieces)) for one in gc.get_objects())

    before = kept()  # other tests', held by their reports
    exported()
    assert kept() <= before


def test_evidence_is_no_part_of_plain_lines() -> None:
    batch = next(iter(deframe(analyzer.open(path("healthy.jsonl")).capture, Options(explain=True))))
    assert batch.evidence is not None and len(batch.evidence) == len(batch)
    same(batch)
