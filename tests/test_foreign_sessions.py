"""Sessions of other protocols, made from their public descriptions: named as no Modbus, in pastes as in captures."""

from __future__ import annotations

from random import Random

import pytest
from scripts import package

from analyzer import paste
from analyzer.deframing.protocols import Deframer
from analyzer.reports.page import text
from analyzer.reports.summary import summarize
from captures.chunks import Capture, Chunk
from captures.line import LineSettings
from dissectors.crc import crc_bytes

SEEDS = range(4)
_ADVICE = ("wiring", "termination", "connect A to A", "two transmitters", "broadcast-answered")
talks = package("foreign_talks")
METERS = package("foreign_meters").METERS


def crc(*parts: bytes) -> bytes:
    body = b"".join(parts)
    return body + crc_bytes(body)


def heard(session: list[bytes]) -> Capture:
    t_ns, chunks = 10**18, []
    for number, octets in enumerate(session):
        t_ns += 200_000_000 if number % 2 == 0 else 30_000_000
        chunks.append(Chunk(t_ns, octets))
    return Capture.of(LineSettings(baud=9600, char_bits=10), chunks)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("name", METERS)
def test_meters_with_the_crc_of_modbus_are_named(name: str, seed: int) -> None:
    random = Random(f"{name} {seed}")
    talk = METERS[name](random)
    read = paste.read(talks.pasted(talk))
    report = summarize(talks.heard(talk, random))
    page = " ".join(text(report).split())
    assert read.why.startswith("not Modbus, but") and name in read.why
    assert "not Modbus, but" in page and name in report.not_modbus
    assert not list(read.frames()) and not report.causes
    assert not [word for word in _ADVICE if word in page]


@pytest.mark.parametrize("seed", range(100, 106))
@pytest.mark.parametrize("name", talks.TALKS)
def test_a_line_of_something_else_has_no_frame_and_no_cause(name: str, seed: int) -> None:
    """A few drawn sessions of each; `benchmarks/score_foreign.py` goes through many."""
    random = Random(f"{name} {seed}")
    talk = talks.TALKS[name](random)
    report = summarize(talks.heard(talk, random))
    assert (report.frames, report.causes) == (0, ())
    assert not list(paste.read(talks.pasted(talk)[:6000].rpartition("\n")[0]).frames())


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("name", ["UART", "MIDI", "marked", "records"])
def test_chance_among_other_bytes_is_the_same_read_by_read(name: str, seed: int) -> None:
    random = Random(f"{name} {130 + seed}")
    capture = talks.heard(talks.TALKS[name](random), random)
    chunks = list(capture.chunks())
    one, many = Deframer(capture.line), Deframer(capture.line)
    at_once, by_reads = [one.feed(chunks), one.close()], [*(many.feed(chunk) for chunk in chunks), many.close()]
    rows = [
        [(r.start, r.length, r.kind, r.foreign) for part in parts for r in part.rows] for parts in (at_once, by_reads)
    ]
    assert rows[0] == rows[1]


def test_a_line_whose_lrc_is_right_by_chance_is_no_ascii_mode() -> None:
    """DCON: `>0001FF` is unit 0, function 1 and nothing more, with its LRC."""
    lines = [b"$142\r", b"!14080600\r", *(b"@14\r", b">0001FF\r", b"@14\r", b">0200FE\r") * 6]
    report = summarize(heard(lines))
    assert (report.frames, report.causes) == (0, ())
    assert not list(paste.read("\n".join(line.hex(" ") for line in lines)).frames())


