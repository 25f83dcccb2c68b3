"""Drawn sessions of protocols that are not Modbus, from what is published of each, and how a tap hears them.

A kind of talk is a function of `TALKS`: of a random source it draws a session, what each side says in order with the
silence before it. Bodies change slowly or not at all where those of such devices do. `heard` draws the tap: speed,
characters, what it is, and how its reads cut the bytes. Two protocols are of nobody: a mark, a length and a sum, and
records of one length that end in a CRC which is not that of Modbus.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from itertools import accumulate
from random import Random
from typing import Final, NamedTuple

from captures.chunks import Capture, Chunk
from captures.line import LineSettings
from dissectors.foreign import mstp_check

MS: Final = 1_000_000


class Said(NamedTuple):
    """What one side says at once, and the silence before it (ms)."""

    after_ms: float
    octets: bytes
    breaks: bool = False  # its first byte is a break, which a UART marks


@dataclass(frozen=True, slots=True)
class Talk:
    """A session: what was said, and the speed (bit/s)."""

    baud: int
    said: list[Said]


# Lines of text.


def _xor(octets: bytes) -> int:
    return list(accumulate(octets, int.__xor__))[-1]


def console(random: Random) -> Talk:
    """A console: commands of a modem with their echo, a log of a device that starts, or lines of measured values."""
    talks = {"modem": _modem, "log": _log, "values": _values}
    said = talks[random.choice(sorted(talks))](random)
    return Talk(random.choice((9600, 19200, 57600, 115200)), list(said))


def _modem(random: Random) -> Iterator[Said]:
    answers = {
        "AT": "", "ATI": "SIMCOM_SIM800L", "AT+CSQ": "+CSQ: {n},0", "AT+CREG?": "+CREG: 0,{d}",
        "AT+CGATT?": "+CGATT: {d}",
        "AT+COPS?": '+COPS: 0,0,"Operator {n}"', "AT+CCLK?": '+CCLK: "26/11/{n},{n}:{n}:{n}+12"', "ATE{d}": "",
        "AT+CMGF=1": "", "AT+CIPSEND={n}": "> ", "AT+CIFSR": "10.{n}.{n}.{d}", "AT+CBC": "+CBC: 0,{n},41{n}",
    }  # fmt: skip
    ends = random.choice(("\r\n", "\n", "\r"))
    echo = random.random() < 0.6

    def drawn(text: str) -> str:
        while "{n}" in text or "{d}" in text:
            text = text.replace("{n}", str(random.randrange(10, 60)), 1).replace("{d}", str(random.randrange(10)), 1)
        return text

    for _ in range(random.randrange(20, 120)):
        asked = drawn(random.choice(list(answers)))
        text = drawn(next(answers[each] for each in answers if each[:6] == asked[:6] or asked.startswith("ATE")))
        command = (asked + ends).encode()
        yield Said(random.uniform(100, 900), command)
        if echo:
            yield Said(2, command)
        end = random.choice(("OK", "OK", "OK", "OK", "ERROR", "+CME ERROR: 58"))
        yield Said(random.uniform(5, 60), (f"\r\n{text}\r\n" if text else "").encode() + f"\r\n{end}\r\n".encode())


def _log(random: Random) -> Iterator[Said]:
    words = ("wifi", "net", "boot", "heap", "sensor", "flash", "init", "task", "mqtt", "retry", "error", "ok", "ready")
    t = 0
    for _ in range(random.randrange(40, 300)):
        t += random.randrange(1, 900)
        rest = " ".join(random.choices(words, k=random.randrange(1, 8)))
        value = random.choice((f"0x{random.getrandbits(32):08x}", str(random.randrange(70000)), ""))
        colour, end = random.choice((("\x1b[0;32m", "\x1b[0m"), ("", "")))
        yield Said(random.uniform(0, 200), f"{colour}{random.choice('IWED')} ({t}) {rest}: {value}{end}\r\n".encode())


def _values(random: Random) -> Iterator[Said]:
    kind = random.choice(("scale", "csv", "json"))
    value = random.uniform(-20, 400)
    for number in range(random.randrange(60, 400)):
        value += random.gauss(0, 0.4)
        line = {
            "scale": f"ST,GS,{value:+09.2f}kg\r\n",
            "csv": f"{number};{value:.2f};{value * 1.7:.1f};{random.randrange(4096)}\r\n",
            "json": f'{{"n":{number},"t":{value:.2f},"h":{random.randrange(100)}}}\n',
        }[kind]
        yield Said(random.uniform(40, 400), line.encode())


def nmea(random: Random) -> Talk:
    """A receiver of positions, a compass or a log: sentences, each with its sum."""
    lat, lon, said = random.uniform(0, 8999), random.uniform(0, 17999), list[Said]()
    kinds = random.sample(("GGA", "RMC", "GSV", "GSA", "VTG", "HDT", "DBT", "MWV"), random.randrange(2, 7))
    talker = random.choice(("GP", "GN", "II", "HE"))
    for second in range(random.randrange(15, 90)):
        lat, lon = lat + random.gauss(0, 0.001), lon + random.gauss(0, 0.001)
        clock = f"{second // 3600:02}{second // 60 % 60:02}{second % 60:02}.00"
        place = f"{lat:09.4f},N,{lon:010.4f},E"
        for n, kind in enumerate(kinds):
            satellites = ",".join(
                f"{random.randrange(33):02},{random.randrange(90)},{random.randrange(360)},41" for _ in "123"
            )
            body = {
                "GGA": f"{clock},{place},1,08,1.{random.randrange(9)},545.4,M,46.9,M,,",
                "RMC": f"{clock},A,{place},{random.uniform(0, 30):.1f},{random.uniform(0, 360):.1f},281126,,,A",
                "GSV": f"3,1,11,{satellites}", "GSA": "A,3,04,05,,09,12,,,24,,,,,2.5,1.3,2.1",
                "VTG": f"{random.uniform(0, 360):.1f},T,,M,5.5,N,10.2,K", "HDT": f"{random.uniform(0, 360):.1f},T",
                "DBT": f"{random.uniform(2, 90):.1f},f,3.2,M,1.8,F", "MWV": f"{random.randrange(360)},R,5.2,N,A",
            }[kind]  # fmt: skip
            sentence = f"{talker}{kind},{body}"
            end = random.uniform(500, 900) if not n else random.uniform(0, 8)
            said.append(Said(end, f"${sentence}*{_xor(sentence.encode()):02X}\r\n".encode()))
    return Talk(random.choice((4800, 9600, 38400)), said)


def dcon(random: Random) -> Talk:
    """Modules of inputs and outputs read by letters (ADAM, ICP DAS), with or without sums."""
    modules = random.sample(range(1, 40), random.randrange(1, 6))
    summed, said = random.random() < 0.3, list[Said]()
    kinds = {unit: random.choice(("one", "eight", "digital")) for unit in modules}

    def line(text: str) -> bytes:
        octets = text.encode()
        return octets + (f"{sum(octets) & 0xFF:02X}".encode() if summed else b"") + b"\r"

    for number in range(random.randrange(40, 200)):
        unit = modules[number % len(modules)]
        values = "".join(f"{random.uniform(-20, 90):+07.2f}" for _ in range(1 if kinds[unit] == "one" else 8))
        talk = [(f"#{unit:02X}", f">{values}")]
        if kinds[unit] == "digital":
            talk = [
                (f"${unit:02X}6", f"!{random.getrandbits(16):04X}00"),
                (f"@{unit:02X}", f">{random.getrandbits(8):04X}"),
            ]
        talk.append((f"${unit:02X}2", f"!{unit:02X}080600"))
        asked, answer = random.choice(talk) if random.random() < 0.2 else talk[0]
        said.append(Said(random.uniform(20, 200), line(asked)))
        if random.random() > 0.05:
            said.append(Said(random.uniform(2, 20), line(answer)))
    return Talk(random.choice((9600, 19200, 38400)), said)


def meter_readout(random: Random) -> Talk:
    """IEC 62056-21: a meter signs on and is read out, or asked for registers one by one."""
    maker, number = (
        random.choice(("LGZ5ZMD1204407.B14", "EKT5CE301v11.8s4", "EMH4\\@01LZQJL0014F", "ISk5MT174-0001")),
        "{:08}",
    )
    address = random.choice(("", number.format(random.randrange(10**8))))
    said: list[Said] = []

    def block(head: bytes, text: str) -> bytes:
        octets = head + text.encode() + b"\x03"
        return octets + bytes((_xor(octets[1:]),))

    for _ in range(random.randrange(2, 8)):
        said += [
            Said(random.uniform(500, 1500), f"/?{address}!\r\n".encode()),
            Said(random.uniform(20, 200), f"/{maker}\r\n".encode()),
        ]
        codes = random.sample((*(f"{k}.8.{n}" for k in (1, 2, 3, 4) for n in range(5)), "0.0.0", "F.F", "0.9.1"), 8)
        value = f"{random.uniform(0, 10**6):010.2f}*kWh"
        if random.random() < 0.5:
            lines = "".join(f"{code}({value})\r\n" for code in codes)
            said += [Said(250, b"\x06050\r\n"), Said(250, block(b"\x02", f"{lines}!\r\n"))]
            continue
        said += [Said(250, b"\x06051\r\n"), Said(250, block(b"\x01P0\x02", f"({random.randrange(10**8):08})"))]
        for name in random.sample(("ET0PE", "VOLTA", "CURRE", "POWEP", "FREQU", "DATE_", "TIME_"), 5):
            said += [Said(60, block(b"\x01R1\x02", f"{name}()")), Said(60, block(b"\x02", f"{name}({value[:8]})\r\n"))]
        said.append(Said(60, block(b"\x01B0", "")))
    return Talk(random.choice((300, 2400, 9600)), said)


# Lines of bytes.


def dmx(random: Random) -> Talk:
    """Packets of levels for lamps, a break before each; most levels stay."""
    levels = bytearray(random.choice((0, 0, 255)) for _ in range(random.choice((24, 64, 128, 256, 512))))
    said = []
    for _ in range(random.randrange(12, 60)):
        for _ in range(random.randrange(8)):
            levels[random.randrange(len(levels))] = random.randrange(256)
        said.append(Said(random.uniform(0.2, 20), b"\0\0" + levels, breaks=True))
    return Talk(250_000, said)


def lin(random: Random) -> Talk:
    """A schedule of identifiers; who publishes answers at once, or nobody does."""
    frames = {number: bytearray(random.randbytes(random.choice((2, 4, 8)))) for number in random.sample(range(60), 9)}
    silent, enhanced, said = set(random.sample(sorted(frames), 2)), random.random() < 0.6, list[Said]()
    for _ in range(random.randrange(8, 60)):
        for number, data in frames.items():
            data[random.randrange(len(data))] = random.choice((0, 1, random.randrange(256)))
            one = (number ^ number >> 1 ^ number >> 2 ^ number >> 4) & 1
            two = ~(number >> 1 ^ number >> 3 ^ number >> 4 ^ number >> 5) & 1
            identifier = number | one << 6 | two << 7
            total = identifier if enhanced else 0
            for octet in data:
                total += octet
                total -= 0xFF if total > 0xFF else 0
            body = b"" if number in silent else bytes(data) + bytes((~total & 0xFF,))
            said.append(Said(random.uniform(5, 15), b"\0\x55" + bytes((identifier,)) + body, breaks=True))
    return Talk(random.choice((9600, 19200)), said)


def midi(random: Random) -> Talk:
    """Notes, controllers and a clock, with running status in some."""
    said, running, clock = list[Said](), random.random() < 0.5, random.random() < 0.4
    channel, last = random.randrange(16), -1
    for _ in range(random.randrange(100, 900)):
        status = random.choice((0x90, 0x90, 0x80, 0xB0, 0xE0)) | channel
        data = bytes((random.randrange(36, 96), random.choice((0, 64, random.randrange(128)))))
        head = b"" if running and status == last else bytes((status,))
        said.append(Said(random.uniform(1, 80), head + data))
        last = status
        if clock:
            said.append(Said(random.uniform(2, 20), b"\xf8"))
        if random.random() < 0.01:
            said.append(
                Said(5, b"\xf0" + bytes(random.randrange(128) for _ in range(random.randrange(4, 60))) + b"\xf7")
            )
            last = -1
    return Talk(31250, said)


def _x25(octets: bytes) -> bytes:
    crc = 0xFFFF
    for octet in octets:
        crc ^= octet
        for _ in range(8):
            crc = crc >> 1 ^ (0x8408 if crc & 1 else 0)
    return (crc ^ 0xFFFF).to_bytes(2, "little")


def mstp(random: Random) -> Talk:
    """BACnet MS/TP: tokens go round, masters are polled for, some read a property."""
    masters = sorted(random.sample(range(20), random.randrange(1, 5)))
    said: list[Said] = []

    def frame(kind: int, to: int, source: int, data: bytes = b"") -> bytes:
        head = struct.pack(">BBBH", kind, to, source, len(data))
        return b"\x55\xff" + head + bytes((mstp_check(head),)) + (data + _x25(data) if data else b"")

    for number in range(random.randrange(60, 400)):
        one = masters[number % len(masters)]
        other = masters[(number + 1) % len(masters)] if len(masters) > 1 else (one + 1) % 127
        said.append(Said(random.uniform(1, 15), frame(0, other, one)))
        if random.random() < 0.2:
            said.append(Said(random.uniform(1, 15), frame(1, random.randrange(127), one)))
        if random.random() < 0.1:
            asked = (
                bytes.fromhex("01040275")
                + random.randbytes(2)
                + bytes.fromhex("0c0c")
                + random.randbytes(4)
                + b"\x19\x55"
            )
            said.append(Said(random.uniform(1, 15), frame(5, other, one, asked)))
            said.append(
                Said(
                    random.uniform(1, 15),
                    frame(6, one, other, b"\x01\x00\x30" + random.randbytes(random.randrange(9, 60))),
                )
            )
    return Talk(random.choice((9600, 19200, 38400, 76800)), said)


def marked(random: Random) -> Talk:
    """Of nobody: a mark of one byte or two, a length, an address, a command, data, a sum or a parity of all."""
    mark = random.choice((b"\xaa", b"\x7e", b"\xaa\x55", b"\x02", b"\xfa"))
    more, at_once, said = random.randrange(6), random.random() < 0.3, list[Said]()
    close = random.choice((lambda octets: sum(octets) & 0xFF, _xor, lambda octets: -sum(octets) & 0xFF))
    units = random.sample(range(1, 30), random.randrange(1, 4))
    bodies = {
        (unit, command): bytearray(random.randbytes(random.randrange(2, 24)))
        for unit in units
        for command in range(1, 5)
    }

    def frame(unit: int, command: int, data: bytes = b"") -> bytes:
        body = bytes((len(data) + more & 0xFF, unit, command)) + data
        return mark + body + bytes((close(body),))

    for _ in range(random.randrange(40, 250)):
        (unit, command), body = random.choice(list(bodies.items()))
        body[random.randrange(len(body))] = random.randrange(256)
        if not at_once:
            said.append(Said(random.uniform(10, 200), frame(unit, command)))
        said.append(Said(random.uniform(3, 40), frame(unit, command | 0x80, bytes(body))))
    return Talk(random.choice((9600, 19200, 57600, 115200)), said)


def records(random: Random) -> Talk:
    """Of nobody: records of one length without a mark, a number and slow values, behind them a CRC of the CCITT's."""
    values = [random.randrange(1 << 15) for _ in range(random.randrange(3, 14))]
    head, said = random.randbytes(random.randrange(3)), list[Said]()
    for number in range(random.randrange(60, 300)):
        values = [max(0, min(0xFFFF, value + round(random.gauss(0, 3)))) for value in values]
        body = head + struct.pack(f">B{len(values)}H", number & 0xFF, *values)
        said.append(Said(random.uniform(20, 150), body + _x25(body)[::-1]))
    return Talk(random.choice((9600, 19200, 57600, 115200)), said)


