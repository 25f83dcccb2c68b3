"""Bytes give a field tree whatever they are; the literature's frames give what the literature says."""

from __future__ import annotations

import json
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.annotation import Context, annotate, summary
from dissectors.crc import crc_bytes
from dissectors.envelopes import Adu, ascii_adu, rtu, tcp
from dissectors.fields import Field
from dissectors.functions import functions
from dissectors.length_rules import Role

REQUEST, RESPONSE = Role.REQUEST, Role.RESPONSE


def frame(text: str) -> Adu:
    """An RTU frame of its unit and PDU in hex."""
    body = bytes.fromhex(text)
    return rtu(body + crc_bytes(body))


def named(fields: tuple[Field, ...]) -> dict[str, Field]:
    return {field.name: field for field in fields}


def everything(fields: tuple[Field, ...]) -> Iterator[Field]:
    for field in fields:
        yield field
        yield from everything(field.fields)


def check_tree(adu: Adu, fields: tuple[Field, ...]) -> None:
    """The laws of a field tree."""
    at = 0
    for field in fields:
        assert field.start == at
        at += field.length
    assert at == len(adu.data)
    for field in everything(fields):
        assert field.raw == adu.data[field.start : field.start + field.length].hex()
        assert field.text.isprintable()
        for child in field.fields:
            assert field.start <= child.start
            assert child.start + child.length <= field.start + field.length
    json.dumps([field.to_json() for field in fields], allow_nan=False)


CODES = st.sampled_from([*functions(), *(code | 0x80 for code in functions()), 0, 65, 0x80, 0xFF])
PDU = st.one_of(
    st.binary(max_size=300),
    st.builds(lambda code, rest: bytes([code]) + rest, CODES, st.binary(max_size=260)),
    st.builds(lambda sub, rest: b"\x08\0" + bytes([sub]) + rest, st.integers(0, 21), st.binary(max_size=9)),
    st.builds(lambda count, rest: b"\x2b\x0e\1\1\0\0" + bytes([count]) + rest, st.integers(0, 5), st.binary()),
    st.builds(lambda code, rest: bytes([code, len(rest)]) + rest, CODES, st.binary(max_size=250)),
)


@given(PDU, st.sampled_from(Role), st.none() | PDU)
def test_any_bytes_give_a_tree_that_tiles_them(pdu: bytes, role: Role, request: bytes | None) -> None:
    body = b"\x11" + pdu
    for adu in (rtu(body), rtu(body + crc_bytes(body)), ascii_adu(body), tcp(b"\0\1\0\0\0\6" + body), tcp(pdu)):
        check_tree(adu, annotate(adu, role, Context(request)))
        line = summary(adu, role, Context(request))
        assert line and line.isprintable()


@pytest.mark.parametrize(
    ("text", "role", "request_text", "line"),
    [
        ("11 03 006B 0003", REQUEST, "", "read 3 holding registers from 107 (40108)"),
        ("11 03 06 AE4156524340", RESPONSE, "03 006B 0003", "3 registers: 44609 22098 17216"),
        ("11 01 0013 0025", REQUEST, "", "read 37 coils from 19 (00020)"),
        ("11 01 05 CD6BB20E1B", RESPONSE, "01 0013 0025", "37 coils: 10110011 11010110 01001101 01110000 11011"),
        ("11 02 00C4 0016", REQUEST, "", "read 22 discrete inputs from 196 (10197)"),
        ("11 04 0008 0001", REQUEST, "", "read 1 input register from 8 (30009)"),
        ("11 04 02 000A", RESPONSE, "04 0008 0001", "1 register: 10"),
        ("11 05 00AC FF00", REQUEST, "", "write coil 172 (00173): on"),
        ("11 06 0001 0003", RESPONSE, "06 0001 0003", "register 1 (40002) written: 3"),
        ("11 0F 0013 000A 02 CD01", REQUEST, "", "write 10 coils from 19 (00020): 10110011 10"),
        ("11 10 0001 0002 04 000A 0102", REQUEST, "", "write 2 registers from 1 (40002): 10 258"),
        ("11 10 0001 0002", RESPONSE, "", "2 registers from 1 (40002) written"),
        ("0A 81 02", RESPONSE, "", "exception 02 illegal data address"),
        ("0A 81 0C", RESPONSE, "", "exception 0C unknown exception"),
        ("01 08 0000 A537", REQUEST, "", "diagnostics: Return Query Data, data a5 37"),
        ("01 0B", REQUEST, "", "get comm event counter"),
        ("01 2B 0E 01 00", REQUEST, "", "read device identification: basic, stream, from VendorName"),
        ("01 41 0102", REQUEST, "", "user-defined function 65, 2 bytes of data"),
        ("01 5A 01", REQUEST, "", "reserved function 90, 1 byte of data"),
        ("01 03 006B", REQUEST, "", "Read Holding Registers request: 2 bytes expected, 0 found"),
    ],
)
def test_in_one_line(text: str, role: Role, request_text: str, line: str) -> None:
    context = Context(bytes.fromhex(request_text)) if request_text else Context()
    assert summary(frame(text), role, context) == line


