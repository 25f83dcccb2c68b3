"""Streams of every kind that a tap gives: a kind is a function of a seed."""

from __future__ import annotations

from array import array
from collections.abc import Callable
from dataclasses import dataclass, replace
from random import Random
from typing import Final

from edges.frames import answer, request, some, vendor
from edges.registry import Bus
from pairing_rounds import drawn

from analyzer.simulation import TAPS
from captures import Chunk, LineSettings
from captures.recording.notes import Note
from dissectors.crc import lrc

_MS: Final = 1_000_000
_TAPS: Final = ("precise", "irq", "ftdi16", "untimed")
_GLITCHES: Final = (b"\0", b"\xff", b"\0\0", b"\xfe\xff")
_KNOWN: Final = {"directions": "request,response"}
_ADDRESSES: Final = range(1, 6)


@dataclass(frozen=True, slots=True)
class FedStream:
    """Reads of one line, in the order in which they return."""

    line: LineSettings
    chunks: list[Chunk]
    timed: bool = True
    notes: tuple[Note, ...] = ()  # in order of time: when nothing was received


Kind = Callable[[Random], FedStream]
Encode = Callable[[bytes, int], bytes]  # of an RTU ADU and its exchange's number


def _rtu(adu: bytes, number: int) -> bytes:  # noqa: ARG001 - one signature serves every envelope
    return adu


def _ascii(adu: bytes, number: int) -> bytes:  # noqa: ARG001
    body = adu[:-2]
    return b":" + (body + bytes([lrc(body)])).hex().upper().encode() + b"\r\n"


def _mbap(adu: bytes, number: int) -> bytes:
    return (number & 0xFFFF).to_bytes(2) + b"\0\0" + (len(adu) - 2).to_bytes(2) + adu[:-2]


