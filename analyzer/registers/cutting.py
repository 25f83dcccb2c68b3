"""From shares to answers: the segments that stand, how sure each is, and what else it may be.

Answers do not overlap. The cut is the one in which most of what moved is read right in expectation, which is not always
the likeliest cut as a whole.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .chain import best_cut
from .hypotheses import HYPOTHESES, WORDS, moved_registers
from .runs import Run

_QUIET = 0.02  # what a register that never moved counts beside one that did
_LONE = 0.85  # and a moving one beside a quiet one as one value: in doubt it stands alone, which gives the same number


@dataclass(frozen=True, slots=True, eq=False)
class Cut:
    """A value at register `at` of a run under hypothesis `number`; `second` is (register, hypothesis, share) of the
    likeliest segment that this one excludes."""

    run: Run
    at: int
    number: int
    confidence: float
    moved: bool
    second: tuple[int, int, float] | None


def cut_of(run: Run, posterior: NDArray[np.float64]) -> list[Cut]:
    """The values of a run, by address."""
    registers = moved_registers(run.moved)
    moves = registers > 0
    lone = (registers == 1) & (WORDS == 2)
    counted = np.sqrt(registers) * np.where(lone, _LONE, 1.0) + _QUIET  # half way from values to registers
    gains = np.where(run.fits, posterior * counted, -np.inf)
    cuts = []
    for at, number in best_cut(gains):
        cuts.append(
            Cut(
                run,
                at,
                number,
                float(np.clip(posterior[at, number], 0.0, 1.0)),
                bool(moves[at, number]),
                _second(posterior, moves, at, number),
            )
        )
    return cuts


def _second(
    posterior: NDArray[np.float64], moves: NDArray[np.bool_], at: int, number: int
) -> tuple[int, int, float] | None:
    """The likeliest other segment that has a register in common with this one; one that moved, if this one did."""
    end = at + HYPOTHESES[number].words
    best: tuple[int, int, float] | None = None
    for rival, hypothesis in enumerate(HYPOTHESES):
        for begin in range(max(0, at - hypothesis.words + 1), min(end, len(posterior))):
            share = float(posterior[begin, rival])
            if (begin, rival) == (at, number) or share <= 0 or (moves[at, number] and not moves[begin, rival]):
                continue
            if best is None or share > best[2]:
                best = (begin, rival, share)
    return best
