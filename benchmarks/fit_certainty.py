"""Fits how sure causes are (`analyzer/causes/certainty.json`) on buses of several hands, causes hidden in turns.

    python benchmarks/fit_certainty.py [--seeds N] [--taps precise,ftdi16]          # fits, and writes the weights
    python benchmarks/fit_certainty.py --turns [--seeds N]                           # without each hand, told on it
    python benchmarks/fit_certainty.py --told [--seeds N]                            # tells them on seeds held out
    python benchmarks/fit_certainty.py --add CASE ... [--seeds N]                    # traits of cases that are new
    python benchmarks/fit_certainty.py --folder FOLDER                               # claims of captures, to the table

The hands: the field cases with faults that have no word (`nameless`), the buses of `otherhand`, the lines of RTUBench,
and captures that others drew, of which the claims alone are kept, as numbers (`data/claims.jsonl`; a folder has a
`truth.json` beside its captures).

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
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path

import numpy as np
from certainty_claims import FOLDS, TABLE, Claim, Sort, claims, claims_of_case, of_folder
from heard_cases import HELD_OUT, heard
from numpy.typing import NDArray
from score_causes import BINS, Bin

import analyzer.causes
from analyzer.causes.certainty import Clues, certainty
from analyzer.causes.registry import suspects
from analyzer.causes.traits import TRAITS, typical
from analyzer.simulation.field.cases.registry import field_cases

_ACCUSES = 0.5
_NO_WORD = 0.5  # of all claims: those about faults without a word, half of them with a word that is hidden
_RIDGE = 1.0
_CAUSE_RIDGE = 2.0  # a cause of its own is fitted only as far as its claims carry it
_OTHER = -0.5  # the weight of a cause that is not among those fitted
_LEAST = 0.005  # of a trait: what is rarer is not written down
_FILE = Path(analyzer.causes.__file__).parent / "certainty.json"


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
    others = [[each for each in found if each.fold != fold] for fold in range(FOLDS)]
    known = [(shares_of(each), none_of(each)) for each in others]
    like = [typical(*known[claim.fold], claim.cause, claim.traits) for claim in found]
    clues = np.array([(*claim.clues, *each.values()) for claim, each in zip(found, like, strict=True)])
    offsets = np.zeros((len(found), len(names)))
    own = [(i, of[claim.cause]) for i, claim in enumerate(found) if claim.cause in of]
    offsets[tuple(np.array(own).T)] = 1
    x, y = np.hstack((np.ones((len(found), 1)), clues, offsets)), np.array([claim.right for claim in found], float)
    ridge = np.concatenate(([1e-3], np.full(clues.shape[1], _RIDGE), np.full(len(names), _CAUSE_RIDGE)))
    beta = _regression(x, y, weights_of(found), ridge)
    n, named = clues.shape[1], (*Clues._fields, *TRAITS)
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


def turns(found: list[Claim]) -> None:
    """Without each hand in turn: what the others' weights make of it; the weights stay as they were."""
    kept = _FILE.read_text("utf-8")
    try:
        for hand in sorted({claim.hand for claim in found}):
            write(fit([claim for claim in found if claim.hand != hand]))
            _forget()
            print(f"without {hand}:")
            tell([claim for claim in found if claim.hand == hand])
    finally:
        _FILE.write_text(kept, encoding="utf-8")
        _forget()


def _forget() -> None:
    certainty.__globals__["_weights"].cache_clear()


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
    nameless = [claim for claim in found if claim.sort is Sort.NAMELESS]
    accused = {claim.where for claim in nameless if not claim.right and claim.said >= _ACCUSES}
    shown = {claim.where for claim in nameless}
    print(f"another cause told at {_ACCUSES} or more of {len(accused)} of {len(shown)} faults without a word")
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
    """The traits of new cases; a cause of which the weights knew none weighs as any other till the next fit."""
    kept = json.loads(_FILE.read_text("utf-8"))
    new = {claim.cause for claim in found if claim.cause not in kept["shares"]["ending"]}
    for trait, shares in shares_of(found).items():
        for cause, kinds in shares.items():
            kept["shares"][trait].setdefault(cause, []).extend(kinds)
    kept["causes"] = {cause: weight for cause, weight in kept["causes"].items() if cause not in new}
    write(kept)


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("cases", nargs="*", metavar="CASE", default=list(field_cases()))
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--taps", default="precise,ftdi16")
    parser.add_argument("--add", action="store_true", help="only add the traits of cases that are new")
    parser.add_argument("--told", action="store_true", help="tell the weights on seeds that were held out")
    parser.add_argument("--turns", action="store_true", help="fit without each hand in turn, and tell that one")
    parser.add_argument("--folder", type=Path, help="keep the claims of these captures in the table")
    options = parser.parse_args(arguments)
    if options.folder:
        with TABLE.open("a", encoding="utf-8") as table:
            table.writelines(claim.line + "\n" for claim in of_folder(options.folder))
        return 0
    if options.add:
        pairs = [(name, tap) for name in options.cases for tap in options.taps.split(",")]
        made = [heard(field_cases()[name], tap, seed) for name, tap in pairs for seed in range(options.seeds)]
        names = [suspect.cause for suspect in suspects()]
        add(
            [claim for each in made for claim in claims_of_case(each, each.ledger(), names) if claim.sort is Sort.KNOWN]
        )
        return 0
    first = HELD_OUT if options.told else 0
    found = list(claims(options.cases, range(first, first + options.seeds), options.taps.split(","), told=options.told))
    if not options.told:
        found += map(Claim.kept, TABLE.read_text("utf-8").splitlines())
    if options.turns:
        turns(found)
        return 0
    if not options.told:
        write(fit(found))
        _forget()
    tell(found)
    if options.told:
        keep(found)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