Make = Callable[[Random], Talk]
TALKS: Final[Mapping[str, Make]] = {
    "UART": console, "DMX": dmx, "LIN": lin, "MIDI": midi, "NMEA": nmea, "DCON": dcon, "IEC 62056": meter_readout,
    "BACnet MS/TP": mstp, "marked": marked, "records": records,
}  # fmt: skip


# The tap.


def heard(talk: Talk, random: Random) -> Capture:
    """What a tap hears: a UART or a logic analyser, whose reads are bytes, frames, a FIFO's, or an adapter's."""
    char_ns = 10 * 10**9 // talk.baud
    octets, errors = list[tuple[int, int]](), set[int]()
    marks, t = random.random() < 0.5, 1_700_000_000 * 10**9
    for said in talk.said:
        t += int(said.after_ms * MS)
        if said.breaks and marks:
            errors.add(len(octets))
        for octet in said.octets:
            t += char_ns
            octets.append((t, octet))
    reads = random.choice(("bytes", "pauses", "fifo", "latency"))
    tap = random.choice((None, None, "logic")) if reads == "bytes" else None
    return Capture.of(LineSettings(talk.baud, 10, tap=tap), list(_reads(octets, errors, reads, char_ns)))


def _reads(octets: list[tuple[int, int]], errors: set[int], how: str, char_ns: int) -> Iterator[Chunk]:
    first = 0
    for at in range(1, len(octets) + 1):
        end = at == len(octets)
        silent = end or octets[at][0] - octets[at - 1][0] > 4 * char_ns
        due = {
            "bytes": True, "pauses": silent, "fifo": silent or at - first >= 14,
            "latency": end or at - first >= 62 or octets[at][0] // (16 * MS) > octets[first][0] // (16 * MS),
        }[how]  # fmt: skip
        if not due:
            continue
        t = octets[at - 1][0] if how != "latency" else (octets[at - 1][0] // (16 * MS) + 1) * 16 * MS
        marked_bad = tuple(place - first for place in range(first, at) if place in errors)
        yield Chunk(t, bytes(octet for _, octet in octets[first:at]), errors=marked_bad)
        first = at


def pasted(talk: Talk) -> str:
    """The session as lines of hexadecimal bytes, a line a message."""
    return "\n".join(said.octets.hex(" ") for said in talk.said)
