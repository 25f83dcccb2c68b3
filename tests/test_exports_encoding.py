"""Lines put together from pieces are, byte for byte, what annotation of each frame gives.

Text that arrays put together is what Python's own joining and formatting give. `Frame.to_json` says the same whether
frames are asked for in order, here and there, or one alone.
"""

from __future__ import annotations

import gc
import random
from dataclasses import replace

import numpy as np
import orjson
import pytest
from declaring import declared
from hypothesis import example, given, settings
from hypothesis import strategies as st
from pdus import CASES, VENDOR, batches, vendor_batches

import analyzer
from analyzer.core import deframe
from analyzer.deframing.protocols import Deframer
from analyzer.exports.encoding import FrameJsonLines, explain_json, noise_json
from analyzer.exports.encoding.blocks import BitPieces, RegisterPieces
from analyzer.exports.encoding.sheet import Sheet, Store, decimals, inside, insides, without
from analyzer.exports.targets.csv import _seconds
from analyzer.options import Options
from analyzer.simulation import Scenario, write
from analyzer.tables.batch import Batch, Frame
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
    @settings(deadline=None, max_examples=25)  # of each function
    def check(batch: Batch) -> None:
        same(batch)

    check()


@given(data=st.data())
@settings(deadline=None, max_examples=75)
def test_vendors_functions_read_as_annotated(tmp_path_factory: pytest.TempPathFactory, data: st.DataObject) -> None:
    file = tmp_path_factory.getbasetemp() / "vendor.py"
    file.write_text(VENDOR, encoding="utf-8")
    with declared():
        codes = [function.code for function in load_file(file)]
        same(data.draw(vendor_batches(codes)), FrameJsonLines())


ASKED = [
    "08000B0000",
    "080000A537",
    "0800030A00",
    "080001FF00",
    "080063010203",
    "0B",
    "0C",
    "11",
    "140E0600040001000206000300090002",
    "150D0600040007000306AF04BE100D",
    "160004FFFF0000",
    "170001000200030001020007",
    "2B0E0100",
    "2B0D0102",
]
ANSWERED = [
    "08000BABCD",
    "080000A537",
    "0800030A00",
    "080063010203",
    "0B00000108",
    "0C080000010801212000",
    "0C06000000000001",
    "1103410700",
    "110A01FF50756D7020763320",
    "140C05060DFE0020050633CD0040",
    "150D0600040007000306AF04BE100D",
    "160004FFFF0000",
    "1704000700FF",
    "2B0E01010000020003414243010456322E30",
    "2B0D0102",
]