def test_read_registers_with_their_addresses() -> None:
    fields = annotate(frame("11 03 06 AE4156524340"), RESPONSE, Context(bytes.fromhex("03006B0003")))
    assert [field.name for field in fields] == ["unit", "function", "byte_count", "registers", "crc"]
    registers = fields[3].fields
    assert [(r.start, r.value, r.address) for r in registers] == [(3, 44609, 107), (5, 22098, 108), (7, 17216, 109)]
    assert registers[0].text == "40108: 44609 (-20927, 0xAE41)"
    assert fields[4].value == 0xAD49
    assert fields[4].text == "ok"


def test_without_the_request_there_are_values_and_no_addresses() -> None:
    fields = annotate(frame("11 03 04 AE415652"), RESPONSE)
    assert [(r.value, r.address) for r in fields[3].fields] == [(44609, None), (22098, None)]


def test_coils_are_least_significant_bit_first() -> None:
    fields = annotate(frame("11 01 05 CD6BB20E1B"), RESPONSE, Context(bytes.fromhex("0100130025")))
    coils = named(fields)["coils"].fields
    assert "".join("1" if coil.value else "0" for coil in coils[:37]) == "1011001111010110010011010111000011011"
    assert [(coil.start, coil.bit, coil.bits, coil.address) for coil in (coils[0], coils[8], coils[36])] == [
        (3, 0, 1, 19),
        (4, 0, 1, 27),
        (7, 4, 1, 55),
    ]
    assert coils[0].text == "00020: on"
    assert (coils[37].name, coils[37].bit, coils[37].bits, coils[37].problem) == ("padding", 5, 3, None)


def test_unused_bits_must_be_zero() -> None:
    fields = annotate(frame("11 01 01 FF"), RESPONSE, Context(bytes.fromhex("0100130003")))
    assert named(fields)["coils"].fields[-1].problem == "unused bits are not zero"


@pytest.mark.parametrize(
    ("text", "role", "name", "problem"),
    [
        ("11 03 0000 007E", REQUEST, "quantity", "126 is outside 1 to 125"),
        ("11 01 0000 0000", REQUEST, "quantity", "0 is outside 1 to 2000"),
        ("11 05 0000 0001", REQUEST, "output_value", "0001 should be FF00 or 0000"),
        ("11 10 0000 0002 06 000000000000", REQUEST, "byte_count", "the quantity, 2, takes 4 bytes, not 6"),
        ("11 03 03 000102", RESPONSE, "byte_count", "3 is not a multiple of 2"),
        ("11 03 06 00010002", RESPONSE, "registers", "6 bytes expected, 4 found"),
        ("11 03 02 00010002", RESPONSE, "surplus", "2 bytes more than the frame's fields take"),
        ("11 03 00", REQUEST, "starting_address", "2 bytes expected, 1 found"),
        ("11 83", REQUEST, "function", "function codes of requests are 1 to 127"),
        ("11 00 01", REQUEST, "function", "function codes are 1 to 127"),
        ("F8 03 0000 0001", REQUEST, "unit", "units 248 to 255 are reserved"),
        ("11 83 0C", RESPONSE, "exception_code", "0C is not defined"),
        ("01 08 0055 0000", REQUEST, "sub_function", "0055 is not defined"),
        ("01 0F 0000 000A 01 CD", REQUEST, "byte_count", "the quantity, 10, takes 2 bytes, not 1"),
        ("01 14 08 060004000100020A", REQUEST, "byte_count", "8 is not a multiple of 7"),
    ],
)
def test_what_breaks_the_specification_is_said_where_it_is(text: str, role: Role, name: str, problem: str) -> None:
    assert named(annotate(frame(text), role))[name].problem == problem


