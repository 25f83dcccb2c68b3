"""The command: streams of every kind, breaches counted."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from random import Random

sys.path[:0] = [str(Path(__file__).parents[1]), str(Path(__file__).parents[2])]

import feeding  # noqa: E402 - from its own folder
from feeding.streams import KINDS, stream  # noqa: E402
from feeding.ways import breaches  # noqa: E402


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="benchmarks/feeding", description=feeding.__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("kinds", nargs="*", metavar="KIND", help=", ".join(KINDS))
    parser.add_argument("--streams", type=int, default=500, help="all kinds together")
    parser.add_argument("--first", type=int, default=0, help="number of the first seed")
    given = parser.parse_args()
    names = given.kinds or list(KINDS)
    parts = sum(KINDS[name][1] for name in names)
    every = broken = 0
    for name in names:
        count = max(1, round(given.streams * KINDS[name][1] / parts))
        octets = bad = 0
        for seed in range(given.first, given.first + count):
            made = stream(name, seed)
            octets += sum(len(chunk.data) for chunk in made.chunks)
            found = list(breaches(made, Random(seed)))
            bad += bool(found)
            for breach in found:
                print(f"    {name} {seed}: {breach}", flush=True)
        print(f"{name:<18} {count:6} streams {octets:9} bytes {bad:5} breaches", flush=True)
        every, broken = every + count, broken + bad
    print(f"{'all':<18} {every:6} streams {broken:22} breaches")
    return int(broken > 0)


if __name__ == "__main__":
    sys.exit(main())
