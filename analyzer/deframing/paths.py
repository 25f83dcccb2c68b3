"""What a path through a contested stretch is made of: candidates, steps, and the few that survive at a position."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

from dissectors.length_rules import Role

from .conversation import Conversation

SURE = 64.0  # bits: what cannot be doubted
_BEAM: Final = 6  # paths


class Candidate(NamedTuple):
    """A window that could be a frame; offsets in the stretch."""

    start: int
    end: int
    role: int
    structure: float
    declared: bool = True  # its function's length is known; else the window's CRC alone speaks for it
    damaged: bool = False  # its CRC is wrong: only an answer that fits a request is believed to be that
    doubtful: bool = False  # breaks a rule, or its function was never heard: whole frames inside count against it


def holds_a_frame(candidates: Sequence[Candidate], start: int, end: int) -> bool:
    """Whether a whole frame takes most of these bytes: then the rest are strays."""
    return any(start <= c.start and c.end <= end and 2 * (c.end - c.start) > end - start for c in candidates)


Losers = tuple[tuple[float, "PathStep | None"], ...]  # paths beaten: by how many bits, and their last steps


@dataclass(slots=True, eq=False)
class PathStep:
    """A part of a path: a frame or a run of noise, and the path before it."""

    start: int
    end: int
    candidate: Candidate | None
    before: PathStep | None
    score: float  # of the path up to its end
    conversation: Conversation  # the conversation after it
    gap_bits: float = 0.0
    conversation_bits: float = 0.0
    losers: Losers = ()  # paths that it beat to its start

    @property
    def damaged_request(self) -> bool:
        return self.candidate is not None and self.candidate.damaged and self.candidate.role == Role.REQUEST


class Survivor(NamedTuple):
    """A path that ends in a frame (or at the beginning); what is behind it, up to where one looks, is noise."""

    score: float  # at its end
    tip: PathStep | None
    end: int
    conversation: Conversation
    noisy: bool = False  # it holds noise, or a damaged frame
    since_noise: float = 0.0  # what its frames since the last noise have scored
    losers: Losers = ()  # paths beaten since its end


def pruned(paths: list[tuple[float, Survivor]], position: int) -> list[Survivor]:
    """The few of these paths to a position that are worth going on with, best first."""
    paths.sort(key=path_score, reverse=True)
    least = paths[0][0] - SURE
    ranks: dict[object, int] = {}
    survivors: list[tuple[float, Survivor]] = []
    for score, path in paths:
        if score < least:
            break  # nothing will bring it back
        conversation, last = path.conversation, path.tip and path.tip.candidate
        key = (
            path.end == position,
            last.role if last else -1,
            tuple([p.start for p in conversation.open_requests]),
            conversation.answered,
        )
        rival = ranks.get(key)
        if rival is None and len(ranks) < _BEAM:
            ranks[key] = len(survivors)
            survivors.append((score, path))
        else:
            rival = rival or 0
            best, winner = survivors[rival]
            if path.tip is not winner.tip:
                survivors[rival] = best, winner._replace(losers=(*winner.losers, (best - score, path.tip)))
    return [path for _, path in survivors]


def candidate_end(candidate: Candidate) -> int:
    return candidate.end


def by_end(candidate: Candidate) -> tuple[int, int, int]:
    """The order in which candidates are taken."""
    return candidate.end, candidate.start, candidate.role


def path_score(scored: tuple[float, Survivor]) -> float:
    return scored[0]
