"""Values without a fixed place, read without annotation: those that annotation gives, whatever the bytes are."""

from __future__ import annotations

import pytest
from construct import Byte, GreedyRange, Struct
from hypothesis import given
from hypothesis import strategies as st

from dissectors.annotation import annotate
from dissectors.blocks import Bits, Items, Record, Registers
from dissectors.declaration import AnyConstruct, ByteCount, Function, Number
from dissectors.envelopes import rtu
from dissectors.functions.file_records import READ_FILE_RECORD, WRITE_FILE_RECORD
from dissectors.layout import values_listed
from dissectors.length_rules import Role
from dissectors.listing import lister

SIDES = [
    (function, role)
    for function in (READ_FILE_RECORD, WRITE_FILE_RECORD)
    for role in (Role.REQUEST, Role.RESPONSE)
    if (function.code, role) != (0x14, Role.REQUEST)  # asks, and holds none
]
GROUPS = st.lists(st.tuples(st.binary(max_size=8), st.integers(0, 9)), max_size=4)


def body(code: int, groups: list[tuple[bytes, int]]) -> bytes:
    """Groups whose counts may say more or less than there is."""
    if code == 0x14:
        parts = [bytes((2 * said + 1, 6)) + data for data, said in groups]
    else:
        parts = [bytes((6, 0, 4, 0, 7, 0, said)) + data for data, said in groups]
    octets = b"".join(parts)
    return bytes((len(octets) & 0xFF,)) + octets


@pytest.mark.parametrize(("function", "role"), SIDES)
@given(groups=GROUPS, cut=st.integers(0, 40))
def test_the_values_are_those_of_annotation(
    function: Function, role: Role, groups: list[tuple[bytes, int]], cut: int
) -> None:
    data = body(function.code, groups)
    data = data[: len(data) - cut] if cut < len(data) else data
    declaration = function.request if role is Role.REQUEST else function.response
    listing = lister(declaration)
    assert listing is not None
    fields = annotate(rtu(bytes((1, function.code)) + data + b"\0\0"), role)
    assert listing(data) == list(values_listed(fields, frozenset({"register"})))


_BITS = Bits("n", each="coil", area="0x", start="n", quantity="n")


@pytest.mark.parametrize(
    "declaration",
    [
        Struct("count" / ByteCount(1, 9), "tries" / GreedyRange("data" / Registers("count"))),
        Struct("count" / ByteCount(1, 9), "register" / Number(1), "data" / Registers("count")),
        Struct(
            "count" / ByteCount(1, 9), "all" / Items("one" / Record("", "n" / Byte, "bits" / _BITS), octets="count")
        ),
    ],
)
def test_what_only_annotation_can_tell_is_left_to_it(declaration: AnyConstruct) -> None:
    assert lister(declaration) is None
