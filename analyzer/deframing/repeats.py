"""Bytes that repeat: a stuck line, a generator, a payload of frames in frames.

What the lattice decides hangs on the bytes ahead (a window of them), the silences there and the conversation so far.
Where all three are what they were one period before, so are the decisions, for as many periods as the bytes go on; they
are copied instead of found again. Nothing but time is saved: the pieces are those that the lattice would give.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from .contest import WINDOWS
from .lattice import Pending, Said
from .pieces import Decided
from .rules import MAX_ADU, Bytes

_KEPT: Final = 256  # places
_FIRST: Final = 1 << 12  # bytes compared at first


class Place(NamedTuple):
    """A place where the lattice was asked: offset in the stream, and how many pieces were fresh then."""

    offset: int
    fresh: int


@dataclass(frozen=True, slots=True)
class Repeat:
    """Periods to copy: `pieces` from number `first` on make one; `count` more follow."""

    period: int
    first: int
    count: int


class Repeats:
    """Remembers where the lattice was asked, since the last checkpoint."""

    def __init__(self) -> None:
        self._seen: dict[object, Place] = {}
        self._ahead = 0  # bytes that decisions have looked at

    def looked(self, octets: int) -> None:
        """A decision has looked at so many bytes."""
        self._ahead = max(self._ahead, octets + MAX_ADU)

    def clear(self) -> None:
        """Silences may be worth something else from here on."""
        self._seen.clear()
        self._ahead = 0

    def look(
        self, data: Bytes, classes: Bytes, at: int, offset: int, state: object, fresh: int, room: int
    ) -> Repeat | None:
        """Whether from `at` (at stream `offset`) on the bytes repeat what was decided since an earlier place.

        `state` is what else decisions hang on, relative to `offset`; `room` how many bytes may be taken.
        """
        window = data[at : at + WINDOWS[0]].tobytes()
        key = window, state
        before = self._seen.get(key)
        if len(self._seen) >= _KEPT:
            self._seen.clear()
        self._seen[key] = Place(offset, fresh)
        if before is None or not offset - at <= before.offset < offset:
            return None
        period = offset - before.offset
        same = min(_alike(data, at, period), _alike(classes, at, period))
        count = min((same - self._ahead) // period, room // period)
        return Repeat(period, before.fresh, count) if count > 0 else None


def _alike(values: Bytes, at: int, period: int) -> int:
    """How many values from `at` on equal those a period before."""
    n, reach = len(values), _FIRST
    while True:  # mostly few do: no need to compare all
        stop = min(n, at + reach)
        other = np.flatnonzero(values[at:stop] != values[at - period : stop - period])
        if len(other):
            return int(other[0])
        if stop == n:
            return n - at
        reach *= 16


def copied(pieces: Sequence[Decided], repeat: Repeat) -> Decided:
    """The pieces of one period, again and again."""
    one = [np.concatenate([piece[i] for piece in pieces]) for i in range(6)]
    n = len(one[0])
    shift = np.repeat(np.arange(1, repeat.count + 1) * repeat.period, n)
    start, end, role, check, margin, weighed = (np.tile(column, repeat.count) for column in one)
    why = None
    if pieces[0].why is not None:
        whys = [piece.why for piece in pieces if piece.why is not None]
        why = np.tile(np.concatenate(whys), repeat.count)
        why["rival_start"] += np.where(why["rival_start"] >= 0, shift, 0)
    return Decided(start + shift, end + shift, role, check, margin, weighed, why)


def relative(said: Said, offset: int) -> object:
    """What was said, seen from an offset."""
    return tuple((p.start - offset, p.adu) for p in said.pending), said.answered, said.last


def shifted(said: Said, by: int) -> Said:
    """The same, said so many bytes later."""
    return Said(tuple(Pending(p.start + by, p.adu, p.expects) for p in said.pending), said.answered, said.last)
