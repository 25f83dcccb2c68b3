"""PDUs of every function and role, and batches of frames of any function, whole and damaged, as hypothesis makes them.

What construct builds from the declarations; and a vendor's declarations.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from hypothesis import strategies as st

from analyzer.tables.batch import Batch
from analyzer.tables.schema import Kind, Rows
from dissectors.crc import crc_bytes
from dissectors.functions import function
from dissectors.length_rules import Role

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
QUERY = fixed(sub_function=st.sampled_from([0, 99]), data=st.binary(min_size=2, max_size=4))
DELIMITER = st.integers(0, 2).map(lambda zero: {"sub_function": 3, "data": {"delimiter": 10, "zero": zero}})
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
CANOPEN = st.binary(max_size=9).map(lambda data: {"mei_type": 0x0D, "mei_data": {"data": data}})
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


# Of quantities as small as the answers that hypothesis likes to make, so that either is now and then the larger.
SMALL = CASES | {(code, REQUEST): read_request(20) for code in (1, 2, 3, 4)}
ODD = {0x08: QUERY | DELIMITER, 0x2B: CANOPEN}  # by the declaration, though no length rule or limit has them so
SMALL |= {key: CASES[key] | ODD[key[0]] for key in CASES if key[0] in ODD}
BIG = st.integers(0, 2**62)


def mangled(adu: bytes, data: st.DataObject) -> tuple[bytes, bool]:
    """An RTU frame of a PDU as the wire may give it, and whether its check is right."""
    how = data.draw(st.sampled_from(["whole"] * 6 + ["cut", "longer", "bytes", "crc"]))
    if how == "cut":
        adu = adu[: data.draw(st.integers(2, len(adu)))]
    elif how == "longer":
        adu += data.draw(st.binary(min_size=1, max_size=3))
    elif how == "bytes":
        at = data.draw(st.integers(2, max(len(adu) - 1, 2)))
        adu = adu[:at] + data.draw(st.binary(min_size=1, max_size=1)) + adu[at + 1 :]
    right = how != "crc"
    return adu + (crc_bytes(adu) if right else crc_bytes(adu + b"\0")), right


@st.composite
def batches(draw: st.DrawFn, code: int) -> Batch:
    """Requests and responses of a function, answers known or not, requests here or in a batch before."""
    data = draw(st.data())
    rows, octets, earlier = list[Rows](), b"", dict[int, bytes]()
    for _ in range(draw(st.integers(1, 4))):
        unit = bytes([draw(st.integers(0, 255))])
        request, right = mangled(unit + built(code, REQUEST, draw(SMALL[code, REQUEST])), data)
        known = draw(st.sampled_from(["no", "here", "here", "before"]))
        if known == "before":
            earlier[10_000 + len(rows)] = request
            asked = 10_000 + len(rows)
        else:
            asked = len(rows) if known == "here" else -1
            rows.append(_row(draw, len(rows), octets, request, Kind.REQUEST, right, -1))
            octets += request
        pdu = draw(st.sampled_from([b""] * 4 + [bytes([code | 0x80, draw(st.integers(0, 255))])]))
        response, right = mangled(unit + (pdu or built(code, RESPONSE, draw(SMALL[code, RESPONSE]))), data)
        rows.append(_row(draw, len(rows), octets, response, Kind.RESPONSE, right, asked))
        octets += response
    return Batch(Rows.joined(rows), np.frombuffer(octets, np.uint8), earlier, off_ns=draw(_OFF_NS))


_OFF_NS = st.sampled_from((0.0, 2e3, math.inf))  # by how much response times may be wrong


def _row(draw: st.DrawFn, index: int, before: bytes, adu: bytes, kind: Kind, right: bool, asked: int) -> Rows:
    row = Rows.zeros(1)
    exception = kind == Kind.RESPONSE and adu[1] & 0x80 and len(adu) > 2
    row.index[:], row.start[:], row.length[:], row.at[:] = index, draw(BIG), len(adu), len(before)
    row.t_start_ns[:], row.t_end_ns[:], row.request[:] = draw(BIG), draw(BIG), asked
    row.request_start[:], row.response_ns[:] = (
        (draw(BIG), draw(st.sampled_from([-1, 0, 5_000, 500_000]))) if asked >= 0 else (-1, -1)
    )
    row.taken_for_start[:] = draw(st.one_of(st.just(-1), BIG)) if kind == Kind.RESPONSE else -1
    row.unsure[:] = kind == Kind.RESPONSE and asked < 0 and draw(st.booleans())
    row.confidence[:], row.kind[:], row.unit[:], row.function[:] = (
        draw(st.floats(0, 1, width=32)),
        kind,
        adu[0],
        adu[1] & 0x7F,
    )
    row.exception[:], row.check[:], row.port[:] = adu[2] if exception else 0, right, draw(st.sampled_from([0, 0, 1]))
    return row


VENDOR = """
from construct import Array, Float32b, GreedyBytes, Int8ub, Int16ub, Padding, Pass, Prefixed, Struct, Switch, this
from dissectors import Address, Bits, ByteCount, Function, Mask, Number, Quantity, Registers, Role, Text
from dissectors.blocks import EachByte, Items, Octets, Record, Rest, Variant
from dissectors.declaration import Flags
from dissectors.declaration import Number as Plain

