"""The laws of feeding on lines in ASCII mode, cut anywhere: between CR and LF, too."""

from __future__ import annotations

from dataclasses import replace

from buses import CHAR_NS, LINE, Found, collect, transactions
from hypothesis import given
from hypothesis import strategies as st

from analyzer.deframing.protocols import Deframer
from analyzer.options import Options
from captures.chunks import Block, Chunk
from captures.line import LineSettings
from dissectors.crc import lrc

_SAME = ("port", "start", "length", "kind", "check", "request", "index", "t_start_ns", "t_end_ns", "response_ns")


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
