"""Bytes as the edges of a UART's line, as a logic analyser would see them."""

from __future__ import annotations

import random
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray


def edges_of(
    characters: Iterable[tuple[int, int]],
    baud: float,
    data_bits: int = 8,
    parity: str = "N",
    off: float = 0.0,
    wrong: Iterable[int] = (),
    broken: Iterable[int] = (),
) -> list[int]:
    """Times in ns of all level changes of (start in ns, value) characters on a line that is high when idle.

    `off`: how much faster the sender's clock is; numbers in `wrong` have their parity bit turned, in `broken` no stop.
    """
    bit = 1e9 / (baud * (1 + off))
    wrong, broken, out = set(wrong), set(broken), list[int]()
    for number, (start, value) in enumerate(characters):
        bits = [0, *(value >> i & 1 for i in range(data_bits))]
        if parity != "N":
            ones = bin(value & (1 << data_bits) - 1).count("1") & 1
            sent = {"E": ones, "O": ones ^ 1, "M": 1, "S": 0}[parity]
            bits.append(sent ^ (number in wrong))
        bits += [0] if number in broken else []
        level = 1
        for place, one in enumerate(bits):
            if one != level:
                out.append(round(start + place * bit))
                level = one
        if level == 0:
            out.append(round(start + len(bits) * bit))
    return out


def frames_on_line(
    frames: Iterable[bytes],
    baud: float,
    char_bits: float,
    gap_bits: float = 0.0,
    pause_ns: int = 5_000_000,
    begin_ns: int = 0,
) -> list[tuple[int, int]]:
    """Start times and values of frames sent one after the other, with so many bits of idle between characters."""
    bit = 1e9 / baud
    now, out = float(begin_ns + pause_ns), list[tuple[int, int]]()
    for frame in frames:
        for value in frame:
            out.append((round(now), value))
            now += (char_bits + gap_bits) * bit
        now += pause_ns
    return out


def sampled(channels: list[list[int]], rate: float, end_ns: int, levels: list[int] | None = None) -> NDArray[np.uint8]:
    """Samples of up to eight channels, a bit each, by the edges of each."""
    count = int(end_ns * rate / 1e9)
    data = np.zeros(count, np.uint8)
    for channel, edges in enumerate(channels):
        level = 1 if levels is None else levels[channel]
        flips = np.zeros(count + 1, np.int64)
        places = np.minimum(np.ceil(np.array(edges, np.float64) * rate / 1e9).astype(np.int64), count)
        np.add.at(flips, places, 1)
        data |= ((np.cumsum(flips[:count]) + level) % 2 << channel).astype(np.uint8)
    return data


def random_frames(chance: random.Random, count: int, ascii_only: bool = False) -> list[bytes]:
    if ascii_only:
        return [
            bytes(chance.choice(b"0123456789ABCDEF:\r\n") for _ in range(chance.randrange(7, 40))) for _ in range(count)
        ]
    return [chance.randbytes(chance.randrange(5, 40)) for _ in range(count)]
