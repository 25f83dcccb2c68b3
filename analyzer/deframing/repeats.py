"""Bytes that repeat: a stuck line, a generator, a payload of frames in frames.

What is decided at a place hangs on the bytes ahead and the silences there, as far as they were looked at, and on the
conversation so far. Where all of that is what it was at an earlier place, so is all that is decided from there on, up
to the next byte or silence that differs: it is copied instead of found again. Nothing but time is saved: the pieces are
those that the lattice would give.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from .contest import WINDOWS
from .lattice import Pending, Said
from .options import Options
from .pieces import Decided
from .rules import MAX_ADU, Bytes
from .tape import Tape

_KEPT: Final = 1024  # places
_FIRST: Final = 1 << 12  # bytes compared at first
_NEVER: Final = 1 << 62


class Place(NamedTuple):
    """A place where the lattice was asked: offset in the stream, pieces that were fresh then, the conversation."""

    offset: int
    fresh: int
    said: Said
    waiting: bool


@dataclass(frozen=True, slots=True)
class Repeat:
    """Pieces to copy: fresh ones from `first` up to `last`, `count` times, each time `shift` bytes further on."""

    first: int
    last: int
    shift: int
    count: int
    moved: int  # bytes, in all
    said: Said  # the conversation after them
    waiting: bool


class Repeats:
    """Remembers where the lattice was asked since the last checkpoint, and how far it looked."""

    def __init__(self, tape: Tape, options: Options) -> None:
        self._tape, self._options = tape, options
        self._places: list[Place] = []
        self._looked: list[int] = []  # offsets: how far was looked, for what is between a place and the next one
        self._decided = 0  # offset up to which the newest place decided
        self._last: dict[object, int] = {}  # by what is ahead: the newest place that decided something itself

    def looked(self, upto: int, decided: int) -> None:
        """The newest place has looked at what is before offset `upto`, and decided what is before `decided`."""
        self._looked[-1], self._decided = upto, decided

    def clear(self) -> None:
        """Silences may be worth something else from here on."""
        self._places.clear()
        self._looked.clear()
        self._last.clear()

    def look(self, at: int, upto: int, place: Place, heard: int, room: int) -> Repeat | None:
        """What of the decisions since an earlier place holds again from index `at` of the tape (`place`) on.

        `upto` is where the bytes end that are known, `heard` counts the functions heard of, `room` is how many bytes
        may be taken.
        """
        data, classes = self._tape.data, self._tape.classes
        if len(self._places) >= _KEPT:
            self.clear()
        if self._places and place.offset > self._decided:  # runs were taken since
            self._looked[-1] = max(self._looked[-1], place.offset + MAX_ADU)
        self._places.append(place)
        self._looked.append(_NEVER)
        state = relative(place.said, place.offset), place.waiting, heard
        keys = []
        for window in WINDOWS:
            ahead = slice(at, min(at + window, upto))
            keys.append((hash(data[ahead].tobytes()), hash(classes[ahead].tobytes()), state))
        tried = -1
        for key in reversed(keys):
            i = self._last.get(key, -1)
            if i >= 0 and i != tried and self._places[i].offset >= self._tape.base:
                repeat = self._repeat(i, at, upto, place, room)
                if repeat is not None:
                    return repeat
                tried = i
        self._last.update(dict.fromkeys(keys, len(self._places) - 1))
        return None

    def _repeat(self, i: int, at: int, upto: int, place: Place, room: int) -> Repeat | None:
        """What of the decisions from place number i on holds again from `at` on."""
        before = self._places[i]
        shift = place.offset - before.offset
        known = _alike(self._tape.data[:upto], at, shift) - MAX_ADU
        known = min(known, _alike(self._tape.classes[:upto], at, shift))
        for least_ns in (self._options.idle_ns, self._options.cut_ns):  # a class does not tell these pauses
            known = min(known, self._pauses_alike(at, shift, known, least_ns))
        most = before.offset + known
        last = i
        while last < len(self._places) - 1 and self._looked[last] <= most:
            if self._places[last + 1].offset - before.offset > room:
                break
            last += 1
        if last == i:
            return None
        after = self._places[last]
        moved = after.offset - before.offset
        count, deepest = 1, max(self._looked[i:last])
        if after is place:  # all that was decided since: once more, and again
            count = min((most - deepest) // shift + 1, room // shift)
        by = shift * count
        self.looked(deepest + by, after.offset + by)
        return Repeat(before.fresh, after.fresh, shift, count, moved * count, shifted(after.said, by), after.waiting)

    def _pauses_alike(self, at: int, shift: int, size: int, least_ns: int) -> int:
        """How many bytes from `at` on have pauses where those `shift` bytes before have them; `size` at the most."""
        here, before = (self._tape.quiet(i - 1, i + size, least_ns) - i for i in (at, at - shift))
        n = min(len(here), len(before))
        first = int(np.argmin(np.append(here[:n] == before[:n], False)))
        return min((int(pauses[first]) for pauses in (here, before) if first < len(pauses)), default=size)


def _alike(values: Bytes, at: int, shift: int) -> int:
    """How many values from `at` on equal those so many bytes before."""
    n, reach = len(values), _FIRST
    while True:  # mostly few do: no need to compare all
        stop = min(n, at + reach)
        other = np.flatnonzero(values[at:stop] != values[at - shift : stop - shift])
        if len(other):
            return int(other[0])
        if stop == n:
            return n - at
        reach *= 16


def copied(pieces: Sequence[Decided], repeat: Repeat) -> Decided:
    """Pieces, again and again."""
    one = [np.concatenate([piece[i] for piece in pieces]) for i in range(6)]
    n = len(one[0])
    shift = np.repeat(np.arange(1, repeat.count + 1) * repeat.shift, n)
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
