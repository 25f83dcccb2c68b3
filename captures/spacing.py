"""Baud rate and length of a character, from the times of single bytes.

A tap that gives each byte its own time (a logic analyser, a UART's interrupt) shows how long a character takes: bytes
of one frame follow each other without a pause, so that the commonest of the short spacings is one character. Of the
usual rates one fits, with 10 or 11 bits to a character. What fits none is left unknown.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from .chunks import Block, Capture
from .line import LineSettings

INFERRED: Final = "inferred"  # the note of a line whose settings were inferred: which ones, and from what
# The likelier first: where two rates fit alike, the commoner one is meant.
RATES: Final = (
    9600, 19200, 115200, 38400, 57600, 4800, 2400, 1200, 230400, 460800, 921600, 250000, 500000, 1000000, 76800, 14400,
    28800, 600, 300, 128000, 256000, 187500, 2000000, 3000000,
)  # fmt: skip
_BITS: Final = (10, 11)
_LOOK: Final = 1 << 15  # bytes by which spacing is judged
_LEAST: Final = 16  # spacings of one length
_SHARE: Final = 0.4  # of all spacings
_ALIKE: Final = 0.02  # of a character, in which spacings of one length differ
_OFF: Final = 0.018  # of a character: a sender's clock may be so far off


def inferred(capture: Capture) -> LineSettings:
    """The line's settings with baud rate and bits of a character, where bytes tell them, and a note that says so."""
    line = capture.line
    block = next(iter(capture.blocks(_LOOK)), None)
    if block is None or (fit := fitting(character_ns(steps_between_bytes([block])), line.char_bits)) is None:
        return line
    baud, bits = fit
    how = f"{baud} bit/s and {bits} bits a character are inferred from the spacing of bytes (--baud says otherwise)"
    return replace(line, baud=baud, char_bits=line.char_bits or bits, notes={**line.notes, INFERRED: how})


def steps_between_bytes(blocks: Iterable[Block]) -> NDArray[np.int64]:
    """Times from each byte to the next one of its port, ns, where both were reads of their own."""
    steps = [np.zeros(0, np.int64)]
    for block in blocks:
        for port in np.flatnonzero(np.bincount(block.port)).tolist():
            chosen = np.flatnonzero(block.port == port)
            single = np.diff(block.offsets)[chosen] == 1
            steps.append(np.diff(block.t_ns[chosen])[single[1:] & single[:-1]])
    return np.concatenate(steps)


def character_ns(steps: NDArray[np.int64]) -> float | None:
    """How long a character takes, ns, by the spacings of bytes; None where they do not tell."""
    steps = np.sort(steps[steps > 0])
    if len(steps) < _LEAST:
        return None
    ends = np.searchsorted(steps, steps * (1 + 2 * _ALIKE), side="right")
    alike = ends - np.arange(len(steps))  # spacings as long as each, or a little longer
    first = int(np.argmax(alike >= max(_LEAST, _SHARE * len(steps))))
    if alike[first] < max(_LEAST, _SHARE * len(steps)):
        return None
    first += int(np.argmax(alike[first : ends[first]]))
    return float(steps[first : ends[first]].mean())


def fitting(character: float | None, char_bits: int | None = None) -> tuple[int, int] | None:
    """Baud rate and bits of a character that takes so long, ns; None where no usual rate fits."""
    if character is None:
        return None
    bits = (char_bits,) if char_bits is not None else _BITS
    offs = [(abs(character * rate / 1e9 / n - 1), rate, n) for rate in RATES for n in bits]
    near = [(off, rate, n) for off, rate, n in offs if off < _OFF]
    if not near:
        return None
    best = min(off for off, *_ in near)
    _, rate, n = next(candidate for candidate in near if candidate[0] <= best + _OFF / 2)
    return rate, n
