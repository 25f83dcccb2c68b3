"""The language of suspects: how much likelier counts are with a cause than without, in bits; and when it is bad.

Parts of the time that are disturbed are told from quiet ones by the most likely course of both.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, log, log2, pi
from typing import Final, NamedTuple

import numpy as np

from ..tables.schema import Bools, Float64s, Int64s

_LEAST: Final = 1e-6


def likelihood_bits(hits: float, trials: float, rate: float) -> float:
    """log2 of how likely so many hits of so many trials are at a rate, the order of them being what it is."""
    rate = min(max(rate, _LEAST), 1 - _LEAST)
    return hits * log2(rate) + (trials - hits) * log2(1 - rate)


def surplus_bits(hits: float, trials: float, background: float) -> float:
    """How much likelier the hits are at their own rate than at the background's; 0 where they are not more."""
    if not trials or hits <= background * trials:
        return 0.0
    own = (hits + 0.5) / (trials + 1)
    return likelihood_bits(hits, trials, own) - likelihood_bits(hits, trials, background)


def clustering_bits(hits: int, trials: int, runs: int) -> float:
    """How much likelier so few runs of hits are where each hit hangs on the one before than by chance.

    `runs`: how many times a hit followed none.
    """
    misses = trials - hits
    if hits < 2 or misses < 2:
        return 0.0
    rate = hits / trials
    stays, enters = (hits - runs + 0.5) / (hits + 1), (runs + 0.5) / (misses + 1)
    chained = likelihood_bits(hits - runs, hits, stays) + likelihood_bits(runs, misses, enters)
    return max(0.0, chained - likelihood_bits(hits, trials, rate)) if stays > rate else 0.0


def regularity_bits(times: Sequence[float]) -> float:
    """How much likelier events come at a steady pace than by chance: gaps of a normal distribution against those of an
    exponential one, its width paid for; 0 for fewer than four events."""
    gaps = np.diff(np.asarray(times, np.float64))
    if len(gaps) < _GAPS or gaps.mean() <= 0:
        return 0.0
    width = max(float(gaps.std()), _STEADIEST * float(gaps.mean()))
    steady = len(gaps) * (log2(float(gaps.mean()) / width / (2 * pi) ** 0.5) + 0.5 / log(2))
    return max(0.0, steady - 0.5 * log2(len(gaps)) - _WIDTH_BITS)


_GAPS: Final = 3
_STEADIEST: Final = 0.03  # of the mean gap
_WIDTH_BITS: Final = 3.0  # for a width of a few that might be
_COHERENT: Final = (16.0, 128.0, 1024.0)  # s; a mains wanders, so that what keeps step in short may not in long
_SHARPNESS: Final = (1.0, 3.0, 10.0, 30.0)  # of phases about one of them: kappa of von Mises' distribution
_LARGE: Final = 30.0
_AT_ONCE: Final = 1 << 18  # phases


class Phases(NamedTuple):
    """How well events keep step: bits, the frequency, and how much alike their phases are (0..1)."""

    bits: float
    frequency: float
    alike: float


def phase_bits(times: Float64s, low: float, high: float) -> Phases:
    """Whether events (s) keep step with some frequency between two (Hz), within stretches of the time.

    How much likelier the phases of each stretch are about one phase, whichever, than any; the bits of stretches add up,
    and pay for the frequencies, lengths and sharpnesses looked at. What it costs hangs on the count of events alone, not
    on the time between the first and the last.
    """
    best = Phases(0.0, 0.0, 0.0)
    if len(times) < 2:
        return best
    times = np.sort(times) - times.min()
    lengths = sorted({min(length, float(times[-1])) for length in _COHERENT} - {0.0})
    for length in lengths:
        frequencies = low + np.arange(int((high - low) * 4 * length) + 1) / (4 * length)
        places = np.floor(times / length)
        _, at, counts = np.unique(places, return_inverse=True, return_counts=True)
        pairs = float((counts * (counts - 1)).sum())
        if not pairs:
            continue
        met = counts[at] > 1  # a phase alone is like any
        tried = (times - places * length)[met]
        starts = np.flatnonzero(np.diff(at[met], prepend=-1))
        counts = counts[counts > 1]
        powers = _powers(tried, starts, frequencies)
        surplus = (powers - counts).sum(axis=1)
        i = int(np.argmax(surplus))
        sums = np.sqrt(powers[i])
        found = max(
            float((_log_bessel(sharp * sums) - counts * _log_bessel(np.array(sharp))).sum()) for sharp in _SHARPNESS
        )
        bits = found / log(2) - log2(len(frequencies) * len(_SHARPNESS) * len(lengths))
        if bits > best.bits:
            best = Phases(bits, float(frequencies[i]), float(np.sqrt(max(surplus[i], 0.0) / pairs)))
    return best