class Signed(Plain):
    def text(self, value):
        return f"{value - 0x10000 if value & 0x8000 else value} °C, «ok»"

class Nosy(Plain):
    def problem(self, value, length, seen):
        return "hot" if seen.number("channel") == value else None

class Half(Plain):
    def _parse(self, stream, context, path):
        return super()._parse(stream, context, path) // 2

ONE = Function(0x41, "Тренд \\"A\\"", Struct("channel" / Number(1), "where" / Address()),
               Struct("channel" / Number(1), "level" / Signed(2)), echoes=("channel",),
               response_words=("{level}", "never {channel}"), request_words='=channel, "{channel:row}" {where}')
TWO = Function(0x42, "Nosy", Struct("channel" / Number(2)), Struct("channel" / Number(2), "x" / Nosy(2)))
THREE = Function(0x43, "Half", Struct("a" / Half(2)), Struct("n" / ByteCount(1, 250), "r" / Registers("n", less=1)))
FOUR = Function(0x44, "Foreign", Struct("a" / Int16ub, Padding(1)),
                Struct("n" / Int8ub, "v" / Array(this.n, Float32b), "rest" / GreedyBytes))
FIVE = Function(0x45, "Scaled",
                Struct("first" / Number(2), "n" / Quantity(1, 9), "r" / Registers("n", scale=2, start="first")),
                Struct("first" / Mask(), "name" / Prefixed(Int8ub, GreedyBytes)), echoes=("first",))
SIX = Function(0x46, "Page", Struct("page" / Int8ub, "at" / Int16ub),
               Struct("n" / ByteCount(1, 9, of="page"), "r" / Registers("n", start="at", area="3x", each="reg")))
ROWS = Items("row" / Record("{v:tick} of {t}", "v" / Number(1), "n" / Number(1), "t" / Text("n")), number="rows")
EIGHT = Function(0x47, "Rows", Struct("rows" / Number(1), "list" / ROWS),
                 Struct("rows" / Number(1), "same" / Items("v" / Number(1), octets="rows")),
                 request_words=("{nothing}", "{list} in {rows:row}"), response_words="rows: {same}")
NINE = Function(0x48, "Cases", Struct("k" / Number(1), "d" / Switch(this.k, {
                    0: Struct("a" / Number(1), "b" / Mask()), 1: Items("v" / Number(1), octets="k"), 2: Pass,
                    3: EachByte("k", "e", lambda byte, wording: f'"{byte}"'), 4: Octets("k")}, default=Rest(usual=1))),
                Struct("k" / Number(1), "d" / Variant(this.k, {
                    0: Struct("a" / Number(1), "b" / Mask()), 1: Struct("r" / Record("", "x" / Number(2)))},
                    default=Struct("rest" / Rest()))), echoes=("k",),
                request_words="case {k}: {d}", response_words=("a is {a:apple}, {b}", "{r} of {k}", "rest {rest}"))
TEN = Function(0x49, "Odd", Struct("k" / Number(1), "d" / Switch(this.k, {0: Flags({0: "low"})}, default=Rest())),
               Struct("n" / Number(1), "d" / Items("v" / Signed(2), octets="n")))
SEVEN = Function(0x03, "My Read", Struct("page" / Number(1)), Struct("value" / Number(2)))
"""


@st.composite
def vendor_batches(draw: st.DrawFn, codes: list[int]) -> Batch:
    """Frames of functions with any data, one after the other, each answer one to the frame before."""
    rows, octets = list[Rows](), b""
    for _ in range(draw(st.integers(1, 6))):
        code = draw(st.sampled_from(codes))
        kind = draw(st.sampled_from([Kind.REQUEST, Kind.RESPONSE]))
        count = draw(st.integers(0, 9))
        counted = st.binary(min_size=count, max_size=count).map(lambda data: bytes([len(data)]) + data)
        small = st.lists(st.integers(0, 4), max_size=9).map(bytes)
        adu = bytes([1, code]) + draw(st.binary(max_size=6) | counted | small)
        adu += crc_bytes(adu)
        asked = len(rows) - 1 if rows and kind == Kind.RESPONSE else -1
        rows.append(_row(draw, len(rows), octets, adu, kind, True, asked))
        octets += adu
    return Batch(Rows.joined(rows), np.frombuffer(octets, np.uint8))
