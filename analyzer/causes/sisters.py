"""Units by what is read of them: those that are asked alike may hold the same kinds of things."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from .evidence import Evidence
from .ledgerview import LedgerView
from .registerstates import PollValues
from .registry import Symptom

READS: Final = 24  # kept ones, under which nothing is said


def unit_reads(view: LedgerView) -> dict[int, list[PollValues]]:
    """What is read of each unit often enough, in the order of addresses."""
    found: dict[int, list[PollValues]] = {}
    for poll in view.ledger.values.polls.values():
        if len(poll.times) >= READS and poll.words.shape[1]:
            found.setdefault(poll.unit, []).append(poll)
    return {unit: sorted(polls, key=_place) for unit, polls in found.items()}


def open_reads(evidence: Evidence) -> Iterator[tuple[int, list[PollValues]]]:
    """Units whose values no cause explains yet, with what is read of them often enough."""
    yield from ((unit, polls) for unit, polls in unit_reads(evidence).items() if evidence.is_open(Symptom.VALUES, unit))


def _place(poll: PollValues) -> tuple[int, int, int]:
    return poll.function, poll.address, poll.words.shape[1]


def asked_alike(view: LedgerView) -> list[list[list[PollValues]]]:
    """What is read of units, together where all of it is the same."""
    groups: dict[tuple[tuple[int, int, int], ...], list[list[PollValues]]] = {}
    for polls in unit_reads(view).values():
        groups.setdefault(tuple(map(_place, polls)), []).append(polls)
    return list(groups.values())


def sisters(evidence: Evidence) -> Iterator[list[PollValues]]:
    """Polls of different units for the same registers; alone where no other unit is asked so."""
    groups: dict[tuple[int, int, int], list[PollValues]] = {}
    for _, polls in open_reads(evidence):
        for poll in polls:
            groups.setdefault(_place(poll), []).append(poll)
    yield from groups.values()
