"""The undecided end of a stream: bytes, what the tap said of their times, and the silences between them.

Bytes with equal times form a group, however many chunks they came in: so results depend on bytes and times alone. The
last group is open until a later time is seen, for it may still grow.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from captures.chunks import Block

from ..tables.schema import NO_GAP
from .gaps import TURNS, classes_of, classes_of_few, silence_positions
from .rules import Bytes, Index

Times = NDArray[np.int64]
_FAR: Final = -(1 << 62)
_LONG_READ: Final = 1 << 16  # bytes
_FEW: Final = 96  # groups, segments


class SegmentReads(NamedTuple):
    """What the reads say of segments: columns, those from `gap_before_ns` on as in `Rows`."""

    t_start_ns: Times  # ns, estimates of first start bit and last stop bit
    t_end_ns: Times
    head: Times  # number of the read that brought the first byte
    tail: Times  # and of the one that brought the last
    heard: Times  # ns, when the read that brought the first byte returned
    gap_before_ns: Times
    gap_most_ns: Times
    gap_least_ns: Times
    gap_at: NDArray[np.int32]
    reads: Times
    errors: NDArray[np.uint16]
    mark: NDArray[np.uint8]


class CharacterTime(NamedTuple):
    """The time of one character on the line, ns; where it is not known, a middling one to scale silences by."""

    ns: float
    known: bool


class ByteBuffer:
    """Columns over the undecided bytes; index 0 is at stream offset `base`."""

    char_ns: float
    _wire_ns: float
    base: int
    data: Bytes
    classes: NDArray[np.uint8]
    group: Index
    time: Times
    _silence: Times
    _errors: Index
    _marks: NDArray[np.uint8]
    _closed: int
    _gone: int
    _partial: bool
    _before: tuple[int, int]

    def __init__(self, character: CharacterTime) -> None:
        self.char_ns = character.ns
        self._wire_ns = character.ns if character.known else 0.0
        self.base = 0
        self.data = np.empty(0, np.uint8)
        self.classes = np.empty(0, np.uint8)  # of the silence before each byte; 0 inside a group
        self.group = np.empty(0, np.intp)  # first byte of each group
        self.time = np.empty(0, np.int64)  # of each group, ns
        self._silence = np.empty(0, np.int64)  # before each closed group, ns; NO_GAP where nothing is known
        self._errors = np.empty(0, np.intp)  # bytes that the UART marked
        self._marks = np.empty(0, np.uint8)  # of each group
        self._closed = 0  # groups whose class is known
        self._gone = 0  # groups dropped so far
        self._partial = False  # the first group began before the first byte here
        self._before = (_FAR, 0)  # time and mark of the group before the first one here

    def __len__(self) -> int:
        return len(self.data)

    @property
    def ready(self) -> int:
        """Bytes before the open group; a read so long that it can't be one is not waited for."""
        if self._closed < len(self.group) and len(self.data) - int(self.group[-1]) < _LONG_READ:
            return int(self.group[-1])
        return len(self.data)

    @property
    def classed(self) -> int:
        """Bytes of which the class of the silence before them is known."""
        return len(self.data) if self._closed == len(self.group) else int(self.group[self._closed])

    @property
    def last_time(self) -> int:
        """Time of the newest byte, ns; far in the past when there was none."""
        return int(self.time[-1]) if len(self.time) else self._before[0]

    def append(self, block: Block) -> None:
        """Add chunks, whatever their port. `close` is to be called before anything is asked of them."""
        if not len(block):
            return
        times, marks = block.t_ns, block.mark
        if len(block.errors):
            self._errors = np.concatenate((self._errors, block.errors + len(self.data)))
        held = len(self.data)
        starts = block.offsets[:-1] + held
        last_mark = int(self._marks[-1]) if len(self._marks) else self._before[1]
        open_group = self._closed < len(self.group)
        same = open_group and int(times[0]) == self.last_time and int(marks[0]) == last_mark
        grown = times[1:] == times[:-1]
        if same or np.count_nonzero(grown):
            new = np.empty(len(block), np.bool_)
            new[0], new[1:] = not same, ~grown | (marks[1:] != marks[:-1])
            starts, times, marks = starts[new], times[new], marks[new]
        if not held:
            self.data, self.classes = block.data.copy(), np.zeros(len(block.data), np.uint8)
            self.group, self.time, self._marks = starts, times, marks
            return
        self.data = np.concatenate((self.data, block.data))
        self.classes = np.concatenate((self.classes, np.zeros(len(block.data), np.uint8)))
        self.group = np.concatenate((self.group, starts))
        self.time = np.concatenate((self.time, times))
        self._marks = np.concatenate((self._marks, marks))

    def close(self, *, over: bool) -> None:
        """Work out what is known of the groups. `over`: no more bytes come with the newest time; else it stays open."""
        first, upto = self._closed, len(self.group) - (not over)
        if upto <= first:
            return
        before, mark = self._before if not first else (int(self.time[first - 1]), int(self._marks[first - 1]))
        if upto - first <= _FEW and not mark and not np.count_nonzero(self._marks):
            self._close_few(first, upto, before)
            return
        sizes = np.empty(upto - first, np.int64)
        following = self.group[first + 1 : upto + 1]
        sizes[: len(following)], sizes[len(following) :] = following, len(self.data)
        sizes -= self.group[first:upto]
        times = self.time[first:upto]
        steps = np.empty_like(times)
        np.subtract(times[1:], times[:-1], out=steps[1:])
        steps[0] = int(times[0]) - max(before, int(times.min()) - (1 << 53))
        silence = steps - (sizes * self.char_ns).astype(np.int64)
        heard = steps - self._wire(sizes)
        if before == _FAR:
            heard[0] = NO_GAP
        self._silence = np.concatenate((self._silence[:first], heard))
        classes = classes_of(silence, self.char_ns)
        if before == _FAR:
            classes[0] = 0  # nothing is known of the silence before a capture
        if mark or self._marks[first:upto].any():
            marks = np.concatenate(([mark], self._marks[first:upto]))
            turned = (marks[1:] != marks[:-1]) & (marks[1:] != 0)
            classes[turned] = TURNS + marks[1:][turned] - 1
        self.classes[self.group[first:upto]] = classes
        self._closed = upto

    def _close_few(self, first: int, upto: int, before: int) -> None:
        """The same of a few groups that no log marks: one by one, for arrays of so few take longer."""
        times, begins = self.time[first:upto].tolist(), self.group[first : upto + 1].tolist()
        if upto == len(self.group):
            begins.append(len(self.data))
        last = max(before, min(times) - (1 << 53))
        silences, heard = [], []
        for time, begin, end in zip(times, begins, begins[1:], strict=False):
            step, size = time - last, end - begin
            silences.append(step - int(size * self.char_ns))
            heard.append(step - round(size * self._wire_ns))
            last = time
        classes = classes_of_few(silences, self.char_ns)
        if before == _FAR:
            heard[0], classes[0] = NO_GAP, 0
        known = np.array(heard, np.int64)
        self._silence = np.concatenate((self._silence[:first], known)) if first else known
        self.classes[self.group[first:upto]] = classes
        self._closed = upto

    def lasts(self, least_ns: int) -> bool:
        """Whether so long passed from the byte before the first one here to the last: else no silence is so long."""
        return len(self.time) > 0 and int(self.time.max()) - min(int(self.time.min()), self._before[0]) >= least_ns

    def begins(self, stop: int) -> Index:
        """Byte indices before `stop` at which groups begin."""
        return self.group[: int(self.group.searchsorted(stop))]

    def marks(self, places: Index) -> NDArray[np.uint8]:
        """The marks of the bytes at these indices."""
        return self._marks[self.group.searchsorted(places, side="right") - 1]

    def quiet(self, low: int, high: int, least_ns: int) -> Index:
        """Byte indices in (low, high) before which the times step by `least_ns` or more; `high` excluded."""
        first, last = self.group.searchsorted((low + 1, high)).tolist()
        if first >= last:
            return np.empty(0, np.intp)
        previous = self.time[first - 1 : last - 1] if first else np.append(self._before[0], self.time[: last - 1])
        return self.group[first:last][self.time[first:last] - previous >= least_ns]

    def reads(self, starts: Index, ends: Index) -> SegmentReads:
        """What the reads say of segments that lie end to end, at least one."""
        if len(starts) <= _FEW and len(self.group) <= _FEW:
            return self._reads_of_few(starts, ends)
        bounds = np.concatenate((starts, ends[-1:]))
        group = self.group.searchsorted(bounds, side="right") - 1
        begins = self.group.take(group) == bounds
        head, tail = group[:-1], group[1:] - begins[1:]
        limits = np.empty_like(self.group)
        limits[:-1], limits[-1] = self.group[1:], len(self.data)
        t_end = self.time[tail] - self._wire(limits[tail] - ends)  # what came in the same read after it, too
        t_start = self.time[head] - self._wire(limits[head] - starts)
        t_start = np.minimum(t_start, t_end - self._wire(ends - starts))
        known = np.full(len(limits) + 1, NO_GAP)  # a spare one: the last segment may end where all do
        known[: len(self._silence)] = self._silence
        if self._partial and starts[0] == 0:
            begins[0] = False
        most, least = np.full(len(starts), NO_GAP), np.full(len(starts), NO_GAP)
        at, errors = np.zeros(len(starts), np.int32), np.zeros(len(starts), np.uint16)
        several = (tail > head).nonzero()[0]
        if len(several):
            within = np.empty(2 * len(several), np.intp)
            within[::2], within[1::2] = head[several] + 1, tail[several] + 1
            most[several] = np.maximum.reduceat(known, within)[::2]
            least[several] = np.minimum.reduceat(known, within)[::2]
            at[several] = self._longest_at(known, head[several], tail[several], most[several]) - starts[several]
        if len(self._errors):
            errors[:] = np.diff(np.searchsorted(self._errors, bounds))
        before = np.where(begins[:-1], known[head], NO_GAP)
        numbers = head + self._gone, tail + self._gone
        reads = tail - head + 1
        marks = self._marks[head]
        return SegmentReads(t_start, t_end, *numbers, self.time[head], before, most, least, at, reads, errors, marks)

    def _reads_of_few(self, starts: Index, ends: Index) -> SegmentReads:
        """The same of a few segments in a few reads: one by one, for arrays of so few take longer."""
        groups, times, wire_ns = self.group.tolist(), self.time.tolist(), self._wire_ns
        limits, silences = [*groups[1:], len(self.data)], self._silence.tolist()
        silences += [NO_GAP] * (len(groups) - len(silences))
        said = []
        for start, end in zip(starts.tolist(), ends.tolist(), strict=True):
            head, tail = bisect_right(groups, start) - 1, bisect_left(groups, end) - 1
            t_end = times[tail] - round((limits[tail] - end) * wire_ns)
            t_start = times[head] - round((limits[head] - start) * wire_ns)
            t_start = min(t_start, t_end - round((end - start) * wire_ns))
            begins = groups[head] == start and not (self._partial and start == 0)
            most = least = NO_GAP
            at = 0
            if tail > head:
                inside = silences[head + 1 : tail + 1]
                most, least = max(inside), min(inside)
                at = groups[head + 1 + inside.index(most)] - start
            before = silences[head] if begins else NO_GAP
            numbers = head + self._gone, tail + self._gone
            said.append((t_start, t_end, *numbers, times[head], before, most, least, at, tail - head + 1))
        columns = np.array(list(zip(*said, strict=True)), np.int64)
        errors = np.zeros(len(said), np.uint16)
        if len(self._errors):
            errors[:] = self._errors.searchsorted(ends) - self._errors.searchsorted(starts)
        marks = self._marks.take(columns[2] - self._gone)
        return SegmentReads._make((*columns[:8], columns[8].astype(np.int32), columns[9], errors, marks))

    def _wire(self, count: Index) -> Times:
        """How long so many bytes take on the wire."""
        taken: Times = np.rint(count * self._wire_ns).astype(np.int64)
        return taken

    def _longest_at(self, silence: Times, head: Index, tail: Index, most: Times) -> Index:
        """The byte before which each segment's longest silence stands; segments are of groups head to tail."""
        sizes = tail - head
        owner = np.arange(len(head)).repeat(sizes)
        groups = (tail + 1 - sizes.cumsum()).take(owner) + np.arange(len(owner))
        hits = (silence.take(groups) == most.take(owner)).nonzero()[0]
        first = np.ones(len(hits), np.bool_)  # of each owner, all of which have one
        of = owner.take(hits)
        first[1:] = of[1:] != of[:-1]
        first_bytes: Index = self.group.take(groups.take(hits[first]))
        return first_bytes

    def parted(
        self, start: Index, end: Index, cut: NDArray[np.bool_], parts: bytes
    ) -> tuple[Index, Index, Index | slice]:
        """Segments, those to `cut` in two where a silence `parts` (by class); and which given one each is of."""
        cuts = [
            np.array(silence_positions(self.classes[low:high].tobytes(), 1, parts), np.intp) + low
            for low, high in zip(start[cut].tolist(), end[cut].tolist(), strict=True)
        ]
        if not any(map(len, cuts)):
            return start, end, slice(None)
        starts = np.sort(np.concatenate((start, *cuts)))
        return starts, np.append(starts[1:], end[-1]), np.searchsorted(start, starts, side="right") - 1

    def drop(self, count: int) -> None:
        """Forget the first `count` bytes: they are decided."""
        if not count:
            return
        gone = len(self.group)
        if count < len(self.data):
            gone = int(self.group.searchsorted(count, side="right")) - 1  # the group that byte `count` lies in
        keep_partial = gone < len(self.group) and int(self.group[gone]) < count
        self._gone += gone
        self._partial = keep_partial
        if gone:
            self._before = (int(self.time[gone - 1]), int(self._marks[gone - 1]))
        self.base += count
        self.data = self.data[count:].copy()
        self.classes = self.classes[count:].copy()
        self.group = self.group[gone:] - count
        if keep_partial:
            self.group[0] = 0
        self.time = self.time[gone:].copy()
        self._silence = self._silence[gone:].copy()
        if len(self._errors):
            self._errors = self._errors[np.searchsorted(self._errors, count) :] - count
        self._marks = self._marks[gone:].copy()
        self._closed = max(0, self._closed - gone)
