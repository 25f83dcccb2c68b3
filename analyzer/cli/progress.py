"""How far long work has come: a line on a terminal with its share, count, rate and time left; silent elsewhere.

Drawn by rich, which is imported when there is something to draw: most work is over before.
"""

from __future__ import annotations

import io
import shutil
import sys
import time
from typing import Final

from dissectors.values import harmless

from ..terminal_text import TerminalText, trusted
from .terminal import coloured, places, say_in_place

_PERIOD_S: Final = 0.2
_BAR: Final = 24  # columns
_SHARE_AND_TIME: Final = 23  # columns, with what is between them
_LEAST_LABEL: Final = 12


class Progress:
    """Called as work goes on; `clear` takes the line away."""

    def __init__(self, label: str, counted: str = "frames", octets_of: str = "the line") -> None:
        self._label, self._counted, self._octets_of = label, counted, octets_of
        self._line: ProgressLine | None = None
        self._begun = time.monotonic()
        self._next = self._begun + 2 * _PERIOD_S if places(sys.stderr) else float("inf")

    def __call__(self, count: int, octets: int, share: float | None = None) -> None:
        """Say it, if the last time is long enough ago. `share` of all; else that of the files being read, if known."""
        now = time.monotonic()
        if now < self._next:
            return
        if share is None:
            from captures.files import share_read

            share = share_read()
        self._next = now + _PERIOD_S
        if self._line is None:
            self._line = ProgressLine(self._label, colour=coloured(sys.stderr), encoding=sys.stderr.encoding)
        rate = count / max(now - self._begun, 1e-3)
        words = f"{count:,} {self._counted}, {rate:,.0f}/s, {octets / 1e6:,.1f} MB of {self._octets_of}"
        say_in_place(self._line.at(share, words, now, shutil.get_terminal_size().columns - 1))

    def clear(self) -> None:
        """Take the line away."""
        if self._line is not None:
            say_in_place("")


class ProgressLine:
    """The line itself: label, bar, share, words, and the time left as the newest pace tells it."""

    def __init__(self, label: str, *, colour: bool, encoding: str | None = None) -> None:
        """`encoding` of where it is shown: the bar is of ASCII where nothing else can be."""
        from rich import progress
        from rich.console import Console
        from rich.table import Column

        def whole() -> Column:
            return Column(no_wrap=True)

        columns: list[progress.ProgressColumn] = [
            progress.TextColumn("{task.description}", markup=False, table_column=whole()),
            progress.BarColumn(_BAR),
            progress.TaskProgressColumn(table_column=whole()),
            progress.TextColumn("{task.fields[words]}", markup=False, table_column=whole()),
            progress.TimeRemainingColumn(compact=True, table_column=whole()),
            progress.TextColumn("{task.fields[left]}", style="progress.remaining", table_column=whole()),
        ]
        self._label, self._now = harmless(label), 0.0
        shown = io.TextIOWrapper(io.BytesIO(), encoding or "utf-8", errors="replace")
        self._console = Console(file=shown, force_terminal=True, no_color=not colour, highlight=False)
        self._progress = progress.Progress(
            *columns, console=self._console, auto_refresh=False, get_time=lambda: self._now
        )
        self._task = self._progress.add_task("", total=None, words="", left="")

    def at(self, share: float | None, words: str, now_s: float, columns: int) -> TerminalText:
        """How it stands at a time (s), so many columns wide at most. `share` of all, where that is known."""
        self._now = now_s
        room = max(columns - _BAR - _SHARE_AND_TIME - len(words), _LEAST_LABEL)
        label = self._label if len(self._label) <= room else f"{self._label[: room - 1]}…"
        total, left = (None, "") if share is None else (1.0, "left")
        self._progress.update(self._task, description=label, total=total, completed=share, words=words, left=left)
        self._console.width = columns
        with self._console.capture() as drawn:
            self._console.print(self._progress.get_renderable(), end="")
        return trusted(drawn.get().splitlines()[0])
