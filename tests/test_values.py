"""Registers and addresses as engineers read them."""

from __future__ import annotations

import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.values import (
    AREAS,
    ORDERS,
    Area,
    Order,
    ValueFormError,
    bits,
    characters,
    floating,
    hexadecimal,
    integer,
    logical,
    ordered,
    physical,
    prefixed,
    readings,
    signed,
)

WORD = st.integers(0, 0xFFFF)
PAIR = [0xAE41, 0x5652]


def test_one_register() -> None:
    assert signed(0xAE41) == -20927
    assert hexadecimal(0xAE41) == "0xAE41"
    assert bits(0xAE41) == "1010 1110 0100 0001"
    found = {reading.kind: reading.value for reading in readings([0xAE41])}
    assert found == {"u16": 44609, "s16": -20927, "hex": "0xAE41", "bits": "1010 1110 0100 0001", "text": ".A"}


def test_a_pair_of_the_literature() -> None:
    assert integer(PAIR) == 2923517522
    assert integer(PAIR, signed=True) == -1371449774
    assert math.isclose(floating(PAIR), -4.3959787e-11, rel_tol=1e-7)
    assert characters(PAIR) == ".AVR"


def test_the_float_constant_of_a_supply() -> None:
    assert f"{floating([0x3F84, 0xD9A8]):.10g}" == "1.037892342"
    assert math.isclose(floating([0x3F84, 0xD9A8]), 1.037892348, rel_tol=1e-7)


@pytest.mark.parametrize(
    ("order", "two", "four"),
    [
        ("ABCD", "ABCD", "ABCDEFGH"),
        ("CDAB", "CDAB", "GHEFCDAB"),
        ("BADC", "BADC", "BADCFEHG"),
        ("DCBA", "DCBA", "HGFEDCBA"),
    ],
)
def test_orders_are_named_by_how_the_bytes_come(order: Order, two: str, four: str) -> None:
    for name in (two, four):
        sent = [int.from_bytes(name[i : i + 2].encode(), "big") for i in range(0, len(name), 2)]
        assert ordered(sent, order) == bytes(sorted(name.encode()))


@given(st.sampled_from(ORDERS), st.floats(width=32, allow_nan=False))
def test_a_single_comes_back_in_any_order(order: Order, value: float) -> None:
    big = list(struct.unpack(">2H", struct.pack(">f", value)))
    sent = list(struct.unpack(">2H", ordered(big, order)))  # each order undoes itself
    assert floating(sent, order) == value


@given(st.sampled_from(ORDERS), st.floats(allow_nan=False), st.integers(-(2**63), 2**63 - 1))
def test_a_double_and_a_long_come_back_in_any_order(order: Order, value: float, whole: int) -> None:
    for data, read in ((struct.pack(">d", value), value), (struct.pack(">q", whole), whole)):
        sent = list(struct.unpack(">4H", ordered(list(struct.unpack(">4H", data)), order)))
        assert (floating(sent, order) if read is value else integer(sent, order, signed=True)) == read


@given(st.lists(WORD, max_size=6))
def test_readings_of_any_number_of_registers(registers: list[int]) -> None:
    found = readings(registers)
    assert found[-1].kind == "text"
    assert str(found[-1].value).isprintable()
    assert len(found) == {1: 5, 2: 13, 4: 13}.get(len(registers), 1)


def test_a_float_of_three_registers_is_refused() -> None:
    with pytest.raises(ValueFormError, match="2 or 4 registers, not 3"):
        floating([1, 2, 3])


@pytest.mark.parametrize(
    ("address", "area", "short", "long"),
    [
        (107, "4x", "40108", "400108"),
        (8, "3x", "30009", "300009"),
        (196, "1x", "10197", "100197"),
        (172, "0x", "00173", "000173"),
        (0, "4x", "40001", "400001"),
        (9998, "4x", "49999", "409999"),
    ],
)
def test_logical_addresses(address: int, area: Area, short: str, long: str) -> None:
    assert logical(address, area) == logical(address, area, 5) == short
    assert logical(address, area, 6) == long
    assert physical(short) == physical(long) == physical(prefixed(address, area)) == (area, address)


def test_addresses_beyond_five_digits_take_six() -> None:
    assert logical(9999, "4x") == "410000"
    assert logical(65535, "0x") == "065536"
    with pytest.raises(ValueFormError):
        logical(9999, "4x", 5)
    for address in (-1, 65536):
        with pytest.raises(ValueFormError):
            logical(address, "4x")


@given(st.integers(0, 0xFFFF), st.sampled_from(list(AREAS)))
def test_addresses_come_back(address: int, area: Area) -> None:
    assert physical(logical(address, area)) == physical(logical(address, area, 6)) == (area, address)
    assert physical(prefixed(address, area)) == (area, address)


@pytest.mark.parametrize(
    "text", ["", "4", "20001", "40000", "400000", "465537", "4x0", "4x", "4010a", "4٠١٠٨", "-4010"]
)
def test_what_is_no_logical_address(text: str) -> None:
    with pytest.raises(ValueFormError, match="is not a logical address"):
        physical(text)


@given(st.text())
def test_any_text_is_an_address_or_one_line_that_says_why_not(text: str) -> None:
    try:
        area, address = physical(text)
    except ValueFormError as error:
        assert "\n" not in str(error)
    else:
        assert area in AREAS and 0 <= address <= 0xFFFF
