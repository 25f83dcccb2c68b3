"""Learns what each kind of evidence for a map is worth beside the others, and prints the table for `recognition.py`.

    python benchmarks/fit_recognition.py [--seeds N] [--polls N ...] [--strength S]

Examples are devices of the shipped maps, with their own map among the candidates, and without it: then they are
strangers, as are the layouts beside this file and sisters of the shipped maps (a part of the map as it is, the rest
elsewhere). The odds of each map against "none of these" are a weighted sum of its evidence. Maps are held out by halves
to show what the table does on maps that it has not seen.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from random import Random

import numpy as np
from numpy.typing import NDArray
from register_series import LAYOUTS, made_device

from analyzer.registers.chartfit import KINDS, chart_fit
from analyzer.registers.inference import infer
from dissectors.maps import RegisterMap, read_map, shipped_map, shipped_names

Floats = NDArray[np.float64]
MOST = 1.5  # a weight: a master may well ask for what a map leaves out, made ones never do
_ROUNDS = 3000
_RATE = 0.02


@dataclass(frozen=True, slots=True)
class Candidates:
    """Of one device the evidence of each map (maps, kinds), and which is right (-1: none)."""

    name: str
    bits: Floats
    right: int
    weight: float


def sister(chart: RegisterMap, random: Random) -> RegisterMap:
    """A device of the same maker: the map's beginning as it is, of the rest some left out and the others moved."""
    rows, shift = [], 0
    kept = random.uniform(0.2, 0.7) * len(chart.rows)
    for number, row in enumerate(chart.rows):
        if number > kept and random.random() < 0.3:
            shift += random.choice((-2, -1, 1, 1, 2, 3, 6))
        if number <= kept or (random.random() < 0.8 and 0 <= row.address + shift <= 0xFFF0):
            rows.append(replace(row, address=row.address + (shift if number > kept else 0), scale_address=None))
    return replace(chart, rows=tuple(rows))


def examples(seeds: range, polls: Sequence[int], share_of_sisters: float) -> Iterator[Candidates]:
    charts = {name: shipped_map(name) for name in shipped_names()}
    names = list(charts)
    strangers = {path.stem: read_map(path) for path in sorted(LAYOUTS.rglob("*.csv"))}
    for seed in seeds:
        for name, chart in [*charts.items(), *strangers.items()]:
            bits = _bits(name, chart, Random(f"fit {name} {seed}"), polls[seed % len(polls)], seed, charts)
            if name in charts:
                at = names.index(name)
                yield Candidates(name, bits, at, 1.0)
                yield Candidates(name, np.delete(bits, at, axis=0), -1, 0.1)
            else:
                yield Candidates(name, bits, -1, 1.0)
        for name, chart in charts.items():
            random = Random(f"sister {name} {seed}")
            bits = _bits(name, sister(chart, random), random, polls[seed % len(polls)], seed, charts)
            yield Candidates(name, bits, -1, share_of_sisters)


def _bits(
    name: str, chart: RegisterMap, random: Random, polls: int, seed: int, charts: dict[str, RegisterMap]
) -> Floats:
    """Of every other seed a part of the values do what nobody expects of their names."""
    chart = replace(chart, match=replace(chart.match, registers=()))
    device = made_device(name, chart, random, polls, move=False, wild=0.2 * (seed % 2))
    values, blocks = infer(device.readings), list(device.readings)
    return np.array([chart_fit(chart, blocks, values).bits for chart in charts.values()])


def fitted(candidates: Sequence[Candidates], strength: float) -> Floats:
    """The weights of greatest likelihood; evidence never counts against its sense."""
    most = max(len(c.bits) for c in candidates)
    bits = np.zeros((len(candidates), most, len(KINDS)))
    there = np.zeros((len(candidates), most), np.bool_)
    right = np.array([c.right for c in candidates])
    shares = np.array([c.weight for c in candidates])
    for number, c in enumerate(candidates):
        bits[number, : len(c.bits)] = c.bits
        there[number, : len(c.bits)] = True
    prior = np.array([-5.0] + [0.5] * (len(KINDS) - 1))
    weights = prior.copy()
    mean, spread = np.zeros(len(KINDS)), np.zeros(len(KINDS))
    for step in range(1, _ROUNDS + 1):
        odds = np.where(there, bits @ weights, -np.inf)
        top = np.maximum(odds.max(axis=1), 0)
        each = np.exp(odds - top[:, None])
        posterior = each / (each.sum(axis=1) + np.exp(-top))[:, None]
        target = np.zeros_like(posterior)
        known = np.flatnonzero(right >= 0)
        target[known, right[known]] = 1
        gradient = np.einsum("d,dm,dmk->k", shares, target - posterior, bits) - strength * (weights - prior)
        mean, spread = 0.9 * mean + 0.1 * gradient, 0.99 * spread + 0.01 * gradient**2
        weights += _RATE * (mean / (1 - 0.9**step)) / (np.sqrt(spread / (1 - 0.99**step)) + 1e-6)
        weights[1:] = np.clip(weights[1:], 0.0, MOST)
    return weights


def scored(candidates: Sequence[Candidates], weights: Floats, least: float) -> str:
    """How often the right map is said, a wrong one, and one of a stranger; and how true the shares are."""
    right = wrong = known = taken = strangers = sisters = sisters_taken = 0
    sure: list[tuple[float, bool]] = []
    for c in candidates:
        odds = np.append(c.bits @ weights, 0.0)
        share = np.exp(odds - odds.max())
        share /= share.sum()
        best = int(share[:-1].argmax())
        said = share[best] >= least
        sure.append((float(share[best]), best == c.right))
        if c.right >= 0:
            known, right, wrong = known + 1, right + (said and best == c.right), wrong + (said and best != c.right)
        elif c.weight == 1.0:
            strangers, taken = strangers + 1, taken + said
        else:
            sisters, sisters_taken = sisters + 1, sisters_taken + said
    shares, truths = (np.array(column, float) for column in zip(*sure, strict=True))
    which = np.minimum((shares * 10).astype(int), 9)
    off = [f"{shares[which == b].mean():.2f}:{truths[which == b].mean():.2f}" for b in sorted(set(which.tolist()))]
    return (
        f"right {right / max(known, 1):.3f} wrong {wrong / max(known, 1):.3f} of {known};"
        f" strangers taken {taken / max(strangers, 1):.4f} of {strangers};"
        f" sisters and maps left out {sisters_taken / max(sisters, 1):.3f} of {sisters}; said:true {' '.join(off)}"
    )


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seeds", type=int, default=6)
    parser.add_argument("--polls", type=int, nargs="+", default=[60, 60, 20, 150])
    parser.add_argument("--strength", type=float, default=0.5)
    parser.add_argument("--sisters", type=float, default=0.02, help="what a sister counts beside another stranger")
    parser.add_argument("--least", type=float, default=0.7, help="the share from which a map is said")
    options = parser.parse_args(arguments)
    candidates = list(examples(range(options.seeds), options.polls, options.sisters))
    for half in range(2):
        names = sorted({c.name for c in candidates})
        out = set(names[half::2])
        weights = fitted([c for c in candidates if c.name not in out], options.strength)
        print(f"held out: {scored([c for c in candidates if c.name in out], weights, options.least)}")
    weights = fitted(candidates, options.strength)
    print(f"all: {scored(candidates, weights, options.least)}")
    print({kind: round(float(weight), 3) for kind, weight in zip(KINDS, weights, strict=True)})
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
