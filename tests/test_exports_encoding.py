"""Lines put together from pieces are, byte for byte, what annotation of each frame gives."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import orjson
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pdus import CASES, REQUEST, RESPONSE, built, read_request

import analyzer
from analyzer.deframing.ascii import AsciiDeframer
from analyzer.exports.encoding import JsonLines, explain_json, noise_json
from analyzer.exports.encoding.pieces import Store
from analyzer.frames import EVIDENCE, ROW, Batch, Kind
from analyzer.pipeline import Options, deframe
from captures.chunks import Chunk
from captures.line import LineSettings
from captures.samples import path
from dissectors import registry
from dissectors.checks import crc_bytes, lrc
from dissectors.functions import load_file

# Of quantities as small as the answers that hypothesis likes to make, so that either is now and then the larger.
SMALL = CASES | {(code, REQUEST): read_request(20) for code in (1, 2, 3, 4)}
BIG = st.integers(0, 2**62)
ENCODER = JsonLines()  # one for all: what it keeps of some frames is used for others


@pytest.fixture(autouse=True)
def _forgotten() -> Iterator[None]:
    """What a test registers is gone after it."""
    registry.functions()
    before = dict(registry._declared)
    yield
    registry._declared.clear()
    registry._declared.update(before)
    registry._state["revision"] += 1


def due(batch: Batch, *, noise: bool = False, explain: bool = False) -> list[bytes]:
    """The lines by way of each frame's annotation."""
    lines = []
    for row in range(len(batch)):
        if batch.rows["kind"][row] == Kind.NOISE:
            lines += [orjson.dumps(noise_json(batch, row))] if noise else []
        else:
            frame = batch.frame(row)
            line = frame.to_json()
            if explain:
                line["explain"] = explain_json(frame)
            lines.append(orjson.dumps(line))
    return lines


def written(batch: Batch, encoder: JsonLines, rows: int = 0) -> list[bytes]:
    """The lines as they are exported, so many rows at once."""
    step = rows or max(len(batch), 1)
    text = b"".join(
        part
        for first in range(0, len(batch), step)
        for part in encoder.text(batch, first, min(first + step, len(batch)))
    )
    assert not text or text.endswith(b"\n")
    return text.splitlines()


def same(batch: Batch, encoder: JsonLines = ENCODER, rows: int = 0) -> None:
    assert written(batch, encoder, rows) == due(batch)


def mangled(adu: bytes, data: st.DataObject) -> tuple[bytes, bool]:
    """An RTU frame of a PDU as the wire may give it, and whether its check is right."""
    how = data.draw(st.sampled_from(["whole"] * 6 + ["cut", "longer", "bytes", "crc"]))
    if how == "cut":
        adu = adu[: data.draw(st.integers(2, len(adu)))]
    elif how == "longer":
        adu += data.draw(st.binary(min_size=1, max_size=3))
    elif how == "bytes":
        at = data.draw(st.integers(2, max(len(adu) - 1, 2)))
        adu = adu[:at] + data.draw(st.binary(min_size=1, max_size=1)) + adu[at + 1 :]
    right = how != "crc"
    return adu + (crc_bytes(adu) if right else crc_bytes(adu + b"\0")), right


@st.composite
def batches(draw: st.DrawFn, code: int) -> Batch:
    """Requests and responses of a function, answers known or not, requests here or in a batch before."""
    data = draw(st.data())
    rows, octets, earlier = [], b"", {}
    for _ in range(draw(st.integers(1, 4))):
        unit = bytes([draw(st.integers(0, 255))])
        request, right = mangled(unit + built(code, REQUEST, draw(SMALL[code, REQUEST])), data)
        known = draw(st.sampled_from(["no", "here", "here", "before"]))
        if known == "before":
            earlier[10_000 + len(rows)] = request
            asked = 10_000 + len(rows)
        else:
            asked = len(rows) if known == "here" else -1
            rows.append(_row(draw, len(rows), octets, request, Kind.REQUEST, right, -1))
            octets += request
        pdu = draw(st.sampled_from([b""] * 4 + [bytes([code | 0x80, draw(st.integers(0, 255))])]))
        response, right = mangled(unit + (pdu or built(code, RESPONSE, draw(SMALL[code, RESPONSE]))), data)
        rows.append(_row(draw, len(rows), octets, response, Kind.RESPONSE, right, asked))
        octets += response
    return Batch(np.concatenate(rows), np.frombuffer(octets, np.uint8), earlier)


def _row(draw: st.DrawFn, index: int, before: bytes, adu: bytes, kind: Kind, right: bool, asked: int) -> Any:
    row = np.zeros(1, ROW)
    exception = kind == Kind.RESPONSE and adu[1] & 0x80 and len(adu) > 2
    row["index"], row["start"], row["length"], row["at"] = index, draw(BIG), len(adu), len(before)
    row["t_start"], row["t_end"], row["request"] = draw(BIG), draw(BIG), asked
    row["request_start"], row["response_ns"] = (
        (draw(BIG), draw(st.sampled_from([-1, 0, 5_000]))) if asked >= 0 else (-1, -1)
    )
    row["confidence"], row["kind"], row["unit"], row["function"] = (
        draw(st.floats(0, 1, width=32)),
        kind,
        adu[0],
        adu[1] & 0x7F,
    )
    row["exception"], row["check"], row["port"] = adu[2] if exception else 0, right, draw(st.sampled_from([0, 0, 1]))
    return row


@pytest.mark.parametrize("code", sorted({code for code, _ in CASES}), ids=lambda v: f"{v:02X}")
def test_every_function_reads_as_annotated(code: int) -> None:
    @given(batches(code))
    @settings(deadline=None, max_examples=60)
    def check(batch: Batch) -> None:
        same(batch)

    check()


