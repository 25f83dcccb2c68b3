"""The command of the campaign: which attacks, how often, with which seed."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parents[1]), str(Path(__file__).parents[2])]

import attack  # noqa: E402 - from its own folder
from attack import damage, fuzz, kills, lines, storms, taps  # noqa: E402
from attack.target import Outcome  # noqa: E402

# Name: what runs it, how often in the short campaign, in the long one.
ATTACKS: dict[str, tuple[Callable[..., Outcome], int, int]] = {
    "fuzz": (fuzz.attack, 20_000, 10_000_000),
    "kills": (kills.attack, 5, 100),
    "damage": (damage.attack, 300, 100_000),
    "storms": (storms.attack, 30, 10_000),
    "lines": (lines.attack, 2, 50),
    "taps": (taps.attack, 500, 200_000),
}


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="benchmarks/attack", description=attack.__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("attacks", nargs="*", metavar="ATTACK", help=", ".join(ATTACKS))
    parser.add_argument("--long", action="store_true", help="the whole campaign")
    parser.add_argument("--times", type=float, default=1.0, help="so many times the usual counts")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument(
        "--only", default="", help="of fuzz: targets with this, or of several after commas one, in their name"
    )
    parser.add_argument("--inputs", type=int, help="of fuzz: how many")
    parser.add_argument("--first", type=int, default=0, help="of fuzz: number of the first input")
    parser.add_argument("--account", type=Path, help="of fuzz: go on with the campaign in this file, up to --inputs")
    parser.add_argument("--nursery", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.nursery:
        fuzz.nurse()
        return 0
    failed = False
    for name in given.attacks or ATTACKS:
        run, short, long = ATTACKS[name]
        count = max(1, round((long if given.long else short) * given.times))
        if name == "fuzz" and given.account:
            outcome = fuzz.campaign(given.seed, given.inputs or count, given.account, only=given.only)
        elif name == "fuzz":
            outcome = fuzz.attack(given.seed, given.inputs or count, only=given.only, first=given.first)
        else:
            outcome = run(given.seed, count)
        print(outcome, flush=True)
        for failure in outcome.failures:
            print(f"    {failure}", flush=True)
        failed = failed or bool(outcome.failures)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
