"""The CRC of any window by one comparison agrees with the CRC computed byte by byte."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from analyzer.deframing.crc_windows import PERIOD, crc_windows
from dissectors.crc import crc16, crc_bytes


@given(st.binary(min_size=1, max_size=120), st.integers(0, 3 * PERIOD))
def test_a_window_checks_exactly_where_its_crc_is_zero(data: bytes, before: int) -> None:
    stream = bytes(before) + data
    heads, tails = crc_windows(np.frombuffer(stream, np.uint8))
    for start in range(before, len(stream)):
        for end in range(start + 1, len(stream) + 1):
            assert (heads[start] == tails[end]) == (crc16(stream[start:end]) == 0)


def test_windows_across_slices_of_the_work() -> None:
    rng = np.random.default_rng(1)
    stream = bytearray(rng.integers(0, 256, 600_000, np.uint8).tobytes())
    places = [1 << 17, (1 << 18) - 5, 3 * PERIOD - 1, 599_000]
    for place in places:
        frame = b"\x11\x03\x00\x6b\x00\x03"
        stream[place - 4 : place + 4] = frame + crc_bytes(frame)
    heads, tails = crc_windows(np.frombuffer(bytes(stream), np.uint8))
    for place in places:
        assert heads[place - 4] == tails[place + 4]
    assert abs(np.mean(heads[:-8] == tails[8:]) - 1 / 65536) < 3e-5
