"""What is certain of a stretch, and how sure: the margin of every step over the best explanation without it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

from dissectors.length_rules import Role

from ..tables.schema import BoundaryEvidence, Kind
from .candidates import CRC_BITS
from .paths import Losers, PathStep
from .segments import NOISE, evidence_rows

_KINDS: Final = {Role.REQUEST: Kind.REQUEST, Role.RESPONSE: Kind.RESPONSE, NOISE: Kind.NOISE}


class Decision(NamedTuple):
    """Certain steps from the lattice's first position on, and the paths that theirs beat where they ended."""

    steps: list[PathStep]
    rivals: Losers

    @property
    def only_frames(self) -> bool:
        """Whether something was decided and no byte of it is noise."""
        return bool(self.steps) and all(step.candidate is not None for step in self.steps)


UNDECIDED: Final = Decision([], ())


def margins(decision: Decision) -> list[tuple[float, PathStep | None]]:
    """For each step, by how much its path beat the best path without it, and what that path had there.

    Where two paths met, the winner's steps since they parted are as sure as the difference (soft-output Viterbi).
    """
    steps = decision.steps
    margin: list[tuple[float, PathStep | None]] = [(float("inf"), None)] * len(steps)
    index = {_key(step): i for i, step in enumerate(steps)}
    beaten = [(at, *rival) for at, step in enumerate(steps) for rival in step.losers]
    beaten += [(len(steps), *rival) for rival in decision.rivals]
    for at, difference, loser in beaten:
        shared: set[int] = set()
        parted = 0  # steps before it are those of both
        segments: list[PathStep] = []
        while loser is not None:
            i = index.get(_key(loser))
            if i is None:
                segments.append(loser)
            elif steps[i] is loser:
                parted = i + 1
                break
            else:
                shared.add(i)
            loser = loser.before
        for i in range(parted, at):
            if i not in shared and difference < margin[i][0]:
                mine = steps[i]
                margin[i] = (difference, next((p for p in segments if p.start < mine.end and p.end > mine.start), None))
    return margin


def evidence_of_steps(
    steps: Sequence[PathStep], found: Sequence[tuple[float, PathStep | None]], offset: int
) -> BoundaryEvidence:
    """The evidence of steps (their margins apart) that begin at a stream offset, with what `margins` found."""
    why = evidence_rows(len(steps))
    for i, (step, (_, other)) in enumerate(zip(steps, found, strict=True)):
        why.silence[i], why.conversation[i] = step.gap_bits, step.conversation_bits
        if step.candidate is not None:
            why.length[i] = step.candidate.structure
            why.crc[i] = 0.0 if step.candidate.damaged else CRC_BITS
        if other is not None:
            why.rival_start[i], why.rival_length[i] = offset + other.start, other.end - other.start
            why.rival_kind[i] = _KINDS[other.candidate.role if other.candidate else NOISE]
    return why


def _key(step: PathStep) -> tuple[int, int, int]:
    return step.start, step.end, step.candidate.role if step.candidate else -1
