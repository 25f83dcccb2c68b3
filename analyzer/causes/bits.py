"""The language of suspects: how much likelier counts are with a cause than without, in bits."""

from __future__ import annotations

from math import log2
from typing import Final

import numpy as np
from numpy.typing import NDArray

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
    if hits < 2 or misses < 2 or runs < 1:
        return 0.0
    rate = hits / trials
    stays, enters = (hits - runs + 0.5) / (hits + 1), (runs + 0.5) / (misses + 1)
    chained = likelihood_bits(hits - runs, hits, stays) + likelihood_bits(runs, misses, enters)
    return max(0.0, chained - likelihood_bits(hits, trials, rate)) if stays > rate else 0.0


_FREQUENCIES: Final = 1 << 17  # that are tried: over spans that tell more of them apart no frequency keeps its phase


def phase_bits(times: NDArray[np.float64], low: float, high: float, span: float) -> tuple[float, float, float]:
    """Whether events keep step with some frequency between two (per unit of time): (bits, frequency, R).

    Rayleigh's test at each frequency that the span tells from its neighbours; the bits pay for having looked at all.
    R is the length of the mean vector, 1 where all events have one phase.
    """
    count = len(times)
    if count < 2 or span <= 0:
        return 0.0, 0.0, 0.0
    step = 1 / (4 * span)
    if (high - low) / step > _FREQUENCIES:
        return 0.0, 0.0, 0.0
    frequencies = np.arange(low, high + step, step)
    best, where = 0.0, 0.0
    for part in np.array_split(frequencies, max(1, len(frequencies) // 256)):
        turns = np.exp(2j * np.pi * np.outer(part, times))
        lengths = np.abs(turns.mean(axis=1))
        i = int(np.argmax(lengths))
        if lengths[i] > best:
            best, where = float(lengths[i]), float(part[i])
    bits = count * best**2 / np.log(2) - log2(max(len(frequencies) / 4, 1))
    return float(bits), where, best


def spread_bits(hits: NDArray[np.int64], trials: NDArray[np.int64]) -> float:
    """How much likelier hits are if each part of the time has a rate of its own than if all share one.

    Paid for by the parts: half the logarithm of the trials for each rate more (the Bayesian information criterion).
    """
    used = trials > 0
    hits, trials = hits[used], np.maximum(trials[used], hits[used])
    total, all_trials = int(hits.sum()), int(trials.sum())
    if len(hits) < 2 or not total:
        return 0.0
    own = sum(
        likelihood_bits(h, n, h / n) if 0 < h < n else 0.0 for h, n in zip(hits.tolist(), trials.tolist(), strict=True)
    )
    return own - likelihood_bits(total, all_trials, total / all_trials) - 0.5 * (len(hits) - 1) * log2(all_trials)
