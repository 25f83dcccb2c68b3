"""The CRC solved for what is to blame, and the other conventions."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.crc import byte_between, crc16, crc_bytes, flipped_bit, needed, registers
from dissectors.crc_variants import ALGORITHMS, VARIANTS, Algorithm, CrcVariant, matching

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
