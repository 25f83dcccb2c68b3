"""Buses for the tracks frames, directions, pairs and damage: kinds of lines, each heard through every tap."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from random import Random

from ..items import Item, bus_truth, split_frames
from ..line import Client, Line, Sent, Unit, add, cut, flip, lose, sometimes, wire_of
from ..modbus import (
    ILLEGAL_ADDRESS,
    Memory,
    adu,
    crc16,
    read,
    read_and_write,
    write_coils,
    write_one,
    write_registers,
)
from ..taps import TAPS

Poll = tuple[int, Callable[[Random], bytes]]
_BAUDS = (9600, 19200, 38400, 115200)


def _words(random: Random, most: int) -> list[int]:
    return [random.choice((0, random.randrange(200), random.randrange(65536))) for _ in range(random.randint(1, most))]


def _reading(function: int, address: int, quantity: int) -> Callable[[Random], bytes]:
    return lambda _: read(function, address, quantity)


def _writing(function: int, address: int) -> Callable[[Random], bytes]:
    ways: dict[int, Callable[[Random], bytes]] = {
        5: lambda random: write_one(5, address, random.choice((0, 0xFF00))),
        6: lambda random: write_one(6, address, random.randrange(1000)),
        15: lambda random: write_coils(address, [random.randrange(2) for _ in range(random.randint(1, 20))]),
        16: lambda random: write_registers(address, _words(random, 8)),
        22: lambda random: bytes((22,)) + address.to_bytes(2, "big") + random.randbytes(4),
        23: lambda random: read_and_write(address, random.randint(1, 6), address + 40, _words(random, 3)),
    }
    return ways[function]


def poll_list(random: Random, units: Sequence[int], reads: Sequence[int], writes: Sequence[int]) -> list[Poll]:
    """A client's list: five reads of one block or another for each write."""
    polls: list[Poll] = []
    for _ in range(random.randint(8, 16)):
        unit, address = random.choice(units), random.choice((0, 1, 40, 107, 256, 1000, 4096, 30000))
        if writes and random.random() < 0.17:
            polls.append((unit, _writing(random.choice(writes), address)))
        else:
            function = random.choice(reads)
            most = 40 if function > 2 else 60
            polls.append((unit, _reading(function, address, random.choice((1, 2, random.randint(1, most))))))
    return polls


def _line(random: Random) -> tuple[Line, list[int]]:
    line = Line(random, baud=random.choice(_BAUDS))
    units = random.sample(range(1, 40), random.randint(2, 5))
    line.units = {unit: Unit(unit, Memory.drawn(random)) for unit in units}
    return line, units


def calm(random: Random) -> tuple[Line, Client]:
    """No problems found: everyday functions, some exceptions, a broadcast now and then."""
    line, units = _line(random)
    refused = random.randrange(8)
    line.units[units[0]].refuses = lambda pdu, _: ILLEGAL_ADDRESS * (pdu[2] % 8 == refused and pdu[0] in (3, 4))
    polls = poll_list(random, units, (1, 2, 3, 3, 3, 4, 4), (5, 6, 6, 15, 16, 16))
    polls.append((0, _writing(6, 12)))
    return line, Client(polls)


def torn(random: Random) -> tuple[Line, Client]:
    """Units that pause inside their answers, for 2 to 25 ms, as slow devices and some converters do."""
    line, units = _line(random)
    for unit in line.units.values():
        unit.tear = (0.5, 2.0, 25.0)
    return line, Client(poll_list(random, units, (3, 3, 4, 1), (6, 16)))


def noisy(random: Random) -> tuple[Line, Client]:
    """One frame in five is damaged, bytes stray in between, and some answers never come."""
    line, units = _line(random)
    spoil = sometimes(0.2, flip, flip, lose, add, cut)
    for unit in line.units.values():
        unit.spoil = spoil
        unit.asleep = lambda _: random.random() < 0.05
    line.glitch = lambda random: (b"", random.randbytes(random.randint(1, 3)) if random.random() < 0.04 else b"")
    return line, Client(poll_list(random, units, (1, 3, 3, 3, 4), (5, 6, 16)), spoil=spoil, timeout_ms=120)


def switching(random: Random) -> tuple[Line, Client]:
    """Drivers that switch late or early leave 00, FF or FE hard before or after frames."""
    line, units = _line(random)

    def stray(random: Random) -> bytes:
        return random.choice((b"\x00", b"\xff", b"\xfe", b"\x00\x00")) if random.random() < 0.35 else b""

    line.glitch = lambda random: (stray(random), stray(random))
    return line, Client(poll_list(random, units, (1, 2, 3, 3, 4), (5, 6, 15, 16)))


