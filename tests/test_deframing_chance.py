"""A clean bus loses nothing: windows inside longer frames that check by chance, made on purpose."""

from __future__ import annotations

from itertools import pairwise

import pytest
from buses import CHAR_NS, READ_AND_ANSWER, adu, deframed

from captures.chunks import Chunk
from dissectors.crc import crc16, crc_bytes

_PAUSES = (0, 6_000_000, 60_000_000, 400_000_000)  # ns: none known, as on a line, a late gateway's


def with_window(body: str, start: int, end: int) -> bytes:
    """An ADU from hex without CRC in which the window [start, end) checks: its last two bytes are made to."""
    data = bytearray.fromhex(body)
    data[end - 2 : end] = crc_bytes(bytes(data[start : end - 2]))
    frame = bytes(data) + crc_bytes(bytes(data))
    assert crc16(frame[start:end]) == 0
    return frame


def write_that_looks_answered() -> bytes:
    """A write of one register whose first 8 bytes are its own answer."""
    address = next(n for n in range(65536) if crc_bytes(bytes.fromhex(f"1110{n:04x}0001"))[0] == 2)
    head = bytes.fromhex(f"1110{address:04x}0001")
    return adu((head + crc_bytes(head)).hex() + "55")


# (request, answer): a window in one of them checks
EXCHANGES = {
    "a write whose first bytes are its own answer": (
        write_that_looks_answered(),
        adu(write_that_looks_answered()[:6].hex()),
    ),
    "a request one byte behind the beginning of a write": (
        with_window("03100122000408363536000000" + "0004", 1, 9),
        adu("031001220004"),
    ),
    "an answer whose first bytes are a request": (adu("010300000008"), with_window("010310" + "0004" * 8, 0, 8)),
    "a request inside an answer": (adu("010300000008"), with_window("010310" + "0103000a0001" + "0000" * 5, 3, 11)),
    "an answer inside a write": (
        with_window("0b10010000050a" + "0103020001" + "0000" + "010203", 7, 14),
        adu("0b1001000005"),
    ),
    "an answer that is its request and one byte": next(
        (adu(f"{unit:02x}07"), answer)
        for unit in range(1, 248)
        for status in range(256)
        if (answer := adu(f"{unit:02x}07{status:02x}"))[:4] == adu(f"{unit:02x}07")
    ),
}


@pytest.mark.parametrize("name", EXCHANGES)
@pytest.mark.parametrize("size", [0, 1, 8, 11, 62])
@pytest.mark.parametrize("pause_ns", _PAUSES)
def test_the_whole_frame_wins_over_a_window_that_checks(name: str, size: int, pause_ns: int) -> None:
    """Reads of `size` bytes (0: one a frame), so that pauses stand inside frames too."""
    if name.endswith("one byte") and size and pause_ns >= _PAUSES[2]:
        pytest.skip("a retry and a stray 00 are as likely behind such a tap")
    exchange = EXCHANGES[name]
    frames = [*READ_AND_ANSWER * 4, *exchange, *READ_AND_ANSWER * 2, *exchange, *READ_AND_ANSWER]
    data = b"".join(frames)
    ends = [0]
    for frame in frames:
        ends.append(ends[-1] + len(frame))
    bounds = [*range(0, len(data), size), len(data)] if size else ends
    now, chunks = 10**9, []
    for low, high in pairwise(bounds):
        now += pause_ns and pause_ns + (high - low) * CHAR_NS
        chunks.append(Chunk(now, data[low:high]))
    assert deframed(chunks).good() == frames
