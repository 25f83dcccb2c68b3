"""Scores the causes that an analysis names against cases from the field.

    python benchmarks/score_causes.py [--seeds N] [--first SEED] [--taps precise,ftdi16] [--misses] [CASE ...]

The cases are `analyzer.simulation.field`: a line bit by bit, and on it a client and units that hear the same wire. A
case counts where the first cause has its id and, where one is to be named, its unit first; of two faults at once
either may come first, and it is named where both are. Beside it, causes among the
first three that are not so are counted as wrong accusations; a healthy case must have none at all. A line a case and
tap, then sums by tap; and how far lost answers and lost time are from what the clients know.
"""

from __future__ import annotations

import argparse
import sys
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from statistics import median

from analyzer.causes.ledger import ledger_of
from analyzer.causes.reasoning import causes_of
from analyzer.causes.registry import Cause
from analyzer.core import analyse
from analyzer.simulation.field.bench import Expected, FieldCapture
from analyzer.simulation.field.cases.registry import ANY_TAP, FieldCase, field_cases
from captures.chunks import Capture

_LOOKED_AT = 3


def causes_in(made: FieldCapture) -> list[Cause]:
    """What the analysis names."""
    capture = Capture.of(made.line, made.chunks, timed=made.line.tap != "untimed")
    return causes_of(ledger_of(((part.batch, part.transactions) for part in analyse(capture)), capture.line))


@dataclass(slots=True)
class CaseTally:
    """The captures of one case behind one tap."""

    seeds: int = 0
    first: int = 0  # named first, with its unit
    named: int = 0  # named anywhere
    wrong: int = 0  # wrong accusations
    misses: list[str] = field(default_factory=list)


def enter(tally: CaseTally, seed: int, made: FieldCapture, found: Sequence[Cause]) -> None:
    """Enter one capture."""
    expected = made.expected
    tally.seeds += 1
    faults = [expected, *([expected.beside] if expected.beside else [])]
    told = [[cause for cause in found if is_right(cause, fault)] for fault in faults]
    right = [cause for causes in told for cause in causes]
    tally.named += all(told) if expected.cause else not found
    first = not found if expected.cause is None else bool(found) and found[0] in right
    tally.first += first
    wrong = [c for c in found[:_LOOKED_AT] if c not in right and c.cause not in expected.also]
    tally.wrong += len(wrong)
    if not first or wrong:
        words = "; ".join(f"{c.cause} {list(c.units)[:4]} {c.bits:.0f} bits" for c in found[:4]) or "nothing"
        tally.misses.append(f"seed {seed}, {made.line.baud} bit/s: {_words(expected)}: said {words}")


def _words(expected: Expected) -> str:
    beside = f" and {_words(expected.beside)}" if expected.beside else ""
    return f"{expected.cause} {list(expected.units)}{beside}"


def is_right(cause: Cause, expected: Expected) -> bool:
    """Whether a cause is the one of a case, with one of its units first where it has any."""
    return cause.cause == expected.cause and (not expected.units or cause.units[:1] in [(u,) for u in expected.units])


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("cases", nargs="*", metavar="CASE", default=list(field_cases()))
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--first", type=int, default=0, metavar="SEED", help="the first seed (0)")
    parser.add_argument("--taps", default=",".join(ANY_TAP))
    parser.add_argument("--misses", action="store_true", help="print each capture that was not told rightly")
    options = parser.parse_args(arguments)
    taps = options.taps.split(",")
    for kind, given, known in (("case", options.cases, field_cases()), ("tap", taps, ANY_TAP)):
        if strange := sorted(set(given) - set(known)):
            parser.error(f"no such {kind}: {', '.join(strange)}; there are {', '.join(known)}")
    tallies: dict[tuple[str, str], CaseTally] = defaultdict(CaseTally)
    answers: list[float] = []
    for name in options.cases:
        case = field_cases()[name]
        for tap in taps:
            for seed in range(options.first, options.first + options.seeds):
                score(case, tap, seed, tallies[name, tap], answers)
            tell(name, tap, case, tallies[name, tap], misses=options.misses)
    for tap in taps:
        sums(tap, tallies)
    if answers:
        print(f"answers lost, said to true: median {median(answers):.3f}, {len(answers)} captures")
    return 0


def score(case: FieldCase, tap: str, seed: int, tally: CaseTally, answers: list[float]) -> None:
    """One capture."""
    made = case.capture(tap, seed)
    found = causes_in(made)
    enter(tally, seed, made, found)
    true = len(made.lost())
    if (
        found
        and made.expected.beside is None
        and is_right(found[0], made.expected)
        and found[0].lost_answers is not None
        and true > 10
    ):
        answers.append(found[0].lost_answers / true)


def tell(name: str, tap: str, case: FieldCase, tally: CaseTally, *, misses: bool) -> None:
    """A line a case and tap."""
    carried = "" if tap in case.taps else "  (this tap cannot carry it)"
    print(
        f"{name:<26}{tap:<10}{tally.first:3} of {tally.seeds}, named {tally.named}, wrong {tally.wrong}{carried}",
        flush=True,
    )
    if misses:
        for line in tally.misses:
            print(f"    {line}", flush=True)


def sums(tap: str, tallies: dict[tuple[str, str], CaseTally]) -> None:
    """All cases behind one tap, and those that it can carry."""
    for words, mine in (
        ("all", [t for (_, each), t in tallies.items() if each == tap]),
        ("carried", [t for (name, each), t in tallies.items() if each == tap and tap in field_cases()[name].taps]),
    ):
        seeds = sum(t.seeds for t in mine)
        if seeds:
            first, wrong = sum(t.first for t in mine), sum(t.wrong for t in mine)
            accused = f"wrong accusations {wrong / seeds:.3f} a capture"
            print(f"{tap:<10}{words:<8} first {first / seeds:.3f} of {seeds}, {accused}")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
