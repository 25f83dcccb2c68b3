"""Lines with one field fault each, and healthy ones, for the track causes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from random import Random

from ..items import Item
from ..line import Client, Line, Unit, add, cut, flip, lose, sometimes, wire_of
from ..modbus import BUSY, ILLEGAL_ADDRESS, Memory, read
from ..taps import TAPS
from .buses import Poll, poll_list

Fault = Callable[[Random, Line, Client], list[int]]  # makes a line faulty; the units at fault
_TAPS = ("bytes", "fifo", "usb")


def healthy(_: Random, __: Line, ___: Client) -> list[int]:
    """No problems found."""
    return []


def unit_silent(random: Random, line: Line, _: Client) -> list[int]:
    """A unit never answers, or from a moment on no more."""
    unit = _one(random, line)
    since = random.choice((0.0, random.uniform(3, 8)))
    unit.asleep = lambda now_s: now_s >= since
    return [unit.address]


def unit_restarts(random: Random, line: Line, _: Client) -> list[int]:
    """A unit is away for two to four seconds, every nine or so."""
    unit, away = _one(random, line), random.uniform(2, 4)
    unit.asleep = lambda now_s: now_s % 9.0 < away
    return [unit.address]


def unit_busy(random: Random, line: Line, _: Client) -> list[int]:
    """A unit refuses a third of its requests with code 6."""
    unit = _one(random, line)
    unit.refuses = lambda _, __: BUSY if random.random() < 0.35 else 0
    return [unit.address]


def missing_registers(random: Random, line: Line, client: Client) -> list[int]:
    """The client asks a unit for registers that it does not have."""
    unit = _one(random, line)
    unit.refuses = lambda pdu, _: ILLEGAL_ADDRESS if pdu[1:3] == b"\x60\x00" else 0
    client.polls = [*client.polls, (unit.address, lambda _: read(3, 0x6000, 4))]
    return [unit.address]


def timeout_too_short(random: Random, line: Line, client: Client) -> list[int]:
    """A unit needs longer for some answers than the client waits."""
    unit = _one(random, line)
    client.timeout_ms, client.retries = 60.0, 1
    unit.slow = (0.4, 60.0, 120.0)
    return []


def two_clients(_: Random, __: Line, ___: Client) -> list[int]:
    """Another client asks the same units in its own time."""
    return []


def same_address(random: Random, line: Line, _: Client) -> list[int]:
    """Two units answer at once."""
    unit = _one(random, line)
    unit.twin = Memory.drawn(random)
    return [unit.address]


def line_noise(_: Random, line: Line, client: Client) -> list[int]:
    """Frames of everybody are damaged, one in ten."""
    client.spoil = sometimes(0.1, flip, flip, flip, lose, add)
    for unit in line.units.values():
        unit.spoil = client.spoil
    return []


def unit_noise(random: Random, line: Line, _: Client) -> list[int]:
    """A third of one unit's answers are damaged, nobody else's."""
    unit = _one(random, line)
    unit.spoil = sometimes(0.35, flip, flip, lose, add)
    return [unit.address]


def driver_late(random: Random, line: Line, _: Client) -> list[int]:
    """The first byte or two of a unit's answers are missing."""
    unit, lost = _one(random, line), random.choice((1, 1, 2))
    unit.spoil = lambda random, data: (data[lost:], "lost") if random.random() < 0.8 else (data, "")
    return [unit.address]


def driver_early(random: Random, line: Line, _: Client) -> list[int]:
    """The last byte of a unit's answers is missing, or its last bits."""
    unit = _one(random, line)
    unit.spoil = lambda random, data: (data[:-1], "cut") if random.random() < 0.8 else cut(random, data)
    return [unit.address]


def unit_settings(random: Random, line: Line, _: Client) -> list[int]:
    """A unit answers at half the rate: two characters are heard for one of its own."""
    unit = _one(random, line)
    unit.spoil = lambda _, data: (b"".join(_at_half_rate(byte) for byte in data), "settings")
    return [unit.address]


def _at_half_rate(byte: int) -> bytes:
    """What a receiver at twice the rate makes of a character: each bit stands for two, start bit and parity too."""
    bits = [0, *(byte >> at & 1 for at in range(8)), byte.bit_count() & 1, 1]
    samples = [bit for bit in bits for _ in range(2)] + [1, 1]
    heard, at = bytearray(), 0
    while at < len(samples) - 10:
        if samples[at]:
            at += 1
            continue
        heard.append(sum(samples[at + 1 + bit] << bit for bit in range(8)))
        at += 11
    return bytes(heard)


def _one(random: Random, line: Line) -> Unit:
    return line.units[random.choice(sorted(line.units))]


FAULTS: dict[str, Fault] = {
    "healthy": healthy, "unit-silent": unit_silent, "unit-restarts": unit_restarts, "unit-busy": unit_busy,
    "missing-registers": missing_registers, "timeout-too-short": timeout_too_short, "two-clients": two_clients,
    "same-address": same_address, "line-noise": line_noise, "unit-noise": unit_noise, "driver-late": driver_late,
    "driver-early": driver_early, "unit-settings": unit_settings,
}  # fmt: skip


def _bus(random: Random) -> tuple[Line, list[Poll]]:
    line = Line(random, baud=random.choice((9600, 19200)))
    addresses = random.sample(range(1, 30), random.randint(3, 5))
    line.units = {address: Unit(address, Memory.drawn(random)) for address in addresses}
    return line, [poll for address in addresses for poll in poll_list(random, [address], (3, 3, 4, 1), (6, 16))[:4]]


def items(seed: int, transactions: int, each: int) -> Iterator[Item]:
    """`each` lines of every fault, taps in turn, so many requests each."""
    for name, fault in FAULTS.items():
        for number in range(each):
            random = Random(f"{seed} {name} {number}")
            line, polls = _bus(random)
            client = Client(polls, rest_ms=(10.0, 40.0))
            units = fault(random, line, client)
            clients = [client]
            if name == "two-clients":
                clients.append(Client(polls[::-1], rest_ms=(30.0, 90.0), deaf=True))
            wire = list(wire_of(line.run(clients, transactions), line.char_ns))
            tap = _TAPS[number % len(_TAPS)]
            truth = {"causes": [] if name == "healthy" else [name], "units": units}
            yield Item(f"{name}-{number}", "causes", "made", ("causes",), truth, line.baud, line.char_bits, tap,
                       {"reads": list(TAPS[tap](wire, random, line.char_ns))})  # fmt: skip