VENDOR = """
from construct import Array, Float32b, GreedyBytes, Int8ub, Int16ub, Padding, Prefixed, Struct, this
from dissectors import Address, Bits, ByteCount, Function, Mask, Number, Quantity, Registers, Role, Text
from dissectors.parts import Number as Plain

class Signed(Plain):
    def text(self, value):
        return f"{value - 0x10000 if value & 0x8000 else value} °C, «ok»"

class Nosy(Plain):
    def problem(self, value, length, seen):
        return "hot" if seen.number("channel") == value else None

class Half(Plain):
    def _parse(self, stream, context, path):
        return super()._parse(stream, context, path) // 2

ONE = Function(0x41, "Тренд \\"A\\"", Struct("channel" / Number(1), "where" / Address()),
               Struct("channel" / Number(1), "level" / Signed(2)), echoes=("channel",))
TWO = Function(0x42, "Nosy", Struct("channel" / Number(2)), Struct("channel" / Number(2), "x" / Nosy(2)))
THREE = Function(0x43, "Half", Struct("a" / Half(2)), Struct("n" / ByteCount(1, 250), "r" / Registers("n", less=1)))
FOUR = Function(0x44, "Foreign", Struct("a" / Int16ub, Padding(1)),
                Struct("n" / Int8ub, "v" / Array(this.n, Float32b), "rest" / GreedyBytes))
FIVE = Function(0x45, "Scaled",
                Struct("first" / Number(2), "n" / Quantity(1, 9), "r" / Registers("n", scale=2, start="first")),
                Struct("first" / Mask(), "name" / Prefixed(Int8ub, GreedyBytes)), echoes=("first",))
SIX = Function(0x46, "Page", Struct("page" / Int8ub, "at" / Int16ub),
               Struct("n" / ByteCount(1, 9, of="page"), "r" / Registers("n", start="at", area="3x", each="reg")))
SEVEN = Function(0x03, "My Read", Struct("page" / Number(1)), Struct("value" / Number(2)))
"""


@given(data=st.data())
@settings(deadline=None, max_examples=150)
def test_vendors_functions_read_as_annotated(tmp_path_factory: pytest.TempPathFactory, data: st.DataObject) -> None:
    file = tmp_path_factory.getbasetemp() / "vendor.py"
    file.write_text(VENDOR)
    codes = [function.code for function in load_file(file)]
    encoder = JsonLines()
    rows, octets = [], b""
    for _ in range(data.draw(st.integers(1, 6))):
        code = data.draw(st.sampled_from(codes))
        kind = data.draw(st.sampled_from([Kind.REQUEST, Kind.RESPONSE]))
        count = data.draw(st.integers(0, 9))
        body = data.draw(
            st.binary(max_size=6) | st.binary(min_size=count, max_size=count).map(lambda b: bytes([len(b)]) + b)
        )
        adu = bytes([1, code]) + body
        adu += crc_bytes(adu)
        asked = len(rows) - 1 if rows and kind == Kind.RESPONSE else -1
        rows.append(_row(lambda strategy: data.draw(strategy), len(rows), octets, adu, kind, True, asked))
        octets += adu
    same(Batch(np.concatenate(rows), np.frombuffer(octets, np.uint8)), encoder)


@given(st.lists(st.tuples(st.integers(0, 255), st.binary(max_size=12)), min_size=1, max_size=5), st.integers(1, 2))
@settings(deadline=None)
def test_unknown_functions_and_scraps_read_as_annotated(frames: list[tuple[int, bytes]], kind: int) -> None:
    rows, octets = [], b""
    for code, body in frames:
        adu = bytes([9, code]) + body
        adu = (adu + crc_bytes(adu)) if body else adu
        row = np.zeros(1, ROW)
        row["index"], row["length"], row["at"] = len(rows), len(adu), len(octets)
        row["request"] = row["request_start"] = row["response_ns"] = -1
        row["kind"], row["unit"], row["function"], row["check"] = kind, 9, code & 0x7F, len(adu) >= 4
        rows.append(row)
        octets += adu
    same(Batch(np.concatenate(rows), np.frombuffer(octets, np.uint8)))


@pytest.mark.parametrize("name", ["healthy.jsonl", "troubled.jsonl"])
@pytest.mark.parametrize("rows", [0, 1, 7])
def test_samples_with_noise_and_reasons(name: str, rows: int) -> None:
    encoder = JsonLines(explain=True, noise=True)
    for batch in deframe(analyzer.open(path(name)).capture, Options(explain=True)):
        assert written(batch, encoder, rows) == due(batch, noise=True, explain=True)


def test_ascii_mode() -> None:
    text = b"".join(
        b":" + (body + bytes([lrc(body)])).hex().upper().encode() + b"\r\n"
        for body in map(bytes.fromhex, ("1103006B0003", "110306AE4156524340", "1103006B0003", "118302"))
    )
    deframer = AsciiDeframer(LineSettings(), Options())
    for batch in (deframer.feed(Chunk(0, text + b"noise")), deframer.close()):
        same(batch)


def test_what_is_kept_is_bounded_and_forgotten_without_a_trace(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("analyzer.exports.encoding.lines.Store", lambda: Store(kept=5_000))
    encoder = JsonLines()
    for batch in deframe(analyzer.open(path("healthy.jsonl")).capture):
        same(batch, encoder, rows=5)


def test_evidence_is_no_part_of_plain_lines() -> None:
    batch = next(iter(deframe(analyzer.open(path("healthy.jsonl")).capture, Options(explain=True))))
    assert batch.evidence is not None and batch.evidence.dtype == EVIDENCE
    same(batch)
