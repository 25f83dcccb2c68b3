"""Other protocols on the pair: named, counted, never diagnosed as broken Modbus; real Modbus between is still read.

Frames are made from what is published of each protocol.
"""

from __future__ import annotations

import struct
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analyzer.core import analyse
from analyzer.deframing.protocols import Deframer
from analyzer.reports import summarize
from analyzer.reports.page import text
from analyzer.simulation.field.cases.disturbances import KINDS
from analyzer.tables.findings import described
from captures.chunks import Capture, Chunk
from captures.line import LineSettings
from dissectors.crc import crc_bytes
from dissectors.foreign import MeterTalk, foreign_bytes

LINE = LineSettings(baud=9600, char_bits=11)
CHARACTER = int(11e9 / 9600)
ASK, ANSWER = bytes.fromhex("0103001000 02".replace(" ", "")), bytes.fromhex("01030400010007")


def crc(data: bytes) -> bytes:
    return data + crc_bytes(data)


def mercury_200(random: Random) -> list[bytes]:
    address = struct.pack(">I", random.choice((48_120_733, 1_234_567, 50_331_905)))
    return [
        crc(address + b"\x27"),
        crc(address + b"\x27" + random.randbytes(16)),
        crc(address + b"\x63"),
        crc(address + b"\x63" + random.randbytes(7)),
    ]


def mercury_230(random: Random) -> list[bytes]:
    unit = b"\x47"
    return [
        crc(unit + b"\x00"),
        crc(unit + b"\x00"),
        crc(unit + b"\x01\x01" + b"\x01" * 6),
        crc(unit + b"\x00"),
        crc(unit + b"\x05\x00\x00"),
        crc(unit + random.randbytes(16)),
        crc(unit + b"\x08\x16\x11"),
        crc(unit + random.randbytes(9)),
        crc(unit + b"\x02"),
        crc(unit + b"\x00"),
    ]


def milur(random: Random) -> list[bytes]:
    return [
        crc(b"\xff\x08\x00" + b"\xff" * 6),
        crc(b"\xff\x08\x00"),
        crc(b"\xff\x01\x01"),
        crc(b"\xff\x01\x01\x03" + random.randbytes(3)),
        crc(b"\xff\x01\x76"),
        crc(b"\xff\x01\x76\x04" + random.randbytes(4)),
    ]


def pulsar(random: Random) -> list[bytes]:
    address = bytes.fromhex("00123456")
    return [
        crc(address + b"\x01\x0e\x01\x00\x00\x00\x12\x34"),
        crc(address + b"\x01\x12" + random.randbytes(8) + b"\x12\x34"),
        crc(address + b"\x04\x0a\x12\x35"),
        crc(address + b"\x04\x10" + random.randbytes(6) + b"\x12\x35"),
    ]


def readout(random: Random) -> list[bytes]:
    data = f"1.8.0({random.randrange(10**6):010.3f}*kWh)\r\n!\r\n\x03".encode()
    check = 0
    for byte in data:
        check ^= byte
    return [b"/?!\r\n", b"/LGZ5ZMD1204407.B14\r\n", b"\x06050\r\n", b"\x02" + data + bytes((check,))]


def dlt645(random: Random) -> list[bytes]:
    head, wake = b"\x68" + bytes.fromhex("345601090021") + b"\x68", b"\xfe" * 4
    request, answer = head + b"\x11\x04\x33\x33\x34\x33", head + b"\x91\x08\x33\x33\x34\x33" + random.randbytes(4)
    return [wake + frame + bytes((sum(frame) & 0xFF, 0x16)) for frame in (request, answer)]


def nmea(random: Random) -> list[bytes]:
    sentences = []
    for body in (f"GPZDA,{random.randrange(240000):06d}.00,25,11,2026,00,00", f"HEHDT,{random.randrange(3600) / 10},T"):
        check = 0
        for byte in body.encode():
            check ^= byte
        sentences.append(f"${body}*{check:02X}\r\n".encode())
    return sentences


def owen(random: Random) -> list[bytes]:
    def frame(head: bytes, data: bytes = b"") -> bytes:
        crc = 0
        for byte in head + data:
            for bit in range(7, -1, -1):
                crc = (crc << 1 ^ (0x8F57 if (byte >> bit & 1) ^ crc >> 15 else 0)) & 0xFFFF
        octets = head + data + crc.to_bytes(2, "big")
        return b"#" + bytes(ord("G") + half for b in octets for half in (b >> 4, b & 15)) + b"\r"

    return [frame(bytes.fromhex("1010b8df")), frame(bytes.fromhex("1006b8df"), random.randbytes(6))]


def dcon(random: Random) -> list[bytes]:
    return [b"#01\r", f">{random.uniform(-20, 90):+07.2f}\r".encode(), b"$012\r", b"!01080600\r"]


