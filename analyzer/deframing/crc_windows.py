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

from dissectors.crc import CRC_TABLE

PERIOD: Final = 32767
_FEW: Final = 192  # bytes: of so few, one by one is faster than by arrays
_SLICE: Final = 1 << 16  # bytes worked on at once: what stays in the cache

U16 = NDArray[np.uint16]


class CrcWindows(NamedTuple):
    """Check [i, j) by `heads[i] == tails[j]`; one entry a byte boundary (n bytes give n + 1)."""

    heads: U16
    tails: U16


def possible_starts(crc: CrcWindows, at: int, size: int) -> frozenset[int]:
    """Which of the `size` bytes from index `at` on may begin a window that ends among them and checks.

    All that do are told; of the others, one in 65,536 is told a byte of `size`.
    """
    tails, heads = crc.tails[at : at + size + 1], crc.heads[at : at + size]
    if size <= _FEW:
        ends = frozenset(tails.tolist())
        return frozenset(start for start, head in enumerate(heads.tolist()) if head in ends)
    marked = np.zeros(1 << 16, np.bool_)
    marked[tails] = True
    return frozenset(marked.take(heads).nonzero()[0].tolist())


class _RegisterTables(NamedTuple):
    powers: U16  # A^k T[1] over two periods, then zeros; then the same with A's fixed point
    logs: NDArray[np.intp]  # of T[b]; into the zeros where T[b] has none; into the second half where it is odd
    turns: NDArray[np.intp]  # -(k + 1) mod PERIOD, for a slice at any phase
    initial: U16  # A^-k FFFF, for a slice at any phase


@cache
def _register_tables() -> _RegisterTables:
    registers = np.arange(1 << 16)
    steps = (registers >> 8) ^ np.array(CRC_TABLE)[registers & 0xFF]
    fixed = int(np.flatnonzero(steps == registers)[1])  # the first is 0
    orbit, leap = np.array([CRC_TABLE[1]]), steps
    while len(orbit) < PERIOD:  # `leap` goes as many steps as there are
        orbit, leap = np.concatenate((orbit, leap[orbit])), leap[leap]
    period = orbit[:PERIOD].astype(np.uint16)
    log = np.full(1 << 16, 2 * PERIOD)
    log[period] = np.arange(PERIOD)
    even = np.concatenate((period, period, np.zeros_like(period)))
    powers = np.concatenate((even, even ^ np.uint16(fixed)))

    def place(register: int) -> int:
        """Where the powers of a register begin."""
        odd = register != 0 and log[register] >= PERIOD
        return int(log[register ^ fixed]) + len(even) if odd else int(log[register])

    k = np.arange(PERIOD + _SLICE + 1)
    return _RegisterTables(
        powers,
        np.array([place(CRC_TABLE[b]) for b in range(256)], np.intp),
        ((-k - 1) % PERIOD).astype(np.intp),
        powers[place(0xFFFF) + (-k % PERIOD)],
    )


def crc_windows(data: NDArray[np.uint8]) -> CrcWindows:
    """Heads and tails of `data` (shape n), each of shape n + 1."""
    registers = _register_tables()
    if len(data) <= _FEW:
        return _of_few(data, registers)
    heads = np.empty(len(data) + 1, np.uint16)
    tails = np.empty(len(data) + 1, np.uint16)
    tails[0] = 0
    for begin in range(0, len(data), _SLICE):
        piece = data[begin : begin + _SLICE]
        n, phase = len(piece), begin % PERIOD
        turned = registers.logs.take(piece)
        turned += registers.turns[phase : phase + n]
        steps = registers.powers.take(turned)
        steps[0] ^= tails[begin]
        tails[begin + 1 : begin + n + 1] = _running(steps)
        np.bitwise_xor(tails[begin : begin + n], registers.initial[phase : phase + n], out=heads[begin : begin + n])
    heads[-1] = tails[-1] ^ registers.initial[len(data) % PERIOD]
    return CrcWindows(heads, tails)


def _of_few(data: NDArray[np.uint8], registers: _RegisterTables) -> CrcWindows:
    """The same of few bytes, in fewer steps."""
    n = len(data)
    tails = np.zeros(n + 1, np.uint16)
    np.bitwise_xor.accumulate(registers.powers.take(registers.logs.take(data) + registers.turns[:n]), out=tails[1:])
    return CrcWindows(tails ^ registers.initial[: n + 1], tails)


def _running(steps: U16) -> U16:
    """The exclusive or of each entry and all before it: four entries at once as the lanes of a word, then the words."""
    words = np.zeros(-(-len(steps) // 4), "<u8")
    lanes = words.view("<u2")
    lanes[: len(steps)] = steps
    words ^= words << 16
    words ^= words << 32
    words[1:] ^= np.bitwise_xor.accumulate(words >> 48)[:-1] * 0x0001_0001_0001_0001
    return lanes[: len(steps)]
