"""A session in the terminal interface: what `--tui` shows."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Final

from captures.line import LineSettings

from ..core import Analysed
from ..live.session import Session

_NOTICES: Final = 5  # the newest


class LiveSource:
    """A session as the interface's source (`analyzer.model.source.ViewSource`)."""

    live = True
    timed = True
    path: Path | None = None

    def __init__(self, session: Session, name: str) -> None:
        self.name = name
        self._session = session
        self._notices: list[str] = []
        self._missed = 0

    @property
    def line(self) -> LineSettings:
        """The line's settings, as far as they are known by now."""
        return self._session.line

    def steps(self, stop: Callable[[], bool]) -> Iterator[Analysed]:
        """Rows as they come; nothing while the line is quiet."""
        with self._session as session:
            for step in session.steps():
                self._notices += [event.text for event in step.events if event.text]
                self._missed += step.missed
                if stop():
                    session.stop()
                yield step.analysed

    def notices(self) -> Sequence[str]:
        """The newest events, and bytes that were not analysed."""
        missed = [f"{self._missed:,} bytes were not analysed live"] if self._missed else []
        return [*missed, *self._notices[-_NOTICES:]]


def show(session: Session, name: str) -> int:
    """Show a session until the user quits; the exit status."""
    from . import run

    run(LiveSource(session, name))
    return 0
