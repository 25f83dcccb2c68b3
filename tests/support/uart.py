"""A UART on the bit level: a wave on a wire, and what a receiver set to some rate and parity makes of it.

A pseudo-terminal has no baud rate; this shows what bytes heard at a wrong one are.
"""

from __future__ import annotations

import numpy as np

from captures.chunks import Block, Chunk
from captures.live.settings import PortSettings

_TICKS_PER_S = 32 * 115_200  # of the wave: fine enough for the fastest line


def wave(talk: list[tuple[float, bytes]], line: PortSettings) -> np.ndarray:
    """Levels on a wire on which bytes are sent at these times (s): one value a tick, idle is 1."""
    assert line.baud is not None
    bit = 1 / line.baud
    last = max(at + len(data) * line.char_bits * bit for at, data in talk) + 20 * bit
    levels = np.ones(int(last * _TICKS_PER_S) + 1, np.uint8)
    for at, data in talk:
        for byte in data:
            for number, level in enumerate(_bits(byte, line)):
                first = round((at + number * bit) * _TICKS_PER_S)
                levels[first : round((at + (number + 1) * bit) * _TICKS_PER_S)] = level
            at += line.char_bits * bit
    return levels


def received(levels: np.ndarray, receiver: PortSettings, *, start_ns: int = 0, read: int = 8) -> Block:
    """What a receiver with these settings hears: each bit is sampled in its middle, reads are of `read` bytes."""
    assert receiver.baud is not None
    bit = _TICKS_PER_S / receiver.baud
    falls = np.flatnonzero((levels[:-1] == 1) & (levels[1:] == 0)) + 1
    size = receiver.data_bits + (receiver.parity != "N")
    chunks: list[Chunk] = []
    held, errors = bytearray(), list[int]()
    at, t_ns = 0, 0
    while True:
        place = np.searchsorted(falls, at)
        if place == len(falls) or falls[place] + (size + 2) * bit >= len(levels):
            break
        begin = falls[place]
        samples = [int(levels[int(begin + (number + 0.5) * bit)]) for number in range(size + 2)]
        gap = (begin - at) / _TICKS_PER_S > 4 * receiver.char_bits / receiver.baud
        if held and (gap or len(held) == read):
            chunks.append(Chunk(t_ns, bytes(held), errors=tuple(errors)))
            held, errors = bytearray(), []
        if samples[0]:  # a spike, no start bit
            at = int(begin + 0.5 * bit)
            continue
        byte = sum(level << number for number, level in enumerate(samples[1 : 1 + receiver.data_bits]))
        if not samples[-1] or not _parity_right(samples[1:-1], receiver.parity):
            errors.append(len(held))
        held.append(byte)
        at = int(begin + (size + 1.5) * bit)
        t_ns = start_ns + round((begin + (size + 2) * bit) / _TICKS_PER_S * 1e9)
    if held:
        chunks.append(Chunk(t_ns, bytes(held), errors=tuple(errors)))
    return Block.from_chunks(chunks)


def _bits(byte: int, line: PortSettings) -> list[int]:
    data = [byte >> number & 1 for number in range(line.data_bits)]
    parity = [] if line.parity == "N" else [(sum(data) + (line.parity == "O")) & 1]
    return [0, *data, *parity, *[1] * round(line.stop_bits)]


def _parity_right(bits: list[int], parity: str) -> bool:
    return parity == "N" or (sum(bits) & 1) == (parity == "O")