def _damaged(random: Random, frame: bytes) -> bytes:
    """A frame as it may come: mostly whole."""
    fault = random.randrange(24)
    if fault == 0:
        at = random.randrange(len(frame))
        return frame[:at] + bytes([frame[at] ^ 1 << random.randrange(8)]) + frame[at + 1 :]
    if fault == 1:
        return frame[: random.randrange(len(frame))]
    if fault == 2:
        return random.choice(_GLITCHES) + frame
    if fault == 3:
        return frame + some(random, random.randint(1, 30))
    if fault == 4:
        return frame[: len(frame) // 2] + frame
    return b"" if fault == 5 else frame


def _talk(
    bus: Bus,
    random: Random,
    encode: Encode = _rtu,
    ports: tuple[int, int] = (0, 0),
    *,
    vendors: float = 0.05,
    swapped: bool = False,
) -> None:
    """Exchanges of a bus with troubles: damage, silence, late answers, retries, broadcasts, vendor frames."""
    polls = [request(random, random.choice(_ADDRESSES)) for _ in range(4)]
    slow = random.choice((1, 1, 1, 20, 300))
    for number in range(random.randint(2, 7)):
        asked = random.choice(polls) if random.random() < 0.7 else request(random, random.choice((0, *_ADDRESSES)))
        if random.random() < vendors:
            function = random.choice((0x41, 0x42, 0x2D))
            asked, answered = (vendor(random, asked[0], function) for _ in range(2))
        else:
            answered = answer(random, asked)
        sent = [(ports[0], asked)] * (2 if random.random() < 0.08 else 1)
        if asked[0] and random.random() > 0.06:
            sent.append((ports[1], answered))
            if random.random() < 0.04:
                sent.append(sent[-1])
        for port, frame in sent:
            where = random.choice(ports) if swapped else port
            bus.stray(_damaged(random, encode(frame, number)), where)
            bus.wait(slow * random.choice((0, 0.3, 2, 5, 20)))
        if random.random() < 0.05:
            bus.stray(some(random, random.randint(1, 60)), random.choice(ports))


def _read(bus: Bus, random: Random, tap: str, notes: dict[str, str] | None = None, skew_ms: float = 0) -> FedStream:
    chunks: list[Chunk] = []
    for port, data in sorted(bus.data.items()):
        shift = round(skew_ms * _MS) if port else 0
        read = TAPS[tap].deliver(bytes(data), bus.times[port], random, bus.char_ns)
        chunks += [replace(chunk, port=port, t_ns=chunk.t_ns + shift) for chunk in read]
    chunks.sort(key=lambda chunk: chunk.t_ns)
    line = LineSettings(baud=bus.baud, char_bits=11, notes=notes or {})
    return FedStream(line, chunks, tap != "untimed")


def _line(random: Random) -> Bus:
    return Bus(random, random.choice((9600, 19200, 115200)))


def _one_port(random: Random) -> FedStream:
    bus = _line(random)
    _talk(bus, random)
    return _read(bus, random, random.choice(_TAPS))


def _gateway(random: Random) -> FedStream:
    bus = _line(random)
    _talk(bus, random)
    return _read(bus, random, "gateway")


def _vendor(random: Random) -> FedStream:
    bus = _line(random)
    _talk(bus, random, vendors=0.8)
    return _read(bus, random, random.choice((*_TAPS, "gateway")))


def _noise(random: Random) -> FedStream:
    bus = _line(random)
    for _ in range(random.randint(1, 5)):
        kind = random.randrange(3)
        if kind == 0:
            bus.stray(some(random, random.randint(1, 120)))
        elif kind == 1:
            bus.stray(random.choice((b"\0", b"\x01\x03", b"\x01\x83", b"\x11\x06\0")) * random.randint(1, 40))
        else:
            bus.stray(_damaged(random, request(random, random.choice(_ADDRESSES))))
        bus.wait(random.choice((0, 1, 5, 60, 3000)))
    return _read(bus, random, random.choice((*_TAPS, "gateway")))


def _cut(bus: Bus, random: Random) -> FedStream:
    """Reads that end anywhere, at any time from their last byte on."""
    data, times = bytes(bus.data[0]), bus.times[0]
    chunks, at, latest = [], 0, 0
    most = random.choice((1, 3, 8, 62, 300))
    late = random.choice((0, 0, 2, 16, 200))
    while at < len(data):
        last = min(len(data), at + random.randint(1, most))
        latest = max(latest, round(times[last - 1] + random.uniform(0, late) * _MS))
        chunks.append(Chunk(latest, data[at:last]))
        at = last
    return FedStream(LineSettings(baud=bus.baud, char_bits=11), chunks)


def _cut_anywhere(random: Random) -> FedStream:
    bus = _line(random)
    _talk(bus, random)
    return _cut(bus, random)


def _ascii_cut(random: Random) -> FedStream:
    bus = _line(random)
    if random.random() < 0.2:
        bus.stray(random.choice(_GLITCHES))
    _talk(bus, random, _ascii, vendors=0)
    return _cut(bus, random)


def _tcp(random: Random) -> FedStream:
    bus = Bus(random, 115200)
    _talk(bus, random, _mbap, random.choice(((0, 0), (0, 1))), vendors=0)
    if len(bus.data) == 1:
        return _cut(bus, random)
    return _read(bus, random, random.choice(("irq", "gateway")))


def _directions(notes: dict[str, str]) -> Kind:
    def made(random: Random) -> FedStream:
        bus, ports = _line(random), (0, 1) if notes else random.choice(((0, 1), (1, 0)))
        _talk(bus, random, ports=ports)
        return _read(bus, random, random.choice((*_TAPS, "gateway")), notes)

    return made


def _mixed_ports(random: Random) -> FedStream:
    bus = _line(random)
    _talk(bus, random, ports=(0, 1), swapped=True)
    return _read(bus, random, random.choice(_TAPS))


def _two_taps(random: Random) -> FedStream:
    bus = _line(random)
    _talk(bus, random, ports=(0, 1), vendors=0)
    notes = _KNOWN if random.random() < 0.7 else {}
    stream = _read(bus, random, random.choice(("precise", "ftdi16", "ftdi16")), notes, random.uniform(-5, 5))
    late = random.choice((0, 3, 10)) * _MS
    newest: dict[int, int] = {}
    chunks = []
    for chunk in stream.chunks:
        t_ns = max(newest.get(chunk.port, 0), chunk.t_ns + round(random.uniform(0, late)))
        newest[chunk.port] = t_ns
        chunks.append(replace(chunk, t_ns=t_ns))
    return replace(stream, chunks=sorted(chunks, key=lambda chunk: chunk.t_ns))


def _clocks_apart(random: Random) -> FedStream:
    """Two ports, of which one has a clock of its own, that lies behind or is set back."""
    made = random.choice((_two_taps, _mixed_ports, _tcp, _tcp_both))(random)
    moved = random.randint(0, 1)
    since = random.choice((0, random.randrange(len(made.chunks) + 1)))
    back = round(random.choice((0.001, 0.1, 20, 300, 3600_000)) * random.random() * _MS)
    newest: dict[int, int] = {}
    chunks = []
    for i, chunk in enumerate(made.chunks):
        t_ns = chunk.t_ns - back * (chunk.port == moved and i >= since)
        t_ns = newest[chunk.port] = max(newest.get(chunk.port, t_ns), t_ns)
        chunks.append(replace(chunk, t_ns=t_ns))
    return replace(made, chunks=chunks)


def _outages(random: Random) -> FedStream:
    """A line whose adapter is away now and then, or loses bytes."""
    made = random.choice((_one_port, _cut_anywhere, _gateway, _tcp, _two_taps))(random)
    if not made.chunks or not made.timed:
        return made
    first, last = made.chunks[0].t_ns, made.chunks[-1].t_ns
    notes = []
    t_ns = first - random.randrange(100 * _MS)
    for _ in range(random.choice((1, 2, 5, 90))):
        near = random.choice(made.chunks).t_ns + random.randrange(-10 * _MS, 600 * _MS)
        t_ns = max(t_ns, random.choice((near, random.randint(first, last + 1))))
        port, kind = random.choice("ab"), random.choice(("lost", "opened", "gap"))
        notes.append(Note(t_ns, kind, f"{port}: {kind}"))
    return replace(made, notes=tuple(notes))


def _tcp_both(random: Random) -> FedStream:
    """Modbus TCP of which an answer, or all, is heard on two ports."""
    bus = Bus(random, 115200)
    asked = [request(random, random.choice(_ADDRESSES)) for _ in range(3)]
    often = random.choice((0.1, 0.5, 1))
    for number in range(random.randint(2, 9)):
        poll = random.choice(asked)
        ask, reply = (_mbap(adu, number // random.choice((1, 1, 2))) for adu in (poll, answer(random, poll)))
        for port in (0, 1) if random.random() < 0.1 else (0,):
            bus.stray(ask, port)
        bus.wait(random.choice((0, 0.3, 5)))
        places = [random.randint(0, 1)] if random.random() > often else random.sample((0, 1), 2)
        for port in places:
            bus.stray(_damaged(random, reply), port)
            bus.wait(random.choice((0, 0.3, 5)))
    return _read(bus, random, random.choice(("irq", "gateway", "precise")))


def _displaced(random: Random) -> FedStream:
    """Units that queue, answer late or twice: whose an answer is shows what it holds."""
    made = drawn(random.randrange(1 << 30), most=60)
    return FedStream(made.capture.line, list(made.capture.chunks()), made.capture.timed)


def _long_repeats(random: Random) -> FedStream:
    """The same few frames for long: runs that are taken as arrays, and their edges."""
    bus = _line(random)
    polls = [request(random, random.choice(_ADDRESSES), (3, 4, 5, 6, 16)) for _ in range(2)]
    for asked in polls:
        frames = (asked, answer(random, asked, 0.0)) if random.random() < 0.6 else (asked,)
        pause = random.choice((0, 0, 1, 5, 60))
        for _ in range(random.randint(1, 120)):
            for frame in frames:
                bus.stray(frame)
                bus.wait(pause)
    data, times = bytes(bus.data[0]), bus.times[0]
    size = random.choice((8, 13, 64, 256, 1000))
    ends = [min(at + size, len(data)) for at in range(0, len(data), size)]
    reads = array("d", (times[end - 1] for end in ends))
    chunks = [Chunk(round(t_ns), data[end - size : end]) for t_ns, end in zip(reads[:-1], ends[:-1], strict=True)]
    chunks.append(Chunk(round(reads[-1]), data[(len(ends) - 1) * size :]))
    return FedStream(LineSettings(baud=bus.baud, char_bits=11), chunks)


KINDS: Final[dict[str, tuple[Kind, int]]] = {  # name: how it is made, its part of the streams
    "one-port": (_one_port, 5),
    "cut-anywhere": (_cut_anywhere, 5),
    "gateway": (_gateway, 4),
    "vendor": (_vendor, 4),
    "noise": (_noise, 4),
    "ascii": (_ascii_cut, 5),
    "tcp": (_tcp, 4),
    "two-ports-known": (_directions(_KNOWN), 5),
    "two-ports-unknown": (_directions({}), 5),
    "two-ports-mixed": (_mixed_ports, 3),
    "two-taps": (_two_taps, 5),
    "tcp-both": (_tcp_both, 4),
    "clocks-apart": (_clocks_apart, 5),
    "outages": (_outages, 4),
    "displaced": (_displaced, 3),
    "repeats": (_long_repeats, 1),
}


def stream(kind: str, seed: int) -> FedStream:
    """The stream of a kind with this number; there may be none of its bytes."""
    return KINDS[kind][0](Random(f"{kind} {seed}"))
