"""Other protocols on the pair, between the polls of a client or alone."""

from __future__ import annotations

import struct
from collections.abc import Callable
from random import Random

from dissectors.crc import ALGORITHMS, Algorithm, lrc

from ...conversation import adu
from ..bench import SECOND, Bench, Expected, site
from ..units import MS, burst_of
from .registry import Site, field_case

_X25 = next(one for one in ALGORITHMS if isinstance(one, Algorithm) and one.name == "CRC-16/X-25")


def _mstp(random: Random) -> list[bytes]:
    """BACnet MS/TP: tokens that go round, a frame with data now and then."""
    to, source = random.sample(range(12), 2)
    if random.random() < 0.7:
        return [_mstp_frame(random.choice((0, 0, 0, 1)), to, source, b"")]
    request = bytes.fromhex("0104") + random.randbytes(random.randint(6, 40))
    return [_mstp_frame(5, to, source, request), _mstp_frame(6, source, to, random.randbytes(random.randint(8, 60)))]


def _mstp_frame(kind: int, to: int, source: int, data: bytes) -> bytes:
    head = struct.pack(">BBBH", kind, to, source, len(data))
    check = 0xFF
    for byte in head:
        check ^= byte
        shifted = check ^ check << 1 ^ check << 2 ^ check << 3 ^ check << 4 ^ check << 5 ^ check << 6 ^ check << 7
        check = (shifted & 0xFE) ^ (shifted >> 8 & 1)
    frame = b"\x55\xff" + head + bytes((~check & 0xFF,))
    return frame + data + _X25(data).to_bytes(2, "little") if data else frame


def _hdlc(random: Random) -> list[bytes]:
    """A meter read by DLMS over HDLC: a request and its answer."""
    unit = random.randrange(1, 60)

    def frame(address: bytes, body: bytes) -> bytes:
        length = 2 + len(address) + 1 + 2 + len(body) + 2
        head = struct.pack(">H", 0xA000 | length) + address + b"\x32"
        inner = head + _X25(head).to_bytes(2, "little") + body
        return b"\x7e" + inner + _X25(inner).to_bytes(2, "little") + b"\x7e"

    forth, back = bytes((unit << 1 | 1, 0x41)), bytes((0x41, unit << 1 | 1))
    request = bytes.fromhex("e6e600c001c1000301") + random.randbytes(6) + b"\x02\x00"
    return [
        frame(forth, request),
        frame(back, bytes.fromhex("e6e700c401c10006") + random.randbytes(random.randint(4, 60))),
    ]


def _mbus(random: Random) -> list[bytes]:
    """M-Bus: a short frame asks, a long frame answers."""
    unit = random.randrange(1, 12)
    short = bytes((0x10, 0x5B, unit, (0x5B + unit) & 0xFF, 0x16))
    body = bytes((0x08, unit, 0x72)) + random.randbytes(random.randint(20, 60))
    return [short, bytes((0x68, len(body), len(body), 0x68)) + body + bytes((sum(body) & 0xFF, 0x16))]


def _ascii(random: Random) -> list[bytes]:
    """Modbus ASCII."""
    unit = random.randrange(1, 20)
    request = bytes((unit, 3)) + struct.pack(">HH", random.randrange(200), 2)
    answer = bytes((unit, 3, 4)) + random.randbytes(4)
    return [b":" + (each + bytes((lrc(each),))).hex().upper().encode() + b"\r\n" for each in (request, answer)]


def _meter(random: Random) -> list[bytes]:
    """An electricity meter with commands of its own and the CRC of Modbus, its address four bytes long."""
    serial = struct.pack(">I", random.choice((48_120_733, 48_120_734, 50_001_200)))
    request, answer = serial + b"\x63", serial + b"\x63" + random.randbytes(7)
    return [adu_of(request), adu_of(answer)]


def adu_of(body: bytes) -> bytes:
    """A body with the CRC of Modbus behind it."""
    return adu(body[0], body[1:])


KINDS: dict[str, Callable[[Random], list[bytes]]] = {
    "mstp": _mstp, "hdlc": _hdlc, "mbus": _mbus, "ascii": _ascii, "meter": _meter
}  # fmt: skip


@field_case("other-protocol")
def other_protocol(random: Random, tap: str) -> Site:
    """Another protocol speaks on the pair, between the polls or in their place."""
    bench = site(random, tap, seconds=(20, 120), bauds=(9600, 19200, 38400))
    kind = random.choice(sorted(KINDS))
    maker, alone = KINDS[kind], kind != "ascii" and random.random() < 0.4  # that alone is a bus of its own kind
    bench.master.manners.pause_ms = lambda _: 40.0
    period = random.uniform(0.1, 1.0) * SECOND
    if alone:
        bench.masters = []

    def speak(t: float) -> None:
        if bench.wire.busy(t) or (not alone and bench.master.waits):
            bench.schedule.at(t + 5 * MS, speak)
            return
        _say(bench, maker(random), t, random)
        bench.schedule.at(t + period * random.uniform(0.8, 1.2), speak)

    bench.schedule.at(0.2 * SECOND, speak)
    return bench, Expected("other-protocol")


def _say(bench: Bench, frames: list[bytes], t: float, random: Random) -> None:
    for frame in frames:
        burst = burst_of(None, bench.uart, frame, t)
        bench.schedule.at(t, lambda _, burst=burst: bench.wire.send(burst))  # type: ignore[misc]
        t = burst.last + random.uniform(5, 30) * MS
