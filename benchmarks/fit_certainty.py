"""Fits how sure causes are (`analyzer/causes/certainty.json`) on field cases, a fifth of all causes hidden in turns.

    python benchmarks/fit_certainty.py [--seeds N] [--taps precise,ftdi16]          # fits, and writes the weights
    python benchmarks/fit_certainty.py --told [--seeds N]                            # tells them on seeds held out
    python benchmarks/fit_certainty.py --add CASE ... [--seeds N]                    # traits of causes that have none

Four minutes a seed on one core where no capture was made before, one where all were: three seeds to fit and two to tell
are enough.

A claim is right where it is the cause of its case or one that is true of it besides. With the cause of a case hidden
each claim is wrong, and so it is of faults that have no word (`nameless`; kinds that are held out are only told). For
the fit the first claim is hidden then as well, and the next one, so that many causes are seen where they are not so.
How sure a claim may be hangs on how often a fault is one without a word. That is no fact of any simulator: it is said
here, and claims are weighed by it, in the fit and where it is told. How typical the traits of a claim are of its cause,
and of each kind of fault without a word, is measured by what other captures showed.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from collections import defaultdict
from collections.abc import Callable, Collection, Iterator
from datetime import UTC, datetime
from enum import Enum
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple
from zlib import crc32

import numpy as np
from heard_cases import HELD_OUT, HeardCase, heard
from nameless import is_fitted, nameless_cases
from nameless_drawn import DRAWN
from numpy.typing import NDArray
from otherhand.kinds import OtherKind, every
from rtubench.adapters.rtuscope_cli import CAUSES
from rtubench.made import faults
from score_causes import BINS, NEAREST, Bin, is_right

import analyzer.causes
from analyzer.causes.certainty import Clues, certainty
from analyzer.causes.evidence import Evidence
from analyzer.causes.ledger import Ledger, ledger_of
from analyzer.causes.reasoning import CauseClaim, claims_of
from analyzer.causes.registry import Cause, suspects
from analyzer.causes.traits import TRAITS, Traits, typical
from analyzer.core import analyse
from analyzer.simulation.field.cases.registry import field_cases
from captures.chunks import Capture, Chunk
from captures.line import LineSettings

_TURNS = 5
_SHORT = 160  # rows
_LOOKED_AT = 3
_QUICK = 4  # seeds of lines that are made byte by byte, for each of those made bit by bit
_BENCH = 250, 3  # requests of a line, and lines of each fault
_STRUCK = 4
_NO_WORD = 0.33  # of all claims: those about faults without a word, half of them with a word that is hidden
_RIDGE = 1.0
_CAUSE_RIDGE = 2.0  # a cause of its own is fitted only as far as its claims carry it
_OTHER = -0.5  # the weight of a cause that is not among those fitted
_LEAST = 0.005  # of a trait: what is rarer is not written down
_FOLDS = 3
_FILE = Path(analyzer.causes.__file__).parent / "certainty.json"


class Sort(Enum):
    """What is known of the fault that a claim is about."""

    KNOWN = "known"
    HIDDEN = "hidden"
    NAMELESS = "nameless"


class Claim(NamedTuple):
    """One claim of one capture."""

    cause: str
    clues: Clues
    traits: Traits
    right: bool
    case: str
    seed: int
    sort: Sort
    weight: float = 1.0  # among those of its sort

    @classmethod
    def of(cls, claim: CauseClaim, made: HeardCase, *, right: bool, sort: Sort = Sort.KNOWN) -> Claim:
        """With what is known of it."""
        return cls(claim.cause.cause, claim.clues, claim.traits, right, made.name, made.seed, sort)

    @property
    def said(self) -> float:
        """How sure it is told."""
        return certainty(self.cause, self.clues, self.traits)

    @property
    def fold(self) -> int:
        """Which part of the captures it is of."""
        return crc32(f"{self.case} {self.seed}".encode()) % _FOLDS


def claims(cases: list[str], seeds: range, taps: list[str], *, told: bool) -> Iterator[Claim]:
    """All claims on these seeds: with the whole vocabulary, and with the fifth hidden that has the case's cause; and on
    faults without a word, of the kinds that are `told` or of the others."""
    names = [suspect.cause for suspect in suspects()]
    for case in (field_cases()[name] for name in cases):
        for tap in (tap for tap in taps if tap in case.taps):
            for seed in seeds:
                made = heard(case, tap, seed)
                ledgers = [made.ledger()]
                if tap == taps[0] and len(made.parts):
                    ledgers.append(made.ledger(_SHORT))  # broken off, as many captures are
                for ledger in ledgers:
                    yield from _claims(made, ledger, names)
                    if not told:
                        yield from _struck(made, ledger)
    more = range(seeds.start, seeds.start + _QUICK * len(seeds))
    yield from _of_others(more, told=told)
    yield from _of_bench(more)
    for name, case in nameless_cases().items():
        for tap in (tap for tap in (taps[:1] if name in DRAWN else taps) if tap in case.taps):
            for seed in seeds if is_fitted(name) != told else ():
                made = heard(case, tap, seed)
                for claim in claims_of(Evidence(made.ledger()))[:_LOOKED_AT]:
                    if claim.cause.severity != "note":
                        true = claim.cause.cause in made.expected.also
                        yield Claim.of(claim, made, right=true, sort=Sort.NAMELESS)


def _of_others(seeds: range, *, told: bool) -> Iterator[Claim]:
    """Of buses of another hand; with the causes that name the fault, and without these."""
    for made in every(seeds):
        kind, ledger = made.kind, _ledger(made.line, made.chunks)
        known = bool(kind.causes) or kind.healthy
        if not known and is_fitted(made.name) == told:
            continue

        def is_so(cause: Cause, kind: OtherKind = kind, at_fault: tuple[int, ...] = made.at_fault) -> bool:
            theirs = not at_fault or set(cause.units) <= set(at_fault)
            return cause.cause in kind.also or (cause.cause in kind.causes and theirs)

        where = made.name, made.seed
        yield from _told(ledger, (), is_so, where, Sort.KNOWN if known else Sort.NAMELESS)
        if kind.causes:
            near = [*kind.also, *(each for cause in kind.causes for each in NEAREST.get(cause, ()))]
            yield from _told(ledger, kind.causes, partial(_is_among, near), where, Sort.HIDDEN)


def _is_among(names: Collection[str], cause: Cause) -> bool:
    return cause.cause in names


def _of_bench(seeds: range) -> Iterator[Claim]:
    """Of the lines of RTUBench, likewise."""
    for item in (item for seed in seeds for item in faults.items(seed, *_BENCH)):
        line = LineSettings(item.baud, item.char_bits, tap=item.tap)
        ledger = _ledger(line, [Chunk(t_ns or 0, data) for t_ns, data in item.inputs["reads"]])
        words, units = item.truth["causes"], set(item.truth["units"])
        mine = [cause for cause, word in CAUSES.items() if word in words]
        where = f"rtubench {item.name.rpartition('-')[0]}", crc32(item.name.encode())

        def is_so(cause: Cause, mine: list[str] = mine, units: set[int] = units) -> bool:
            return cause.cause in mine and set(cause.units) <= (units or set(cause.units))

        yield from _told(ledger, (), is_so, where, Sort.KNOWN)
        if mine:
            yield from _told(ledger, mine, partial(_is_among, ()), where, Sort.HIDDEN)


def _ledger(line: LineSettings, chunks: list[Chunk]) -> Ledger:
    capture = Capture.of(line, chunks)
    return ledger_of(((part.batch, part.transactions) for part in analyse(capture)), capture.line)


def _told(
    ledger: Ledger, hidden: Collection[str], is_so: Callable[[Cause], bool], where: tuple[str, int], sort: Sort
) -> Iterator[Claim]:
    among = [suspect for suspect in suspects() if suspect.cause not in hidden]
    for each in claims_of(Evidence(ledger), among)[:_LOOKED_AT]:
        if each.cause.severity != "note":
            yield Claim(each.cause.cause, each.clues, each.traits, is_so(each.cause), *where, sort)


def _claims(made: HeardCase, ledger: Ledger, names: list[str]) -> Iterator[Claim]:
    expected = made.expected
    faults = [expected, *([expected.beside] if expected.beside else [])]
    for claim in claims_of(Evidence(ledger))[:_LOOKED_AT]:
        if claim.cause.severity != "note" or expected.cause is not None:
            true = any(is_right(claim.cause, fault) for fault in faults) or claim.cause.cause in expected.also
            yield Claim.of(claim, made, right=true)
    if not expected.cause or expected.beside:
        return
    turn = names.index(expected.cause) % _TURNS
    among = [suspect for i, suspect in enumerate(suspects()) if i % _TURNS != turn]
    for claim in claims_of(Evidence(ledger), among)[:_LOOKED_AT]:
        near = claim.cause.cause in (*expected.also, *NEAREST.get(expected.cause, ()))
        yield Claim.of(claim, made, right=near, sort=Sort.HIDDEN)


def _struck(made: HeardCase, ledger: Ledger) -> Iterator[Claim]:
    """What is claimed with the cause of a case hidden, and then with the first of these claims hidden as well."""
    cause, found = made.expected.cause, list[Claim]()
    if not cause or made.expected.beside:
        return
    near, hidden = (*made.expected.also, *NEAREST.get(cause, ())), {cause}
    for _ in range(_STRUCK):
        told = claims_of(Evidence(ledger), [each for each in suspects() if each.cause not in hidden])
        found += [Claim.of(each, made, right=each.cause.cause in near, sort=Sort.HIDDEN) for each in told[:_LOOKED_AT]]
        if not told:
            break
        hidden.add(told[0].cause.cause)
    yield from (each._replace(weight=min(1.0, _LOOKED_AT / len(found))) for each in found)


Spread = dict[str, float]


def spread_of(found: list[Claim], trait: str) -> Spread:
    """How a trait of these claims spreads, in the mean."""
    sums: Spread = defaultdict(float)
    for each in (claim.traits[trait] for claim in found if trait in claim.traits):
        for value, count in each.items():
            sums[value] += count / sum(each.values())
    every = sum(sums.values())
    return {value: round(n / every, 3) for value, n in sorted(sums.items()) if n > _LEAST * every}


def shares_of(found: list[Claim]) -> dict[str, dict[str, list[Spread]]]:
    """Of right claims, by trait and cause, of each case."""
    shares: dict[str, dict[str, list[Spread]]] = {trait: defaultdict(list) for trait in TRAITS}
    for cause in sorted({claim.cause for claim in found}):
        right = [claim for claim in found if claim.right and claim.sort is Sort.KNOWN and claim.cause == cause]
        for trait, kinds in _by_trait(right, lambda claim: claim.case).items():
            shares[trait][cause] += kinds.values()
    return {trait: {cause: kinds for cause, kinds in causes.items() if kinds} for trait, causes in shares.items()}


def none_of(found: list[Claim]) -> dict[str, list[Spread]]:
    """Of wrong claims on faults that have no word, by trait and kind of fault."""
    wrong = [claim for claim in found if not claim.right and claim.sort is Sort.NAMELESS]
    return {trait: list(kinds.values()) for trait, kinds in _by_trait(wrong, lambda claim: claim.case).items()}


def _by_trait(found: list[Claim], key: Callable[[Claim], str]) -> dict[str, dict[str, Spread]]:
    groups: dict[str, list[Claim]] = defaultdict(list)
    for claim in found:
        groups[key(claim)].append(claim)
    spreads = {trait: {name: spread_of(groups[name], trait) for name in sorted(groups)} for trait in TRAITS}
    return {trait: {name: each for name, each in kinds.items() if each} for trait, kinds in spreads.items()}


def weights_of(found: list[Claim]) -> NDArray[np.float64]:
    """How much each claim counts: faults without a word as often as said above, and of each capture about the same."""
    weights = np.array([claim.weight for claim in found])
    sorts = np.array([claim.sort.value for claim in found])
    share = {Sort.KNOWN: 1 - _NO_WORD, Sort.HIDDEN: _NO_WORD / 2, Sort.NAMELESS: _NO_WORD / 2}
    for sort, part in share.items():
        mine = sorts == sort.value
        weights[mine] *= part * len(found) / max(weights[mine].sum(), 1.0)
    return weights


def fit(found: list[Claim]) -> dict[str, object]:
    """Ridge logistic regression."""
    names = sorted({claim.cause for claim in found if claim.right})  # one that is never so here may be so elsewhere
    of = {name: i for i, name in enumerate(names)}
    others = [[each for each in found if each.fold != fold] for fold in range(_FOLDS)]
    known = [(shares_of(each), none_of(each)) for each in others]
    like = [typical(*known[claim.fold], claim.cause, claim.traits) for claim in found]
    clues = np.array(
        [(*claim.clues, *each.values(), min(each["ending"], 0.0)) for claim, each in zip(found, like, strict=True)]
    )
    offsets = np.zeros((len(found), len(names)))
    own = [(i, of[claim.cause]) for i, claim in enumerate(found) if claim.cause in of]
    offsets[tuple(np.array(own).T)] = 1
    x, y = np.hstack((np.ones((len(found), 1)), clues, offsets)), np.array([claim.right for claim in found], float)
    ridge = np.concatenate(([1e-3], np.full(clues.shape[1], _RIDGE), np.full(len(names), _CAUSE_RIDGE)))
    beta = _regression(x, y, weights_of(found), ridge)
    n, named = clues.shape[1], (*Clues._fields, *TRAITS, "unlike")
    return {
        "intercept": round(float(beta[0]), 4),
        "clues": {name: round(float(b), 4) for name, b in zip(named, beta[1 : n + 1], strict=True)},
        "other": _OTHER,
        "causes": {name: round(float(b), 4) for name, b in zip(names, beta[n + 1 :], strict=True)},
        "shares": shares_of(found),
        "none": none_of(found),
    }


def _regression(
    x: NDArray[np.float64], y: NDArray[np.float64], weights: NDArray[np.float64], ridge: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Logistic, by Newton's method."""
    beta = np.zeros(x.shape[1])
    for _ in range(60):
        p = 1 / (1 + np.exp(-x @ beta))
        slope = x.T @ (weights * (y - p)) - ridge * beta
        step = np.linalg.solve((x * (weights * p * (1 - p))[:, None]).T @ x + np.diag(ridge), slope)
        beta += step
        if np.abs(step).max() < 1e-8:
            break
    return beta


