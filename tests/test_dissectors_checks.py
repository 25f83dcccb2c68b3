"""Check values: the specification's examples, their algebra, what is to blame for wrong ones, other conventions."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.crc import (
    ALGORITHMS,
    CRC_TABLE,
    VARIANTS,
    Algorithm,
    CrcVariant,
    byte_between,
    crc16,
    crc_bytes,
    crc_ok,
    flipped_bit,
    lrc,
    matching,
    needed,
    registers,
)

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


bodies = st.binary(min_size=2, max_size=254)


def _frame(body: bytes) -> bytes:
    return body + crc_bytes(body)


@given(bodies, st.data())
def test_a_residue_names_its_bit(body: bytes, source: st.DataObject) -> None:
    frame = bytearray(_frame(body))
    byte, bit = source.draw(st.integers(0, len(frame) - 1)), source.draw(st.integers(0, 7))
    frame[byte] ^= 1 << bit
    assert flipped_bit(crc16(bytes(frame)), len(frame)) == (byte, bit)


@given(bodies, st.data())
def test_two_flipped_bits_are_never_taken_for_one(body: bytes, source: st.DataObject) -> None:
    frame = _frame(body)
    first, second = source.draw(st.lists(st.integers(0, 8 * len(frame) - 1), min_size=2, max_size=2, unique=True))
    damaged = bytearray(frame)
    for at in (first, second):
        damaged[at // 8] ^= 1 << at % 8
    assert flipped_bit(crc16(bytes(damaged)), len(frame)) is None


def test_a_right_frame_has_no_flipped_bit() -> None:
    assert flipped_bit(0, 256) is None


def test_a_short_frame_has_no_bits_beyond_it() -> None:
    damaged = bytearray(_frame(bytes(20)))
    damaged[0] ^= 1
    assert flipped_bit(crc16(bytes(damaged)), 22) == (0, 0)
    assert flipped_bit(crc16(bytes(damaged)), 21) is None


def test_frames_too_long_to_tell_are_refused() -> None:
    with pytest.raises(ValueError, match="several bits"):
        flipped_bit(1, 5000)


@given(bodies)
def test_a_right_frame_has_the_registers_that_it_needs(body: bytes) -> None:
    frame = _frame(body)
    assert registers(frame) == needed(frame)


@given(bodies, st.data())
def test_a_lost_byte_is_found_in_its_place(body: bytes, source: st.DataObject) -> None:
    frame = _frame(body)
    at = source.draw(st.integers(0, len(frame) - 1))
    left = frame[:at] + frame[at + 1 :]
    assert byte_between(registers(left)[at], needed(left)[at]) == frame[at]


@given(st.integers(0, 0xFFFF), st.integers(0, 0xFFFF))
def test_at_most_one_byte_leads_from_one_register_to_another(before: int, after: int) -> None:
    leading = [byte for byte in range(256) if crc16(bytes((byte,)), before) == after]
    found = byte_between(before, after)
    assert leading == ([] if found is None else [found])


@pytest.mark.parametrize("algorithm", ALGORITHMS, ids=lambda algorithm: algorithm.name)
def test_catalogued_check_values(algorithm: Algorithm) -> None:
    assert algorithm(b"123456789") == algorithm.check


@pytest.mark.parametrize("variant", VARIANTS, ids=lambda variant: variant.name)
def test_every_convention_is_recognised(variant: CrcVariant) -> None:
    body = bytes.fromhex("110306AE4156524340")
    assert [found.name for found in matching(body + variant.made(body))] == [variant.name]


def test_the_usual_convention_is_no_variant() -> None:
    assert not list(matching(bytes.fromhex("110306AE415652434049AD")))
    assert len({variant.name for variant in VARIANTS}) == len(VARIANTS)
