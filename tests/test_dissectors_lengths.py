"""Length rules: what the specification says, as the declarations say it."""

from __future__ import annotations

import pickle

import pytest
from construct import (
    Array,
    Bytes,
    Check,
    CString,
    GreedyBytes,
    Int8ub,
    Int16ub,
    Int16ul,
    Int24ub,
    Optional,
    Prefixed,
    Struct,
    Switch,
    this,
)
from hypothesis import given
from hypothesis import strategies as st

from dissectors.declaration import ByteCount, Function, Quantity
from dissectors.functions import functions
from dissectors.length_rules import Role, compiled, field_names, rebuilt, shape
from dissectors.lengths import RULES, pdu_length, plausibility, relations, rule
from dissectors.limits import MAX_PDU, Bound, Choice, Count, Echo, RequestedByteCount, Sized

REQUEST, RESPONSE = Role.REQUEST, Role.RESPONSE


@pytest.mark.parametrize(
    ("code", "role", "base", "count"),
    [
        (0x01, REQUEST, 5, None),
        (0x01, RESPONSE, 2, Count(1, 1, 1)),
        (0x03, REQUEST, 5, None),
        (0x03, RESPONSE, 2, Count(1, 1, 1)),
        (0x05, RESPONSE, 5, None),
        (0x06, REQUEST, 5, None),
        (0x07, REQUEST, 1, None),
        (0x07, RESPONSE, 2, None),
        (0x08, REQUEST, 5, None),
        (0x0B, RESPONSE, 5, None),
        (0x0C, RESPONSE, 2, Count(1, 1, 1)),
        (0x0F, REQUEST, 6, Count(5, 1, 1)),
        (0x10, REQUEST, 6, Count(5, 1, 1)),
        (0x10, RESPONSE, 5, None),
        (0x11, RESPONSE, 2, Count(1, 1, 1)),
        (0x14, REQUEST, 2, Count(1, 1, 1)),
        (0x15, RESPONSE, 2, Count(1, 1, 1)),
        (0x16, REQUEST, 7, None),
        (0x17, REQUEST, 10, Count(9, 1, 1)),
        (0x18, RESPONSE, 3, Count(1, 2, 1)),
        (0x80, RESPONSE, 2, None),  # seen: an exception to function 0
        (0x83, RESPONSE, 2, None),
        (0xC1, RESPONSE, 2, None),
    ],
)
def test_lengths_of_the_specification(code: int, role: Role, base: int, count: Count | None) -> None:
    known = rule(code, role)
    assert known is not None
    assert (known.base, known.count, known.walk) == (base, count, None)


def test_there_is_a_rule_for_each_side_of_each_function_and_for_each_exception() -> None:
    due = {(code, role) for code in functions() for role in Role} | {(code, RESPONSE) for code in range(0x80, 0x100)}
    assert set(RULES) == due
    assert len(RULES) == len(due)


def test_only_diagnostics_and_encapsulated_have_other_lengths() -> None:
    assert {code for (code, _), known in RULES.items() if known.variable} == {0x08, 0x2B}


def test_limits_that_real_frames_break_are_soft_and_contradictions_hard() -> None:
    read = rule(0x03, REQUEST)
    assert read is not None
    assert read.checks == (Bound(3, 2, 1, 125, soft=True),)
    coil = rule(0x05, REQUEST)
    assert coil is not None
    assert coil.checks == (Choice(3, 2, (0xFF00, 0), soft=True),)
    write = rule(0x10, REQUEST)
    assert write is not None
    assert Sized(5, 3, bits=False) in write.checks
    assert not Sized(5, 3, bits=False).soft
    odd = bytes.fromhex("0303 00112233")
    assert pdu_length(odd, RESPONSE) == -1
    assert pdu_length(bytes.fromhex("03 0000 007E"), REQUEST) == 5


def test_checks_stay_within_the_shortest_frame_and_its_crc() -> None:
    for known in RULES.values():
        for check in known.checks:
            if known.base is not None and not isinstance(check, Sized):
                assert check.offset + check.width <= known.base + 2


def test_relations_of_the_specification() -> None:
    assert relations(0x03) == (RequestedByteCount(1, 3, bits=False),)
    assert relations(0x01) == (RequestedByteCount(1, 3, bits=True),)
    assert relations(0x17) == (RequestedByteCount(1, 3, bits=False),)
    assert relations(0x05) == (Echo(1, 1, 2), Echo(3, 3, 2))
    assert relations(0x10) == (Echo(1, 1, 2), Echo(3, 3, 2))
    assert relations(0x16) == (Echo(1, 1, 2), Echo(3, 3, 2), Echo(5, 5, 2))
    assert relations(0x08) == (Echo(1, 1, 2),)
    assert relations(0x11) == relations(0x65) == relations(0x83) == ()