def bins(found: list[Claim]) -> Iterator[Bin]:
    """How sure the claims of each bin were, and how many of them were so, by what they count."""
    weights, said = weights_of(found), np.array([claim.said for claim in found])
    right = np.array([claim.right for claim in found], float)
    for low, high in pairwise(BINS):
        mine = (said >= low) & (said < high)
        if mine.any():
            means = (float(np.average(each[mine], weights=weights[mine])) for each in (said, right))
            yield Bin(low, min(high, 1.0), int(mine.sum()), *means)


def tell(found: list[Claim]) -> None:
    """How sure, and how often right; of all claims, and of those of each sort."""
    weights, right = weights_of(found), np.array([claim.right for claim in found], float)
    said = np.array([claim.said for claim in found])
    for sort in Sort:
        mine = np.array([claim.sort is sort for claim in found])
        if mine.any():
            print(f"{sort.value:<9}{mine.sum():5} claims, {said[mine].mean():.3f} said, {right[mine].mean():.3f} so")
    error = 0.0
    for each in bins(found):
        inside = (said >= each.low) & (said < each.high)
        error += abs(each.said - each.so) * float(weights[inside].sum()) / float(weights.sum())
        print(
            f"certainty {each.low:.2f}..{each.high:.2f}: {each.claims:4} claims, {each.said:.3f} said, {each.so:.3f} so"
        )
    loss = np.average(-np.log(np.where(right > 0, said, 1 - said)), weights=weights)
    print(f"calibration error {error:.3f}, log loss {loss:.3f} a claim")


