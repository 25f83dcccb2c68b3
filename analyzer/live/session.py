"""One session: bytes to the disk first, then to the analysis, then to whoever looks.

A thread takes what the source gives, hands it to the recorder and queues it; the analysis runs where `steps` is
iterated. Where that falls behind, or its output is held up, bytes are recorded all the same, and those that were not
analysed are counted and said (`Step.missed`).
"""

from __future__ import annotations

import queue
import threading
import time
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, Protocol

from captures.chunks import Block
from captures.line import LineSettings
from captures.live.wire import Item, PortEvent, Tick, heard_until
from captures.recording.notekinds import MARK
from captures.recording.notes import Note

from ..core import Analysed, Analyzer
from ..errors import stream_under_base
from ..options import Options
from ..tables.batch import Batch
from ..tables.findings import Findings
from .outlets import Outlet

_BACKLOG: Final = 4 << 20  # bytes that wait for the analysis at most
_PATIENCE_S: Final = 0.2
_SPARED: Final = 9  # times what a step takes of the processor pass at least until the next one begins,
_LONGEST_S: Final = 0.1  # but no more than this
_LATELY: Final = 8  # steps, over which that is averaged,
_ODD: Final = 2  # times the average count of one that takes longer, as now and then a look at all that was heard does
_USUAL_S: Final = 0.001  # before any
_DEAF: Final = frozenset({"lost", "opened", "gap"})  # events that tell when nothing was received
_NOTED: Final = frozenset({"lost", "opened", "clock", "settled", "gap", "notice"})  # events that stand in the record


class SessionSource(Protocol):
    """Where items come from: a tap, a replay.

    `waits`: it can be made to wait for an analysis that is behind; a bus can't. `more`: behind the newest item another
    one comes without a wait.
    """

    @property
    def waits(self) -> bool: ...

    @property
    def more(self) -> bool: ...

    @property
    def line(self) -> LineSettings:
        """The line's settings, as far as they are known by now."""

    def items(self) -> Iterator[Item]:
        """What comes, until `close`; waits for it. An event `settled` tells that `line` is another from then on."""

    def judge(self, heard: int, sense: int, line: LineSettings) -> None:
        """So many bytes more, heard on this `line`, were analysed; so many of them are frames with a right check."""

    def close(self) -> None:
        """End soon; may be called by another thread, or by a signal."""


class RecordingSink(Protocol):
    """What records: `captures.recording.recorder.Recorder`, or something before it."""

    def write(self, block: Block) -> None: ...

    def note(self, note: Note) -> None: ...

    def settings(self, line: LineSettings) -> None: ...

    def tick(self) -> None: ...

    def close(self, heard_ns: int | None = None) -> None: ...


@dataclass(frozen=True, slots=True)
class SessionStep:
    """What came to light at once. `heard` are bytes of the line, `marked` those of them with an error of their own."""

    t_ns: int
    analysed: Analysed
    events: list[PortEvent] = field(default_factory=list)
    heard: int = 0
    marked: int = 0
    missed: int = 0  # bytes that were not analysed

    @property
    def batch(self) -> Batch:
        """The rows."""
        return self.analysed.batch

    @property
    def findings(self) -> Findings:
        """What was found, of these rows or of earlier ones."""
        return self.analysed.findings