@pytest.mark.parametrize(
    ("kind", "pdu"), [*((Kind.REQUEST, pdu) for pdu in ASKED), *((Kind.RESPONSE, pdu) for pdu in ANSWERED)]
)
def test_a_whole_frame_of_a_public_function_is_set_from_pieces(
    kind: Kind, pdu: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    adu = bytes([9]) + bytes.fromhex(pdu)
    row = Rows.zeros(1)
    row.length[:], row.kind[:], row.unit[:], row.function[:], row.check[:] = len(adu) + 2, kind, 9, adu[1], True
    row.request[:] = row.request_start[:] = row.response_ns[:] = row.taken_for_start[:] = -1
    batch = Batch(row, np.frombuffer(adu + crc_bytes(adu), np.uint8))
    due_lines = due(batch)
    monkeypatch.setattr("analyzer.exports.encoding.forms.Whole.text", lambda *_: pytest.fail("annotated by itself"))
    assert written(batch, FrameJsonLines()) == due_lines


@given(st.lists(st.tuples(st.integers(0, 255), st.binary(max_size=12)), min_size=1, max_size=5), st.integers(1, 2))
@example([(0x95, bytes.fromhex("01000000000000010000"))], 1)
@settings(deadline=None)
def test_unknown_functions_and_scraps_read_as_annotated(frames: list[tuple[int, bytes]], kind: int) -> None:
    rows, octets = list[Rows](), b""
    for code, body in frames:
        adu = bytes([9, code]) + body
        adu = (adu + crc_bytes(adu)) if body else adu
        row = Rows.zeros(1)
        row.index[:], row.length[:], row.at[:] = len(rows), len(adu), len(octets)
        row.request[:] = row.request_start[:] = row.response_ns[:] = row.taken_for_start[:] = -1
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


TEXTS = st.lists(
    st.binary(max_size=9) | st.integers(0, 700).map(lambda n: bytes(i % 251 for i in range(n))), max_size=9
)
WHOLE = (1 << 63) - 1


def joined(sheet: Sheet) -> bytes:
    return b"".join(sheet.parts())


@given(st.lists(st.integers(-WHOLE, WHOLE) | st.integers(-10001, 10001), max_size=20))
@example([0])
@example([-WHOLE, WHOLE])
@example([-9999, 9999, 10000])
def test_numbers_read_as_python_writes_them(numbers: list[int]) -> None:
    text, begins, sizes = decimals(np.array(numbers, np.int64))
    places = zip(begins.tolist(), sizes.tolist(), strict=True)
    assert [text[at : at + size].tobytes() for at, size in places] == [b"%d" % number for number in numbers]


@given(TEXTS, TEXTS, st.data())
def test_pieces_of_any_size_are_joined(kept: list[bytes], lent: list[bytes], data: st.DataObject) -> None:
    store = Store()
    made = store.add(kept)
    sheet = Sheet(store, np.zeros(0, np.int64))
    pieces = np.concatenate((made[: len(made) // 2], sheet.texts(lent), made[len(made) // 2 :]))
    texts = [*kept[: len(made) // 2], *lent, *kept[len(made) // 2 :]]
    order = data.draw(st.lists(st.integers(0, len(texts) - 1), max_size=30)) if texts else []
    sheet.pieces = pieces[order] if order else sheet.pieces
    assert joined(sheet) == b"".join(texts[i] for i in order)


@given(st.lists(st.lists(st.integers(0, 50) | st.integers(0, 1 << 40), max_size=30), max_size=6), st.integers(1, 300))
def test_tables_give_what_was_made_also_after_forgetting(asked: list[list[int]], kept: int) -> None:
    store = Store(kept)
    table = store.table(lambda number: b"<%d>" % number)
    for numbers in asked:
        store.settle()
        sheet = Sheet(store, np.ones(len(numbers), np.int64))
        sheet.at(np.arange(len(numbers))).put(table.take_pieces(np.array(numbers, np.int64)))
        assert joined(sheet) == b"".join(b"<%d>" % number for number in numbers)


def test_a_piece_without_its_beginning() -> None:
    store = Store()
    sheet = Sheet(store, np.zeros(0, np.int64))
    sheet.pieces = without(store.add([b", 12", b", 345"]), 2)
    assert joined(sheet) == b"12345"


@given(st.lists(st.text(max_size=6) | st.sampled_from(['"', '","', "\\", '\\","']), max_size=8))
def test_texts_at_once_are_escaped_as_each_is(texts: list[str]) -> None:
    assert insides(texts) == [inside(text) for text in texts]


@given(st.lists(st.integers(-(10**18), 10**18) | st.integers(0, 10**7) | st.integers(0, 10**13).map(lambda n: 500 * n)))
@example([499, 500, 501, 999_999_499, 999_999_500, 999_999_999, (1 << 53) - 1, 1 << 53, -1, -500])
def test_seconds_round_as_their_float_does(ns: list[int]) -> None:
    sheet = Sheet(Store(), np.full(len(ns), 3))
    cursor = sheet.at(np.arange(len(ns)))
    whole, rest = _seconds(np.array(ns, np.int64), sheet)
    for part in (whole, b".", rest):
        cursor.put(part)
    assert joined(sheet).decode() == "".join(f"{one / 1e9:.6f}" for one in ns)


@pytest.fixture(scope="module")
def frames(tmp_path_factory: pytest.TempPathFactory) -> list[Frame]:
    path = tmp_path_factory.mktemp("bus") / "bus.jsonl"
    write(Scenario("noisy", "irq", seed=5), path)
    return list(analyzer.open(path).frames())


def alone(frame: Frame) -> Frame:
    return replace(frame, told=None)


def test_asked_in_order(frames: list[Frame]) -> None:
    assert len(frames) > 100
    for frame in frames:
        assert frame.to_json() == alone(frame).to_json()
        assert list(frame.to_json()) == list(alone(frame).to_json())


def test_asked_here_and_there(frames: list[Frame]) -> None:
    chosen = random.Random(1)
    for start in (0, 40, 7):
        for frame in [*frames[start : start + 30], *chosen.sample(frames, 30)]:
            assert frame.to_json() == alone(frame).to_json()


def test_changes_stay_with_who_makes_them(frames: list[Frame]) -> None:
    for frame in frames[:20]:
        line = frame.to_json()
        line["fields"].clear()
        assert frame.to_json()["fields"]


def test_without_fields(frames: list[Frame]) -> None:
    for frame in frames[:20]:
        plain = alone(frame).to_json()
        del plain["fields"]
        assert frame.to_json(fields=False) == plain
