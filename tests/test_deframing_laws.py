"""The laws that hold for any bytes at all, and for any way of feeding them.

The laws of feeding hold on lines in ASCII mode, too, cut anywhere: between CR and LF as well.
"""

from __future__ import annotations

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from buses import CHAR_NS, LINE, Found, adu, collect, deframed, rtu_deframer, streams, transactions
from hypothesis import example, given, settings
from hypothesis import strategies as st

from analyzer.deframing.protocols import Deframer
from analyzer.options import Options
from captures.chunks import Block, Chunk, Mark
from captures.limits import TIME_LIMIT
from captures.line import LineSettings
from dissectors.crc import crc16, lrc

_SAME = ("port", "start", "length", "kind", "check", "request", "index", "t_start_ns", "t_end_ns", "response_ns")

random_streams = st.lists(
    st.tuples(st.sampled_from([0, CHAR_NS, 5_000_000, 60_000_000, 5_000_000_000]), st.binary(min_size=1, max_size=80)),
    max_size=12,
).map(lambda parts: [Chunk(sum(gap for gap, _ in parts[: i + 1]), data) for i, (_, data) in enumerate(parts)])
write, other, vendor = adu("110600010002"), adu("1106000a0bcd"), adu("0541010203")
repeats = st.lists(
    st.tuples(
        st.sampled_from([write, other, vendor, b"\x01\x03\xf8" + write * 3, adu("000600010002"), b"\0", b"\x01\x83"]),
        st.integers(1, 60),
        st.sampled_from([0, CHAR_NS, 5_000_000, 60_000_000, 2_000_000_000]),
        st.integers(1, 300),
    ),
    max_size=4,
)