def _powers(times: Float64s, starts: Int64s, frequencies: Float64s) -> Float64s:
    """The squared length of the sum of the phases of each stretch, a row a frequency."""
    rows = max(1, _AT_ONCE // len(times))
    powers = []
    for i in range(0, len(frequencies), rows):
        phases = 2 * np.pi * np.outer(frequencies[i : i + rows], times)
        parts = (np.add.reduceat(part(phases), starts, axis=1) for part in (np.cos, np.sin))
        powers.append(sum(np.square(part) for part in parts))
    return np.concatenate(powers)


def _log_bessel(x: Float64s) -> Float64s:
    """The logarithm of the modified Bessel function of order 0, which itself overflows."""
    large = np.maximum(x, _LARGE)
    return np.where(
        x < _LARGE, np.log(np.i0(np.minimum(x, _LARGE))), large - 0.5 * np.log(2 * np.pi * large) + 1 / (8 * large)
    )


def strays(numbers: Sequence[float] | Float64s) -> float:
    """How far most of these lie apart; 0 where there are none."""
    return float(np.subtract(*np.quantile(numbers, (0.9, 0.1)))) if len(numbers) else 0.0


_SWITCH_BITS: Final = 9.0  # a change between quiet and disturbed, one of 256 parts
_ROUNDS: Final = 6
_RECURS: Final = 3  # times: two are one distance, which nothing confirms


def mean_period_s(begins_ns: Sequence[int]) -> float | None:
    """How often something comes again, by when it began each time; None where it came too few times to tell."""
    if len(begins_ns) < _RECURS:
        return None
    return round((begins_ns[-1] - begins_ns[0]) / (len(begins_ns) - 1) / 1e9, 3)


def spells_of(hits: Int64s, trials: Int64s) -> tuple[float, Bools]:
    """Parts of the time that are disturbed, by the most likely course of quiet and disturbed; and what it saves in bits.

    Two rates and a price for each change, refined in turns (hard EM).
    """
    trials = np.maximum(trials, hits)
    used = np.flatnonzero(trials > 0)
    inside = np.zeros(len(hits), np.bool_)
    h, n = hits[used].astype(float), trials[used].astype(float)
    if len(used) < 4 or not h.sum():
        return 0.0, inside
    rate = h.sum() / n.sum()
    quiet, loud, best, path = rate / 4, min(rate * 2.5, 0.9), 0.0, inside[used]
    for _ in range(_ROUNDS):
        path, best = _course(h, n, quiet, loud)
        if path.all() or not path.any():
            return 0.0, inside
        quiet = max((h[~path].sum() + 0.25) / (n[~path].sum() + 0.5), 1e-6)
        loud = (h[path].sum() + 0.25) / (n[path].sum() + 0.5)
    inside[used] = path
    one = likelihood_bits(float(h.sum()), float(n.sum()), rate)
    return float(best - one - log2(max(n.sum(), 2))), inside


def _course(h: Float64s, n: Float64s, quiet: float, loud: float) -> tuple[Bools, float]:
    """Viterbi over two states."""
    gains = [(h * log2(rate) + (n - h) * log2(1 - rate)).tolist() for rate in (quiet, min(loud, 1 - 1e-6))]
    calm, wild, back = 0.0, -inf, []
    for stays, strays_off in zip(*gains, strict=True):
        back.append((wild - _SWITCH_BITS > calm, wild >= calm - _SWITCH_BITS))
        calm, wild = max(calm, wild - _SWITCH_BITS) + stays, max(wild, calm - _SWITCH_BITS) + strays_off
    path = [wild > calm]
    for came in reversed(back[1:]):
        path.append(came[path[-1]])
    return np.array(path[::-1], np.bool_), max(calm, wild)
