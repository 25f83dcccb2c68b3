"""Many PDUs read at once: what annotation and the walk of one PDU say, whatever the bytes are."""

from __future__ import annotations

import numpy as np
import pytest
from construct import Byte, GreedyRange, Struct
from hypothesis import given
from hypothesis import strategies as st

from dissectors.annotation import annotate
from dissectors.blocks import Bits, Items, Record, Registers
from dissectors.columnar import pdu_ends, register_runs
from dissectors.declaration import AnyConstruct, ByteCount, Function, Number
from dissectors.envelopes import rtu
from dissectors.functions.file_records import READ_FILE_RECORD, WRITE_FILE_RECORD
from dissectors.layout import values_listed
from dissectors.length_rules import PduWalk, Role
from dissectors.limits import MAX_PDU
from dissectors.registry import functions

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
    runs = register_runs(declaration)
    assert runs is not None
    octets = np.frombuffer(data + b"\xff" * 4, np.uint8)  # what follows is of no PDU here
    pdu, begins, counts = runs(octets, np.array([0, 0]), np.array([len(data), 0]))  # the second has no bytes
    assert not pdu.any()
    found = [
        int.from_bytes(data[begin + 2 * i : begin + 2 * i + 2], "big")
        for begin, count in zip(begins.tolist(), counts.tolist(), strict=True)
        for i in range(count)
    ]
    fields = annotate(rtu(bytes((1, function.code)) + data + b"\0\0"), role)
    assert found == list(values_listed(fields, frozenset({"register"})))


DECLARED = {
    (function.code, role): function.request if role is Role.REQUEST else function.response
    for function in functions().values()
    for role in Role
}
HEADS = [  # beginnings that walks go on from
    b"\x0e\x06\x00\x04\x00\x01\x00\x02\x06\x00\x03\x00\x09\x00\x02",
    b"\x0c\x05\x06\x0d\xfe\x00\x20\x05\x06\x33\xcd\x00\x40",
    b"\x0d\x06\x00\x04\x00\x07\x00\x03\x06\xaf\x04\xbe\x10\x0d",
    b"\x0e\x01\x01\x00\x00\x03\x00\x16Company identification\x01\x03ABC\x02\x05V2.11",
    b"\x0e\x01\x00",
]


@given(st.lists(st.tuples(st.sampled_from(HEADS), st.integers(0, 60), st.binary(max_size=300)), min_size=1, max_size=6))
def test_pdus_end_where_the_walk_of_each_ends(parts: list[tuple[bytes, int, bytes]]) -> None:
    bodies = [head[:kept] + more for head, kept, more in parts]
    ends = np.cumsum([len(body) for body in bodies])
    begins = ends - [len(body) for body in bodies]
    octets = np.frombuffer(b"".join(bodies) + b"\0", np.uint8)
    assert len(DECLARED) > 30
    for (code, _), declaration in DECLARED.items():
        found = pdu_ends(declaration)
        assert found is not None
        sizes = 1 + found(octets, begins, ends) - begins
        walk = PduWalk(declaration, ())
        wanted = [walk(bytes((code,)) + body) for body in bodies]
        assert np.where((sizes > 0) & (sizes <= MAX_PDU), sizes, -1).tolist() == [size or -1 for size in wanted]


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
    assert register_runs(declaration) is None
