"""ASCII mode on the line: frames between `:` and CR LF, paired like any others."""

from __future__ import annotations

from buses import LINE, collect, proven
from hypothesis import given
from hypothesis import strategies as st

from analyzer.core import deframe
from analyzer.deframing.protocols import Deframer
from analyzer.options import Options
from captures.chunks import Capture, Chunk
from dissectors.crc import lrc


def frame(text: str) -> bytes:
    data = bytes.fromhex(text)
    return b":" + (data + bytes([lrc(data)])).hex().upper().encode() + b"\r\n"


READ, ANSWER = frame("1103006b0003"), frame("110306ae4156524340")


def test_a_capture_in_ascii_mode_is_seen_as_one_and_paired() -> None:
    chunks = [Chunk(10**9 + i * 10**8, READ if i % 2 == 0 else ANSWER) for i in range(8)]
    frames = [f for batch in deframe(Capture.of(LINE, chunks)) for f in batch.frames()]
    assert [f.direction for f in frames] == ["request", "response"] * 4
    assert [f.protocol for f in frames] == ["ascii"] * 8
    assert frames[1].request_start == 0
    assert all(f.crc_ok for f in frames)
    assert frames[1].to_json()["hex"] == "110306ae4156524340cc"
    assert "40108" in frames[0].summary() and "44609" in frames[1].summary()


def test_a_wrong_lrc_is_a_damaged_frame_and_text_around_is_noise() -> None:
    broken = READ[:-4] + b"00\r\n"
    deframer = Deframer(LINE, Options(protocol="ascii"))
    found = collect([deframer.feed(Chunk(1, b"boot ok\r\n" + READ + broken)), deframer.close()])
    assert found.rows.kind.tolist() == [0, 1, 1]
    assert found.rows.check.tolist() == [False, True, False]


def test_a_line_feed_that_the_tap_held_back_belongs_to_its_frame() -> None:
    """A gateway sends its first 17 bytes, the rest 200 ms later: characters of a frame may be a second apart."""
    deframer = Deframer(LINE, Options(protocol="ascii"))
    parts = [(10**9, READ[:-1]), (1_200_000_000, READ[-1:] + ANSWER)]
    batches = [deframer.feed(Chunk(*parts[0])), deframer.tick(1_100_000_000), deframer.feed(Chunk(*parts[1]))]
    found = collect([*batches, deframer.close()])
    assert found.rows.kind.tolist() == [1, 2]
    assert found.rows.length.tolist() == [len(READ), len(ANSWER)]


def test_frames_that_end_without_a_line_feed_do_not_wait_for_one() -> None:
    """Once one was seen that does; then a quiet line tells as it does elsewhere."""
    deframer = Deframer(LINE, Options(protocol="ascii"))
    deframer.feed(Chunk(10**9, READ[:-1] + ANSWER[:-1]))
    assert len(deframer.tick(1_100_000_000))
    other = Deframer(LINE, Options(protocol="ascii"))
    other.feed(Chunk(10**9, READ[:-1]))
    assert not len(other.tick(1_100_000_000))
    assert len(other.tick(2_100_000_000))


def test_an_echo_that_is_cut_at_the_very_end_answers_nothing() -> None:
    """A stream of the campaign: its fields were looked for after the last byte."""
    deframer = Deframer(LINE, Options(protocol="ascii"))
    found = collect([deframer.feed(Chunk(1, b":110F0013000A02CD01F3\r\n:110F0468\r\n")), deframer.close()])
    assert found.rows.check.tolist() == [True, False]
    assert found.rows.request.tolist() == [-1, -1]


def test_rtu_bytes_are_not_taken_for_ascii() -> None:
    assert proven(bytes.fromhex("1103006b00037687") * 20) == "rtu"
    assert proven(READ + ANSWER) == "ascii"


def test_garbage_for_answers_does_not_make_requests_in_ascii_rtu() -> None:
    """A unit at another speed answers each request with bytes that no text has."""
    garbage = bytes.fromhex("292139000127012d212171") + bytes(range(0x80, 0x90))
    assert proven((READ + garbage) * 4) == "ascii"
    chunks = [Chunk(10**9 + i * 10**8, READ if i % 2 == 0 else garbage) for i in range(20)]
    frames = [f for batch in deframe(Capture.of(LINE, chunks)) for f in batch.frames() if f.crc_ok]
    assert [f.protocol for f in frames] == ["ascii"] * 10


def test_rtu_among_frames_in_ascii_is_still_rtu() -> None:
    spoken = bytes.fromhex("1103006b00037687110306ae415652434049ad")
    chunks = [Chunk(10**9 + i * 10**8, READ if i % 2 == 0 else spoken * 2) for i in range(80)]
    frames = [f for batch in deframe(Capture.of(LINE, chunks)) for f in batch.frames() if f.crc_ok]
    assert {f.protocol for f in frames} == {"rtu"}


@given(
    st.lists(st.one_of(st.sampled_from([READ, ANSWER, b":", b"\r\n"]), st.binary(max_size=40)), max_size=12),
    st.integers(1, 50),
)
def test_every_byte_once_whatever_comes(pieces: list[bytes], size: int) -> None:
    data = b"".join(pieces)
    deframer = Deframer(LINE, Options(protocol="ascii"))
    batches = [deframer.feed(Chunk(i * 10**6, data[i : i + size])) for i in range(0, len(data), size)]
    found = collect([*batches, deframer.close()])
    assert found.data == data
    assert (found.rows.start + found.rows.length)[:-1].tolist() == found.rows.start[1:].tolist()