@pytest.mark.parametrize(
    ("response", "request_text", "name", "problem"),
    [
        ("11 03 04 00010002", "03 0000 0003", "byte_count", "the quantity of the request, 3, takes 6 bytes, not 4"),
        ("11 06 0002 0003", "06 0001 0003", "register_address", "the request has 1 (0x0001, 40002)"),
        ("11 05 0002 FF00", "05 0002 0000", "output_value", "the request has off"),
    ],
)
def test_a_response_that_contradicts_its_request(response: str, request_text: str, name: str, problem: str) -> None:
    fields = annotate(frame(response), RESPONSE, Context(bytes.fromhex(request_text)))
    assert named(fields)[name].problem == problem


def test_the_request_of_another_function_says_nothing() -> None:
    fields = annotate(frame("11 03 02 0001"), RESPONSE, Context(bytes.fromhex("0400000002")))
    assert not any(field.problem for field in fields)
    assert named(fields)["registers"].fields[0].address is None


def test_a_wrong_check_value_says_what_is_right() -> None:
    (*_, crc) = annotate(rtu(bytes.fromhex("1103006B00037688")), REQUEST)
    assert (crc.name, crc.value, crc.problem) == ("crc", 0x8876, "76 87 is correct")
    assert crc.text == "wrong: 76 88, should be 76 87"
    (*_, lrc) = annotate(ascii_adu(bytes.fromhex("0A03000C0001E7")), REQUEST)
    assert (lrc.name, lrc.problem) == ("lrc", "E6 is correct")


def test_a_frame_too_short_for_a_check_value() -> None:
    fields = annotate(rtu(bytes.fromhex("1103")), REQUEST)
    assert [(field.name, field.length) for field in fields] == [("unit", 1), ("function", 1), ("crc", 0)]
    assert fields[1].problem == "after this, 2 bytes expected, 0 found"
    assert fields[-1].problem == "2 bytes can't hold a frame"
    assert annotate(rtu(b""), REQUEST) == ()


def test_tcp_has_a_header_and_no_check_value() -> None:
    fields = annotate(tcp(bytes.fromhex("0001 0000 0006 11 03006B0003")), REQUEST)
    assert [(field.name, field.value) for field in fields[:4]] == [
        ("transaction", 1),
        ("protocol_id", 0),
        ("length", 6),
        ("unit", 17),
    ]
    assert fields[-1].name == "quantity"
    wrong = named(annotate(tcp(bytes.fromhex("0001 0007 0008 FF 03006B0003")), REQUEST))
    assert wrong["protocol_id"].problem == "0 is Modbus, anything else is not"
    assert wrong["length"].problem == "8 bytes should follow, 6 do"
    assert wrong["unit"].problem is None


def test_an_exception_shows_its_bits() -> None:
    fields = annotate(frame("0A 81 02"), RESPONSE)
    flag, code = fields[1].fields
    assert (flag.bit, flag.bits, flag.value) == (7, 1, True)
    assert (code.bit, code.bits, code.value) == (0, 7, 1)
    assert fields[2].text == "02 illegal data address"


def test_json_has_the_agreed_keys() -> None:
    line = annotate(frame("11 01 01 01"), RESPONSE)[3].to_json()
    assert list(line) == ["name", "start", "length", "value", "raw", "text", "fields"]
    children = line["fields"]
    assert isinstance(children, list)
    assert list(children[0]) == ["name", "start", "length", "value", "raw", "text", "bit", "bits"]
