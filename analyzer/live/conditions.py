"""Conditions on a bus that goes on: a filter asked row by row, and what was around the moment at which one came true.

A condition says what to show, when to stop, what triggers. Around a trigger only so many seconds before it and after it
are kept, of lines or of blocks to record. `LiveTrigger` watches a bus for rows, or for causes of trouble.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterator
from typing import Final, Generic, NamedTuple, TypeVar

import numpy as np

from captures.chunks import Block
from captures.line import LineSettings
from captures.recording.notes import Note
from dissectors.maps.files import UnitMaps

from ..causes.reasoning import RunningStory
from ..causes.registry import suspects
from ..filters import FilterError, compile_filter, meant
from ..filters.table import BatchTable
from ..languages import tr
from .lines import Recent, ShownRow
from .session import RecordingSink, SessionStep


class Condition:
    """One filter. What became of a request is known once its answer came; later findings ask it again."""

    def __init__(self, text: str, charts: UnitMaps | None = None) -> None:
        """FilterError says where `text` is no filter; `charts` are the maps that names in it come from."""
        self._filter = compile_filter(text, charts=charts)
        self._origin: int | None = None
        self._of: object = None
        self._mask: np.ndarray[tuple[int], np.dtype[np.bool_]] = np.zeros(0, np.bool_)

    def holds(self, shown: ShownRow, step: SessionStep, line: LineSettings) -> bool:
        """Whether this row passes, by what is known of it now."""
        if self._of is not shown.batch:
            if self._origin is None:
                self._origin = int(shown.batch.rows.t_start_ns[0])
            table = BatchTable(shown.batch, line, transactions=step.analysed.transactions, origin_ns=self._origin)
            self._of, self._mask = shown.batch, self._filter.mask(table)
        return bool(self._mask[shown.row])


T = TypeVar("T")
_MEMORY: Final = 64 << 20  # bytes kept for a trigger that may come


class TriggerWindow(Generic[T]):
    """Passes things on that are near a trigger, and keeps the newest ones in case one comes."""

    def __init__(self, before_ns: int, after_ns: int) -> None:
        self._before, self._after = before_ns, after_ns
        self._recent: deque[tuple[int, T, int]] = deque()
        self._size = 0
        self._until: int | None = None

    def offer(self, t_ns: int, item: T, size: int = 1) -> list[T]:
        """Things to pass on now: this one, or nothing."""
        if self._until is not None and t_ns <= self._until:
            return [item]
        self._recent.append((t_ns, item, size))
        self._size += size
        while self._recent and (self._recent[0][0] < t_ns - self._before or self._size > _MEMORY):
            self._size -= self._recent.popleft()[2]
        return []

    def fire(self, t_ns: int) -> list[T]:
        """There is a trigger: what to pass on of what was before it."""
        self._until = max(self._until or 0, t_ns + self._after)
        near = [item for at, item, _ in self._recent if at >= t_ns - self._before]
        self._recent.clear()
        self._size = 0
        return near


class TriggeredSink:
    """Before a recorder: lets blocks through that are near a trigger. `fire` may be called by another thread."""

    def __init__(self, recorder: RecordingSink, before_ns: int, after_ns: int) -> None:
        self._recorder = recorder
        self._window: TriggerWindow[Block] = TriggerWindow(before_ns, after_ns)
        self._lock = threading.Lock()
        self._due: list[Block] = []
        self._notes: list[Note] = []

    def fire(self, t_ns: int) -> None:
        """There is a trigger."""
        with self._lock:
            self._due += self._window.fire(t_ns)
            self._notes.append(Note(t_ns, "trigger", "what was around this moment was recorded"))

    def write(self, block: Block) -> None:
        """A block, which is recorded now, later or not at all."""
        with self._lock:
            self._due += self._window.offer(int(block.t_ns[-1]), block, len(block.data))

    def note(self, note: Note) -> None:
        """A note."""
        self._recorder.note(note)

    def settings(self, line: LineSettings) -> None:
        """The line is another from now on."""
        self.tick()
        self._recorder.settings(line)

    def tick(self) -> None:
        """Record what is due."""
        with self._lock:
            due, self._due = self._due, []
            notes, self._notes = self._notes, []
        for block in due:
            self._recorder.write(block)
        for note in notes:
            self._recorder.note(note)
        self._recorder.tick()

    def close(self, heard_ns: int | None = None) -> None:  # noqa: ARG002 - much that was heard is not recorded
        """No more comes."""
        self.tick()
        self._recorder.close()


class Fired(NamedTuple):
    """What a trigger waits for has come: when, in words, and the row's first byte of its port; -1: it is no row."""

    t_ns: int
    text: str
    port: int = -1
    start: int = -1


class LiveTrigger:
    """What a live bus is watched for: rows that pass a filter, or a new cause (`cause`, `cause all-silent`).

    What comes again before it has rested for a while is the same trouble: it is told once. `count` of those so far.
    """

    def __init__(
        self,
        text: str,
        charts: UnitMaps | None = None,
        *,
        rest_ns: int = 0,
        hit: Callable[[int], object] = bool,
    ) -> None:
        """FilterError says what is wrong with `text`. `hit` is called with the time of everything that comes."""
        self.text, self.count = text, 0
        self._cause = _cause_in(text)
        self._condition = Condition(text, charts) if self._cause is None else None
        self._rest_ns, self._hit = rest_ns, hit
        self._recent = Recent()
        self._story = RunningStory(LineSettings(), aside=True)
        self._until: int | None = None

    def feed(self, step: SessionStep, line: LineSettings) -> list[Fired]:
        """What the next step brings of it, but for what only goes on."""
        fired = []
        for each in self._causes(step, line) if self._condition is None else self._rows(self._condition, step, line):
            self._hit(each.t_ns)
            if self._until is None or each.t_ns > self._until:
                fired.append(each)
            self._until = max(self._until or 0, each.t_ns + self._rest_ns)
        self.count += len(fired)
        return fired

    def _rows(self, condition: Condition, step: SessionStep, line: LineSettings) -> Iterator[Fired]:
        for shown in self._recent.feed(step):
            if condition.holds(shown, step, line):
                yield Fired(shown.values.t_end_ns, self.text, shown.values.port, shown.values.start)

    def _causes(self, step: SessionStep, line: LineSettings) -> Iterator[Fired]:
        for revision in self._story.feed(step.batch, step.analysed.transactions, line):
            if revision.state == "new" and self._cause in ("", revision.cause.cause):
                yield Fired(step.t_ns, revision.cause.text)


_CAUSE: Final = "cause"


def _cause_in(text: str) -> str | None:
    """The cause that `cause NAME` names, empty for any; None where that is a filter."""
    words = text.split()
    if words[:1] != [_CAUSE] or len(words) > 2:
        return None
    names = {suspect.cause for suspect in suspects()}
    for name in words[1:]:
        if name not in names:
            told = tr("no cause is called {name}{meant}", name=name, meant=meant(name, names))
            raise FilterError(told, text.index(name))
    return "".join(words[1:])
