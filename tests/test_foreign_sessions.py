"""Sessions of other protocols, made from their public descriptions: named as no Modbus, in pastes as in captures."""

from __future__ import annotations

from collections.abc import Callable
from random import Random

import pytest

from analyzer import paste
from analyzer.reports.page import text
from analyzer.reports.summary import summarize
from captures.chunks import Capture, Chunk
from captures.line import LineSettings
from dissectors.crc import crc_bytes

SEEDS = range(4)
_ADVICE = ("wiring", "termination", "connect A to A", "two transmitters", "broadcast-answered")
Session = list[bytes]


def crc(*parts: bytes) -> bytes:
    body = b"".join(parts)
    return body + crc_bytes(body)


def mercury_206(random: Random) -> Session:
    """Address of four bytes, command; the answer repeats both before its data."""
    address = random.randrange(10**6, 10**8).to_bytes(4, "big")
    data = {0x20: 4, 0x21: 7, 0x22: 2, 0x26: 2, 0x27: 16, 0x28: 6, 0x2F: 4, 0x63: 7}
    asked = random.choices(list(data), k=random.randrange(4, 12))
    return [
        each
        for command in asked
        for each in (
            crc(address, bytes((command,))),
            crc(address, bytes((command,)), random.randbytes(data[command])),
        )
    ]


def mercury_230(random: Random) -> Session:
    """Address, command, parameters; the answer is address and data alone."""
    unit = bytes((random.randrange(1, 240),))
    session = [crc(unit, b"\0"), crc(unit, b"\0"), crc(unit, b"\x01\x01", bytes([1]) * 6), crc(unit, b"\0")]
    for _ in range(random.randrange(4, 12)):
        asked, size = random.choice(((b"\x05\x00\x00", 16), (b"\x08\x11\x11", 3), (b"\x08\x05", 2), (b"\x04\x00", 8)))
        session += [crc(unit, asked), crc(unit, random.randbytes(size))]
    return session


def milur(random: Random) -> Session:
    """Address, command, parameter; the answer repeats them before a length and the data."""
    unit = bytes((random.randrange(1, 255),))
    session = [crc(unit, b"\x08\x00", b"\xff" * 6), crc(unit, b"\x08\x01")]
    for _ in range(random.randrange(4, 12)):
        parameter = bytes((1, random.choice((1, 2, 3, 4, 118))))
        session += [crc(unit, parameter), crc(unit, parameter, b"\x04", random.randbytes(4))]
    return session


def pulsar(random: Random) -> Session:
    """Address of eight digits, function, length of all, data, number of the request."""
    address = bytes(random.randrange(10) << 4 | random.randrange(10) for _ in range(4))
    session = []
    for _ in range(random.randrange(3, 10)):
        number = random.randbytes(2)
        for data in (b"\x01\0\0\0", random.randbytes(random.choice((4, 8)))):
            session.append(crc(address, bytes((1, 10 + len(data))), data, number))
    return session


def of_nobody(random: Random) -> Session:
    """A meter that nobody has described: address, command, data; answers without a command."""
    unit = bytes((random.randrange(1, 240),))
    session = []
    for _ in range(random.randrange(7, 16)):
        session.append(crc(unit, bytes((random.choice((0x33, 0x70, 0x05, 0x08, 0x01)),)), random.randbytes(2)))
        session.append(crc(unit, random.randbytes(random.randrange(1, 20))))
    return session


METERS: dict[str, Callable[[Random], Session]] = {
    "Mercury 200": mercury_206,
    "Mercury 230": mercury_230,
    "Milur": milur,
    "Pulsar": pulsar,
    "CRC of Modbus": of_nobody,
}


def heard(session: Session) -> Capture:
    t_ns, chunks = 10**18, []
    for number, octets in enumerate(session):
        t_ns += 200_000_000 if number % 2 == 0 else 30_000_000
        chunks.append(Chunk(t_ns, octets))
    return Capture.of(LineSettings(baud=9600, char_bits=10), chunks)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("name", METERS)
def test_meters_with_the_crc_of_modbus_are_named(name: str, seed: int) -> None:
    session = METERS[name](Random(f"{name} {seed}"))
    read = paste.read("\n".join(octets.hex(" ") for octets in session))
    report = summarize(heard(session))
    page = " ".join(text(report).split())
    assert read.why.startswith("not Modbus, but") and name in read.why
    assert "not Modbus, but" in page and name in report.not_modbus
    assert not list(read.frames()) and not report.causes
    assert not [word for word in _ADVICE if word in page]


def lengths(random: Random) -> Session:
    """A protocol of somebody: a mark, a length, data, a sum."""
    made = []
    for _ in range(60):
        data = random.randbytes(random.randrange(1, 20))
        made.append(bytes((0xAA, len(data))) + data + bytes((sum(data) & 0xFF,)))
    return made


def lin(random: Random) -> Session:
    made = []
    for _ in range(60):
        number, data = random.randrange(60), random.randbytes(random.choice((2, 4, 8)))
        one = (number ^ number >> 1 ^ number >> 2 ^ number >> 4) & 1
        two = ~(number >> 1 ^ number >> 3 ^ number >> 4 ^ number >> 5) & 1
        identifier = number | one << 6 | two << 7
        total = identifier + sum(data)
        while total > 0xFF:
            total = (total & 0xFF) + (total >> 8)
        made.append(b"\0\x55" + bytes((identifier,)) + data + bytes((~total & 0xFF,)))
    return made


def midi(random: Random) -> Session:
    return [bytes((random.choice((0x90, 0x80, 0xB0)), random.randrange(128), random.randrange(128))) for _ in range(99)]


def dmx(random: Random) -> Session:
    levels = bytearray(128)
    packets = []
    for _ in range(12):
        levels[random.randrange(128)] = random.randrange(256)
        packets.append(b"\0" + bytes(levels))
    return packets


LINES = {"lengths": (lengths, 57600), "LIN": (lin, 19200), "MIDI": (midi, 31250), "DMX": (dmx, 250_000)}


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("name", LINES)
def test_a_line_of_something_else_has_no_frame_and_no_cause(name: str, seed: int) -> None:
    made, baud = LINES[name]
    t_ns, chunks = 10**18, []
    random = Random(f"{name} {seed}")
    for octets in made(random):
        t_ns += len(octets) * 10**10 // baud + random.randrange(1_000_000, 30_000_000)
        chunks.append(Chunk(t_ns, octets))
    report = summarize(Capture.of(LineSettings(baud=baud, char_bits=10), chunks))
    assert (report.frames, report.causes) == (0, ())


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
