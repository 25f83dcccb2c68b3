"""Fits how sure causes are (`analyzer/causes/certainty.json`) on field cases, a fifth of all causes hidden in turns.

    python benchmarks/fit_certainty.py [--seeds N] [--taps precise,ftdi16]          # fits, and writes the weights
    python benchmarks/fit_certainty.py --told [--seeds N]                            # tells them on seeds held out

A claim is right where it is the cause of its case or one that is true of it besides. With the cause of a case hidden
each claim is wrong, and so it is of faults that have no word (`nameless`; kinds that are held out are only told); such
claims weigh as much as faults without a word are among those of the field. How like a claim's outcomes are to those of
its cause is measured by what other seeds showed.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import defaultdict
from collections.abc import Iterator
from math import log
from pathlib import Path
from typing import NamedTuple

import numpy as np
from heard_cases import HELD_OUT, HeardCase, heard
from nameless import fitted, nameless_cases
from numpy.typing import NDArray
from score_causes import NEAREST, Calibration, is_right

import analyzer.causes
from analyzer.causes.certainty import Clues, Outcomes, certainty, typical
from analyzer.causes.evidence import Evidence
from analyzer.causes.ledger import Ledger
from analyzer.causes.reasoning import CauseClaim, claims_of
from analyzer.causes.registry import suspects
from analyzer.simulation.field.cases.registry import field_cases

_TURNS = 5
_SHORT = 160  # rows
_LOOKED_AT = 3
_HIDDEN_WEIGHT = 0.4  # of faults in the field about three in ten have no word
_RIDGE = 0.05
_CAUSE_RIDGE = 2.0  # a cause of its own is fitted only as far as its claims carry it
_LEAST = 0.001  # of the outcomes, of one that is written down
_FILE = Path(analyzer.causes.__file__).parent / "certainty.json"


class Claim(NamedTuple):
    """One claim of one capture."""

    cause: str
    clues: Clues
    outcomes: Outcomes
    right: bool
    weight: float
    seed: int

    @classmethod
    def of(cls, claim: CauseClaim, seed: int, *, right: bool, weight: float) -> Claim:
        """With what is known of it."""
        return cls(claim.cause.cause, claim.clues, claim.outcomes, right, weight, seed)

    @property
    def said(self) -> float:
        """How sure it is told."""
        return certainty(self.cause, self.clues, self.outcomes)


def claims(cases: list[str], seeds: range, taps: list[str], *, told: bool) -> Iterator[Claim]:
    """All claims on these seeds: with the whole vocabulary, and with the fifth hidden that has the case's cause; and on
    faults without a word, of the kinds that are `told` or of the others."""
    names = [suspect.cause for suspect in suspects()]
    for case in (field_cases()[name] for name in cases):
        for tap in (tap for tap in taps if tap in case.taps):
            for seed in seeds:
                made = heard(case, tap, seed)
                yield from _claims(made, made.ledger(), names)
                if tap == taps[0] and len(made.parts):
                    yield from _claims(made, made.ledger(_SHORT), names)  # broken off, as many captures are
    for name, case in nameless_cases().items():
        for tap in (tap for tap in taps if tap in case.taps and (name not in fitted()) == told):
            for seed in seeds:
                made = heard(case, tap, seed)
                for claim in claims_of(Evidence(made.ledger()))[:_LOOKED_AT]:
                    if claim.cause.severity != "note":
                        true = claim.cause.cause in made.expected.also
                        yield Claim.of(claim, seed, right=true, weight=_HIDDEN_WEIGHT)


def _claims(made: HeardCase, ledger: Ledger, names: list[str]) -> Iterator[Claim]:
    expected = made.expected
    faults = [expected, *([expected.beside] if expected.beside else [])]
    for claim in claims_of(Evidence(ledger))[:_LOOKED_AT]:
        if claim.cause.severity != "note" or expected.cause is not None:
            true = any(is_right(claim.cause, fault) for fault in faults) or claim.cause.cause in expected.also
            yield Claim.of(claim, made.seed, right=true, weight=1.0)
    if not expected.cause or expected.beside:
        return
    turn = names.index(expected.cause) % _TURNS
    among = [suspect for i, suspect in enumerate(suspects()) if i % _TURNS != turn]
    for claim in claims_of(Evidence(ledger), among)[:_LOOKED_AT]:
        near = claim.cause.cause in (*expected.also, *NEAREST.get(expected.cause, ()))
        yield Claim.of(claim, made.seed, right=near, weight=_HIDDEN_WEIGHT)


Shares = dict[str, dict[str, float]]


def shares_of(found: list[Claim]) -> Shares:
    """How the outcomes of right claims of each cause spread, in the mean, and those of all claims ("")."""
    sums: dict[str, dict[str, float]] = defaultdict(lambda: defaultdict(float))
    for claim in found:
        every = sum(claim.outcomes.values())
        for name in ("", claim.cause) if claim.right else ("",):
            for outcome, count in claim.outcomes.items():
                sums[name][outcome] += count / every
    shares: Shares = {}
    for cause, counts in sorted(sums.items()):
        every = sum(counts.values())
        shares[cause] = {name: round(n / every, 4) for name, n in sorted(counts.items()) if n > _LEAST * every}
    return shares


def fit(found: list[Claim]) -> dict[str, object]:
    """Ridge logistic regression, by Newton's method."""
    names = sorted({claim.cause for claim in found})
    of = {name: i for i, name in enumerate(names)}
    others = {seed: shares_of([each for each in found if each.seed != seed]) for seed in {each.seed for each in found}}
    clues = np.array([(*claim.clues, typical(others[claim.seed], claim.cause, claim.outcomes)) for claim in found])
    offsets = np.zeros((len(found), len(names)))
    offsets[np.arange(len(found)), [of[claim.cause] for claim in found]] = 1
    x = np.hstack((np.ones((len(found), 1)), clues, offsets))
    y, weight = np.array([claim.right for claim in found], float), np.array([claim.weight for claim in found])
    ridge = np.concatenate(([1e-3], np.full(clues.shape[1], _RIDGE), np.full(len(names), _CAUSE_RIDGE)))
    beta = np.zeros(x.shape[1])
    for _ in range(60):
        p = 1 / (1 + np.exp(-x @ beta))
        gradient = x.T @ (weight * (y - p)) - ridge * beta
        hessian = (x * (weight * p * (1 - p))[:, None]).T @ x + np.diag(ridge)
        step = np.linalg.solve(hessian, gradient)
        beta += step
        if np.abs(step).max() < 1e-8:
            break
    beta = _steeper(x @ beta, y, weight) @ np.array((beta, np.eye(1, len(beta))[0]))
    n, named = clues.shape[1], (*Clues._fields, "typical")
    return {
        "intercept": round(float(beta[0]), 4),
        "clues": {name: round(float(b), 4) for name, b in zip(named, beta[1 : n + 1], strict=True)},
        "other": -0.5,
        "causes": {name: round(float(b), 4) for name, b in zip(names, beta[n + 1 :], strict=True)},
        "shares": shares_of(found),
    }


