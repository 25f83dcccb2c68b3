"""How a tap hears a line: the same bytes, cut into reads with times as kinds of hardware give them.

`t_ns` of a read is when it reached the program, at or after the last stop bit of its last byte; None where a tap has no
clock. Nothing is lost, so that places in the byte stream are the same for all taps of a line.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from random import Random
from typing import NamedTuple

from .line import MS

Wire = Sequence[tuple[int, int]]  # time of the last stop bit, byte


class Read(NamedTuple):
    """Bytes that came at once."""

    t_ns: int | None
    data: bytes


def each_byte(wire: Wire, random: Random, _: float) -> Iterator[Read]:
    """A logic analyser, or a port read byte by byte: some microseconds late."""
    for t_ns, byte in wire:
        yield Read(t_ns + random.randrange(40_000), bytes((byte,)))


def fifo(wire: Wire, random: Random, char_ns: float) -> Iterator[Read]:
    """A UART that speaks up at eight bytes, or after four characters of silence."""
    for group in _groups(wire, 4 * char_ns):
        for at in range(0, len(group), 8):
            part = group[at : at + 8]
            waits = 0 if len(part) == 8 else 4 * char_ns
            yield _read(part, waits + random.randrange(100_000))


def usb(wire: Wire, random: Random, _: float) -> Iterator[Read]:
    """A USB adapter whose latency timer runs for 16 ms, with packets of at most 62 bytes."""
    phase, held = random.randrange(16 * MS), list[tuple[int, int]]()
    for t_ns, byte in wire:
        if held and (_tick(t_ns, phase) != _tick(held[0][0], phase) or len(held) == 62):
            yield _usb_read(held, phase, random)
            held = []
        held.append((t_ns, byte))
    if held:
        yield _usb_read(held, phase, random)


def _tick(t_ns: int, phase: int) -> int:
    return (t_ns + phase) // (16 * MS)


def _usb_read(held: Wire, phase: int, random: Random) -> Read:
    full = len(held) == 62
    at = held[-1][0] if full else (_tick(held[-1][0], phase) + 1) * 16 * MS - phase
    return Read(at + random.randrange(200_000), bytes(byte for _, byte in held))


def network(wire: Wire, random: Random, _: float) -> Iterator[Read]:
    """A gateway: packets end at 5 ms of silence or anywhere, come up to a second late, and join on the way."""
    parts = [part for group in _groups(wire, 5 * MS) for part in _torn(group, random)]
    now, held = 0, b""
    for part, later in zip(parts, [*parts[1:], None], strict=True):
        late = random.expovariate(1 / 15) if random.random() < 0.98 else random.uniform(100, 1000)
        now = max(now, round(part[-1][0] + late * MS))
        held += bytes(byte for _, byte in part)
        if later is None or later[-1][0] > now:
            yield Read(now, held)
            held = b""


def _torn(group: Wire, random: Random) -> Iterator[Wire]:
    at = random.randrange(1, len(group)) if len(group) > 1 and random.random() < 0.1 else len(group)
    yield group[:at]
    if at < len(group):
        yield group[at:]


def untimed(wire: Wire, _: Random, __: float) -> Iterator[Read]:
    """Bytes in a file, without times."""
    yield Read(None, bytes(byte for _, byte in wire))


def _groups(wire: Wire, silence: float) -> Iterator[Wire]:
    """Bytes between which no silence is longer."""
    first = 0
    for at in range(1, len(wire) + 1):
        if at == len(wire) or wire[at][0] - wire[at - 1][0] > silence:
            yield wire[first:at]
            first = at


def _read(part: Wire, late: float) -> Read:
    return Read(round(part[-1][0] + late), bytes(byte for _, byte in part))


TAPS: dict[str, Callable[[Wire, Random, float], Iterator[Read]]] = {
    "bytes": each_byte, "fifo": fifo, "usb": usb, "network": network, "untimed": untimed,
}  # fmt: skip
