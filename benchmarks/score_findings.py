"""Scores the diagnosis against captures with one known defect each.

    python benchmarks/score_findings.py [--seeds N] [--first SEED] [--taps precise,irq] [--healthy] [--misses] [CODE]

The simulator makes the captures (`rtuscope simulate --defect CODE`): every defect, every tap that can carry it, N
seeds. A finding counts where code, start and length are the truth's (the code alone, where it is about the bus as a
whole), and where it names a bit, a byte, a place or a convention, that as well. A line a code: findings due, missed,
misplaced, false (in all captures, whatever their defect), recall and precision; then what stood falsely in which
captures, and with `--misses` each miss. `--healthy` scores captures with nothing wrong instead: any error or warning
there is false.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field

from analyzer.core import analyse
from analyzer.simulation import TAPS, Scenario, Simulation, TruthFinding, simulate
from analyzer.simulation.defects import defects
from analyzer.tables.findings import Finding, Severity, described
from captures.chunks import Capture
from dissectors.crc import VARIANTS

# True of a tap, of the polls that a healthy master happens to make, or of one window in 65,536, whatever else is wrong.
_ALWAYS = {"timing-blind", "poll-waste", "crc-collision"}


@dataclass(slots=True)
class Tally:
    """What became of the findings of one code."""

    due: int = 0
    missed: int = 0
    misplaced: int = 0  # found where it was due, but with another byte, bit, place or convention
    false: int = 0
    where: Counter[str] = field(default_factory=Counter)  # false ones, by the defect and tap of the capture


def found_in(made: Simulation) -> list[Finding]:
    """Everything that the diagnosis says of a capture."""
    capture = Capture.of(made.line, made.chunks, timed=made.line.tap != "untimed")
    return [finding for part in analyse(capture) for finding in described(part.findings)]


def score(truth: tuple[TruthFinding, ...], found: list[Finding], tallies: dict[str, Tally], label: str) -> list[str]:
    """Enters one capture into the tallies; the misses in words."""
    left: defaultdict[tuple[str, int, int], list[Finding]] = defaultdict(list)
    for finding in found:
        left[finding.code, finding.start, finding.length].append(finding)
    misses = []
    for due in truth:
        tally = tallies[due.code]
        tally.due += 1
        said = left[due.code, due.start, due.length]
        if not said:
            tally.missed += 1
            end = due.start + due.length
            there = sorted({f.code for f in found if f.start < end and f.start + f.length > due.start})
            misses.append(f"{label}: {due.to_json()}: said {', '.join(there) or 'nothing'}")
        elif not agrees(due, said.pop()):
            tally.misplaced += 1
            misses.append(f"{label}: {due.to_json()}: said of another place")
    tolerated = {(code, due.start, due.length) for due in truth for code in due.also}
    for (code, start, length), rest in left.items():
        if rest and code not in _ALWAYS and (code, start, length) not in tolerated:
            tallies[code].false += len(rest)
            tallies[code].where[label] += len(rest)
    return misses


def agrees(due: TruthFinding, said: Finding) -> bool:
    """Whether the finding names what the truth does, or says that it is among its equals."""
    numbers, detail = said.numbers, due.detail
    match due.code:
        case "bit-flip":
            return (numbers["byte"], numbers["bit"]) == (detail["byte"], detail["bit"])
        case "byte-missing" | "byte-extra":
            spans = [(numbers.get(f"{which}first"), numbers.get(f"{which}last")) for which in ("", "second_")]
            return any(a is not None and b is not None and a <= detail["byte"] <= b for a, b in spans)
        case "crc-variant":
            return bool(VARIANTS[int(numbers["variant"])].name == detail["variant"])
        case "truncated":
            return "due" not in numbers or numbers["due"] <= detail["due"]
        case "slow-device":
            return bool(numbers["unit"] == detail["unit"])
        case _:
            return True


def captures_with(code: str, taps: list[str], seeds: range) -> Iterator[tuple[str, Simulation]]:
    """The captures of one defect, each with a label."""
    for tap in defects()[code].taps:
        if tap in taps:
            for seed in seeds:
                yield f"{code} {tap} {seed}", simulate(Scenario("clean", tap, seed=seed, defect=code))


def healthy(taps: list[str], seeds: range) -> int:
    """Errors and warnings on captures with nothing wrong."""
    false = 0
    for tap in taps:
        for seed in seeds:
            found = found_in(simulate(Scenario("clean", tap, seed=seed)))
            # The simulator's devices refuse a request now and then, and do so rightly.
            wrong = Counter(f.code for f in found if f.severity > Severity.NOTE and f.code != "exception")
            false += wrong.total()
            print(f"{tap:<10} {seed:4} {dict(wrong) or 'nothing'}")
    return 1 if false else 0


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("codes", nargs="*", metavar="CODE", default=list(defects()))
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--first", type=int, default=0, metavar="SEED", help="the first seed (0)")
    parser.add_argument("--taps", default=",".join(TAPS))
    parser.add_argument("--misses", action="store_true", help="print each miss")
    parser.add_argument("--healthy", action="store_true", help="score captures with nothing wrong")
    options = parser.parse_args(arguments)
    taps = options.taps.split(",")
    for kind, given, known in (("code", options.codes, defects()), ("tap", taps, TAPS)):
        if strange := sorted(set(given) - set(known)):
            parser.error(f"no such {kind}: {', '.join(strange)}; there are {', '.join(known)}")
    seeds = range(options.first, options.first + options.seeds)
    if options.healthy:
        return healthy(taps, seeds)
    tallies: defaultdict[str, Tally] = defaultdict(Tally)
    misses: list[str] = []
    for code in options.codes:
        for label, made in captures_with(code, taps, seeds):
            misses += score(made.findings, found_in(made), tallies, label)
    print(f"{'code':<22} {'due':>6} {'missed':>6} {'place':>6} {'false':>6} {'recall':>8} {'precision':>9}")
    for code, tally in sorted(tallies.items()):
        hits = tally.due - tally.missed - tally.misplaced
        said = tally.due - tally.missed + tally.false
        recall = f"{hits / tally.due:8.4f}" if tally.due else f"{'-':>8}"
        precision = f"{hits / said:9.4f}" if said else f"{'-':>9}"
        print(f"{code:<22} {tally.due:6} {tally.missed:6} {tally.misplaced:6} {tally.false:6} {recall} {precision}")
    for code, tally in sorted(tallies.items()):
        if tally.false:
            print(f"false {code}: {', '.join(f'{n} in {label}' for label, n in tally.where.most_common(6))}")
    if options.misses:
        print(*misses, sep="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
