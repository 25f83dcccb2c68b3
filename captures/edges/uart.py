"""A UART as arrays: edges in, characters out, each with its start, its end, its errors and its measured bit time.

A character begins with the first falling edge after the middle of the stop bit before it. All edges inside it are
rounded to whole bits, which is the same as sampling in the middle of each bit: an edge flips that bit and all behind
it, so that the character is the exclusive or of its edges' flips. Only the walk from start to start is a loop.

Samples of a fixed rate: when they were taken, the rate as sigrok writes it, the unit of a column of times.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from math import ceil
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..text.timeforms import UNIT_NS

Times = NDArray[np.int64]

_MEASURED: Final = 2  # bits from the start edge to another one, by which a sender's rate is measured, at the least
_ODD_ONES: Final = np.array([value.bit_count() & 1 for value in range(256)])
_WRONG: Final = 3  # edges passed over that are as bad as a character in error
_TRIES: Final = 12  # edges of a capture's beginning, one of which begins a character
_SPIKE: Final = 0.25  # of a bit: what is shorter is no level, whichever way it goes


@dataclass(frozen=True, slots=True)
class UartSettings:
    """How a line sends: bit/s, data bits, parity (N, E, O, M, S), stop bits; `inverted`: the idle level is low."""

    baud: float
    data_bits: int = 8
    parity: str = "N"
    stop_bits: float = 1
    inverted: bool = False

    @property
    def bit_ns(self) -> float:
        return 1e9 / self.baud

    @property
    def stop_at(self) -> int:
        """The number of the first stop bit; the start bit is 0."""
        return 1 + self.data_bits + (self.parity != "N")

    @property
    def char_bits(self) -> int:
        """Bits of a character on the line, start and stop bits included."""
        return self.stop_at + ceil(self.stop_bits)

    def __str__(self) -> str:
        polarity = ", inverted" if self.inverted else ""
        return f"{self.baud:.0f} bit/s {self.data_bits}{self.parity}{self.stop_bits:g}{polarity}"


class Characters(NamedTuple):
    """Characters in order, as columns: n values each."""

    start_ns: Times  # of the start bit
    end_ns: Times  # of the last stop bit
    value: NDArray[np.uint8]
    framing: NDArray[np.bool_]  # the stop bit was low
    parity: NDArray[np.bool_]  # the parity bit was wrong
    span_ns: Times  # from the start bit to the last falling edge in the character, 0 for none far enough
    span_bits: NDArray[np.uint8]  # so many bits


class Uart:
    """Decodes one channel. `feed` takes edges as they come and gives the characters that are over."""

    def __init__(self, settings: UartSettings, level: int, begin_ns: int | None = None) -> None:
        """`level`: before the first edge, 0 or 1. `begin_ns`: since when the line was heard, where that is known."""
        self.settings = settings
        self._level = level ^ settings.inverted
        self._edges: Times = np.zeros(0, np.int64)
        self._begin_ns = begin_ns
        self._synchronised = False

    def feed(self, edges: Times, until_ns: int | None) -> Characters:
        """The characters that end by `until_ns`, up to which all edges are known now; None: no more come."""
        edges = without_spikes(np.concatenate((self._edges, edges)), _SPIKE * self.settings.bit_ns)
        falling = np.arange(self._level ^ 1, len(edges), 2)  # edges alternate
        starts = edges[falling]
        over = len(starts) if until_ns is None else int(np.searchsorted(starts, until_ns - self._length_ns(), "right"))
        bit = self.settings.bit_ns
        following = np.searchsorted(starts, starts + int((self.settings.stop_at + 0.5) * bit))
        lows = np.diff(edges, append=np.iinfo(np.int64).max)[falling]
        glitch = lows < bit / 2  # too short for a start bit
        following[glitch] = np.flatnonzero(glitch) + 1
        first = 0
        if not self._synchronised and over:
            idle = self._begin_ns is not None and starts[0] - self._begin_ns > self._length_ns()
            first = 0 if idle else self._first(edges, falling, following, glitch, over)
            self._synchronised = True
        chosen, behind = _walk(following, first, over)
        chosen = chosen[~glitch[chosen]]
        cut = int(falling[behind]) if behind < len(falling) else len(edges)
        characters = self._characters(edges[:cut], falling[chosen])
        self._level ^= cut & 1
        self._edges = edges[cut:]
        return characters

    def _length_ns(self) -> int:
        return ceil((self.settings.char_bits + _SPIKE) * self.settings.bit_ns)

    def _first(self, edges: Times, falling: Times, following: Times, glitch: NDArray[np.bool_], over: int) -> int:
        """Where the first character begins, if the capture may begin amid one: where most of what follows fits."""
        starts = edges[falling[:over]]
        quiet = np.flatnonzero(np.diff(starts) > 2 * self._length_ns())
        end = int(quiet[0]) + 1 if len(quiet) else min(over, 20 * _TRIES)
        best, least = 0, None
        for first in range(min(_TRIES, end)):
            chosen, _ = _walk(following, first, end)
            chosen = chosen[~glitch[chosen]]
            cut = int(falling[end]) if end < len(falling) else len(edges)
            characters = self._characters(edges[:cut], falling[chosen])
            cost = first + _WRONG * int((characters.framing | characters.parity).sum())
            if least is None or cost < least:
                best, least = first, cost
        return best

    def _characters(self, edges: Times, begins: Times) -> Characters:
        """The characters whose start bits begin with these edges (their numbers)."""
        settings, bit = self.settings, self.settings.bit_ns
        start = edges[begins]
        if not len(begins):
            none = np.zeros(0, np.int64)
            return Characters(none, none, none.astype(np.uint8), none > 0, none > 0, none, none.astype(np.uint8))
        counts = np.diff(begins, append=len(edges))
        inside = edges[begins[0] :] - np.repeat(start, counts)
        position = np.minimum((inside / bit + 0.5).astype(np.int64), 15)
        flips = np.left_shift(0xFFFF, position, dtype=np.int64)
        offsets = begins - begins[0]
        flips[offsets] = 0  # the start edge itself
        word = np.bitwise_xor.reduceat(flips, offsets)
        value = (word >> 1) & ((1 << settings.data_bits) - 1)
        framing = (word >> settings.stop_at) & 1 == 0
        wrong = np.zeros(len(word), np.bool_)
        if settings.parity != "N":
            sent = (word >> (1 + settings.data_bits)) & 1
            wrong = sent != parity_bit(value, settings.parity)
        end = start + ceil((settings.stop_at + settings.stop_bits) * bit)
        falls = (np.arange(len(inside)) - np.repeat(offsets, counts)) % 2 == 0
        falls &= position <= settings.stop_at
        number = np.where(falls, position, 0)
        bits = np.maximum.reduceat(number, offsets)
        span = np.maximum.reduceat(np.where(falls, inside, 0), offsets)
        bits[bits < _MEASURED] = 0
        span[bits == 0] = 0
        return Characters(start, end, value.astype(np.uint8), framing, wrong, span, bits.astype(np.uint8))


def without_spikes(edges: Times, least_ns: float) -> Times:
    """The edges of a line without what is shorter than this: a glitch leaves none, an edge that rings its first."""
    close = np.diff(edges) < least_ns
    if not close.any():
        return edges
    first = np.flatnonzero(np.concatenate(([True], ~close)))  # of those that follow each other closely
    counts = np.diff(first, append=len(edges))
    kept: Times = edges[first[counts % 2 == 1]]
    return kept


def parity_bit(value: NDArray[np.int64], parity: str) -> NDArray[np.int64]:
    """The bit that goes with each value, for parity E, O, M or S."""
    if parity in "MS":
        return np.full(len(value), int(parity == "M"))
    return _ODD_ONES[value] ^ int(parity == "O")


def _walk(following: Times, first: int, over: int) -> tuple[Times, int]:
    """From start to start, from this one on: those before `over`, and the one behind."""
    chosen: list[int] = []
    at, steps = first, following[:over].tolist()
    while at < over:
        chosen.append(at)
        at = steps[at]
    return np.array(chosen, np.int64), at


RATE: Final = re.compile(r"\s*(\d+(?:\.\d+)?)\s*([kMG]?)(?:Hz)?\s*")
_SCALE: Final = {"": 1, "k": 10**3, "M": 10**6, "G": 10**9}
_SECOND: Final = 1_000_000_000
_SAID: Final = re.compile(r"(?:sample ?rate: | at )(\d{1,9}(?:\.\d{1,9})?) ?([kMG]?)Hz", re.IGNORECASE)


def hertz_of(number: str, prefix: str) -> int | None:
    """Samples a second, of a number and its prefix; None where nothing samples so."""
    wanted = float(number) * _SCALE[prefix]
    return round(wanted) if 1 <= wanted <= _SECOND else None


def sample_times(samples: NDArray[np.int64], rate: int) -> Times:
    """When samples of these numbers were taken, in ns."""
    seconds, rest = np.divmod(samples, rate)
    at: Times = seconds * _SECOND + rest * _SECOND // rate
    return at


def rate_said(text: str) -> int | None:
    """The rate that a comment of sigrok's tables says, in samples a second."""
    said = _SAID.search(text)
    return None if said is None else hertz_of(said[1], said[2])


def unit_of(title: str) -> int | None:
    """The unit, in ns, that the title of a column of times says: `Time [ms]`, `(us)`, `microseconds`."""
    words = re.findall(r"\w+", title.lower())
    return UNIT_NS.get(words[-1]) if words else None
