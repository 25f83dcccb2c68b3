"""Where candidates tile the bytes with no rival: the path is forced, and whole runs of frames are taken as arrays.

An interval (start, end) that no other one overlaps needs no lattice; most need no thought about their role either.
Some do: a write's echo reads as request and as response. Request and echo side by side are told apart here by their
places, as the lattice would; whatever is not plain is left to it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dissectors.lengths import Role

from .candidates import Candidates
from .conversation import fitting
from .lattice import CONTRARY, FITS, FITS_EXCEPTION, UNASKED, Candidate, Said
from .prefix import Windows
from .rules import Bytes, Index, Mask
from .silence import Trust, Turn

_PLAIN: Final = -4.0  # bits by which silence may speak against a role that the places speak for


class Runs(NamedTuple):
    """Intervals (start, end) of candidates, and which of them have no rival."""

    start: Index
    end: Index
    role: NDArray[np.uint8]
    either: Mask  # both roles read alike
    structure: NDArray[np.float32]
    clean: Mask
    last: Index  # the last interval of the run that each is in


@dataclass(frozen=True, slots=True)
class Stretch:
    """What is known of the bytes being worked on, which begin at index `begin` of the tape."""

    data: Bytes
    begin: int
    crc: Windows
    found: Candidates

    def any(self, at: int, limit: int) -> bool:
        """Whether a candidate begins in [at, limit)."""
        low, high = np.searchsorted(self.found.start, (at, limit))
        return bool(low < high)

    def candidates(self, at: int, limit: int) -> list[Candidate]:
        """Those that lie in [at, limit), with offsets from `at`."""
        low, high = np.searchsorted(self.found.start, (at, limit))
        start, end = self.found.start[low:high], self.found.end[low:high]
        fits = end <= limit
        return [
            Candidate(*values)
            for values in zip(
                (start[fits] - at).tolist(),
                (end[fits] - at).tolist(),
                self.found.role[low:high][fits].tolist(),
                self.found.structure[low:high][fits].tolist(),
                strict=True,
            )
        ]


def runs_of(found: Candidates, known: int) -> Runs:
    """Intervals of candidates; those without a rival that end at or before `known`, where nothing can still appear."""
    n = len(found)
    new = np.ones(n, np.bool_)
    new[1:] = (found.start[1:] != found.start[:-1]) | (found.end[1:] != found.end[:-1])
    first = np.flatnonzero(new)
    start, end = found.start[first], found.end[first]
    either = np.diff(np.append(first, n)) > 1
    reach = np.concatenate(([0], np.maximum.accumulate(end)[:-1])) if len(end) else end
    following = np.append(start[1:], np.iinfo(np.intp).max)[: len(start)]
    clean = (reach <= start) & (following >= end) & (end <= known)
    m = len(start)
    joined = np.zeros(m, np.bool_)
    joined[1:] = clean[1:] & clean[:-1] & (start[1:] == end[:-1])
    heads = np.flatnonzero(~joined)
    lasts = np.append(heads[1:] - 1, m - 1)[: len(heads)]
    last = np.repeat(lasts, lasts - heads + 1) if m else np.empty(0, np.intp)
    return Runs(start, end, found.role[first], either, found.structure[first], clean, last)


def plain_roles(
    data: Bytes,
    start: Index,
    role: NDArray[np.uint8],
    either: Mask,
    silences: NDArray[np.uint8],
    trust: Trust,
    *,
    answered: bool,
) -> NDArray[np.uint8]:
    """Roles of frames that stand end to end, up to the first one that is not plain.

    `role` is right where not `either`. Plain are two frames of which the second may answer the first, where no third
    could take part, silence does not speak against it, and nothing is pending before them. `answered`: that is so
    before the first frame.
    """
    if not either.any():
        return role
    n = len(start)
    pairs = np.flatnonzero(either[:-1] | either[1:])
    pairs = pairs[
        (either[pairs] | (role[pairs] == Role.REQUEST)) & (either[pairs + 1] | (role[pairs + 1] == Role.RESPONSE))
    ]
    answered_next = np.zeros(n + 1, np.bool_)  # at k: frame k + 1 may answer frame k
    answered_next[pairs] = fitting(data, start[pairs], start[pairs + 1])
    first, second = answered_next[:n].copy(), np.zeros(n, np.bool_)  # of two that belong together and to no third
    first[1:] &= ~answered_next[: n - 1]
    first[:n] &= ~answered_next[1:]
    second[1:] = first[:-1]
    tables = np.array(trust.evidence)
    silence = silences.take(start)
    speaks = tables[Turn.RESPONSE][silence] - tables[Turn.AGAIN][silence] >= _PLAIN
    asks = tables[Turn.REQUEST][silence] - tables[Turn.RESPONSE][silence] >= _PLAIN
    told = np.zeros(n, np.bool_)
    told[:-1] = asks[:-1] & speaks[1:] & (np.arange(n - 1) + 2 < n)
    first &= told | ~either
    second[1:] &= first[:-1]
    roles = role.copy()
    roles[first & either], roles[second & either] = Role.REQUEST, Role.RESPONSE
    plain = ~either | first | second
    pending = np.append(not answered, roles[:-1] == Role.REQUEST)  # the frame before was a request
    plain &= ~(first & either & pending)
    doubt = np.flatnonzero(~plain)
    return roles[: int(doubt[0])] if len(doubt) else roles


def plain_evidence(
    data: Bytes,
    start: Index,
    end: Index,
    role: NDArray[np.uint8],
    classes: NDArray[np.uint8],
    trust: Trust,
    said: Said,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """What silence and conversation say for frames of a run, in bits, as the lattice would weigh them.

    `classes` are those of the silences before the frames; `said` is the conversation before the first.
    """
    asks = (role == Role.REQUEST) & (data.take(start) != 0)
    pending = np.append(not said.answered, asks[:-1])
    turns = np.where(asks & pending, Turn.AGAIN, role)
    conversation = np.where(asks & pending, trust.unanswered_bits, 0.0)
    answers = np.flatnonzero((role[1:] == Role.RESPONSE) & (role[:-1] == Role.REQUEST)) + 1
    fits = fitting(data, start[answers - 1], start[answers])
    failed = data.take(start[answers] + 1) & 0x80 != 0
    conversation[answers] = np.where(fits, np.where(failed, FITS_EXCEPTION, FITS), CONTRARY)
    if role[0] == Role.RESPONSE:
        known = said.answers(data[start[0] : end[0]].tobytes()) is not None
        conversation[0] = FITS if known else UNASKED if said.answered else CONTRARY
    return np.array(trust.evidence)[turns, classes], conversation
