"""The columns say of every frame what its annotation says."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pdus import CASES, REQUEST, RESPONSE, built

import analyzer
from analyzer.core import deframe
from analyzer.deframing.protocols import Deframer
from analyzer.options import Options
from analyzer.tables.batch import Batch
from analyzer.tables.columns import AreaCode, decode
from analyzer.tables.schema import Kind, Rows
from captures.chunks import Chunk
from captures.line import LineSettings
from captures.samples import path
from dissectors.annotation import Context, annotate
from dissectors.crc import crc_bytes, lrc
from dissectors.envelopes import rtu
from dissectors.fields import Field
from dissectors.length_rules import Role

VALUES = {"register", "coil", "input", "register_value", "output_value"}


@dataclass(frozen=True)
class Said:
    """What annotation says of a frame, in the words of the columns."""

    address: int
    quantity: int
    value_address: int | None
    values: list[int]


def leaves(fields: Iterable[Field]) -> Iterator[Field]:
    for field in fields:
        yield field
        yield from leaves(field.fields)


def number(fields: Iterable[Field], *endings: str) -> int:
    found = (f for f in fields if f.name.endswith(endings) and f.length == 2 and isinstance(f.value, int))
    return next((int(f.value) for f in found if f.value is not None), -1)


def said(adu: bytes, role: Role, request: bytes | None) -> Said:
    fields = annotate(rtu(adu), role, Context(request))
    asked = annotate(rtu(request_adu(request)), REQUEST) if request else ()
    values = [f for f in leaves(fields) if f.name in VALUES and isinstance(f.value, int)]
    numbers = [int(f.value != 0) if f.name == "output_value" else int(f.value or 0) for f in values]
    address = number(fields, "address")
    if role is RESPONSE and adu[1] in (1, 2, 3, 4, 0x17, 0x18):  # which have none of their own
        address = number(asked, "address")
    quantity = number(fields, "quantity", "quantity_to_read", "fifo_count")
    if quantity < 0 and function_has_values(adu[1]) and not has_quantity(adu[1], role):
        quantity = len(values)
    return Said(address, quantity, next((f.address for f in values if f.address is not None), None), numbers)


def function_has_values(code: int) -> bool:
    return code in (1, 2, 3, 4, 5, 6, 0x0F, 0x10, 0x14, 0x15, 0x17, 0x18)


def has_quantity(code: int, role: Role) -> bool:
    return (role is REQUEST and code in (1, 2, 3, 4, 0x14, 0x17, 0x18)) or code in (0x0F, 0x10) or code == 0x18


def request_adu(pdu: bytes) -> bytes:
    body = b"\x01" + pdu
    return body + crc_bytes(body)


def batch_of(frames: list[tuple[Role, bytes, int]], earlier: dict[int, bytes] | None = None) -> Batch:
    """Rows of these (role, ADU, index of the request or -1), a byte of noise before each."""
    rows = Rows.zeros(2 * len(frames))
    rows.index[:], rows.request[:] = -1, -1
    data = b""
    for i, (role, adu, request) in enumerate(frames):
        rows.at[2 * i], rows.length[2 * i] = len(data), 1
        data += b"\xff"
        row = rows[2 * i + 1 : 2 * i + 2]
        row.index[:], row.at[:], row.length[:], row.request[:] = i, len(data), len(adu), request
        row.kind[:] = Kind.REQUEST if role is REQUEST else Kind.RESPONSE
        row.unit[:], row.function[:], row.check[:] = adu[0], adu[1] & 0x7F, True
        if adu[1] & 0x80:
            row.exception[:] = adu[2]
        data += adu
    return Batch(rows, np.frombuffer(data, np.uint8), earlier or {})


def cut(pdu: bytes, data: st.DataObject) -> bytes:
    return pdu[: data.draw(st.integers(1, len(pdu)))] if data.draw(st.booleans()) else pdu


@pytest.mark.parametrize("code", sorted({code for code, _ in CASES}), ids=lambda v: f"{v:02X}")
def test_columns_and_annotation_agree(code: int) -> None:
    @settings(max_examples=40)  # of each function
    @given(st.lists(st.tuples(CASES[code, REQUEST], CASES[code, RESPONSE]), min_size=1, max_size=4), st.data())
    def check(pairs: list[tuple[object, object]], data: st.DataObject) -> None:
        frames: list[tuple[Role, bytes, int]] = []
        for asked, answered in pairs:
            request = cut(built(code, REQUEST, asked), data)  # type: ignore[arg-type]
            response = cut(built(code, RESPONSE, answered), data)  # type: ignore[arg-type]
            known = data.draw(st.booleans())
            frames.append((REQUEST, request_adu(request), -1))
            frames.append((RESPONSE, request_adu(response), len(frames) - 1 if known else -1))
        decoded = decode(batch_of(frames))
        for i, (role, adu, of) in enumerate(frames):
            due = said(adu, role, frames[of][1][1:-2] if of >= 0 else None)
            row = 2 * i + 1
            assert decoded.values_of(row).tolist() == due.values
            assert (int(decoded.address[row]), int(decoded.quantity[row])) == (due.address, due.quantity)
            if due.value_address is not None:
                assert decoded.value_address[row] == due.value_address
            assert decoded.address[row - 1] == decoded.quantity[row - 1] == -1
            assert not len(decoded.values_of(row - 1))

    check()


def test_an_exception_has_its_requests_address() -> None:
    request, exception = request_adu(bytes.fromhex("03006B0003")), request_adu(bytes.fromhex("8302"))
    here = decode(batch_of([(REQUEST, request, -1), (RESPONSE, exception, 0)]))
    assert (here.address[3], here.quantity[3], here.area[3]) == (107, 3, AreaCode.HOLDING_REGISTERS)
    assert not len(here.values_of(3))
    before = decode(batch_of([(RESPONSE, exception, 7)], earlier={7: request}))
    assert (before.address[1], before.quantity[1]) == (107, 3)
    unknown = decode(batch_of([(RESPONSE, exception, 7)]))
    assert (unknown.address[1], unknown.quantity[1]) == (-1, -1)


def test_ascii_frames_are_decoded_from_what_their_digits_stand_for() -> None:
    lines = b""
    for body in (bytes.fromhex("1103006B0003"), bytes.fromhex("110306AE4156524340")):
        lines += b":" + (body + bytes([lrc(body)])).hex().upper().encode() + b"\r\n"
    deframer = Deframer(LineSettings(), Options(protocol="ascii"))
    batches = [deframer.feed(Chunk(0, lines)), deframer.close()]
    rows = [(decode(b), b, i) for b in batches for i in np.flatnonzero(b.rows.kind != Kind.NOISE).tolist()]
    assert [int(decoded.address[i]) for decoded, _, i in rows] == [107, 107]
    assert rows[1][0].values_of(rows[1][2]).tolist() == [44609, 22098, 17216]


def test_batches_decode_as_their_frames_do() -> None:
    """A whole sample, requests in batches before among it."""
    found = 0
    for batch in deframe(analyzer.open(path("troubled.jsonl")).capture):
        decoded = decode(batch)
        for row in np.flatnonzero(batch.rows.index >= 0).tolist():
            frame = batch.frame(row)
            if frame.crc_ok and frame.exception is None:
                request = frame.context.request
                due = said(frame.captured, frame.role, request)
                assert decoded.values_of(row).tolist() == due.values
                assert (int(decoded.address[row]), int(decoded.quantity[row])) == (due.address, due.quantity)
                found += 1
    assert found > 100
