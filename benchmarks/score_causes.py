"""Scores the causes that an analysis names against cases from the field.

    python benchmarks/score_causes.py [--seeds N] [--held-out] [--taps precise,ftdi16] [--misses] [CASE ...]
    python benchmarks/score_causes.py --hide              # a fifth of the vocabulary hidden, in turns
    python benchmarks/score_causes.py --folder FOLDER     # captures with a truth.json

The cases are `analyzer.simulation.field`: a line bit by bit, and on it a client and units that hear the same wire. A
case counts where the first cause has its id and, where one is to be named, its unit first; of two faults at once
either may come first, and it is named where both are. Beside it, causes among the
first three that are not so are counted as wrong accusations; a healthy case must have none at all. A line a case and
tap, then sums by tap; how far lost answers are from what the clients know; and how sure the claims were that were right
(bins of certainty). Rows are kept on disk (`heard_cases`), so that a second run takes seconds.

Seeds from 1000 on are held out (`--held-out`): nothing is fitted to them. `--hide` hides a fifth of the vocabulary in
turns and scores the cases of what is hidden: there nothing that is said as sure may be another cause.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

from heard_cases import HELD_OUT, HeardCase, heard

import captures
from analyzer.causes.ledger import ledger_of
from analyzer.causes.reasoning import Story, story_of
from analyzer.causes.registry import Cause, suspects
from analyzer.core import analyse
from analyzer.simulation.field.bench import Expected
from analyzer.simulation.field.cases.registry import ANY_TAP, field_cases

_LOOKED_AT = 3
_TURNS = 5
_SURE = 0.5  # a claim less certain than that accuses nobody
NEAREST = {  # what is true as well where the very word is hidden
    "all-silent": ("dead-unit", "absent-units", "unit-restarts"),
    "absent-units": ("dead-unit",),
    "dead-unit": ("absent-units", "all-silent", "retry-policy"),
    "retry-policy": ("dead-unit", "absent-units"),
    "tap-flow-control": ("tap-loses",),
    "tap-reversed": ("tap-one-direction",),
    "client-driver-held": ("driver-enabled-late",),
    "emi-mains": ("interference",),
    "emi-drive": ("interference", "hours"),
    "hours": ("interference",),
}
BINS = (0.0, 0.5, 0.7, 0.8, 0.9, 0.95, 0.98, 1.001)


@dataclass(slots=True)
class CaseTally:
    """The captures of one case behind one tap."""

    seeds: int = 0
    first: int = 0  # named first, with its unit
    named: int = 0  # named anywhere
    wrong: int = 0  # wrong accusations
    mute: int = 0  # not a word
    misses: list[str] = field(default_factory=list)


class Bin(NamedTuple):
    """Claims about as sure as each other: how many, how sure, and which share of them was so."""

    low: float
    high: float
    claims: int
    said: float
    so: float


@dataclass(slots=True)
class Calibration:
    """How sure claims were, and whether they were right."""

    claims: list[tuple[float, bool]] = field(default_factory=list)

    def add(self, causes: Sequence[Cause], right: Sequence[Cause], also: Sequence[str]) -> None:
        """The first causes of a capture."""
        self.claims += [(c.confidence, c in right or c.cause in also) for c in causes[:_LOOKED_AT]]

    def bins(self) -> Iterator[Bin]:
        """How sure the claims of each bin were, and how many of them were so."""
        for low, high in pairwise(BINS):
            inside = [claim for claim in self.claims if low <= claim[0] < high]
            if inside:
                said, so = (sum(claim[i] for claim in inside) / len(inside) for i in (0, 1))
                yield Bin(low, min(high, 1.0), len(inside), said, so)

    @property
    def error(self) -> float:
        """How far certainty is from what is so, over all claims."""
        return sum(abs(each.said - each.so) * each.claims for each in self.bins()) / len(self.claims)

    def tell(self) -> None:
        """A line a bin, then how far certainty is from what is so."""
        if not self.claims:
            return
        for each in self.bins():
            print(
                f"certainty {each.low:.2f}..{each.high:.2f}: {each.claims:4} claims, {each.said:.3f} said, "
                f"{each.so:.3f} so"
            )
        brier = sum((said - so) ** 2 for said, so in self.claims) / len(self.claims)
        print(f"calibration error {self.error:.3f}, Brier score {brier:.3f} of {len(self.claims)} claims")


def enter(tally: CaseTally, calibration: Calibration, made: HeardCase, story: Story) -> None:
    """Enter one capture."""
    expected, found = made.expected, story.causes
    tally.seeds += 1
    if expected.cause == "":
        _enter_nameless(tally, calibration, made, story)
        return
    if expected.cause is None:  # facts are no faults
        found = [cause for cause in found if cause.severity != "note"]
    faults = [expected, *([expected.beside] if expected.beside else [])]
    told = [[cause for cause in found if is_right(cause, fault)] for fault in faults]
    right = [cause for causes in told for cause in causes]
    tally.named += all(told) if expected.cause else not found
    first = not found if expected.cause is None else bool(found) and found[0] in right
    tally.first += first
    wrong = [c for c in found[:_LOOKED_AT] if c not in right and c.cause not in expected.also]
    wrong = [c for c in wrong if c.severity != "note"]
    tally.wrong += len(wrong)
    tally.mute += bool(expected.cause) and not found and not story.not_explained
    calibration.add(found, right, expected.also)
    if not first or wrong:
        tally.misses.append(f"seed {made.seed}, {made.line.baud} bit/s: {_words(expected)}: said {said(story)}")


def _enter_nameless(tally: CaseTally, calibration: Calibration, made: HeardCase, story: Story) -> None:
    """A fault without a word: honest is as good as it gets."""
    verdict = verdict_on(story, made.expected.also)
    tally.first += verdict == "honest"
    tally.named += verdict == "honest"
    tally.wrong += verdict == "wrong"
    tally.mute += verdict == "mute"
    calibration.add(story.causes, (), made.expected.also)
    if verdict != "honest":
        tally.misses.append(f"seed {made.seed}, {made.line.baud} bit/s: {verdict}, no word for it: said {said(story)}")


def said(story: Story) -> str:
    """What was said, in a line."""
    words = [f"{c.cause} {list(c.units)[:4]} {c.bits:.0f} bits {c.confidence:.2f}" for c in story.causes[:4]]
    words += [f"not explained: unit {each.unit}, {each.exchanges}, {each.like}" for each in story.not_explained[:3]]
    return "; ".join(words) or "nothing"


def _words(expected: Expected) -> str:
    beside = f" and {_words(expected.beside)}" if expected.beside else ""
    return f"{expected.cause} {list(expected.units)}{beside}"


def is_right(cause: Cause, expected: Expected) -> bool:
    """Whether a cause is the one of a case, with one of its units first where it has any."""
    return cause.cause == expected.cause and (not expected.units or cause.units[:1] in [(u,) for u in expected.units])


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("cases", nargs="*", metavar="CASE", default=list(field_cases()))
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--first", type=int, default=0, metavar="SEED", help="the first seed (0)")
    parser.add_argument("--held-out", action="store_true", help="seeds that nothing was fitted to")
    parser.add_argument("--taps", default="precise,ftdi16")
    parser.add_argument("--misses", action="store_true", help="print each capture that was not told rightly")
    parser.add_argument("--hide", action="store_true", help="hide a fifth of the vocabulary, in turns")
    parser.add_argument("--folder", type=Path, help="captures with a truth.json, in place of the cases")
    options = parser.parse_args(arguments)
    if options.folder:
        return score_folder(options.folder)
    taps = options.taps.split(",")
    for kind, given, known in (("case", options.cases, field_cases()), ("tap", taps, ANY_TAP)):
        if strange := sorted(set(given) - set(known)):
            parser.error(f"no such {kind}: {', '.join(strange)}; there are {', '.join(known)}")
    first = options.first + (HELD_OUT if options.held_out else 0)
    seeds = range(first, first + options.seeds)
    if options.hide:
        return score_hidden(options.cases, taps, seeds, misses=options.misses)
    tallies: dict[tuple[str, str], CaseTally] = defaultdict(CaseTally)
    calibration = Calibration()
    answers: list[float] = []
    for name in options.cases:
        for tap in taps:
            for seed in seeds:
                score(heard(field_cases()[name], tap, seed), tallies[name, tap], calibration, answers)
            tell(name, tap, tallies[name, tap], misses=options.misses)
    for tap in taps:
        sums(tap, tallies)
    calibration.tell()
    if answers:
        print(f"answers lost, said to true: median {median(answers):.3f}, {len(answers)} captures")
    return 0


def score(made: HeardCase, tally: CaseTally, calibration: Calibration, answers: list[float]) -> None:
    """One capture."""
    story = story_of(made.ledger())
    enter(tally, calibration, made, story)
    found = story.causes
    if (
        found
        and made.expected.beside is None
        and is_right(found[0], made.expected)
        and found[0].lost_answers is not None
        and made.lost > 10
    ):
        answers.append(found[0].lost_answers / made.lost)


def tell(name: str, tap: str, tally: CaseTally, *, misses: bool) -> None:
    """A line a case and tap, where it is not all well."""
    carried = "" if tap in field_cases()[name].taps else "  (this tap cannot carry it)"
    if misses or tally.misses:
        print(f"{name:<26}{tap:<10}{tally.first:3} of {tally.seeds}, named {tally.named}, wrong {tally.wrong}{carried}")
    for line in tally.misses if misses else ():
        print(f"    {line}", flush=True)


def sums(tap: str, tallies: dict[tuple[str, str], CaseTally]) -> None:
    """All cases behind one tap, and those that it can carry."""
    mine_by_sort: dict[str, list[CaseTally]] = defaultdict(list)
    for (name, each), tally in tallies.items():
        if each == tap:
            mine_by_sort["all"].append(tally)
            if tap in field_cases()[name].taps:
                mine_by_sort[_sort_of(name)].append(tally)
    for words, mine in mine_by_sort.items():
        if seeds := sum(t.seeds for t in mine):
            first, named, wrong, mute = (
                sum(getattr(t, each) for t in mine) / seeds for each in ("first", "named", "wrong", "mute")
            )
            print(
                f"{tap:<10}{words:<8} first {first:.3f}, named {named:.3f} of {seeds}, "
                f"wrong accusations {wrong:.3f} a capture, mute {mute:.3f}"
            )


def _sort_of(name: str) -> str:
    return next((sort for sort in ("healthy", "nameless") if name.startswith(sort)), "known")


def score_hidden(names: Sequence[str], taps: Sequence[str], seeds: range, *, misses: bool) -> int:
    """The cases of each fifth of the vocabulary, told without it."""
    counts: Counter[str] = Counter()
    calibration = Calibration()
    for turn in range(_TURNS):
        hidden = {suspect.cause for suspect in suspects()[turn::_TURNS]}
        among = [suspect for suspect in suspects() if suspect.cause not in hidden]
        for name in names:
            for tap in taps:
                if tap not in field_cases()[name].taps:
                    continue
                for seed in seeds:
                    made = heard(field_cases()[name], tap, seed)
                    if made.expected.cause not in hidden or made.expected.beside:
                        continue
                    story = story_of(made.ledger(), among)
                    also = (*made.expected.also, *NEAREST.get(made.expected.cause, ()))
                    verdict = verdict_on(story, also)
                    counts[verdict] += 1
                    calibration.add(story.causes, (), also)
                    if misses and verdict in ("wrong", "mute"):
                        print(f"{name:<26}{tap:<10}{seed} {verdict}: {_words(made.expected)}: said {said(story)}")
    every = sum(counts.values())
    print(f"hidden: {every} captures, " + ", ".join(f"{each} {n / every:.3f}" for each, n in sorted(counts.items())))
    calibration.tell()
    return 0


def verdict_on(story: Story, also: Sequence[str]) -> str:
    """Of a fault without a word; a note accuses nobody."""
    accused = [c for c in story.causes[:_LOOKED_AT] if c.severity != "note" and c.cause not in also]
    if any(c.confidence >= _SURE for c in accused):
        return "wrong"
    return "honest" if story.causes or story.not_explained else "mute"


def score_folder(folder: Path) -> int:
    """Captures with a truth beside them."""
    counts: Counter[str] = Counter()
    for name, truth in json.loads((folder / "truth.json").read_text()).items():
        capture = captures.open(folder / f"{name}.jsonl")
        parts = ((part.batch, part.transactions) for part in analyse(capture))
        story = story_of(ledger_of(parts, capture.line))
        verdict = _held_against(story, truth)
        counts[verdict] += 1
        print(f"{name} {verdict:<8} {truth['what'][:60]}: said {said(story)}")
    print(", ".join(f"{each} {n}" for each, n in sorted(counts.items())))
    return 0


def _held_against(story: Story, truth: dict[str, Any]) -> str:
    """Right, honest, wrong, or mute; or, where nothing is wrong, well."""
    wrong, named = list(_accused(story, truth)), {(cause.cause, cause.units[:1]) for cause in story.causes}
    if truth["healthy"]:
        return "wrong" if wrong else "well"
    if wrong:
        return "wrong"
    if not story.causes and not story.not_explained:
        return "mute"
    faults = [fault for fault in truth["causes"] if fault["word_exists"]]
    found = [any(cause in fault["ids"] and (not fault["units"] or set(units) <= set(fault["units"]))
                 for cause, units in named) for fault in faults]  # fmt: skip
    if faults:
        return "right" if all(found) else "part"
    return "named" if story.causes else "honest"


def _accused(story: Story, truth: dict[str, Any]) -> Iterator[Cause]:
    """Causes that would send somebody the wrong way."""
    fine = {each for fault in truth["causes"] for each in fault["ids"]} | set(truth["let_pass"])
    for cause in story.causes[:_LOOKED_AT]:
        known = cause.cause in truth["must_not_say"] or truth["healthy"]
        if cause.cause not in fine and known and cause.severity != "note":
            yield cause


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
