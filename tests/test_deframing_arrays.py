"""Array forms say the same as what is told of one frame at a time: the CRC of any window, the lengths that fit."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from analyzer.deframing.rules import PERIOD, crc_windows, lengths_fit
from dissectors.crc import crc16, crc_bytes
from dissectors.length_rules import Role
from dissectors.lengths import RULES, sound_roles


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


FUNCTIONS = sorted({function for function, _ in RULES})
PDUS = st.builds(
    lambda function, head, rest: bytes((function, *head, *rest)),
    st.sampled_from(FUNCTIONS) | st.integers(0, 255),
    st.lists(st.integers(0, 6), max_size=8),
    st.binary(max_size=12),
)


@settings(max_examples=120, deadline=None)
@given(st.lists(PDUS, min_size=1, max_size=6))
def test_lengths_fit_as_sound_roles_says(pdus: list[bytes]) -> None:
    data = np.frombuffer(b"".join(b"\x01" + pdu + b"\0\0" for pdu in pdus), np.uint8)
    length = np.array([len(pdu) + 3 for pdu in pdus], np.intp)
    at = np.cumsum(length) - length
    for i, pdu in enumerate(pdus):
        for role in Role:
            mine = np.flatnonzero(np.array([other[0] == pdu[0] for other in pdus]))
            fits = lengths_fit(data, at[mine], length[mine], pdu[0], role)
            assert bool(fits[mine.tolist().index(i)]) == (role in sound_roles(pdu)), (pdu.hex(), role)
