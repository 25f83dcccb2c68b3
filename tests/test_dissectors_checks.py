"""Check values against the specification's examples and against their algebra."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.crc import CRC_TABLE, crc16, crc_bytes, crc_ok, lrc

VECTORS = [
    "1103006B00037687",
    "110306AE415652434049AD",
    "1101001300250E84",
    "110105CD6BB20E1B45E6",
    "110200C40016BAA9",
    "110203ACDB352018",
    "110400080001B298",
    "110402000AF8F4",
    "110500ACFF004E8B",
    "1106000100039A9B",
    "110F0013000A02CD01BF0B",
    "110F0013000A2699",
    "1110000100020 4000A0102C6F0".replace(" ", ""),
    "1110000100021298",
    "0A0104A10001AC63",
    "0A8102B053",
    "04031C3FE91518030200010202000318020003 0B06C639070101000000000 0 0DEE".replace(" ", ""),
]


@pytest.mark.parametrize("vector", VECTORS)
def test_frames_of_the_literature_check(vector: str) -> None:
    adu = bytes.fromhex(vector)
    assert crc_ok(adu)
    assert crc_bytes(adu[:-2]) == adu[-2:]
    assert crc16(adu) == 0


def test_the_low_byte_goes_first() -> None:
    assert crc16(bytes.fromhex("010300000001")) == 0x0A84
    assert crc_bytes(bytes.fromhex("010300000001")) == bytes.fromhex("840A")


def test_standard_check_word() -> None:
    assert crc16(b"123456789") == 0x4B37


def test_lrc_of_the_literature() -> None:
    assert lrc(bytes.fromhex("0A03000C0001")) == 0xE6


@given(st.binary(), st.binary())
def test_a_crc_can_be_carried_on(first: bytes, second: bytes) -> None:
    assert crc16(second, crc16(first)) == crc16(first + second)


@given(st.binary(min_size=2, max_size=40), st.data())
def test_one_flipped_bit_never_passes(data: bytes, source: st.DataObject) -> None:
    adu = bytearray(data + crc_bytes(data))
    bit = source.draw(st.integers(0, 8 * len(adu) - 1))
    adu[bit >> 3] ^= 1 << (bit & 7)
    assert not crc_ok(bytes(adu))


@given(st.binary(max_size=3))
def test_too_short_is_no_frame(data: bytes) -> None:
    assert not crc_ok(data)


@given(st.binary())
def test_lrc_makes_the_sum_zero(data: bytes) -> None:
    assert (sum(data) + lrc(data)) & 0xFF == 0


def test_the_table_is_the_crc_of_single_bytes() -> None:
    assert [crc16(bytes([byte]), 0) for byte in range(256)] == list(CRC_TABLE)
