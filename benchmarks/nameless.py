"""Faults that no cause is a word for: what an analysis says of them shows how honest it is.

Kinds are drawn like field cases, on sites of their own: some stand one by one (`nameless_kinds`, `nameless_strange`),
others are put together of what happens and when (`nameless_drawn`). Half of the kinds (`fitted`) may be looked at when
a rule or a weight is made; the others are only told (`--told`). Where some cause is true of a kind besides, its case
says so.

    python benchmarks/nameless.py [--drawn] [--told] [--seeds N] [--first SEED] [--taps TAPS] [--misses] [CASE ...]
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Sequence
from zlib import crc32

from heard_cases import HELD_OUT, heard
from nameless_drawn import DRAWN
from nameless_kinds import KINDS
from nameless_strange import STRANGE
from score_causes import Calibration, said, verdict_on

from analyzer.causes.reasoning import story_of
from analyzer.simulation.field.cases.registry import FieldCase


def nameless_cases() -> dict[str, FieldCase]:
    """All of them, by name."""
    return dict(sorted((KINDS | STRANGE | DRAWN).items()))


def fitted() -> list[str]:
    """Those that a fit may see: about half of them, by their names."""
    return [name for name in nameless_cases() if is_fitted(name)]


def is_fitted(name: str) -> bool:
    """Whether a kind is one of them."""
    return bool(crc32(name.encode()) % 2)


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("cases", nargs="*", metavar="CASE")
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--first", type=int, default=0, metavar="SEED", help="the first seed (0)")
    parser.add_argument("--taps", default="precise,ftdi16")
    parser.add_argument("--told", action="store_true", help="the kinds and seeds that nothing was fitted to")
    parser.add_argument("--drawn", action="store_true", help="the kinds that are put together, not those one by one")
    parser.add_argument("--misses", action="store_true", help="print each capture that was not told honestly")
    options = parser.parse_args(arguments)
    seen = fitted()
    kinds = DRAWN if options.drawn else KINDS | STRANGE
    names = options.cases or [name for name in sorted(kinds) if (name in seen) != options.told]
    first = options.first + (HELD_OUT if options.told else 0)
    return tell(names, options.taps.split(","), range(first, first + options.seeds), misses=options.misses)


def tell(names: Sequence[str], taps: Sequence[str], seeds: range, *, misses: bool) -> int:
    """A line a kind, then sums and how sure the claims were."""
    sums: Counter[str] = Counter()
    calibration = Calibration()
    for name in names:
        case, counts = nameless_cases()[name], Counter[str]()
        for tap in (tap for tap in taps if tap in case.taps):
            for seed in seeds:
                made = heard(case, tap, seed)
                story = story_of(made.ledger())
                found = verdict_on(story, made.expected.also)
                counts[found] += 1
                counts["accusing"] += any(
                    cause.severity != "note" and cause.cause not in made.expected.also for cause in story.causes
                )
                calibration.add(story.causes, (), made.expected.also)
                if misses and (found != "honest" or not story.not_explained):
                    print(f"    {name} {tap} {seed} {found}: {case.words} Said {said(story)}", flush=True)
        print(f"{name:<20}" + ", ".join(f"{each} {n}" for each, n in sorted(counts.items())), flush=True)
        sums += counts
    every = sum(n for each, n in sums.items() if each != "accusing")
    print(f"{every} captures: " + ", ".join(f"{each} {n / max(every, 1):.3f}" for each, n in sorted(sums.items())))
    calibration.tell()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
