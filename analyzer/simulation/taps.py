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

from array import array
from bisect import bisect_left
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
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

Deliver = Callable[[bytes, "array[float]", Random, float], Iterator["captures.Chunk"]]


@dataclass(frozen=True, slots=True)
class SimulatedTap:
    """A tap: how it delivers (bytes, their times in ns, a source of chance, ns a character), and usual baud rates."""

    deliver: Deliver
    bauds: tuple[int, ...]


def _precise(data: bytes, times: array[float], random: Random, character_ns: float) -> Iterator[captures.Chunk]:
    for i, time in enumerate(times):
        yield captures.Chunk(round(time), data[i : i + 1])


def _irq(data: bytes, times: array[float], random: Random, character_ns: float) -> Iterator[captures.Chunk]:
    timeout = _FIFO_TIMEOUT * character_ns
    first, latest = 0, 0
    for i in range(1, len(data) + 1):
        full = i - first == _FIFO_LEVEL
        if full or i == len(data) or times[i] - times[i - 1] > timeout:
            ready = times[i - 1] + (0 if full else timeout)
            latest = max(latest, round(ready + random.uniform(0.05, 0.4) * MS))
            yield captures.Chunk(latest, data[first:i])
            first = i


def _usb(data: bytes, times: array[float], random: Random, character_ns: float) -> Iterator[captures.Chunk]:
    if not data:
        return
    first, latest = 0, 0
    due = times[0] + _USB_TIMER_NS
    for i, time in enumerate(times):
        if time > due:
            if first < i:
                latest = max(latest, round(due + random.uniform(0, 1) * MS))
                yield captures.Chunk(latest, data[first:i])
                first = i
            due += (time - due) // _USB_TIMER_NS * _USB_TIMER_NS + _USB_TIMER_NS
        if i + 1 - first == _USB_PACKET:
            latest = max(latest, round(time + random.uniform(0.05, 0.4) * MS))
            yield captures.Chunk(latest, data[first : i + 1])
            first = i + 1
            due = time + _USB_TIMER_NS
    if first < len(data):
        yield captures.Chunk(max(latest, round(due + random.uniform(0, 1) * MS)), data[first:])


def _gateway(data: bytes, times: array[float], random: Random, character_ns: float) -> Iterator[captures.Chunk]:
    first, latest = 0, 0
    while first < len(data):
        last = min(first + random.choice(_TCP_PIECES), len(data))
        delay = random.uniform(100, 1000) if random.random() < _TCP_STALLED else random.uniform(5, 40)
        latest = max(latest + 1000, round(times[last - 1] + delay * MS))
        yield captures.Chunk(latest, data[first:last])
        first = last


def _untimed(data: bytes, times: array[float], random: Random, character_ns: float) -> Iterator[captures.Chunk]:
    if data:
        yield captures.Chunk(0, data)


def with_errors(chunks: Iterable[captures.Chunk], errors: Sequence[int]) -> Iterator[captures.Chunk]:
    """The chunks with the bytes marked that stand at these offsets of the stream, in order."""
    start = low = 0
    for chunk in chunks:
        end = start + len(chunk.data)
        high = bisect_left(errors, end, low)
        yield replace(chunk, errors=tuple(at - start for at in errors[low:high])) if high > low else chunk
        start, low = end, high


_USUAL_BAUDS = (9600, 19200)

TAPS: Mapping[str, SimulatedTap] = MappingProxyType(
    {
        "precise": SimulatedTap(_precise, _USUAL_BAUDS),
        "irq": SimulatedTap(_irq, _USUAL_BAUDS),
        "ftdi16": SimulatedTap(_usb, (38400, 57600, 115200)),
        "gateway": SimulatedTap(_gateway, _USUAL_BAUDS),
        "untimed": SimulatedTap(_untimed, _USUAL_BAUDS),
    }
)
