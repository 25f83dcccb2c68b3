"""The conversation as the engine carries it: looked up only when somebody asks.

A run of frames taken as arrays says nothing that needs knowing until the next contested stretch; then the frames in
reach of its end are gone through.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dissectors.lengths import Role

from .conversation import fitting
from .lattice import Pending, Said
from .rules import Bytes, Index


@dataclass(frozen=True, slots=True)
class Run:
    """Frames (indices of `data`, whose first byte is at stream offset `base`)."""

    data: Bytes
    base: int
    start: Index
    end: Index
    role: NDArray[np.uint8]

    def frames(self) -> Iterator[tuple[bytes, int, int]]:
        """ADU, stream offset and role of each."""
        for s, e, r in zip(self.start.tolist(), self.end.tolist(), self.role.tolist(), strict=True):
            yield self.data[s:e].tobytes(), self.base + s, r

    def in_turns(self) -> Said | None:
        """The conversation after a run in which each request was answered by the next frame; None where it was not."""
        first = int(self.role[0] == Role.RESPONSE)  # that one answers what is before the run
        start, role = self.start[first:], self.role[first:]
        asked, answers = start[0::2], start[1::2]
        if not len(asked) or (role[0::2] != Role.REQUEST).any() or (role[1::2] != Role.RESPONSE).any():
            return None
        if not self.data.take(asked).all() or not fitting(self.data, asked[: len(answers)], answers).all():
            return None  # a broadcast, or an answer to something else
        begin, end = int(asked[-1]), int(self.end[first:][0::2][-1])
        last = Pending.of(self.base + begin, self.data[begin:end].tobytes())
        open_one = len(asked) > len(answers)
        return Said((last,) if open_one else (), not open_one, last.adu)


class Talk:
    """What was said so far, and a run of frames that has yet to be added to it."""

    def __init__(self) -> None:
        self._said = Said()
        self._run: Run | None = None

    @property
    def said(self) -> Said:
        """The conversation up to now."""
        if self._run is not None:
            said = self._said
            if not said.pending and (short := self._run.in_turns()) is not None:
                self.settle(short)
                return short
            for adu, offset, role in self._run.frames():
                if role == Role.REQUEST:
                    said = said.ask(Pending.of(offset, adu))
                elif (which := said.answers(adu)) is not None:
                    said = said.answer(which)
            self.settle(said)
        return self._said

    def settle(self, said: Said) -> None:
        """The conversation is this now."""
        self._said, self._run = said, None

    def go_on(self, run: Run, *, alone: bool) -> None:
        """A run of frames follows; `alone`: it reaches back further than any conversation does."""
        self._said = Said() if alone else self.said
        self._run = run