@pytest.mark.parametrize("function", [0x29, 0x50])
def test_functions_that_nobody_declared_are_modbus_where_answers_repeat_them(function: int) -> None:
    """A vendor's own, with a few reads between; a meter's answer has data where Modbus repeats the function."""
    random, vendor, meter = Random(3), list[bytes](), list[bytes]()
    for number in range(30):
        asked = crc(bytes((7, function)), random.randbytes(3))
        vendor += [asked, crc(bytes((7, function)), random.randbytes(9))]
        meter += [asked, crc(b"\7\xe1", random.randbytes(9))]
        vendor += [] if number % 8 else [crc(b"\x11\3\0\0\0\2"), crc(b"\x11\3\4", random.randbytes(4))]
    assert not summarize(heard(vendor)).not_modbus and summarize(heard(vendor)).frames == len(vendor)
    assert summarize(heard(meter)).not_modbus
    assert "not Modbus" not in paste.read("\n".join(octets.hex(" ") for octets in vendor)).why
    assert "not Modbus" in paste.read("\n".join(octets.hex(" ") for octets in meter)).why


@pytest.mark.parametrize("mark", [b":", b">"])
def test_ascii_mode_is_known_by_either_mark(mark: bytes) -> None:
    asked = [b":0A03000C0001E6\r\n", b":0A03020001F0\r\n"] * 6
    lines = [mark + line[1:] for line in asked]
    assert summarize(heard(lines)).frames == len(lines)
    assert len(list(paste.read("\n".join(line.hex(" ") for line in lines)).frames())) == len(lines)


_RUNS = [0x00, 0x0C, 0x0F, 0x18, 0x1C, 0x30, 0x3C, 0x60, 0x78, 0x80, 0xC0, 0xE0, 0xF8, 0xFE]


@pytest.mark.parametrize("seed", SEEDS)
def test_lively_bytes_that_the_uart_does_not_mark_are_no_wrong_settings(seed: int) -> None:
    """Frames of a protocol that nobody knows, each with a sum behind it."""
    random, t_ns, chunks = Random(seed), 10**18, []
    size, mark = random.randrange(6, 30), random.randbytes(2)
    for _ in range(80):
        body = mark + random.randbytes(size)
        t_ns += random.randrange(20, 200) * 10**6
        chunks.append(Chunk(t_ns, body + bytes((sum(body) & 0xFF,))))
    assert not summarize(Capture.of(LineSettings(9600, 10), chunks)).causes


@pytest.mark.parametrize("tap", ["logic", None])
def test_whole_characters_of_edges_rule_wrong_settings_out(tap: str | None) -> None:
    """The same bytes from a UART may well be those of a line at another speed: their bits come in runs."""
    random = Random(5)
    chunks = [Chunk(10**18 + i * 10**8, bytes(random.choices(_RUNS, k=20))) for i in range(40)]
    report = summarize(Capture.of(LineSettings(115200, 10, tap=tap), chunks))
    assert [cause.cause for cause in report.causes] == ([] if tap else ["tap-line-settings"])


def test_modbus_with_a_vendors_functions_is_modbus() -> None:
    """Functions that are free for users, and a few that nobody has declared among reads."""
    random, session = Random(2), []
    for number in range(12):
        session += [crc(b"\x11\x03\0\0\0\2"), crc(b"\x11\x03\x04", random.randbytes(4))]
        session += [crc(b"\x11", bytes((65 if number % 3 else 0x5A,)), random.randbytes(6)), crc(b"\x11\x41\0")]
    assert not summarize(heard(session)).not_modbus
    assert "not Modbus" not in paste.read("\n".join(octets.hex(" ") for octets in session)).why


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("function", [0x41, 0x5A])
def test_a_bus_of_one_vendor_in_noise_keeps_its_frames(function: int, seed: int) -> None:
    """All but the first of a unit, which might be chance."""
    random = Random(f"{function} {seed}")
    t_ns, chunks = 10**18, []
    for _ in range(60):
        for octets in (random.randbytes(80), crc(bytes((5, function)), random.randbytes(random.randrange(2, 40)))):
            t_ns += 100_000_000
            chunks.append(Chunk(t_ns, octets))
    report = summarize(Capture.of(LineSettings(9600, 10), chunks))
    assert report.frames >= 0.9 * 60
