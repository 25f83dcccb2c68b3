"""The conversation as the engine carries it: looked up only when somebody asks.

Runs of frames taken as arrays say nothing that needs knowing until the next contested stretch; then the frames in
reach of its beginning are gone through.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from dissectors.lengths import Role

from .lattice import OPEN, Pending, Said
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

    def adu(self, i: int) -> bytes:
        """The bytes of one."""
        return self.data[self.start[i] : self.end[i]].tobytes()


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
            said = said_after(said, run)
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
    """The conversation after a run: exchange by exchange, and at once where nothing is open."""
    n = len(run.start)
    asks = run.role == Role.REQUEST
    single = ~(asks[:-1] & run.fits[1:])
    alone = np.ones(n, np.bool_)
    alone[:-1] &= single
    alone[1:] &= single
    odd = [*alone.nonzero()[0].tolist(), n]
    i = k = 0
    if asks[-OPEN:].all() and len({run.adu(j) for j in range(max(0, n - OPEN), n)}) == OPEN:
        i = n - OPEN  # whatever was open before them is forgotten
    while i < n:
        while odd[k] < i:
            k += 1
        if odd[k] > i:
            if not said.pending:
                i = odd[k] - 2  # only the last exchange before it matters
            said = said.exchanged(run.base + int(run.start[i]), run.adu(i))
            i += 2
            continue
        adu = run.adu(i)
        if asks[i]:
            said = said.ask(Pending.of(run.base + int(run.start[i]), adu))
        elif (which := said.answers(adu)) is not None:
            said = said.answer(which)
        i += 1
    return said