TALKS = {
    **KINDS, "Mercury 200": mercury_200, "Mercury 230": mercury_230, "Milur": milur, "Pulsar": pulsar, "IEC": readout,
    "DL/T 645": dlt645, "NMEA 0183": nmea, "OWEN": owen, "DCON": dcon,
}  # fmt: skip
del TALKS["meter"]  # whose answers are a Mercury's of another make
NAMES = {"mstp": "MS/TP", "hdlc": "HDLC", "mbus": "M-Bus", "ascii": "ASCII", "IEC": "IEC 62056-21"}


def heard(kind: str, *, between: bool, reads: str, rounds: int = 12) -> list[Chunk]:
    random, t = Random(5), 10**18
    chunks: list[Chunk] = []

    def say(frame: bytes, pause_ms: float) -> None:
        nonlocal t
        if reads == "bytes":
            for i, byte in enumerate(frame):
                chunks.append(Chunk(t + (i + 1) * CHARACTER, bytes((byte,))))
        else:
            chunks.append(Chunk(t + len(frame) * CHARACTER, frame))
        t += len(frame) * CHARACTER + int(pause_ms * 1e6)

    for _ in range(rounds):
        if between:
            say(crc(ASK), 8)
            say(crc(ANSWER), 20)
        for frame in TALKS[kind](random):
            say(frame, 10)
        t += 20_000_000
    return chunks


@pytest.mark.parametrize("reads", ["bytes", "frames"])
@pytest.mark.parametrize("kind", TALKS)
def test_named_counted_and_nobodys_fault(kind: str, reads: str) -> None:
    chunks = heard(kind, between=True, reads=reads)
    modbus, named, others = 0, 0, []
    for part in analyse(Capture.of(LINE, chunks)):
        modbus += sum(frame.unit == 1 and frame.crc_ok is True for frame in part.batch.frames())
        for found in described(part.findings):
            if found.code == "other-protocol":
                named += int(found.numbers["bytes"])
                assert NAMES.get(kind, kind) in found.text
            elif found.code != "timing-blind":
                others.append((found.code, found.text))
    assert modbus == 24
    assert others == []
    assert named == sum(len(chunk.data) for chunk in chunks) - 12 * len(crc(ASK) + crc(ANSWER))
    report = summarize(Capture.of(LINE, chunks))
    assert (report.noise_bytes, sum(report.foreign.values())) == (0, named), "counted apart"


@pytest.mark.parametrize("kind", sorted(set(TALKS) - {"ascii"}))
def test_alone_on_the_line_it_is_no_modbus(kind: str) -> None:
    parts = list(analyse(Capture.of(LINE, heard(kind, between=False, reads="bytes"))))
    assert not [frame for part in parts for frame in part.batch.frames()]
    assert {finding.code for part in parts for finding in described(part.findings)} == {"other-protocol"}


@pytest.mark.parametrize("kind", sorted(set(TALKS) - {"ascii"}))
def test_where_it_is_alone_the_page_says_what_it_is(kind: str) -> None:
    report = summarize(Capture.of(LINE, heard(kind, between=False, reads="bytes", rounds=40)))
    page = " ".join(text(report).split())
    assert "No Modbus frame was found." in page
    assert report.causes == (), "of what is no Modbus nothing is wrong"
    assert "not Modbus, but" in page
    assert NAMES.get(kind, kind) in page
    assert "other-protocol note" in page, "the table of findings"


@pytest.mark.parametrize("kind", ["Mercury 230", "Pulsar", "mstp"])
def test_however_it_is_read(kind: str) -> None:
    chunks = heard(kind, between=True, reads="bytes", rounds=4)
    one, many = Deframer(LINE), Deframer(LINE)
    at_once = [one.feed(chunks), one.close()]
    by_reads = [*(many.feed(chunk) for chunk in chunks), many.close()]
    rows = [
        [(r.start, r.length, r.kind, r.foreign) for part in parts for r in part.rows] for parts in (at_once, by_reads)
    ]
    assert rows[0] == rows[1]


@given(st.lists(st.tuples(st.integers(65, 72), st.binary(min_size=1, max_size=30)), min_size=1, max_size=40))
@settings(deadline=None, max_examples=90)
def test_a_vendors_function_is_no_meters_talk_but_by_rare_chance(said: list[tuple[int, bytes]]) -> None:
    talk = MeterTalk()
    named = [talk.name(crc(bytes((17, code)) + data), undeclared=True) for code, data in said]
    assert all(
        not name or len(data) == 3 or (len(data) > 3 and data[3] == len(data) + 4)
        for name, (_, data) in zip(named, said, strict=True)
    )


@given(st.binary(max_size=300))
def test_random_bytes_are_nobodys(data: bytes) -> None:
    name, frames, covered = foreign_bytes(data)
    assert (not name and not frames and not covered) or covered >= 5
