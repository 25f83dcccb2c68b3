"""What is peculiar to single functions: names, words, layouts of devices."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.annotation import annotate, summary
from dissectors.crc import crc_bytes
from dissectors.envelopes import rtu
from dissectors.fields import Field
from dissectors.functions import exception_meaning, exception_name, function, function_class, function_name, functions
from dissectors.functions.diagnostics import SUB_FUNCTIONS, event
from dissectors.length_rules import Role
from dissectors.values import device_text, harmless

REQUEST, RESPONSE = Role.REQUEST, Role.RESPONSE


def fields_of(body: bytes, role: Role) -> dict[str, Field]:
    return {field.name: field for field in annotate(rtu(body + crc_bytes(body)), role)}


def test_names_of_the_specification() -> None:
    assert {code: declared.name for code, declared in functions().items()} == {
        0x01: "Read Coils",
        0x02: "Read Discrete Inputs",
        0x03: "Read Holding Registers",
        0x04: "Read Input Registers",
        0x05: "Write Single Coil",
        0x06: "Write Single Register",
        0x07: "Read Exception Status",
        0x08: "Diagnostics",
        0x0B: "Get Comm Event Counter",
        0x0C: "Get Comm Event Log",
        0x0F: "Write Multiple Coils",
        0x10: "Write Multiple Registers",
        0x11: "Report Server ID",
        0x14: "Read File Record",
        0x15: "Write File Record",
        0x16: "Mask Write Register",
        0x17: "Read/Write Multiple Registers",
        0x18: "Read FIFO Queue",
        0x2B: "Encapsulated Interface Transport",
    }


@pytest.mark.parametrize(
    ("code", "kind", "name"),
    [
        (3, "public", "Read Holding Registers"),
        (0x83, "public", "Read Holding Registers"),
        (65, "user-defined", "user-defined function 65"),
        (110, "user-defined", "user-defined function 110"),
        (73, "unassigned", "unassigned function 73"),
        (90, "reserved", "reserved function 90"),
        (0, "invalid", "invalid function 0"),
    ],
)
def test_classes_of_codes(code: int, kind: str, name: str) -> None:
    assert (function_class(code), function_name(code)) == (kind, name)


def test_an_exception_is_of_its_function() -> None:
    assert function(0x83) is function(0x03) is functions()[3]
    assert function(65) is None


def test_exceptions() -> None:
    assert [exception_name(code) for code in (1, 2, 3, 4, 5, 6, 7, 8, 10, 11)] == [
        "illegal function",
        "illegal data address",
        "illegal data value",
        "server device failure",
        "acknowledge",
        "server device busy",
        "negative acknowledge",
        "memory parity error",
        "gateway path unavailable",
        "gateway target device failed to respond",
    ]
    assert exception_name(9) == "unknown exception"
    assert exception_meaning(2) and not exception_meaning(9)


@pytest.mark.parametrize("sub", SUB_FUNCTIONS)
def test_each_diagnostic_has_a_name_and_data(sub: int) -> None:
    for role in Role:
        fields = fields_of(bytes([1, 8, 0, sub, 0, 0]), role)
        assert fields["sub_function"].text == f"{sub:04X} {SUB_FUNCTIONS[sub][0]}"
        assert fields["data"].length == 2
        assert not any(field.problem for field in fields.values())


def test_diagnostics_counters_are_explained() -> None:
    assert fields_of(bytes.fromhex("0108000B0007"), RESPONSE)["data"].text == "7 messages seen on the bus"
    assert fields_of(bytes.fromhex("01080001FF00"), REQUEST)["data"].text == "clear the event log"
    assert fields_of(bytes.fromhex("010800033A00"), REQUEST)["data"].fields[0].value == 0x3A
    assert fields_of(bytes.fromhex("010800043A00"), REQUEST)["data"].problem == "3A00 should be 0000"


def test_query_data_may_be_longer() -> None:
    fields = fields_of(bytes.fromhex("01080000") + b"hello!", REQUEST)
    assert fields["data"].length == 6
    assert fields["data"].text == "68 65 6c 6c 6f 21 (hello!)"
    assert fields["data"].problem is None


@pytest.mark.parametrize(
    ("byte", "words"),
    [
        (0x00, "communications restarted"),
        (0x04, "entered listen only mode"),
        (0x20, "in listen only mode"),
        (0x80, "received"),
        (0x82, "received: communication error"),
        (0xD0, "received: character overrun, broadcast"),
        (0x40, "sent"),
        (0x41, "sent: read exception (1 to 3)"),
        (0x64, "sent: server busy exception (5, 6), in listen only mode"),
    ],
)
def test_event_bytes(byte: int, words: str) -> None:
    assert event(byte) == words


def test_event_log() -> None:
    fields = fields_of(bytes.fromhex("010C0800000108012182 40"), RESPONSE)
    assert [child.text for child in fields["events"].fields] == ["received: communication error", "sent"]
    assert fields["message_count"].value == 289


@pytest.mark.parametrize(
    ("data", "pieces"),
    [
        (b"\xb4\xffLMB3.1.4", [("server_id", 180), ("run_indicator", 255), ("additional_data", "LMB3.1.4")]),
        (b"\x01\x00", [("server_id", 1), ("run_indicator", 0)]),
        (b"Pymodbus-PM-3.16\xff", [("server_id", "Pymodbus-PM-3.16"), ("run_indicator", 255)]),
        (b"Pymodbus\0", [("server_id", "Pymodbus"), ("run_indicator", 0)]),
        (b"EL PSU Control (c) 2010 Elim Ltd.", [("server_id", "EL PSU Control (c) 2010 Elim Ltd.")]),
        (b"\x01\x02\x03", [("server_id", "010203")]),
        (b"A", [("server_id", "A")]),
    ],
)
def test_server_ids_of_real_devices(data: bytes, pieces: list[tuple[str, object]]) -> None:
    fields = fields_of(bytes([1, 0x11, len(data)]) + data, RESPONSE)
    assert [(child.name, child.value) for child in fields["data"].fields] == pieces


def test_device_identification() -> None:
    body = bytes.fromhex("012B0E0183FF02 02") + b"\x00\x04ACME" + b"\x80\x02\x1b["
    fields = fields_of(body, RESPONSE)
    assert fields["conformity_level"].text == "83 extended, stream and single objects"
    assert fields["more_follows"].text == "more follows"
    assert [child.text for child in fields["objects"].fields] == ["00 VendorName: ACME", "80 private: \\x1b["]
    assert not any(field.problem for field in fields.values())


def test_canopen_is_opaque_and_named() -> None:
    body = bytes.fromhex("012B0D010203")
    fields = fields_of(body, REQUEST)
    assert fields["mei_type"].text == "0D CANopen General Reference"
    assert fields["data"].value == "010203"
    assert summary(rtu(body + crc_bytes(body)), REQUEST) == "CANopen General Reference: 01 02 03"


def test_file_records_that_run_past_their_byte_count() -> None:
    fields = fields_of(bytes.fromhex("0114 08 050 6000100 02 05 06 00030004".replace(" ", "")), RESPONSE)
    assert fields["sub_responses"].problem == "the byte count says 8, what is in it takes 12"


@given(st.text() | st.binary().map(device_text))
def test_foreign_text_is_harmless(text: str) -> None:
    shown = harmless(text)
    assert shown.isprintable() or not shown
    assert harmless(shown) == shown
    if text.isprintable():
        assert shown == text


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("\x1b[31m", "\\x1b[31m"),
        ("a\nb", "a\\nb"),
        ("\x9b2J", "\\x9b2J"),
        ("\u202eabc", "\\u202eabc"),
        ("\u2028", "\\u2028"),
        ("\ud800", "\\ud800"),
        ("Ünïcode", "Ünïcode"),
    ],
)
def test_escapes(text: str, shown: str) -> None:
    assert harmless(text) == shown