class Session:
    """A source being recorded and analysed. A context manager: the recording is closed when it is left."""

    def __init__(
        self,
        source: SessionSource,
        *,
        recorder: RecordingSink | None = None,
        options: Options = Options(),  # noqa: B008 - frozen
        backlog: int = _BACKLOG,
        outlets: Sequence[Outlet] = (),
    ) -> None:
        """`outlets` get every step before whoever takes them; they are closed with the session."""
        self.line = source.line
        self._source = source
        self._recorder = recorder
        self._analyzer = Analyzer(source.line, options, settles=False)
        self._queue: queue.SimpleQueue[list[Any]] = queue.SimpleQueue()
        self._ready: list[Any] = []  # the other thread's: what is queued next, as one, so that one wait ends
        self._backlog = backlog
        self._outlets = outlets
        self._waiting = 0  # bytes queued
        self._lock = threading.Condition()
        self._stopped = False
        self._missed: dict[int, int] = {}  # the other thread's: bytes not queued, by port
        self._newest = 0
        self._marks: deque[str] = deque()  # to be recorded
        self._thread = threading.Thread(target=self._pump, daemon=True)

    def __enter__(self) -> Session:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()
        self._thread.join()
        for outlet in self._outlets:
            outlet.close()

    def stop(self) -> None:
        """End soon: `steps` gives what there is, then ends."""
        self._stopped = True
        self._source.close()

    def close(self, patience_s: float) -> bool:
        """End now, whatever waits for the analysis; whether the recording is closed by then."""
        self.stop()
        self._thread.join(patience_s)
        return not self._thread.is_alive()

    def mark(self, text: str) -> bool:
        """Put a note of the user's into the recording, at the newest time heard; whether there is a recording."""
        self._marks.append(text)
        return self._recorder is not None

    @property
    def waits(self) -> bool:
        """Whether the source waits for an analysis that is behind: a replay does, a bus does not."""
        return self._source.waits

    @property
    def waiting(self) -> int:
        """Bytes that wait for the analysis."""
        return self._waiting

    def steps(self) -> Iterator[SessionStep]:
        """What comes to light, step by step; a quiet line gives empty ones a few times a second.

        Raises what the source or the recorder raised.
        """
        for step in stream_under_base(self._steps()):
            yield self._fed(step)

    def _fed(self, step: SessionStep) -> SessionStep:
        """The step, after the outlets got it; one that fails is left out from now on, and that is said."""
        for outlet in list(self._outlets):
            try:
                outlet.feed(step, self.line)
            except Exception as error:
                self._outlets = [each for each in self._outlets if each is not outlet]
                text = f"{type(outlet).__name__.lower()}: ended: {type(error).__name__}: {error}"
                step.events.append(PortEvent(step.t_ns, 0, "failed", text, {}))
        return step

    def _steps(self) -> Iterator[SessionStep]:
        over, pace = False, _StepPace()
        while not over:
            if not self._source.waits:
                pace.wait()
            items = self._queue.get()
            pace.begin()
            while not self._queue.empty():
                items += self._queue.get()
            for part in _grouped(items):
                if isinstance(part, BaseException):
                    raise part
                if part is None:
                    over = True
                    break
                step = self._step(part)
                self._newest = max(self._newest, step.t_ns)
                yield step
        self._analyzer.close()
        yield SessionStep(self._newest, self._analyzer.latest)

    def _step(self, part: _Heard | Tick | PortEvent | _OtherLine | _Missed) -> SessionStep:
        if isinstance(part, _Missed):
            return self._begun_anew(part.t_ns, missed=part.octets)
        if isinstance(part, _OtherLine):
            self.line = part.line
            return self._begun_anew(part.event.t_ns, part.event)
        if isinstance(part, PortEvent):
            if part.kind in _DEAF:
                self._analyzer.note(Note(part.t_ns, part.kind, part.text))
            return SessionStep(part.t_ns, Analysed.nothing(), [part])
        if isinstance(part, Tick):
            self._analyzer.tick(part.t_ns)
            return self._judged(SessionStep(part.t_ns, self._analyzer.latest))
        block = part.block
        with self._lock:
            self._waiting -= len(block.data)
            self._lock.notify()
        self._analyzer.feed(block, part.until_ns)
        t_ns = int(block.t_ns[-1]) if part.until_ns is None else part.until_ns
        octets, marked = len(block.data), len(block.errors)
        return self._judged(SessionStep(t_ns, self._analyzer.latest, heard=octets, marked=marked))

    def _begun_anew(self, t_ns: int, *events: PortEvent, missed: Mapping[int, int] | None = None) -> SessionStep:
        """The line is another from now on, or bytes were missed: what was certain before."""
        self._analyzer.restart(self.line, missed)
        return SessionStep(t_ns, self._analyzer.latest, list(events), missed=sum((missed or {}).values()))

    def _judged(self, step: SessionStep) -> SessionStep:
        rows = step.batch.rows
        self._source.judge(step.heard, int(rows.length.dot(rows.check)), self.line)
        return step

    def _pump(self) -> None:
        """The other thread: what the source gives, to the disk and into the queue."""
        heard_ns = None
        try:
            try:
                for item in self._source.items():
                    heard_ns = heard_until(item)
                    self._record(item)
                    self._offer(item)
                    if not (isinstance(item, Block) and self._source.more):  # a tick goes with the reads before it
                        self._hand_over()
                    self._record_marks()
                    if self._recorder is not None:
                        self._recorder.tick()
                self._tell_missed()
            finally:
                if self._recorder is not None:
                    self._recorder.close(heard_ns)
        except BaseException as error:  # raised again where the steps are taken
            self._ready.append(error)
        else:
            self._ready.append(None)
        self._hand_over()

    def _hand_over(self) -> None:
        if self._ready:
            self._queue.put(self._ready)
            self._ready = []

    def _record(self, item: Item) -> None:
        if self._recorder is None:
            return
        if isinstance(item, Block):
            self._recorder.write(item)
        elif isinstance(item, PortEvent):
            if item.kind == "settled":
                self._recorder.settings(self._source.line)
            if item.kind in _NOTED:
                self._recorder.note(Note(item.t_ns, item.kind, item.text))

    def _record_marks(self) -> None:
        while self._marks and self._recorder is not None and self._newest:
            self._recorder.note(Note(self._newest, MARK, self._marks.popleft()))

    def _offer(self, item: Item) -> None:
        """Queue it, but for bytes that the analysis is too far behind to take."""
        if isinstance(item, Block):
            with self._lock:
                while self._source.waits and self._waiting > 0 and not self._stopped:
                    self._lock.wait(_PATIENCE_S)
                room = (self._backlog // 2 if self._missed else self._backlog) - self._waiting
                full = len(item.data) > room and not self._source.waits
                self._waiting += 0 if full else len(item.data)
            if full:
                for port, octets in item.octets_by_port().items():
                    self._missed[port] = self._missed.get(port, 0) + octets
                return
            self._tell_missed(int(item.t_ns[0]))
        if isinstance(item, PortEvent) and item.kind == "settled":
            self._ready.append(_OtherLine(item, self._source.line))
        else:
            self._ready.append(item)

    def _tell_missed(self, t_ns: int = 0) -> None:
        if self._missed:
            self._ready.append(_Missed(t_ns, self._missed))
            self._missed = {}


class _StepPace:
    """Gathers more before the next step where steps are dear, as on a line full of noise or on a slow machine: part of
    what a step costs goes by the step. `begin` a step, `wait` behind it."""

    def __init__(self) -> None:
        self._mean_s = _USUAL_S
        self.begin()

    def begin(self) -> None:
        self._begun, self._ran = time.monotonic(), time.thread_time()

    def wait(self) -> None:
        took_s = min(time.thread_time() - self._ran, _ODD * self._mean_s)
        self._mean_s += (took_s - self._mean_s) / _LATELY
        left = self._begun + min(_SPARED * self._mean_s, _LONGEST_S) - time.monotonic()
        if left > 0:
            time.sleep(left)


@dataclass(frozen=True, slots=True)
class _OtherLine:
    """The line is `line` from here on; by the time that this is analysed the source may know another."""

    event: PortEvent
    line: LineSettings


@dataclass(frozen=True, slots=True)
class _Missed:
    """Bytes, by port, that were not queued before what follows."""

    t_ns: int
    octets: dict[int, int]


@dataclass(frozen=True, slots=True)
class _Heard:
    """A block, and up to when nothing came after it, where that is known."""

    block: Block
    until_ns: int | None


def _grouped(items: list[Any]) -> Iterator[Any]:
    """Items in order, blocks that follow each other as one: a listener that is behind catches up by larger steps."""
    blocks: list[Block] = []
    for item in items:
        if isinstance(item, Block):
            blocks.append(item)
        elif isinstance(item, Tick) and blocks:
            if item is items[-1]:  # else more came since
                yield _Heard(Block.joined(blocks), item.t_ns)
                blocks = []
        else:
            if blocks:
                yield _Heard(Block.joined(blocks), None)
                blocks = []
            yield item
    if blocks:
        yield _Heard(Block.joined(blocks), None)
