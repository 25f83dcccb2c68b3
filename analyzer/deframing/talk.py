"""The conversation as the engine carries it: looked up only when somebody asks.

Runs of frames taken as arrays say nothing that needs knowing until the next contested stretch; then the frames in
reach of its beginning are gone through.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from dissectors.lengths import Role

from .lattice import Pending, Said
from .rules import Bytes, Index, Mask

REACH: Final = 1300  # bytes: further back than a conversation reaches


@dataclass(frozen=True, slots=True)
class Run:
    """Frames (indices of `data`, whose first byte is at stream offset `base`)."""

    data: Bytes
    base: int
    start: Index
    end: Index
    role: NDArray[np.uint8]
    fits: Mask  # that it answers the one before it

    @property
    def octets(self) -> int:
        """Bytes."""
        return int(self.end[-1] - self.start[0])

    def part(self, first: int, last: int | None) -> Run:
        """Some of its frames."""
        some = slice(first, last)
        return Run(self.data, self.base, self.start[some], self.end[some], self.role[some], self.fits[some])

    def frames(self) -> Iterator[tuple[bytes, int, int]]:
        """ADU, stream offset and role of each."""
        for s, e, r in zip(self.start.tolist(), self.end.tolist(), self.role.tolist(), strict=True):
            yield self.data[s:e].tobytes(), self.base + s, r

    def in_turns(self) -> Said | None:
        """The conversation after a run in which each request was answered by the next frame; None where it was not."""
        first = int(self.role[0] == Role.RESPONSE)  # that one answers what is before the run
        start, role, fits = self.start[first:], self.role[first:], self.fits[first:]
        asked, answers = start[0::2], start[1::2]
        if not len(asked) or (role[0::2] != Role.REQUEST).any() or (role[1::2] != Role.RESPONSE).any():
            return None
        if not fits[1::2].all() or not self.data.take(asked).all():
            return None  # a broadcast, or an answer to something else
        begin, end = int(asked[-1]), int(self.end[first:][0::2][-1])
        last = Pending.of(self.base + begin, self.data[begin:end].tobytes())
        open_one = len(asked) > len(answers)
        return Said((last,) if open_one else (), not open_one, last.adu)


class Talk:
    """What was said so far, and runs of frames that have yet to be added to it."""

    def __init__(self) -> None:
        self._said = Said()
        self._runs: list[Run] = []

    @property
    def said(self) -> Said:
        """The conversation up to now."""
        said = self._said
        for run in self._runs:
            short = None if said.pending else run.in_turns()
            if said.pending and len(run.start) > 1:  # mostly what the first one answers
                said, run = said_after(said, run.part(0, 1)), run.part(1, None)
                short = None if said.pending else run.in_turns()
            said = said_after(said, run) if short is None else short
        self.settle(said)
        return said

    def settle(self, said: Said) -> None:
        """The conversation is this now."""
        self._said = said
        self._runs.clear()

    def go_on(self, run: Run) -> None:
        """A run of frames follows. What it, with the runs before it, puts out of reach is forgotten."""
        self._runs.append(run)
        if len(self._runs) == 1 and run.octets < REACH:
            return
        octets = 0
        for i in range(len(self._runs) - 1, -1, -1):
            octets += self._runs[i].octets
            if octets >= REACH:
                del self._runs[:i]
                self._said = Said()
                break


def said_after(said: Said, run: Run) -> Said:
    """The conversation after a run, frame by frame."""
    for adu, offset, role in run.frames():
        if role == Role.REQUEST:
            said = said.ask(Pending.of(offset, adu))
        elif (which := said.answers(adu)) is not None:
            said = said.answer(which)
    return said
