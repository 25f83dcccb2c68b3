"""What construct builds from a declaration, the rules of the same declaration must measure and find in order."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pdus import CASES, REQUEST, RESPONSE, Values, built, registers_read, words

from dissectors.annotation import Context, annotate, summary
from dissectors.crc import crc_bytes
from dissectors.envelopes import rtu
from dissectors.functions import functions
from dissectors.length_rules import Role
from dissectors.lengths import layout, pdu_length, plausibility, relations, rule
from dissectors.limits import Echo


def test_every_function_has_a_case_here() -> None:
    assert {code for code, _ in CASES} == set(functions())


@pytest.mark.parametrize(("code", "role"), CASES, ids=lambda v: f"{v:02X}" if type(v) is int else v.name)
def test_what_is_built_is_measured_and_in_order(code: int, role: Role) -> None:
    @settings(max_examples=40)  # of each function and role
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
    @settings(max_examples=40)  # of each function and role
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
        if isinstance(relation, Echo):
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
