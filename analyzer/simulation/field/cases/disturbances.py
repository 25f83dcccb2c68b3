"""What the line itself suffers: reflections, no bias, interference; and other protocols on it."""

from __future__ import annotations

import struct
from collections.abc import Callable
from random import Random

from dissectors.crc import ALGORITHMS, Algorithm, lrc

from ...conversation import adu
from ..bench import SECOND, Bench, Expected, read_pdu, site
from ..master import FieldPoll
from ..units import MS, FieldUnit, analog, burst_of, steps
from ..wire import Burst, Pulse
from .registry import BYTES, TIMED, Site, field_case


@field_case("termination")
def termination(random: Random, tap: str) -> Site:
    """Reflections bend the early bits of what far units send."""
    bench = site(random, tap, units=(4, 10), seconds=(40, 300), bauds=(9600, 19200, 38400, 57600, 115200))
    numbers = list(bench.units)
    random.shuffle(numbers)
    far = numbers[: max(2, len(numbers) // 3)]
    reach = {number: random.uniform(0.4, 1.0) for number in far}
    rate = random.choice((0.004, 0.01, 0.03))
    from_start = random.random() < 0.6  # ringing behind the start's edge only, or behind any

    def bend(burst: Burst, chance: Random) -> list[Pulse]:
        share = reach.get(burst.sender.unit, 0.0) if isinstance(burst.sender, FieldUnit) else 0.0
        if not share:
            return []
        bit, pulses = burst.uart.bit_ns, []
        for start in burst.starts:
            if chance.random() < rate * share * 4:
                at = chance.choice((1, 1, 1, 2, 2, 3)) if from_start else chance.choice((1, 1, 2, 2, 3, 4, 5))
                t = start + (at + 0.2) * bit
                pulses.append(Pulse(t, t + chance.uniform(0.5, 0.7) * bit, "flip"))
        return pulses

    bench.wire.bends = bend
    return bench, Expected("termination", tuple(far))


@field_case("bias")
def bias(random: Random, tap: str) -> Site:
    """Nothing holds the line while no driver is on: it picks up bytes that nobody sent."""
    bench = site(random, tap, seconds=(30, 300))
    let_float(random, bench)
    return bench, Expected("bias")


def let_float(random: Random, bench: Bench) -> None:
    """Nothing holds the line; its client rests between polls, so that it shows."""
    bench.master.manners.pause_ms = lambda _: random.uniform(10, 120)
    bit, char = bench.uart.bit_ns, bench.uart.char_ns
    pulses: list[Pulse] = []
    rate = random.choice((0.5, 2.0, 8.0))  # stretches a second
    t = 0.0
    while t < bench.duration_ns:
        t += random.expovariate(rate) * SECOND
        at = t
        for _ in range(random.choice((1, 1, 2, 4, 8))):
            width = random.choice((0.7, 1.2, 2.0, 5.0, 9.5)) * bit * random.uniform(0.8, 1.2)
            pulses.append(Pulse(at, at + width, "float"))
            at += width + random.uniform(0.5, 2.0) * char
    bench.pulses(pulses)


def _spikes(random: Random, bench: Bench, times: list[float]) -> None:
    width = random.uniform(0.6, 2.5) * bench.uart.bit_ns
    bench.pulses([Pulse(t, t + width * random.uniform(0.7, 1.3), "flip") for t in times])


@field_case("interference", TIMED)
def interference(random: Random, tap: str) -> Site:
    """Spikes at any time, few or many, on whatever is on the line."""
    bench = site(random, tap, seconds=(60, 300), bauds=(2400, 4800, 9600, 9600, 19200))
    _spikes(random, bench, _poisson(random, 0.0, bench.duration_ns, random.choice((1.0, 3.0, 10.0))))
    return bench, Expected("interference")


@field_case("emi-mains", BYTES)
def emi_mains(random: Random, tap: str) -> Site:
    """Spikes in step with the mains."""
    bench = site(random, tap, seconds=(60, 300), bauds=(2400, 4800, 9600, 19200, 38400))
    mains = random.choice((50.0, 50.0, 60.0)) * (1 + random.uniform(-4e-4, 4e-4))
    half = SECOND / mains / random.choice((1, 2, 2))
    phase, share, jitter = random.random(), random.choice((0.005, 0.02, 0.06)), random.uniform(0.01, 0.06)
    count = int(bench.duration_ns / half)
    times = [(k + phase + random.gauss(0, jitter)) * half for k in range(count) if random.random() < share]
    _spikes(random, bench, times)
    return bench, Expected("emi-mains")


@field_case("emi-drive")
def emi_drive(random: Random, tap: str) -> Site:
    """Interference while a drive runs, which its state on the bus tells."""
    bench = site(random, tap, units=(3, 8), seconds=(90, 400))
    unit = bench.unit()
    spells, t = [], random.uniform(0, 20) * SECOND
    while t < bench.duration_ns:
        length = random.uniform(0.04, 0.2) * bench.duration_ns
        spells.append((t, t + length))
        t += length + random.uniform(0.04, 0.2) * bench.duration_ns
    address = random.choice((10, 400, 2000))

    def on(at: float) -> bool:
        return any(begin <= at < end for begin, end in spells)

    kind = random.random()
    if kind < 0.2:  # a speed, which is told from 0 only
        speed = analog(random)
        unit.holdings.words[address] = lambda at: speed(at) if on(at) else 0
        bench.master.polls.append(FieldPoll(unit.unit, read_pdu(random.choice((3, 4)), address, 2)))
    elif kind < 0.6:
        unit.bits.words[address] = lambda at: int(on(at))
        bench.master.polls.append(FieldPoll(unit.unit, read_pdu(random.choice((1, 2)), address, 8)))
    else:
        unit.holdings.words[address] = steps(random, on)
        bench.master.polls.append(FieldPoll(unit.unit, read_pdu(random.choice((3, 4)), address, 2)))
    rate = random.choice((1.0, 3.0, 8.0))
    times = [t for begin, end in spells for t in _poisson(random, begin, end, rate)]
    _spikes(random, bench, times)
    return bench, Expected("emi-drive", (), ("hours",))


def _poisson(random: Random, begin: float, end: float, rate: float) -> list[float]:
    times, t = [], begin
    while (t := t + random.expovariate(rate) * SECOND) < end:
        times.append(t)
    return times


@field_case("hours", TIMED)
def hours(random: Random, tap: str) -> Site:
    """Interference at certain times only, days or minutes long, which nothing on the bus tells."""
    if random.random() < 0.5:
        bench = site(random, tap, units=(2, 6), seconds=(200, 600))
        count, rate = random.randint(1, 3), random.choice((2.0, 5.0))
        spells = []
        for k in range(count):
            begin = (k + random.uniform(0.1, 0.5)) / count * bench.duration_ns
            spells.append((begin, begin + random.uniform(0.1, 0.3) / count * bench.duration_ns))
    else:
        bench = site(random, tap, units=(2, 5))
        hour, days = 3600 * SECOND, random.choice((1, 2, 3))
        bench.duration_ns, bench.begin_ns = days * 24 * hour, 0.0
        bench.epoch_ns = 1_760_000_000_000_000_000
        period = days * 24 * hour / 900 / len({id(poll) for poll in bench.master.polls}) * len(bench.master.polls)
        bench.master.manners.cycle_ms = period / 1e6
        at, long = random.uniform(2, 18), random.uniform(1, 4)
        spells = [((day * 24 + at) * hour, (day * 24 + at + long) * hour) for day in range(days)]
        rate = random.choice((2.0, 5.0))
        bench.wire.pulses = []
        spells = [(begin, end) for begin, end in spells]
        bench.master.random = random
        return _sparse(random, bench, spells)
    _spikes(random, bench, [t for begin, end in spells for t in _poisson(random, begin, end, rate)])
    return bench, Expected("hours")


def _sparse(random: Random, bench: Bench, spells: list[tuple[float, float]]) -> Site:
    """Frames are rare: only where one passes can a spike do harm, so each gets its chance as it passes."""
    share = random.uniform(0.15, 0.5)

    def bend(burst: Burst, chance: Random) -> list[Pulse]:
        t = burst.starts[0]
        if chance.random() >= share or not any(begin <= t < end for begin, end in spells):
            return []
        at = t + chance.random() * (burst.last - t)
        return [Pulse(at, at + chance.uniform(0.6, 2.5) * burst.uart.bit_ns, "flip")]

    bench.wire.bends = bend
    return bench, Expected("hours")


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
