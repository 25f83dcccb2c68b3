"""A line's settings from its edges: bit time by the widths of pulses; polarity, parity and stop bits by what fits.

Pulses away from the idle level lie inside characters: they are whole numbers of bits, and many of them are one bit
long, which gives the bit time; of the usual rates the nearest is meant. How many bits a character has is found by
decoding: with one too many, or one too few, stop bits are missing, and a parity bit that is right in character after
character is no chance.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ..spacing import RATES
from .uart import Characters, Times, Uart, UartSettings, parity_bit, without_spikes

ENOUGH: Final = 6000  # edges by which a channel is judged
_LEAST: Final = 8  # edges of a channel that may carry characters
_WHOLE: Final = 0.85  # of the pulses within a character that must be whole numbers of bits
_NEAR: Final = 0.2  # of a bit, off a whole number
_OFF: Final = 0.035  # of a bit: a sender's clock may be so far from the usual rate
_SELDOM: Final = (56000,)  # bit/s: near to a usual rate, so meant where the line has just this one
_JUST: Final = 0.005  # of a rate, off it
_SLOWEST: Final = 200.0  # bit/s
_RIGHT: Final = 0.97  # of the characters or parity bits, that leave no doubt
_GOOD: Final = 0.8  # of the characters that must be without an error
_FEW: Final = 16  # characters, of which parity may be right by chance
_CLOCK: Final = 32  # pulses, or characters, all alike that are a clock
_SPARE: Final = 0.07  # of a bit, to which a sample that is missed is added
_COARSE: Final = 0.3  # of a bit, off a whole number, where samples are few
_BOTH: Final = 0.02  # of a bit, by which widths differ that are not the same number of samples
_APART: Final = 3  # times as long as a usual glitch, at the least, is the shortest pulse
_GLITCHES: Final = (0.02, 0.1, 0.3, 0.6)  # of all widths, that may be those of glitches
_EVENTFUL: Final = 2.5  # edges in a character, on average; an enabled driver has two


@dataclass(frozen=True, slots=True)
class GivenSettings:
    """What is known of the line beforehand; None where nobody said."""

    baud: int | None = None
    parity: str | None = None
    bits: int | None = None
    stop: float | None = None
    inverted: bool | None = None


def settings_of(
    edges: Times, level: int, given: GivenSettings, begin_ns: int | None = None
) -> tuple[UartSettings, float] | None:
    """The settings that fit a channel's edges best, and the share of characters without error; None: no characters.

    `level` is that before the first edge, `begin_ns` since when the line was heard. What is given is taken as it is.
    """
    edges = edges[:ENOUGH]

    def decoded(settings: UartSettings) -> Characters:
        return Uart(settings, level, begin_ns).feed(edges, None)

    if len(edges) < _LEAST:
        return None
    best: tuple[UartSettings, float] | None = None
    for clean in _cleaned(edges):
        for inverted in _polarities(clean, level) if given.inverted is None else (given.inverted,):
            for baud in _rates(clean, level ^ inverted) if given.baud is None else (float(given.baud),):
                plain = UartSettings(baud, given.bits or 8, given.parity or "N", given.stop or 1, inverted)
                settings = plain if given.parity is not None else _with_parity(decoded, plain, given)
                characters = decoded(settings)
                settings = replace(settings, baud=usual_rate(baud))
                score = _right(characters)
                if given.baud is None and not _eventful(clean, characters, settings):
                    continue
                if not _is_clock(characters) and (best is None or score > best[1]):
                    best = settings, score
            if best is not None and best[1] >= _RIGHT:
                return best
        if best is not None and (best[1] >= _GOOD or given.baud is not None):
            return best
    return None


def _cleaned(edges: Times) -> Iterator[Times]:
    """The edges, then those that are left without glitches, by how many of its pulses may be some."""
    yield edges
    widths = np.diff(edges)
    tried = len(edges)
    for share in _GLITCHES:
        clean = without_spikes(edges, _APART * float(np.quantile(widths, share)))
        if _LEAST <= len(clean) < tried:
            tried = len(clean)
            yield clean


def _eventful(edges: Times, characters: Characters, settings: UartSettings) -> bool:
    """Whether characters have edges within them, or follow each other closely at a usual rate.

    A driver's enable, or a line that is on while a frame is sent, has one pulse to what looks like a character.
    """
    count = len(characters.start_ns)
    if not count or len(edges) >= _EVENTFUL * count:
        return True
    steps = np.diff(characters.start_ns) / (settings.char_bits * settings.bit_ns)
    return settings.baud in RATES and len(steps) > 0 and bool((np.abs(steps - 1) < _NEAR / 2).mean() > 1 / 2)


def _rates(edges: Times, level: int) -> tuple[float, ...]:
    """Bit rates by the widths of pulses: there may be no pulse of one bit among them."""
    widths = np.diff(edges)
    if len(widths) > _CLOCK and (np.abs(widths - np.median(widths)) <= _NEAR / 2 * np.median(widths)).mean() > _RIGHT:
        return ()  # a clock
    bit = bit_ns(widths[level ^ 1 :: 2], widths[level::2])  # `level` as if the line were idle when high
    return () if bit is None else (1e9 / bit, 2e9 / bit)


def bit_ns(low: Times, high: Times) -> float | None:
    """The time of one bit by the widths of pulses; None where the low ones are not whole numbers of anything."""
    if len(low) < _LEAST / 2:
        return None
    bit = float(np.quantile(low, 0.2))
    for most in (1.5, 3.5, 5.5, 10.5):
        near = _tolerance(low, bit)
        parts = [(_near_multiples(low, bit, most, near)), (_near_multiples(high, bit, most, near))]
        if bit <= 0 or not sum(count.sum() for _, count in parts):
            return None
        bit = float(sum(width.sum() for width, _ in parts) / sum(count.sum() for _, count in parts))
    share = len(_near_multiples(low, bit, 10.5, _tolerance(low, bit))[0]) / len(low)
    return bit if share >= _WHOLE and 1e9 / bit >= _SLOWEST else None


def _tolerance(widths: Times, bit: float) -> float:
    """How far, in bits, a pulse may be from a whole number: samples that are a quarter of a bit apart miss as much."""
    steps: NDArray[np.float64] = np.diff(np.unique(widths[widths < 10.5 * bit])).astype(np.float64)
    steps = steps[steps > _BOTH * bit]
    return float(np.clip(steps.min() / bit + _SPARE, _NEAR, _COARSE)) if bit > 0 and len(steps) else _NEAR


def _near_multiples(widths: Times, bit: float, most: float, tolerance: float) -> tuple[Times, Times]:
    """Those pulses that are near to a whole number of bits, up to so many, and these numbers."""
    widths = widths[widths < most * bit]
    count = np.rint(widths / bit).astype(np.int64)
    near = (np.abs(widths / bit - count) < tolerance) & (count > 0)
    return widths[near], count[near]


def usual_rate(baud: float) -> float:
    """The usual rate that is meant, or this one where none is near."""
    for rate in _SELDOM:
        if abs(baud / rate - 1) <= _JUST:
            return float(rate)
    nearest = min(RATES, key=lambda rate: abs(baud / rate - 1))
    return float(nearest) if abs(baud / nearest - 1) < _OFF else round(baud, 1)


def _polarities(edges: Times, level: int) -> tuple[bool, bool]:
    """Whether the line is inverted, the likelier first: it is idle in its longest pulses."""
    widths = np.diff(edges)
    longest = np.argsort(widths)[-max(len(widths) // 50, 1) :]
    low = int(widths[longest[(longest + 1 + level) % 2 == 0]].sum())
    likely = 2 * low > int(widths[longest].sum())
    return likely, not likely


def _with_parity(
    decoded: Callable[[UartSettings], Characters], plain: UartSettings, given: GivenSettings
) -> UartSettings:
    """The same settings with the parity and the stop bits that the characters have."""
    short = decoded(plain)
    # a bit behind the data, whatever it is: 1 unless `parity` says that it is not as `M` has it
    wide = decoded(replace(plain, parity="M"))
    if _framed(short) >= min(_RIGHT, _framed(wide)):
        if given.bits is None and (seven := _seventh(short.value)) is not None:
            return replace(plain, data_bits=7, parity=seven)
        if given.stop is None and _two_stop_bits(short, plain):
            return replace(plain, stop_bits=2)
        return plain
    behind = ~wide.parity[~wide.framing]
    value = wide.value[~wide.framing].astype(np.int64)
    if not len(behind):
        return plain
    shares = {parity: float((behind == parity_bit(value, parity)).mean()) for parity in "EOS"}
    parity = max(shares, key=lambda parity: shares[parity])
    return replace(plain, parity=parity) if shares[parity] >= _GOOD else plain


def _seventh(value: NDArray[np.uint8]) -> str | None:
    """The parity of seven data bits that the eighth bit is; None where it is a data bit."""
    if len(value) < _FEW or len(np.unique(value)) < _FEW / 2:
        return None
    sent, data = value >> 7, (value & 0x7F).astype(np.int64)
    for parity in "EO":
        if (sent == parity_bit(data, parity)).mean() >= _RIGHT:
            return parity
    return None


def _two_stop_bits(characters: Characters, settings: UartSettings) -> bool:
    """Whether characters that follow each other closely are one bit longer than one stop bit makes them."""
    steps = np.diff(characters.start_ns) / settings.bit_ns
    close = steps[steps < settings.char_bits + 1.5]
    return len(close) >= _FEW / 2 and bool((np.abs(close - settings.char_bits - 1) < _NEAR).mean() >= _RIGHT)


def _framed(characters: Characters) -> float:
    return 1.0 - float(characters.framing.mean()) if len(characters.framing) else 0.0


def _right(characters: Characters) -> float:
    return 1.0 - float((characters.framing | characters.parity).mean()) if len(characters.framing) else 0.0


def _is_clock(characters: Characters) -> bool:
    return len(characters.value) > _CLOCK and len(np.unique(characters.value)) == 1