@pytest.mark.parametrize(
    ("pdu", "role", "length"),
    [
        ("", REQUEST, None),
        ("03", REQUEST, 5),
        ("03", RESPONSE, None),
        ("0306", RESPONSE, 8),
        ("83", REQUEST, -1),
        ("83", RESPONSE, 2),
        ("00", REQUEST, -1),
        ("41", REQUEST, None),
        ("10 0000 0002 06", REQUEST, -1),  # two registers do not take six bytes
        ("0F 0000 000A 02", REQUEST, 8),
        ("14 08", REQUEST, -1),  # groups take seven bytes each
        ("14 07 05", REQUEST, -1),  # of reference type 6
        ("0C 05", RESPONSE, -1),  # what stands before the events takes six
        ("18 0001", RESPONSE, -1),
        ("2B", RESPONSE, None),
        ("2B 0C", RESPONSE, -1),
        ("2B 0D", RESPONSE, None),
        ("2B 0D 010203040506", RESPONSE, None),
        ("2B 0E 01", REQUEST, None),
        ("2B 0E 01 00", REQUEST, 4),
        ("2B 0E 05 00", REQUEST, -1),
        ("2B 0E 01 01 00 00 02 00 03 414243 01", RESPONSE, None),
        ("2B 0E 01 01 00 00 02 00 03 414243 01 01", RESPONSE, None),
        ("2B 0E 01 01 00 00 02 00 03 414243 01 01 44", RESPONSE, 15),
        ("2B 0E 01 01 00 00 00", RESPONSE, 7),
    ],
)
def test_from_the_first_bytes(pdu: str, role: Role, length: int | None) -> None:
    assert pdu_length(bytes.fromhex(pdu), role) == length


def test_objects_that_no_pdu_can_hold() -> None:
    pdu = bytes.fromhex("2B0E0101000002 00FF") + bytes(255) + bytes.fromhex("01FF")
    assert pdu_length(pdu, RESPONSE) == -1


@given(st.binary(max_size=300), st.sampled_from(Role))
def test_bytes_never_raise_and_more_of_them_never_change_the_answer(pdu: bytes, role: Role) -> None:
    said = None
    for known in range(len(pdu) + 1):
        length = pdu_length(pdu[:known], role)
        assert length is None or length == -1 or length >= 1
        if said is not None and said > 0:
            assert length in (said, -1)  # a later field may yet rule it out
        if said == -1:
            assert length == -1
        said = length if length is not None else said
    assert all(isinstance(line, str) for line in plausibility(pdu, role))


@given(st.binary(max_size=260).map(lambda rest: b"\x2b\x0e\x01\x01" + rest))
def test_a_walk_ends(pdu: bytes) -> None:
    length = pdu_length(pdu, RESPONSE)
    assert length is None or length == -1 or 7 <= length <= min(len(pdu), MAX_PDU)
    if len(pdu) >= MAX_PDU:
        assert length is not None


def test_plausibility_in_words() -> None:
    assert plausibility(bytes.fromhex("03 0000 007E"), REQUEST) == ["quantity: 126 is outside 1 to 125"]
    assert plausibility(bytes.fromhex("05 0000 0001"), REQUEST) == ["output_value: 0001 should be FF00 or 0000"]
    assert plausibility(bytes.fromhex("10 0000 0002 06 000000000000"), REQUEST) == [
        "byte_count: the quantity, 2, takes 4 bytes, not 6"
    ]
    assert plausibility(bytes.fromhex("83 0C"), RESPONSE) == ["byte 1: 0C is not defined"]
    assert plausibility(b"", REQUEST) == plausibility(b"\x41\0", REQUEST) == []


def test_rules_are_plain_data() -> None:
    plain = [known for known in RULES.values() if known.walk is None]
    assert pickle.loads(pickle.dumps(plain)) == plain