def nested(random: Random) -> tuple[Line, Client]:
    """Registers that hold whole frames, and frames whose first bytes end in a right check value of their own."""
    line, units = _line(random)
    frames = [adu(random.choice(units), read(3, random.randrange(200), random.randint(1, 9))) for _ in range(4)]
    frames += [adu(random.choice(units), bytes((3, 4)) + random.randbytes(4)) + b"\0" for _ in range(3)]
    kept = [int.from_bytes(frame[at : at + 2], "big") for frame in frames for at in range(0, len(frame) - 1, 2)]
    for unit in line.units.values():
        unit.memory = Memory(lambda address: kept[address % len(kept)])
    polls = poll_list(random, units, (3, 3, 4), (16,))
    polls += [(unit, _early(random, line.units[unit], 5000 + 200 * at)) for at, unit in enumerate(units)]
    polls += [(units[0], lambda random: write_registers(8, [*kept[:8], random.randrange(9)])) for _ in range(2)]
    return line, Client(polls)


def _early(random: Random, unit: Unit, address: int) -> Callable[[Random], bytes]:
    """A read whose answer begins with bytes that end in a right check value, long before its end."""
    quantity, first = random.randint(8, 30), random.randint(1, 5)
    head = bytes((unit.address, 3, 2 * quantity)) + random.randbytes(2 * first)
    octets = head[3:] + crc16(head).to_bytes(2, "little")
    for at in range(first + 1):
        unit.memory.written[address + at] = int.from_bytes(octets[2 * at : 2 * at + 2], "big")
    return _reading(3, address, quantity)


def late(random: Random) -> tuple[Line, Client]:
    """The client gives up too soon: answers come after the next request, and for another than it waits for."""
    line, units = _line(random)
    for unit in line.units.values():
        unit.delay_ms = (3.0, 15.0)
        unit.slow = (0.15, 40.0, 160.0)
    return line, Client(poll_list(random, units, (3, 3, 4, 1), (6, 16)), timeout_ms=50, rest_ms=(2.0, 8.0))


def odd(random: Random) -> tuple[Line, Client]:
    """Functions that few tools know: 07, 08, 11, 16, 17, 2B and a maker's own 41 (hexadecimal), among reads."""
    line, units = _line(random)
    rare: list[Callable[[Random], bytes]] = [
        lambda _: b"\x07", lambda random: b"\x08\x00\x00" + random.randbytes(2), lambda _: b"\x11",
        lambda _: b"\x2b\x0e\x01\x00", lambda random: bytes((0x41, random.randrange(30))), _writing(22, 9),
        _writing(23, 20),
    ]  # fmt: skip
    polls = poll_list(random, units, (1, 3, 3, 4), (6, 16))
    polls += [(random.choice(units), way) for way in rare]
    random.shuffle(polls)
    return line, Client(polls)


BUSES = {one.__name__: one for one in (calm, torn, noisy, switching, nested, late, odd)}
_EVERY = ("frames", "directions", "pairs")


def tracks_of(sent: Sequence[Sent]) -> tuple[str, ...]:
    """Damage is scored where there is some."""
    damaged = sum(bool(one.fault) for one in sent)
    return (*_EVERY, "damage") if damaged >= 5 else _EVERY


def heard(name: str, sent: list[Sent], line: Line, seed: int, source: str = "made") -> Iterator[Item]:
    """What was sent, through every tap."""
    wire = list(wire_of(sent, line.char_ns))
    truth = {"frames": bus_truth(sent)}
    given = {"wire": list(TAPS["bytes"](wire, Random(0), line.char_ns)), "frames": split_frames(sent, wire)}
    for tap, hear in TAPS.items():
        reads = list(hear(wire, Random(f"{seed} {name} {tap}"), line.char_ns))
        yield Item(f"{name}-{tap}", "bus", source, tracks_of(sent), truth, line.baud, line.char_bits, tap,
                   {"reads": reads, **given})  # fmt: skip


def items(seed: int, transactions: int) -> Iterator[Item]:
    """Every kind of bus through every tap, so many requests each."""
    for name, make in BUSES.items():
        line, client = make(Random(f"{seed} {name}"))
        yield from heard(name, line.run([client], transactions), line, seed)