def _steeper(score: NDArray[np.float64], y: NDArray[np.float64], weight: NDArray[np.float64]) -> NDArray[np.float64]:
    """The factor and the offset that undo what the ridge flattens."""
    x, beta = np.stack((score, np.ones(len(score))), axis=1), np.array((1.0, 0.0))
    for _ in range(30):
        p = 1 / (1 + np.exp(-x @ beta))
        beta += np.linalg.solve((x * (weight * p * (1 - p))[:, None]).T @ x, x.T @ (weight * (y - p)))
    return beta


def tell(found: list[Claim]) -> None:
    """How sure, and how often right."""
    for words, mine in (("all", found), ("whole vocabulary", [c for c in found if c.weight == 1]),
                        ("cause hidden", [c for c in found if c.weight < 1])):  # fmt: skip
        print(words)
        Calibration([(c.said, c.right) for c in mine], [c.weight for c in mine]).tell()
    loss = -sum(c.weight * log(p if c.right else 1 - p) for c in found for p in [c.said])
    print(f"log loss {loss / sum(c.weight for c in found):.3f} a claim")


def keep(found: list[Claim]) -> None:
    """What was told on held-out seeds, beside the weights, for the page that documents the causes."""
    told = {}
    for name, mine in (("all", found), ("hidden", [c for c in found if c.weight < 1])):
        every = Calibration([(c.said, c.right) for c in mine], [c.weight for c in mine])
        told[name] = [
            [each.low, each.high, each.claims, round(each.said, 3), round(each.so, 3)] for each in every.bins()
        ]
    kept = json.loads(_FILE.read_text("utf-8")) | {"told": told}
    _FILE.write_text(json.dumps(kept, indent=1, sort_keys=True) + "\n", encoding="utf-8")


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("cases", nargs="*", metavar="CASE", default=list(field_cases()))
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--taps", default="precise,ftdi16")
    parser.add_argument("--told", action="store_true", help="tell the weights on seeds that were held out")
    options = parser.parse_args(arguments)
    first = HELD_OUT if options.told else 0
    found = list(claims(options.cases, range(first, first + options.seeds), options.taps.split(","), told=options.told))
    if not options.told:
        _FILE.write_text(json.dumps(fit(found), indent=1, sort_keys=True) + "\n", encoding="utf-8")
        certainty.__globals__["_weights"].cache_clear()
    tell(found)
    if options.told:
        keep(found)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
