"""Scores the deframer on the edges that real lines have every day, class by class.

    python benchmarks/score_edges.py [--seeds N] [--first N] [--misses] [CLASS ...]

A class (`edges`) is a function that makes captures with known truth: stray bytes beside a frame that nobody was heard
to ask for, a tap that hears answers only, two ports of one direction each, lines full of undeclared functions, counts
that contradict a frame whose CRC is right. A line a class and tap: frames, missed, false, recall, precision, and the
shares of right directions and pairs among the frames that were found. A frame counts where port, start and length are
right.
"""

from __future__ import annotations

import argparse
import sys
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from random import Random

from edges import EDGES
from edges.registry import Bus

from analyzer.core import deframe
from analyzer.tables.schema import Kind
from captures import Capture

LEAST = 0.98  # recall and precision of a class


@dataclass(slots=True)
class EdgeTally:
    """What became of the frames of one class."""

    frames: int = 0
    hits: int = 0
    false: int = 0
    directions: int = 0
    pairs: int = 0
    paired: int = 0
    misses: list[str] = field(default_factory=list)


def score(bus: Bus, capture: Capture, tally: EdgeTally, label: str) -> None:
    """Enters one capture."""
    found = {}
    for batch in deframe(capture):
        for row in batch.rows[(batch.rows.kind != Kind.NOISE) & batch.rows.check]:
            key = (row.port, row.start, row.length)
            found[key] = ("q" if row.kind == Kind.REQUEST else "a", row.request_start)
    tally.frames += len(bus.frames) - len(bus.plain)
    for key, (role, request) in bus.frames.items():
        if key in bus.plain:
            continue
        if key not in found:
            port, start, length = key
            around = bytes(bus.data[port][max(0, start - 4) : start + length + 4]).hex()
            tally.misses.append(f"{label}: {role} {key} in {around}")
            continue
        tally.hits += 1
        kind, asked = found[key]
        tally.directions += kind == ("q" if role == "q" else "a")
        if request is not None:
            tally.pairs += 1
            tally.paired += asked == request[1]
    tally.false += len(found.keys() - bus.frames.keys())


def cases(names: Sequence[str], seeds: int, first: int = 0) -> Iterator[tuple[str, str, Bus, Capture, str]]:
    """Captures with class, tap and a label of each."""
    for name in names:
        make, taps, count = EDGES[name]
        for tap in taps:
            for seed in range(first * count, (first + seeds) * count):
                random = Random(f"{name} {tap} {seed}")
                bus, notes = make(random)
                yield name, tap, bus, bus.capture(tap, notes), f"{name} {tap} {seed}"


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("classes", nargs="*", metavar="CLASS", help="words that the names of classes hold")
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--first", type=int, default=0, help="number of the first seed")
    parser.add_argument("--misses", action="store_true", help="print each miss")
    options = parser.parse_args(arguments)
    names = [name for name in EDGES if not options.classes or any(word in name for word in options.classes)]
    tallies: defaultdict[tuple[str, str], EdgeTally] = defaultdict(EdgeTally)
    for name, tap, bus, capture, label in cases(names, options.seeds, options.first):
        score(bus, capture, tallies[name, tap], label)
    titles = ("frames", "missed", "false", "recall", "precision", "direction", "pairs")
    print(f"{'class':<66} {'tap':<8}", *(f"{title:>9}" for title in titles))
    for (name, tap), tally in tallies.items():
        shares = (
            tally.hits / max(1, tally.frames),
            tally.hits / max(1, tally.hits + tally.false),
            tally.directions / max(1, tally.hits),
            tally.paired / max(1, tally.pairs) if tally.pairs else float("nan"),
        )
        counts = tally.frames, tally.frames - tally.hits, tally.false
        low = " <" * (min(shares[:2]) < LEAST)
        print(f"{name:<66} {tap:<8}", *(f"{n:9}" for n in counts), *(f"{share:9.4f}" for share in shares), low)
    if options.misses:
        for tally in tallies.values():
            print(*tally.misses[:12], sep="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
