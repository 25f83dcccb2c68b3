"""RTU, ASCII and TCP around the same PDU; whatever the bytes, an answer."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.crc import crc_bytes, lrc
from dissectors.envelopes import ascii_adu, ascii_frames, rtu, tcp, tcp_frames

BODY = st.binary(min_size=2, max_size=60)
PDU = bytes.fromhex("0300 6B0003")


def coded(body: bytes) -> bytes:
    """An ASCII frame of unit and PDU."""
    return b":" + (body + bytes([lrc(body)])).hex().upper().encode() + b"\r\n"


def test_rtu() -> None:
    adu = rtu(bytes.fromhex("1103006B00037687"))
    assert (adu.protocol, adu.unit, adu.pdu, adu.check_ok) == ("rtu", 17, PDU, True)
    assert adu.check_received == adu.check_computed == 0x8776
    assert not rtu(bytes.fromhex("1103006B00037688")).check_ok


@pytest.mark.parametrize("size", [0, 1, 2, 3])
def test_rtu_too_short_to_hold_a_check(size: int) -> None:
    adu = rtu(bytes(range(size)))
    assert adu.check_ok is False
    assert adu.check_received is None
    assert adu.pdu == bytes(range(1, size))


def test_ascii_of_the_literature() -> None:
    (adu,) = ascii_frames(b":0A03000C0001E6\r\n")
    assert (adu.unit, adu.pdu, adu.check_ok) == (10, bytes.fromhex("03000C0001"), True)
    assert adu.data == bytes.fromhex("0A03000C0001E6")
    assert (adu.start, adu.length) == (0, 17)


@pytest.mark.parametrize(
    "raw",
    [
        b":0A03000C0001E6",  # the paste ends early
        b":0A03000C0001E6\r",
        b":0A03000C0001E6\n",
        b":0a03000c0001e6\r\n",
        b">0A03000C0001E6\r\n",
        bytes(c | 0x80 for c in b":0A03000C0001E6\r\n"),
        b"noise :0A03000C0001E6\r\n",
        b"12:30:05 :0A03000C0001E6",
    ],
)
def test_ascii_as_it_is_pasted(raw: bytes) -> None:
    (adu,) = ascii_frames(raw)
    assert adu.check_ok
    assert adu.data == bytes.fromhex("0A03000C0001E6")


def test_ascii_damaged() -> None:
    (odd,) = ascii_frames(b":0A03000C0001E\r\n")
    assert odd.check_ok is False
    (cut,) = ascii_frames(b":0A03000?0001E6\r\n")
    assert (cut.check_ok, cut.data) == (False, bytes.fromhex("0A0300"))
    assert ascii_frames(b":0A\r\n$018\r") == []


@given(st.lists(BODY, max_size=5), st.booleans())
def test_ascii_frames_in_a_row(bodies: list[bytes], eighth: bool) -> None:
    raw = b"".join(map(coded, bodies))
    if eighth:
        raw = bytes(c | 0x80 for c in raw)
    found = ascii_frames(raw)
    assert [adu.data[:-1] for adu in found] == bodies
    assert all(adu.check_ok for adu in found)
    at = 0
    for adu in found:
        assert adu.start == at
        at += adu.length
    assert at == len(raw)


def test_tcp() -> None:
    (adu,) = tcp_frames(bytes.fromhex("0001 0000 0006 11") + PDU)
    assert (adu.unit, adu.pdu, adu.check_ok, adu.check_received) == (17, PDU, None, None)
    assert tcp_frames(b"\0\1\0\1\0\6\x11" + PDU) == []  # protocol 1 is something else
    assert tcp_frames(b"\0\1\0\0\0\6\x11") == []  # no function code


def test_tcp_cut_short_keeps_what_is_there() -> None:
    (adu,) = tcp_frames(bytes.fromhex("0001 0000 0006 11") + PDU[:3])
    assert (adu.pdu, adu.length) == (PDU[:3], 10)


@given(st.lists(st.tuples(st.integers(0, 0xFFFF), BODY), max_size=5))
def test_tcp_frames_in_a_row(frames: list[tuple[int, bytes]]) -> None:
    raw = b"".join(n.to_bytes(2, "big") + b"\0\0" + len(b).to_bytes(2, "big") + b for n, b in frames)
    found = tcp_frames(raw)
    assert [(int.from_bytes(adu.data[:2], "big"), adu.data[6:]) for adu in found] == frames
    assert b"".join(adu.data for adu in found) == raw
    assert [raw[adu.start : adu.start + adu.length] for adu in found] == [adu.data for adu in found]


@given(st.binary(max_size=300))
def test_bytes_never_raise(raw: bytes) -> None:
    for adu in (rtu(raw), ascii_adu(raw), tcp(raw), *ascii_frames(raw), *ascii_frames(b":" + raw.hex().encode())):
        assert adu.pdu in adu.data
        assert adu.check_ok is None or isinstance(adu.check_ok, bool)
    for adu in tcp_frames(raw):
        assert raw[adu.start : adu.start + adu.length] == adu.data


@given(BODY)
def test_a_right_check_is_said_to_be_right(body: bytes) -> None:
    assert rtu(body + crc_bytes(body)).check_ok is True
    assert ascii_adu(body + bytes([lrc(body)])).check_ok is True