SHAPES = {  # declaration: size, count, layout, (open-ended, bare, stepped)
    "numbers have a place": (Struct("a" / Int8ub, "b" / Int16ub), 4, None, {"a": (1, 1), "b": (2, 2)}, (0, 0, 0)),
    "of three bytes none": (Struct("a" / Int24ub, "b" / Int8ub), 5, None, {"b": (4, 1)}, (0, 0, 0)),
    "of low byte first none": (Struct("a" / Int16ul, "s" / Bytes(this.a)), 3, None, {}, (0, 0, 1)),
    "bytes that are counted": (Struct("n" / Int8ub, "s" / Bytes(this.n)), 2, Count(1, 1, 1), {"n": (1, 1)}, (0, 0, 0)),
    "bytes that nothing counts": (Struct("s" / Bytes(lambda c: c.n)), 1, None, {}, (0, 0, 1)),
    "a size below nothing": (Struct("s" / Bytes(-1)), 1, None, {}, (0, 0, 1)),
    "elements": (Struct("n" / Int16ub, "s" / Array(this.n, Int16ub)), 3, Count(1, 2, 2), {"n": (1, 2)}, (0, 0, 0)),
    "of any size": (Struct("n" / Int8ub, "s" / Array(this.n, CString("ascii"))), 2, None, {"n": (1, 1)}, (0, 0, 1)),
    "behind their number": (Struct("s" / Prefixed(Int8ub, GreedyBytes)), 2, Count(1, 1, 1), {}, (0, 0, 0)),
    "behind a wide number": (Struct("s" / Prefixed(Int24ub, GreedyBytes)), 1, None, {}, (0, 0, 1)),
    "behind low byte first": (Struct("s" / Prefixed(Int16ul, GreedyBytes)), 1, None, {}, (0, 0, 1)),
    "with their number": (Struct("s" / Prefixed(Int8ub, GreedyBytes, includelength=True)), 1, None, {}, (0, 0, 1)),
    "counted twice": (Struct("n" / Int8ub, Bytes(this.n), Bytes(this.n)), 2, Count(1, 1, 1), {"n": (1, 1)}, (0, 0, 1)),
    "a text with an end": (Struct("s" / CString("ascii")), 1, None, {}, (0, 0, 1)),
    "to the end": (Struct("a" / Int8ub, "s" / GreedyBytes), 2, None, {"a": (1, 1)}, (1, 1, 0)),
    "to the end, within": (Struct("s" / Optional(GreedyBytes)), 1, None, {}, (0, 0, 1)),
    "of one size": (Struct("k" / Int8ub, Switch(this.k, {1: Int16ub, 2: Bytes(2)})), 4, None, {"k": (1, 1)}, (0, 0, 0)),
    "of two": (Struct("k" / Int8ub, Switch(this.k, {1: Int16ub, 2: Int8ub})), 2, None, {"k": (1, 1)}, (0, 0, 1)),
    "nothing": (Struct("k" / Int8ub, Switch(this.k, {})), 2, None, {"k": (1, 1)}, (0, 0, 1)),
    "behind two sizes no place": (
        Struct("k" / Int8ub, Switch(this.k, {1: Int16ub, 2: Int8ub}), "z" / Int8ub), 3, None, {"k": (1, 1)}, (0, 0, 1)
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", SHAPES)
def test_the_shape_of_what_others_declare(case: str) -> None:
    declaration, size, count, placed, flags = SHAPES[case]
    found = shape(declaration)
    assert (found.size, found.count, found.layout) == (size, count, placed)
    assert (found.open_ended, found.bare, found.stepped) == flags


TEXT = CString("ascii")
WALKS = {  # declaration, bytes behind the function code: the length
    "a text that ends": (Struct("s" / TEXT), b"abc\0z", 5),
    "one that does not yet": (Struct("s" / TEXT), b"abc", None),
    "nor in any PDU": (Struct("s" / TEXT), b"a" * (MAX_PDU - 1), -1),
    "the longest": (Struct("s" / TEXT), b"a" * (MAX_PDU - 2) + b"\0", MAX_PDU),
    "longer": (Struct("s" / TEXT), b"a" * (MAX_PDU - 1) + b"\0", -1),
    "one that fails": (Struct(Check(lambda _: 1 // 0), "s" / TEXT), b"a\0", -1),
    "a number that cannot be": (Struct("n" / ByteCount(2, 8, multiple=2), "s" / TEXT), b"\3a\0", -1),
    "a count that does not fit": (Struct("q" / Quantity(1, 9), "n" / ByteCount(1, 9, of="q"), TEXT), b"\0\2\3\0", -1),
    "one that does": (Struct("q" / Quantity(1, 9), "n" / ByteCount(1, 9, of="q"), TEXT), b"\0\2\4\0", 5),
    "no end": (Struct("s" / TEXT, "rest" / GreedyBytes), b"a\0z", None),
}  # fmt: skip


@pytest.mark.parametrize("case", WALKS)
def test_the_length_of_what_others_declare(case: str) -> None:
    declaration, data, expected = WALKS[case]
    known, _ = compiled(Function(0x41, "X", declaration, declaration), REQUEST)
    assert known.walk is not None and known.walk(b"\x41" + data) == expected


def test_names_of_fields_and_parts_that_are_replaced() -> None:
    declared = Struct("a" / Int8ub, "in" / Struct("b" / Int16ub), Switch(this.a, {1: "c" / Int8ub}))
    assert field_names(declared) == ["a", "in", "b", "c"]
    assert rebuilt(declared, lambda _: None) is declared
    wider = rebuilt(declared, lambda part: Int24ub if part is Int16ub else None)
    assert (shape(wider).layout, shape(declared).layout) == ({"a": (1, 1)}, {"a": (1, 1), "b": (2, 2)})
