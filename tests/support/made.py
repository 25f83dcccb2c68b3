"""Batches of frames of any function, whole and damaged, as hypothesis makes them; and a vendor's declarations."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st
from pdus import CASES, REQUEST, RESPONSE, built, read_request

from analyzer.tables.batch import Batch
from analyzer.tables.schema import Kind, Rows
from dissectors.crc import crc_bytes

# Of quantities as small as the answers that hypothesis likes to make, so that either is now and then the larger.
SMALL = CASES | {(code, REQUEST): read_request(20) for code in (1, 2, 3, 4)}
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
    return Batch(Rows.joined(rows), np.frombuffer(octets, np.uint8), earlier)


def _row(draw: st.DrawFn, index: int, before: bytes, adu: bytes, kind: Kind, right: bool, asked: int) -> Rows:
    row = Rows.zeros(1)
    exception = kind == Kind.RESPONSE and adu[1] & 0x80 and len(adu) > 2
    row.index[:], row.start[:], row.length[:], row.at[:] = index, draw(BIG), len(adu), len(before)
    row.t_start_ns[:], row.t_end_ns[:], row.request[:] = draw(BIG), draw(BIG), asked
    row.request_start[:], row.response_ns[:] = (
        (draw(BIG), draw(st.sampled_from([-1, 0, 5_000]))) if asked >= 0 else (-1, -1)
    )
    row.confidence[:], row.kind[:], row.unit[:], row.function[:] = (
        draw(st.floats(0, 1, width=32)),
        kind,
        adu[0],
        adu[1] & 0x7F,
    )
    row.exception[:], row.check[:], row.port[:] = adu[2] if exception else 0, right, draw(st.sampled_from([0, 0, 1]))
    return row


VENDOR = """
from construct import Array, Float32b, GreedyBytes, Int8ub, Int16ub, Padding, Prefixed, Struct, this
from dissectors import Address, Bits, ByteCount, Function, Mask, Number, Quantity, Registers, Role, Text
from dissectors.parts import Number as Plain

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
        adu = bytes([1, code]) + draw(st.binary(max_size=6) | counted)
        adu += crc_bytes(adu)
        asked = len(rows) - 1 if rows and kind == Kind.RESPONSE else -1
        rows.append(_row(draw, len(rows), octets, adu, kind, True, asked))
        octets += adu
    return Batch(Rows.joined(rows), np.frombuffer(octets, np.uint8))
