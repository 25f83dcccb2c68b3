"""CRC-16 of any window of a stream, by one comparison.

The CRC is linear over GF(2). Let A be the step of the CRC register over one zero byte, T[b] the register that byte b
leaves, and s[j] the running register (from 0) before byte j: s[j+1] = A s[j] ^ T[b]. "Unwinding" the register by its
position, u[j] = A^-j s[j], turns the recurrence into a plain exclusive or: u[j+1] = u[j] ^ A^-(j+1) T[b]. A window
[i, j) that ends in its own check value leaves 0000 from the initial FFFF, which is u[j] == u[i] ^ A^-i FFFF. So

    heads[i] = u[i] ^ A^-i FFFF,  tails[j] = u[j]:   window [i, j) checks  <=>  heads[i] == tails[j].

A^-k T[b] needs no matrices: x generates all non-zero registers of even parity (32767 of them, one orbit of A), and an
odd one is an even one plus A's fixed point. So a register is a logarithm and a parity, A^-k subtracts k from the
logarithm, and a table of 32767 powers does the rest. Nothing here knows frames.
"""

from __future__ import annotations

from functools import cache
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dissectors.checks import CRC_TABLE

PERIOD: Final = 32767
_SLICE: Final = 1 << 17  # bytes worked on at once: what stays in the cache

U16 = NDArray[np.uint16]


class Windows(NamedTuple):
    """Check [i, j) by `heads[i] == tails[j]`; one entry a byte boundary (n bytes give n + 1)."""

    heads: U16
    tails: U16


def opening(crc: Windows, at: int, size: int) -> NDArray[np.bool_]:
    """For each of the `size` bytes from index `at` on: whether any window from it on that ends among them may check.

    Where one does, that is told; of the others, one in 65,536 is told a byte of `size`.
    """
    here = slice(at, at + size + 1)
    ends = np.zeros(1 << 16, np.bool_)
    ends[crc.tails[here]] = True
    may: NDArray[np.bool_] = ends.take(crc.heads[here])
    return may


class _Tables(NamedTuple):
    powers: U16  # A^k T[1] over two periods, then zeros
    logs: NDArray[np.intp]  # of T[b]; into the zeros where T[b] has none
    odd: U16  # A's fixed point where T[b] is odd, else 0
    turns: NDArray[np.intp]  # -(k + 1) mod PERIOD, for a slice at any phase
    initial: U16  # A^-k FFFF, for a slice at any phase


@cache
def _tables() -> _Tables:
    registers = np.arange(1 << 16)
    steps = (registers >> 8) ^ np.array(CRC_TABLE)[registers & 0xFF]
    fixed = int(np.flatnonzero(steps == registers)[1])  # the first is 0
    orbit, leap = np.array([CRC_TABLE[1]]), steps
    while len(orbit) < PERIOD:  # `leap` goes as many steps as there are
        orbit, leap = np.concatenate((orbit, leap[orbit])), leap[leap]
    period = orbit[:PERIOD].astype(np.uint16)
    log = np.full(1 << 16, 2 * PERIOD)
    log[period] = np.arange(PERIOD)
    powers = np.concatenate((period, period, np.zeros_like(period)))

    def split(register: int) -> tuple[int, int]:
        """The logarithm of a register's even part, and its odd part."""
        odd = 0 if log[register] < PERIOD or not register else fixed
        return int(log[register ^ odd]), odd

    parts = [split(CRC_TABLE[b]) for b in range(256)]
    log_initial, odd_initial = split(0xFFFF)
    k = np.arange(PERIOD + _SLICE + 1)
    return _Tables(
        powers,
        np.array([p[0] for p in parts], np.intp),
        np.array([p[1] for p in parts], np.uint16),
        ((-k - 1) % PERIOD).astype(np.intp),
        powers[log_initial + (-k % PERIOD)] ^ np.uint16(odd_initial),
    )


def windows(data: NDArray[np.uint8]) -> Windows:
    """Heads and tails of `data` (shape n), each of shape n + 1."""
    tables = _tables()
    heads = np.empty(len(data) + 1, np.uint16)
    tails = np.empty(len(data) + 1, np.uint16)
    tails[0] = 0
    for begin in range(0, len(data), _SLICE):
        piece = data[begin : begin + _SLICE]
        n, phase = len(piece), begin % PERIOD
        turned = tables.logs.take(piece)
        turned += tables.turns[phase : phase + n]
        steps = tables.powers.take(turned)
        steps ^= tables.odd.take(piece)
        steps[0] ^= tails[begin]
        np.bitwise_xor.accumulate(steps, out=tails[begin + 1 : begin + n + 1])
        np.bitwise_xor(tails[begin : begin + n], tables.initial[phase : phase + n], out=heads[begin : begin + n])
    heads[-1] = tails[-1] ^ tables.initial[len(data) % PERIOD]
    return Windows(heads, tails)