def write(weights: dict[str, object]) -> None:
    """The weights; how one trait spreads stands on a line."""
    text = json.dumps(weights, indent=1, sort_keys=True)
    lines = re.sub(r"\{[^{}]*\}|\[[^][{}]*\]", lambda found: re.sub(r"\n\s*", " ", found[0]), text)
    _FILE.write_text(lines + "\n", encoding="utf-8")


def keep(found: list[Claim]) -> None:
    """What was told on held-out seeds, and when, beside the weights, for the page that documents the causes."""
    told = [[e.low, e.high, e.claims, round(e.said, 3), round(e.so, 3)] for e in bins(found)]
    kept = json.loads(_FILE.read_text("utf-8")) | {"told": told, "told_on": datetime.now(UTC).date().isoformat()}
    write(kept)


def add(found: list[Claim]) -> None:
    """The traits of causes that the weights know none of, which so far weigh as any other; all else stays."""
    kept = json.loads(_FILE.read_text("utf-8"))
    new = {claim.cause for claim in found if claim.cause not in kept["shares"]["ending"]}
    for trait, shares in shares_of([claim for claim in found if claim.cause in new]).items():
        kept["shares"][trait] |= shares
    kept["causes"] = {cause: weight for cause, weight in kept["causes"].items() if cause not in new}
    write(kept)


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("cases", nargs="*", metavar="CASE", default=list(field_cases()))
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--taps", default="precise,ftdi16")
    parser.add_argument("--add", action="store_true", help="only add the traits of causes that have none")
    parser.add_argument("--told", action="store_true", help="tell the weights on seeds that were held out")
    options = parser.parse_args(arguments)
    if options.add:
        pairs = [(name, tap) for name in options.cases for tap in options.taps.split(",")]
        made = [heard(field_cases()[name], tap, seed) for name, tap in pairs for seed in range(options.seeds)]
        names = [suspect.cause for suspect in suspects()]
        add([claim for each in made for claim in _claims(each, each.ledger(), names) if claim.sort is Sort.KNOWN])
        return 0
    first = HELD_OUT if options.told else 0
    found = list(claims(options.cases, range(first, first + options.seeds), options.taps.split(","), told=options.told))
    if not options.told:
        write(fit(found))
        certainty.__globals__["_weights"].cache_clear()
    tell(found)
    if options.told:
        keep(found)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
