"""The taps that can be simulated: how bytes with exact times become chunks with the times that software sees.

    precise    every byte by itself, at the end of its stop bit
    irq        a UART's FIFO: an interrupt at 8 bytes, or 4 characters after the last one; read 0.05 to 0.4 ms later
    ftdi16     a USB adapter: what has come, each 16 ms, or a packet of 62 bytes as soon as it is full
    gateway    RTU over TCP: pieces of any size, one in four up to a second late, so that many arrive together
    untimed    everything at once, no times

A new tap is one new entry in `TAPS`.
"""

# ruff: noqa: ARG001 - one signature serves every tap

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from random import Random
from types import MappingProxyType

import captures

MS = 1e6  # ns
_FIFO_LEVEL = 8  # bytes
_FIFO_TIMEOUT = 4  # characters
_USB_PACKET = 62  # bytes beside the two of modem status
_USB_TIMER_NS = 16 * MS
_TCP_PIECES = (1, 3, 8, 8, 20, 64, 200)
_TCP_STALLED = 0.25  # of the pieces

Octets = Iterable[tuple[int, float]]  # a byte and the time at which it ended, ns
Hears = Callable[[Octets, Random, float], Iterator["captures.Chunk"]]


@dataclass(frozen=True, slots=True)
class SimulatedTap:
    """A tap: how it hears (bytes with their times, a source of chance, ns a character). Nothing of a line is kept
    longer than it takes to fill a chunk."""

    hears: Hears

    def deliver(
        self, data: Iterable[int], times: Iterable[float], random: Random, character_ns: float
    ) -> Iterator[captures.Chunk]:
        """The chunks of bytes whose times (ns) stand in an array of their own."""
        return self.hears(zip(data, times, strict=True), random, character_ns)


def _precise(octets: Octets, random: Random, character_ns: float) -> Iterator[captures.Chunk]:
    for value, time in octets:
        yield captures.Chunk(round(time), bytes((value,)))


def _irq(octets: Octets, random: Random, character_ns: float) -> Iterator[captures.Chunk]:
    timeout = _FIFO_TIMEOUT * character_ns
    held, last, latest = bytearray(), 0.0, 0
    for value, time in octets:
        full = len(held) == _FIFO_LEVEL
        if held and (full or time - last > timeout):
            latest = max(latest, round(last + (0 if full else timeout) + random.uniform(0.05, 0.4) * MS))
            yield captures.Chunk(latest, bytes(held))
            held.clear()
        held.append(value)
        last = time
    if held:
        ready = last + (0 if len(held) == _FIFO_LEVEL else timeout)
        yield captures.Chunk(max(latest, round(ready + random.uniform(0.05, 0.4) * MS)), bytes(held))


def _usb(octets: Octets, random: Random, character_ns: float) -> Iterator[captures.Chunk]:
    held, latest = bytearray(), 0
    due: float | None = None
    for value, time in octets:
        if due is None:
            due = time + _USB_TIMER_NS
        elif time > due:
            if held:
                latest = max(latest, round(due + random.uniform(0, 1) * MS))
                yield captures.Chunk(latest, bytes(held))
                held.clear()
            due += (time - due) // _USB_TIMER_NS * _USB_TIMER_NS + _USB_TIMER_NS
        held.append(value)
        if len(held) == _USB_PACKET:
            latest = max(latest, round(time + random.uniform(0.05, 0.4) * MS))
            yield captures.Chunk(latest, bytes(held))
            held.clear()
            due = time + _USB_TIMER_NS
    if held and due is not None:
        yield captures.Chunk(max(latest, round(due + random.uniform(0, 1) * MS)), bytes(held))


def _gateway(octets: Octets, random: Random, character_ns: float) -> Iterator[captures.Chunk]:
    stream, latest = iter(octets), 0
    for first in stream:
        piece = [first, *islice(stream, random.choice(_TCP_PIECES) - 1)]
        delay = random.uniform(100, 1000) if random.random() < _TCP_STALLED else random.uniform(5, 40)
        latest = max(latest + 1000, round(piece[-1][1] + delay * MS))
        yield captures.Chunk(latest, bytes(value for value, _ in piece))


def _untimed(octets: Octets, random: Random, character_ns: float) -> Iterator[captures.Chunk]:
    if data := bytes(value for value, _ in octets):
        yield captures.Chunk(0, data)


def with_errors(chunks: Iterable[captures.Chunk], errors: Sequence[int]) -> Iterator[captures.Chunk]:
    """The chunks with the bytes marked that stand at these offsets of the stream, in order."""
    start = low = 0
    for chunk in chunks:
        end = start + len(chunk.data)
        high = bisect_left(errors, end, low)
        yield replace(chunk, errors=tuple(at - start for at in errors[low:high])) if high > low else chunk
        start, low = end, high


USUAL_BAUDS = (9600, 19200)  # bit/s, of a bus that is drawn by chance

TAPS: Mapping[str, SimulatedTap] = MappingProxyType(
    {
        "precise": SimulatedTap(_precise),
        "irq": SimulatedTap(_irq),
        "ftdi16": SimulatedTap(_usb),
        "gateway": SimulatedTap(_gateway),
        "untimed": SimulatedTap(_untimed),
    }
)
