"""Blocks, captures in memory, and times put in order."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from captures import Block, Capture, Chunk, LineSettings, Mark

SECOND = 1_000_000_000


def times(chunks: list[Chunk], **options: bool) -> list[int]:
    return [chunk.t_ns for chunk in Capture.of(LineSettings(), chunks, **options).chunks()]


def test_a_block_gives_back_its_chunks() -> None:
    chunks = [
        Chunk(5, b"\x11\x03", port=1, mark=Mark.TX, errors=(0,)),
        Chunk(7, b"\x11\x03\x06", mark=Mark.RX, errors=(0, 2)),
        Chunk(7, b"\x00"),
    ]
    block = Block.from_chunks(chunks)
    assert [block.chunk(i) for i in range(len(block))] == chunks
    assert block.offsets.tolist() == [0, 2, 5, 6]
    assert block.errors.tolist() == [0, 2, 4]
    assert [block.slice(1, 3).chunk(i) for i in range(2)] == chunks[1:]


def test_empty_chunks_are_left_out() -> None:
    assert len(Block.from_chunks([Chunk(1, b""), Chunk(2, b"a"), Chunk(3, b"")])) == 1
    assert list(Capture.of(LineSettings(), [Chunk(1, b"")]).blocks()) == []


@pytest.mark.parametrize(
    "chunk",
    [Chunk(1 << 62, b"a"), Chunk(0, b"a", port=256), Chunk(0, b"a", errors=(1,)), Chunk(0, b"a", errors=(-1,))],
)
def test_impossible_values_are_refused(chunk: Chunk) -> None:
    with pytest.raises(ValueError):
        Block.from_chunks([chunk])


@given(st.lists(st.binary(min_size=1, max_size=40), min_size=1, max_size=30), st.integers(1, 100))
def test_blocks_hold_whole_chunks_up_to_their_limit(parts: list[bytes], limit: int) -> None:
    chunks = [Chunk(i, part, errors=(len(part) - 1,)) for i, part in enumerate(parts)]
    capture = Capture.of(LineSettings(), chunks)
    blocks = list(capture.blocks(limit))
    assert [block.chunk(i) for block in blocks for i in range(len(block))] == chunks
    assert all(len(block.data) <= limit or len(block) == 1 for block in blocks)
    assert list(capture.chunks()) == chunks, "a second pass gives the same"


def test_small_steps_back_are_held_and_said_once() -> None:
    capture = Capture.of(LineSettings(), [Chunk(t, b"a") for t in (10, 50, 40, 45, 60, 55)])
    assert [chunk.t_ns for chunk in capture.chunks()] == [10, 50, 50, 50, 60, 60]
    assert [str(damage) for damage in capture.damage] == ["chunk 2: time goes back 2 times, first by 0.000 ms: held"]


def test_a_clock_set_back_keeps_the_gaps_after_it() -> None:
    chunks = [Chunk(t * SECOND, b"a") for t in (100, 101, 3, 4, 7)]
    capture = Capture.of(LineSettings(), chunks)
    assert [chunk.t_ns // SECOND for chunk in capture.chunks()] == [100, 101, 101, 102, 105]
    assert capture.damage[0].where == "chunk 2"
    assert "clock set back once by 98.000 s" in capture.damage[0].what


def test_ports_have_their_own_order() -> None:
    chunks = [Chunk(5, b"a"), Chunk(3, b"b", port=1), Chunk(6, b"a"), Chunk(4, b"b", port=1)]
    capture = Capture.of(LineSettings(), chunks)
    assert list(capture.chunks()) == chunks
    assert not capture.damage


@given(
    st.lists(st.tuples(st.integers(-(2**61), 2**61), st.integers(0, 2)), min_size=1, max_size=30),
    st.integers(1, 10),
)
def test_times_never_decrease_within_a_port_however_blocks_fall(reads: list[tuple[int, int]], limit: int) -> None:
    chunks = [Chunk(t, b"a", port=port) for t, port in reads]
    capture = Capture.of(LineSettings(), chunks)
    given_times: dict[int, int] = {}
    for chunk in capture.chunks():
        assert chunk.t_ns >= given_times.get(chunk.port, chunk.t_ns)
        given_times[chunk.port] = chunk.t_ns
    whole = [chunk.t_ns for chunk in capture.chunks()]
    pieces = [int(t) for block in capture.blocks(limit) for t in block.t_ns]
    assert pieces == whole


def test_order_is_kept_across_the_blocks_of_a_source() -> None:
    class Source:
        line, timed = LineSettings(), True

        def blocks(self, max_bytes: int, note: object) -> Iterator[Block]:
            del max_bytes, note
            for t in (10, 8, 9, 12):
                yield Block.from_chunks([Chunk(t, b"a")])

    assert [chunk.t_ns for chunk in Capture(Source()).chunks()] == [10, 10, 10, 12]


def test_untimed_captures_have_no_times() -> None:
    assert times([Chunk(5, b"a"), Chunk(3, b"b")], timed=False) == [0, 0]
    block = next(Capture.of(LineSettings(), [Chunk(5, b"a")], timed=False).blocks())
    assert not block.timed
    assert block.t_ns.dtype == np.int64


def test_damage_is_bounded_and_counted() -> None:
    class Source:
        line, timed = LineSettings(), True

        def blocks(self, max_bytes: int, note: Callable[[str, str], object]) -> Iterator[Block]:
            del max_bytes
            for i in range(1000):
                note(f"line {i}", "bad")
            yield Block.from_chunks([Chunk(0, b"a")])

    capture = Capture(Source())
    for _ in range(2):
        list(capture.blocks())
        assert (len(capture.damage), capture.damage_count) == (100, 1000)


def test_settings_keep_what_they_do_not_know() -> None:
    line, complaints = LineSettings.from_header({"baud": 9600, "char_bits": 11, "source": "x", "list": [1, 2]})
    assert (line.baud, line.char_bits, dict(line.notes)) == (9600, 11, {"source": "x", "list": "[1, 2]"})
    assert not complaints
    assert LineSettings.from_header(line.to_header()) == (line, [])


@pytest.mark.parametrize(
    ("header", "char_bits", "notes"),
    [
        ({"parity": "N", "bits": 8, "stop": 1}, 10, {"data_bits": "8"}),
        ({"parity": "E", "data_bits": 7}, 10, {"data_bits": "7"}),
        ({"parity": "N", "data_bits": 8, "stop_bits": 2}, 11, {"data_bits": "8"}),
        ({"parity": "N", "stop_bits": 2}, None, {}),
        ({"parity": "N", "data_bits": "8"}, None, {"data_bits": "8"}),
        ({"data_bits": 8}, None, {"data_bits": "8"}),
        ({"char_bits": 11, "parity": "N", "data_bits": 8, "stop_bits": 1}, 11, {"data_bits": "8"}),
        ({"char_bits": 10, "stop_bits": 1, "stop": "14:00"}, 10, {"stop": "14:00"}),
        (
            {"stop": "14:00", "bits": [1], "baudrate": "fast"},
            None,
            {"stop": "14:00", "bits": "[1]", "baudrate": "fast"},
        ),
        ({"parity": "N", "data_bits": 8, "stop": float("inf")}, 10, {"data_bits": "8", "stop": "Infinity"}),
    ],
)
def test_a_character_may_be_told_in_parts_as_ports_are_set_up(
    header: dict[str, object], char_bits: int | None, notes: dict[str, str]
) -> None:
    line, complaints = LineSettings.from_header(header)
    assert (line.char_bits, dict(line.notes), complaints) == (char_bits, notes, [])


@pytest.mark.parametrize("header", [{"baud": 0}, {"baud": "fast"}, {"baud": True}, {"char_bits": 99}, {"stop_bits": 7}])
def test_impossible_settings_are_said_and_kept_as_notes(header: dict[str, object]) -> None:
    line, complaints = LineSettings.from_header(header)
    key = next(iter(header))
    assert getattr(line, key) is None
    assert key in line.notes
    assert complaints[0].startswith(key)