def reads(parts: list[tuple[bytes, int, int, int]]) -> list[Chunk]:
    """Bytes that repeat, in reads of one size with one pause between them."""
    chunks: list[Chunk] = []
    t_ns = 0
    for pattern, times, pause_ns, size in parts:
        data = pattern * times
        size = max(size, len(data) // 40)  # thousands of feeds an example would take minutes
        for at in range(0, len(data), size):
            read = data[at : at + size]
            t_ns += len(read) * CHAR_NS + pause_ns
            chunks.append(Chunk(t_ns, read))
    return chunks


asked, answer = adu("11030000000a"), adu("110314" + "0102" * 10)
coil, failed, zeros = adu("1105000aff00"), adu("118302"), adu("010402030178")[:-2] + b"\0\0"
degenerate = st.one_of(
    st.lists(
        st.sampled_from(
            [
                write,
                other,
                vendor,
                asked,
                asked + answer,
                failed,
                zeros,
                adu("000600010002"),
                b"\0",
                b"\x01\x83",
                b"\x01\x03\xf8" + write * 31,
                adu("0103f8" + (write * 31).hex()),
                coil * 2 + adu("110300000001") + adu("1103020007"),
            ]
        ),
        min_size=1,
        max_size=2,
    ).map(b"".join),
    st.lists(st.binary(min_size=4, max_size=4), min_size=2, max_size=30).map(
        lambda values: b"".join(adu("1106" + value.hex()) for value in values)
    ),
)
long_repeats = st.lists(
    st.tuples(
        degenerate,
        st.integers(1, 1200),
        st.sampled_from([0, 0, CHAR_NS, 3 * CHAR_NS, 5_000_000, 60_000_000, 2_000_000_000]),
        st.sampled_from([8, 13, 64, 100, 256, 1000, 4096]),
    ).map(lambda part: (part[0], 1 + part[1] // len(part[0]), *part[2:])),
    min_size=1,
    max_size=3,
)


any_stream = st.one_of(streams(), random_streams, repeats.map(reads))


def silence(chunk: Chunk, after: Chunk) -> int:
    """How long (ns) nothing is sent between two reads: a clock that is said to tick must not deny bytes on the wire."""
    return after.t_ns - len(after.data) * CHAR_NS - chunk.t_ns


@st.composite
def two_port_streams(draw: st.DrawFn) -> tuple[list[Chunk], LineSettings]:
    """Requests and answers on two ports, or frames of either on both, late by some milliseconds; directions said or
    not."""
    apart, said = draw(st.booleans()), draw(st.booleans())
    pauses = draw(st.sampled_from([[0], [0, CHAR_NS], [300_000, 6_000_000], [6_000_000, 60_000_000, 2_000_000_000]]))
    size = draw(st.sampled_from([1, 8, 62]))
    chunks: list[Chunk] = []
    newest, now = [0, 0], 10**9
    for pair in draw(st.lists(transactions(), max_size=10)):
        for direction, frame in enumerate(pair):
            port = direction if apart else draw(st.integers(0, 1))
            stray = draw(st.sampled_from([b"", b"", b"", b"\0", b"\x11\x03\x55"]))
            if draw(st.integers(0, 15)) == 0:
                continue  # lost
            for at in range(0, len(stray + frame), size):
                read = (stray + frame)[at : at + size]
                now += len(read) * CHAR_NS + draw(st.sampled_from(pauses))
                newest[port] = max(newest[port], now + draw(st.sampled_from([0, 0, 4_000_000])))
                chunks.append(Chunk(newest[port], read, port=port))
    notes = {"directions": "request,response"} if said else {}
    return sorted(chunks, key=lambda chunk: chunk.t_ns), replace(LINE, notes=notes)


def assert_same(one: Found, other: Found) -> None:
    assert len(one.rows) == len(other.rows)
    for name in _SAME:
        assert (one.rows.column(name) == other.rows.column(name)).all(), name


@given(any_stream)
def test_every_byte_once_in_order_and_unchanged_and_a_frame_said_to_be_whole_is(chunks: list[Chunk]) -> None:
    found = deframed(chunks)
    sent = b"".join(c.data for c in chunks)
    ends = np.cumsum(found.rows.length)
    assert (found.rows.start == ends - found.rows.length).all()
    assert int(found.rows.length.sum()) == len(sent)
    assert found.data == sent
    for frame in found.good():
        assert 4 <= len(frame) <= 256
        assert crc16(frame) == 0


@given(any_stream)
def test_a_file_at_once_and_read_by_read_give_the_same(chunks: list[Chunk]) -> None:
    assert_same(deframed([Block.from_chunks(chunks)]), deframed(chunks))


@settings(max_examples=12)
@given(long_repeats.map(reads))
def test_what_repeats_for_long_is_the_same_at_once_and_read_by_read(chunks: list[Chunk]) -> None:
    assert_same(deframed([Block.from_chunks(chunks)]), deframed(chunks))


@settings(max_examples=50)
@given(any_stream, st.data())
def test_how_reads_are_split_does_not_matter_where_times_are_the_same(chunks: list[Chunk], data: st.DataObject) -> None:
    split = []
    for chunk in chunks:
        at = data.draw(st.integers(0, len(chunk.data)))
        split += [Chunk(chunk.t_ns, part) for part in (chunk.data[:at], chunk.data[at:]) if part]
    assert_same(deframed(chunks), deframed(split))


@settings(max_examples=50)
@given(any_stream)
def test_a_clock_that_ticks_in_the_pauses_changes_nothing(chunks: list[Chunk]) -> None:
    deframer = rtu_deframer(LINE)
    batches = []
    for chunk, after in zip(chunks, [*chunks[1:], None], strict=False):
        batches.append(deframer.feed(chunk))
        for pause in (CHAR_NS, 50_000_000, 3_000_000_000):
            if after is not None and silence(chunk, after) > pause:
                batches.append(deframer.tick(chunk.t_ns + pause))
    batches.append(deframer.close())
    assert_same(deframed(chunks), collect(batches))


@settings(max_examples=50)
@given(any_stream, st.data())
def test_bytes_given_with_the_silence_behind_them_change_nothing(chunks: list[Chunk], data: st.DataObject) -> None:
    deframer = rtu_deframer(LINE)
    batches, held = [], []
    for chunk, after in zip(chunks, [*chunks[1:], None], strict=False):
        held.append(chunk)
        pauses = [p for p in (0, CHAR_NS, 8_000_000, 3_000_000_000) if after is None or p < silence(chunk, after)]
        pause = data.draw(st.sampled_from([None, *pauses]))
        if pause is not None:
            batches.append(deframer.feed(Block.from_chunks(held), chunk.t_ns + pause))
            held = []
    batches.append(deframer.feed(held))
    batches.append(deframer.close())
    assert_same(deframed(chunks), collect(batches))


@given(
    st.lists(
        st.tuples(
            st.sampled_from([1 - TIME_LIMIT, 0, 40_000_000, TIME_LIMIT - 1]),
            st.sampled_from([asked, answer, write, coil, bytes.fromhex("011700030006000e00030600ff00ff00ff")]),
            st.sampled_from(list(Mark)),
        ),
        max_size=8,
    )
)
@example(
    [
        (1 - TIME_LIMIT, write, Mark.TX),
        (1 - TIME_LIMIT, bytes.fromhex("011700030006000e00030600ff00ff00ff"), Mark.TX),
        (TIME_LIMIT - 1, write, Mark.RX),
        (TIME_LIMIT - 1, coil, Mark.NONE),
    ]
)
def test_times_as_far_apart_as_there_are_leave_no_nonsense(parts: list[tuple[int, bytes, Mark]]) -> None:
    parts.sort(key=lambda part: part[0])
    rows = deframed([Chunk(t_ns, data, mark=mark) for t_ns, data, mark in parts]).rows
    for row in ((rows.request >= 0) & (rows.response_ns >= 0)).nonzero()[0].tolist():
        request = int(((rows.index == rows.request[row]) & (rows.kind > 0)).argmax())
        assert int(rows.response_ns[row]) == max(0, int(rows.t_start_ns[row]) - int(rows.t_end_ns[request]))


@settings(max_examples=25)  # each is read octet by octet
@given(two_port_streams(), st.data())
def test_two_ports_give_the_same_however_they_are_read(
    stream: tuple[list[Chunk], LineSettings], data: st.DataObject
) -> None:
    chunks, line = stream
    once = deframed([Block.from_chunks(chunks)] if chunks else [], line)
    assert_same(once, deframed(chunks, line))
    octets = [replace(chunk, data=chunk.data[i : i + 1]) for chunk in chunks for i in range(len(chunk.data))]
    assert_same(once, deframed(octets, line))
    deframer, batches = rtu_deframer(line), []
    for i, chunk in enumerate(chunks):
        batches.append(deframer.feed(chunk))
        free = min((later.t_ns - len(later.data) * CHAR_NS for later in chunks[i + 1 :]), default=0) - chunk.t_ns
        for pause in (CHAR_NS, 50_000_000, 1_500_000_000):
            if pause < free and data.draw(st.booleans()):
                batches.append(deframer.tick(chunk.t_ns + pause))
    assert_same(once, collect([*batches, deframer.close()]))


@settings(max_examples=50)
@given(any_stream, st.data())
def test_what_was_given_is_not_revised_by_what_comes_later(chunks: list[Chunk], data: st.DataObject) -> None:
    cut = data.draw(st.integers(0, len(chunks)))
    deframer = rtu_deframer(LINE)
    early = collect([rtu_deframer(LINE).close(), *(deframer.feed(c) for c in chunks[:cut])]).rows
    whole = deframed(chunks).rows[: len(early)]
    for name in _SAME:
        assert (early.column(name) == whole.column(name)).all()


ADVERSARIAL = {
    "zeros": b"\0",
    "ones": b"\xff",
    "01 03": b"\x01\x03",
    "03 03 ff": b"\x03\x03\xff",
    "01 83": b"\x01\x83",
    "00 11": b"\0\x11",
    "user functions": b"\x01\x41",
    "frames": adu("11030001000a"),
    "nested": adu("0103fa" + (adu("110600010002") * 31).hex() + "0000"),
}


@pytest.mark.parametrize("name", ADVERSARIAL)
@pytest.mark.parametrize("timed", [False, True])
def test_memory_is_bounded_whatever_the_bytes(name: str, timed: bool) -> None:
    pattern = ADVERSARIAL[name]
    piece = (pattern * (4096 // len(pattern) + 1))[:4096]
    deframer = rtu_deframer(LINE)
    tracemalloc.start()
    try:
        peaks = []
        feeds = 8 if name in ("nested", "frames") else 32
        for i in range(feeds):
            deframer.feed(Chunk(i * 100_000_000 if timed else 0, piece))
            if i % (feeds // 2) == feeds // 2 - 1:  # (a read without an end is taken apart every 16 feeds)
                peaks.append(tracemalloc.get_traced_memory()[1])
                tracemalloc.reset_peak()
    finally:
        tracemalloc.stop()
    assert peaks[-1] < peaks[0] * 1.5 + 2_000_000


def text_of(frame: bytes) -> bytes:
    """An RTU ADU as ASCII mode has it."""
    body = frame[:-2]
    return b":" + (body + bytes([lrc(body)])).hex().upper().encode() + b"\r\n"


@st.composite
def ascii_streams(draw: st.DrawFn) -> tuple[list[Chunk], LineSettings]:
    """Frames with faults, on one port or two, in reads of any size."""
    two, said = draw(st.booleans()), draw(st.booleans())
    size = draw(st.sampled_from([1, 5, 16, 17, 62]))
    pauses = draw(st.sampled_from([[0], [0, CHAR_NS], [3_000_000, 60_000_000], [0, 60_000_000, 1_200_000_000]]))
    ends = draw(st.sampled_from([b"\r\n", b"\r\n", b"\r"]))
    chunks, now = [], 10**9
    for pair in draw(st.lists(transactions(), max_size=8)):
        for direction, frame in enumerate(pair):
            text = text_of(frame)[:-2] + ends
            fault = draw(st.integers(0, 11))
            if fault == 0:
                text = text[: draw(st.integers(1, len(text)))]
            elif fault == 1:
                text = draw(st.sampled_from([b"\0", b":", b"\r", b"\n", b"::01", b"xyz" * 700])) + text
            elif fault == 2:
                text = text_of(frame)[:-2] + draw(st.sampled_from([b"\r", b"\n", b"\r\n"]))
            for at in range(0, len(text), size):
                read = text[at : at + size]
                now += len(read) * CHAR_NS + draw(st.sampled_from(pauses))
                chunks.append(Chunk(now, read, port=direction if two else 0))
    return chunks, replace(LINE, notes={"directions": "request,response"} if said else {})


def found_in(line: LineSettings, feeds: list[Chunk | Block | int]) -> Found:
    """What comes of blocks and chunks, and of ticks (times, ns)."""
    deframer = Deframer(line, Options(protocol="ascii"))
    batches = [deframer.tick(feed) if isinstance(feed, int) else deframer.feed(feed) for feed in feeds]
    return collect([*batches, deframer.close()])


@settings(max_examples=25)  # each is read octet by octet
@given(ascii_streams(), st.data())
def test_text_gives_the_same_however_it_is_read(stream: tuple[list[Chunk], LineSettings], data: st.DataObject) -> None:
    chunks, line = stream
    once = found_in(line, [Block.from_chunks(chunks)] if chunks else [])
    octets: list[Chunk | Block | int] = [
        replace(chunk, data=chunk.data[i : i + 1]) for chunk in chunks for i in range(len(chunk.data))
    ]
    ticked: list[Chunk | Block | int] = []
    for i, chunk in enumerate(chunks):
        ticked.append(chunk)
        free = chunks[i + 1].t_ns - len(chunks[i + 1].data) * CHAR_NS - chunk.t_ns if i + 1 < len(chunks) else 0
        ticked += [
            chunk.t_ns + pause
            for pause in (CHAR_NS, 55_000_000, 1_050_000_000)
            if pause < free and data.draw(st.booleans())
        ]
    for other in (found_in(line, list(chunks)), found_in(line, octets), found_in(line, ticked)):
        assert other.data == once.data
        assert len(other.rows) == len(once.rows)
        for name in _SAME:
            assert (other.rows.column(name) == once.rows.column(name)).all(), name
    assert int(once.rows.length.sum()) == sum(len(chunk.data) for chunk in chunks)
