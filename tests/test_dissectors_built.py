"""What construct builds from a declaration, the rules of the same declaration must measure and find in order."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dissectors.annotation import Context, annotate, summary
from dissectors.checks import crc_bytes
from dissectors.envelopes import rtu
from dissectors.functions import function, functions
from dissectors.lengths import Role, layout, pdu_length, plausibility, relations, rule

WORD = st.integers(0, 0xFFFF)
BYTE = st.integers(0, 0xFF)
Values = dict[str, Any]
Made = st.SearchStrategy[Values]

REQUEST, RESPONSE = Role.REQUEST, Role.RESPONSE


def words(least: int, most: int) -> st.SearchStrategy[list[int]]:
    return st.lists(WORD, min_size=least, max_size=most)


def fixed(**parts: st.SearchStrategy[Any]) -> Made:
    return st.fixed_dictionaries(parts)


def read_request(most: int) -> Made:
    return fixed(starting_address=WORD, quantity=st.integers(1, most))


def registers_read(values: list[int]) -> Values:
    return {"byte_count": 2 * len(values), "registers": values}


def bits_read(name: str) -> Callable[[list[bool]], Values]:
    return lambda values: {"byte_count": (len(values) + 7) // 8, name: values}


def bits(most: int) -> st.SearchStrategy[list[bool]]:
    return st.lists(st.booleans(), min_size=1, max_size=most)


COIL = fixed(output_address=WORD, output_value=st.sampled_from([0xFF00, 0]))
REGISTER = fixed(register_address=WORD, register_value=WORD)
WRITTEN = fixed(starting_address=WORD, quantity=st.integers(1, 123))
MASKS = fixed(reference_address=WORD, and_mask=WORD, or_mask=WORD)
NOTHING: Made = st.just({})
STATUS = st.sampled_from([0, 0xFFFF])
SUB_REQUEST = fixed(
    reference_type=st.just(6),
    file_number=st.integers(1, 0xFFFF),
    record_number=st.integers(0, 9999),
    record_length=WORD,
)
SUB_RESPONSE = words(1, 20).map(
    lambda v: {"file_response_length": 1 + 2 * len(v), "reference_type": 6, "record_data": v}
)
SUB_WRITE = st.builds(
    lambda group, data: {**group, "record_length": len(data), "record_data": data}, SUB_REQUEST, words(1, 20)
)
OBJECT = st.builds(
    lambda code, value: {"object_id": code, "object_length": len(value), "object_value": value},
    BYTE,
    st.binary(max_size=30),
)


def written(count: Callable[[list[Any]], int], name: str) -> Callable[[int, list[Any]], Values]:
    return lambda address, values: {
        "starting_address": address,
        "quantity": len(values),
        "byte_count": count(values),
        name: values,
    }


def groups(name: str, element: Made, most: int, size: Callable[[Values], int]) -> Made:
    return st.lists(element, min_size=1, max_size=most).map(
        lambda found: {"byte_count": sum(map(size, found)), name: found}
    )


def identification(objects: list[Values]) -> Values:
    return {
        "mei_type": 0x0E,
        "mei_data": {
            "read_device_id_code": 1,
            "conformity_level": 0x81,
            "more_follows": 0,
            "next_object_id": 0,
            "number_of_objects": len(objects),
            "objects": objects,
        },
    }


CASES: dict[tuple[int, Role], Made] = {
    (0x01, REQUEST): read_request(2000),
    (0x01, RESPONSE): bits(2000).map(bits_read("coils")),
    (0x02, REQUEST): read_request(2000),
    (0x02, RESPONSE): bits(2000).map(bits_read("inputs")),
    (0x03, REQUEST): read_request(125),
    (0x03, RESPONSE): words(1, 125).map(registers_read),
    (0x04, REQUEST): read_request(125),
    (0x04, RESPONSE): words(1, 125).map(registers_read),
    (0x05, REQUEST): COIL,
    (0x05, RESPONSE): COIL,
    (0x06, REQUEST): REGISTER,
    (0x06, RESPONSE): REGISTER,
    (0x07, REQUEST): NOTHING,
    (0x07, RESPONSE): fixed(output_data=BYTE),
    (0x08, REQUEST): fixed(sub_function=st.just(1), data=st.sampled_from([0, 0xFF00])),
    (0x08, RESPONSE): fixed(sub_function=st.integers(11, 18), data=WORD),
    (0x0B, REQUEST): NOTHING,
    (0x0B, RESPONSE): fixed(status=STATUS, event_count=WORD),
    (0x0C, REQUEST): NOTHING,
    (0x0C, RESPONSE): st.builds(
        lambda events, a, b: {
            "byte_count": 6 + len(events),
            "status": 0,
            "event_count": a,
            "message_count": b,
            "events": events,
        },
        st.binary(max_size=64),
        WORD,
        WORD,
    ),
    (0x0F, REQUEST): st.builds(written(lambda v: (len(v) + 7) // 8, "coils"), WORD, bits(1968)),
    (0x0F, RESPONSE): WRITTEN,
    (0x10, REQUEST): st.builds(written(lambda v: 2 * len(v), "registers"), WORD, words(1, 123)),
    (0x10, RESPONSE): WRITTEN,
    (0x11, REQUEST): NOTHING,
    (0x11, RESPONSE): st.binary(min_size=1, max_size=251).map(lambda data: {"byte_count": len(data), "data": data}),
    (0x14, REQUEST): groups("sub_requests", SUB_REQUEST, 35, lambda _: 7),
    (0x14, RESPONSE): groups("sub_responses", SUB_RESPONSE, 5, lambda v: 2 + 2 * len(v["record_data"])),
    (0x15, REQUEST): groups("sub_requests", SUB_WRITE, 5, lambda v: 7 + 2 * len(v["record_data"])),
    (0x15, RESPONSE): groups("sub_requests", SUB_WRITE, 5, lambda v: 7 + 2 * len(v["record_data"])),
    (0x16, REQUEST): MASKS,
    (0x16, RESPONSE): MASKS,
    (0x17, REQUEST): st.builds(
        lambda at, n, to, values: {
            "read_starting_address": at,
            "quantity_to_read": n,
            "write_starting_address": to,
            "quantity_to_write": len(values),
            "write_byte_count": 2 * len(values),
            "write_registers": values,
        },
        WORD,
        st.integers(1, 125),
        WORD,
        words(1, 121),
    ),
    (0x17, RESPONSE): words(1, 125).map(registers_read),
    (0x18, REQUEST): fixed(fifo_pointer_address=WORD),
    (0x18, RESPONSE): words(0, 31).map(lambda v: {"byte_count": 2 + 2 * len(v), "fifo_count": len(v), "registers": v}),
    (0x2B, REQUEST): fixed(
        mei_type=st.just(0x0E), mei_data=fixed(read_device_id_code=st.integers(1, 4), object_id=BYTE)
    ),
    (0x2B, RESPONSE): st.lists(OBJECT, max_size=7).map(identification),
}


def built(code: int, role: Role, values: Values) -> bytes:
    declared = function(code)
    assert declared is not None
    declaration = declared.request if role is Role.REQUEST else declared.response
    return bytes([code]) + declaration.build(values)


def test_every_function_has_a_case_here() -> None:
    assert {code for code, _ in CASES} == set(functions())


@pytest.mark.parametrize(("code", "role"), CASES, ids=lambda v: f"{v:02X}" if type(v) is int else v.name)
def test_what_is_built_is_measured_and_in_order(code: int, role: Role) -> None:
    @given(CASES[code, role], st.binary(max_size=6))
    def check(values: Values, after: bytes) -> None:
        pdu = built(code, role, values)
        assert pdu_length(pdu, role) == len(pdu)
        assert pdu_length(pdu + after, role) == len(pdu)  # what follows does not matter
        for known in range(len(pdu)):  # and a beginning never misleads
            assert pdu_length(pdu[:known], role) in (None, len(pdu))
        assert plausibility(pdu, role) == []
        adu = bytes([1]) + pdu
        fields = annotate(rtu(adu + crc_bytes(adu)), role)
        assert [field.problem for field in fields] == [None] * len(fields)
        named = {field.name: field for field in fields}
        for name, (offset, width) in layout(code, role).items():
            assert (named[name].start, named[name].length) == (1 + offset, width)
            assert named[name].value == int.from_bytes(pdu[offset : offset + width], "big")

    check()


@pytest.mark.parametrize(("code", "role"), CASES, ids=lambda v: f"{v:02X}" if type(v) is int else v.name)
def test_a_frame_cut_anywhere_says_so(code: int, role: Role) -> None:
    @given(CASES[code, role], st.data())
    def check(values: Values, data: st.DataObject) -> None:
        pdu = built(code, role, values)
        if len(pdu) < 2:
            return
        cut = data.draw(st.integers(1, len(pdu) - 1))
        known = rule(code, role)
        assert known is not None
        adu = bytes([1]) + pdu[:cut]
        fields = annotate(rtu(adu + crc_bytes(adu)), role)
        assert any(field.problem for field in fields)
        assert sum(field.length for field in fields) == len(adu) + 2

    check()


@given(st.integers(0, 0xFFFF), words(1, 125))
def test_a_read_gives_its_response_addresses(start: int, values: list[int]) -> None:
    request = built(3, REQUEST, {"starting_address": start, "quantity": len(values)})
    response = bytes([1]) + built(3, RESPONSE, registers_read(values))
    fields = annotate(rtu(response + crc_bytes(response)), RESPONSE, Context(request))
    registers = next(field for field in fields if field.name == "registers")
    assert [child.value for child in registers.fields] == values
    due = [start + i if start + i <= 0xFFFF else None for i in range(len(values))]
    assert [child.address for child in registers.fields] == due


@given(st.integers(1, 125), words(1, 125))
def test_a_byte_count_that_the_request_did_not_ask_for_is_a_problem(quantity: int, values: list[int]) -> None:
    request = built(3, REQUEST, {"starting_address": 0, "quantity": quantity})
    response = bytes([1]) + built(3, RESPONSE, registers_read(values))
    fields = annotate(rtu(response + crc_bytes(response)), RESPONSE, Context(request))
    assert (fields[2].problem is None) == (quantity == len(values))


@pytest.mark.parametrize("code", sorted(functions()))
def test_relations_hold_between_places_that_exist(code: int) -> None:
    request, response = layout(code, REQUEST), layout(code, RESPONSE)
    for relation in relations(code):
        if hasattr(relation, "width"):
            assert (relation.request_offset, relation.width) in request.values()
            assert (relation.response_offset, relation.width) in response.values()
        else:
            assert (relation.quantity_offset, 2) in request.values()
            assert (relation.count_offset, 1) in response.values()


def test_every_summary_is_one_line_in_words() -> None:
    said = set()
    for code in functions():
        for role in Role:
            adu = bytes([1, code, *range(1, 12)])
            line = summary(rtu(adu + crc_bytes(adu)), role)
            assert line and line.isprintable()
            said.add(line)
    assert len(said) > len(functions())
