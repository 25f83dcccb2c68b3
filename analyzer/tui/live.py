"""A session in the terminal interface: what `--tui` shows."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final, Protocol

from captures.line import LineSettings
from captures.recording.notes import Note

from ..core import Analysed
from ..languages import counted, retold, tr
from ..live.conditions import Fired, LiveTrigger
from ..live.session import Session
from ..live.status import LineStatus, recording_words
from ..model.source import Grave
from ..outages import Deaf, deaf_times
from ..words import percent, shortened

if TYPE_CHECKING:
    from dissectors.maps.files import UnitMaps

    from ..live.session import SessionStep

_NOTICES: Final = 5  # the newest
_TRIGGER: Final = 24  # columns of what the bus is watched for
_BAD: Final = frozenset({"lost", "failed", "gap"})  # events that mean a loss


class RecordingState(Protocol):
    """What is known of a recording (`captures.recording.recorder.Recorder`)."""

    bytes: int
    lost: int

    @property
    def path(self) -> Path | None: ...

    @property
    def paused(self) -> bool: ...


class LiveSource:
    """A session as the interface's source (`analyzer.model.source.ViewSource`)."""

    live = True
    timed = True
    path: Path | None = None
    trigger: LiveTrigger | None = None

    def __init__(
        self,
        session: Session,
        name: str,
        recording: RecordingState | None = None,
        trigger: Callable[[str, UnitMaps | None], LiveTrigger] = LiveTrigger,
    ) -> None:
        """`trigger` makes what the bus is watched for."""
        self.name = name
        self.recording = recording
        self._session = session
        self._notices: list[str] = []
        self._missed = 0
        self._gone: set[int] = set()  # ports that are away
        self._status = LineStatus(session.line)
        self._outages: list[Note] = []  # when nothing was received
        self._new_trigger = trigger
        self._fired: deque[Fired] = deque()  # triggers that were not told yet

    @property
    def line(self) -> LineSettings:
        """The line's settings, as far as they are known by now."""
        return self._session.line

    def steps(self, stop: Callable[[], bool]) -> Iterator[Analysed]:
        """Rows as they come; nothing while the line is quiet."""
        with self._session as session:
            for step in session.steps():
                for event in step.events:
                    text = retold(event.text)
                    if text:
                        self._notices.append(Grave(text) if event.kind in _BAD else text)
                    if event.kind in _BAD | {"opened"}:
                        self._outages.append(Note(event.t_ns, event.kind, text))
                    if event.kind == "lost":
                        self._gone.add(event.port)
                    elif event.kind == "opened":
                        self._gone.discard(event.port)
                self._missed += step.missed
                self._status.line = session.line
                self._status.feed(step)
                self._watch(step)
                if stop():
                    session.stop()
                yield step.analysed

    def watch(self, text: str, charts: UnitMaps | None = None) -> None:
        """What to watch the bus for from now on, nothing where that is empty. FilterError."""
        self.trigger = self._new_trigger(text, charts) if text else None

    def _watch(self, step: SessionStep) -> None:
        for fired in self.trigger.feed(step, self._session.line) if self.trigger is not None else ():
            self._session.mark(tr("trigger: {words}", words=fired.text))
            self._fired.append(fired)

    def fired(self) -> Iterator[Fired]:
        """What triggered since this was asked last."""
        while self._fired:
            yield self._fired.popleft()

    def notices(self) -> Sequence[str]:
        """The newest events, and bytes that were not analysed."""
        missed = (
            [Grave(tr("{bytes} not analysed", bytes=counted(self._missed, "byte", "bytes")))] if self._missed else []
        )
        return [*missed, *self._notices[-_NOTICES:]]

    @property
    def deaf(self) -> Sequence[Deaf]:
        """Times in which nothing was received."""
        return deaf_times(self._outages)

    def mark(self, text: str) -> bool:
        """A note of the user's into the recording; False where nothing is recorded."""
        return self._session.mark(text)

    @property
    def gone(self) -> bool:
        """Whether nothing can be heard: the adapter is away."""
        return bool(self._gone)

    def state(self) -> list[tuple[str, str]]:
        """How the session does, in words that stay on the screen, each with its kind."""
        words: list[tuple[str, str]] = []
        if self.gone:
            words.append((tr("UNPLUGGED"), "error"))
        record = self.recording
        if record is None:
            words.append((tr("not recorded"), "dim"))
        else:
            name, paused = "" if record.path is None else record.path.name, record.paused
            words.append((recording_words(record.bytes, paused=paused, name=name), "error" if paused else "good"))
            if record.lost:
                words.append((tr("LOST {bytes}", bytes=counted(record.lost, "byte", "bytes")), "error"))
        if self._missed:
            words.append((tr("{bytes} not analysed", bytes=counted(self._missed, "byte", "bytes")), "error"))
        if (trigger := self.trigger) is not None:
            text = shortened(trigger.text, _TRIGGER)
            told = tr("trigger {words}: {count}", words=text, count=trigger.count)
            words.append((told, "warning" if trigger.count else "dim"))
        load = self._status.load
        rate = tr("{rate:.0f} frames/s", rate=self._status.frames_per_s)
        words.append((rate + ("" if load is None else f", {tr('load {share}', share=percent(load))}"), ""))
        return words


def show_live(source: LiveSource, charts: UnitMaps | None = None) -> int:
    """Show a session until the user quits; the exit status. `charts`: what registers are called."""
    from . import run

    run(source, view="polls", charts=None if charts is None else charts.of)
    return 0
