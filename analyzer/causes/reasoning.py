"""From a ledger to causes: the suspect that saves most bits is taken, what it explains is struck, and so on."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from .evidence import Evidence
from .ledger import Ledger
from .model import Cause
from .registry import Suspect, Suspicion, suspects
from .telling import words_of

THRESHOLD: Final = 24.0  # bits under which nothing is said
_LEFT_OVER: Final = 0.06  # of what is explained: so much may be left because no explanation is perfect,
_LEFT_OVER_MOST: Final = 100.0  # and a cause of its own weighs more
_MOST: Final = 8
_SURE: Final = 0.99
_DOUBT: Final = 12.0  # bits of margin that make a confidence of two thirds


@dataclass(frozen=True, slots=True)
class Weighed:
    """A suspicion with the suspect that has it."""

    suspect: Suspect
    suspicion: Suspicion


def weigh(evidence: Evidence) -> list[Weighed]:
    """All suspicions that explain something new, the heaviest first."""
    found = [Weighed(each, suspicion) for each in suspects() for suspicion in each.judge(evidence)]
    fresh = [weighed for weighed in found if not weighed.suspicion.explains <= evidence.explained]
    return sorted(fresh, key=lambda weighed: -weighed.suspicion.bits)


def causes_of(ledger: Ledger) -> list[Cause]:
    """The causes that a ledger shows, best first."""
    return sorted(_explained(Evidence(ledger)), key=lambda cause: -cause.bits)


def _explained(evidence: Evidence) -> Iterator[Cause]:
    least = THRESHOLD
    for _ in range(_MOST):
        found = weigh(evidence)
        if not found or found[0].suspicion.bits < least:
            return
        best = found[0]
        least = max(least, min(_LEFT_OVER * best.suspicion.bits, _LEFT_OVER_MOST))
        rivals = [each for each in found[1:] if each.suspicion.explains & best.suspicion.explains]
        yield _cause(best, rivals[0] if rivals else None, evidence.ledger)
        evidence = evidence.without(best.suspicion.explains)


def _cause(best: Weighed, rival: Weighed | None, ledger: Ledger) -> Cause:
    suspect, found, timed = best.suspect, best.suspicion, ledger.timed
    margin = found.bits - (max(rival.suspicion.bits, THRESHOLD / 2) if rival else THRESHOLD / 2)
    confidence = min(_SURE, 1 - 1 / (2 + margin / _DOUBT))
    words = words_of(suspect, found.numbers)
    return Cause(
        cause=suspect.cause,
        severity=suspect.severity.name.lower(),
        units=found.units,
        blame=suspect.blame,
        text=words.text,
        share=words.share,
        since_ns=found.since if timed else None,
        until_ns=found.until if timed else None,
        period_s=found.period_s if timed else None,
        confidence=round(confidence, 3),
        runner_up=rival.suspect.cause if rival else None,
        deciding_test=words.deciding_test,
        remedy=words.remedy,
        lost_answers=found.lost_answers,
        lost_ms=min(found.lost_ms, ledger.span_ns / 1e6) if timed and found.lost_ms is not None else None,
        frames=found.frames,
        bits=round(found.bits, 1),
        explains=found.explains,
        numbers=found.numbers,
    )
