"""What narrows the rows: span, noise, only what changed; and how it is taken back."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..languages import tr
from ..words import short
from .filterbar import FilterBar

if TYPE_CHECKING:
    from .screen import BusScreen


class Narrowing:
    """The main screen's scope, as the user narrows it."""

    def __init__(self, screen: BusScreen) -> None:
        self._screen = screen
        self._scope = screen.desk.scope

    def to_span(self, span: tuple[int, int]) -> None:
        """Only this span of time from now on."""
        self._scope.span = span
        self._say_span()
        self._screen.jobs.reselect()
        self._screen.refresh_view()

    def only_changed(self) -> None:
        """Only transactions whose answer differs from the last one to that poll; or all again."""
        scope = self._scope
        scope.only_changed = not scope.only_changed
        self._screen.jobs.reselect()
        only = tr("only what changed since the last same poll; d shows all")
        self._screen.tell(only if scope.only_changed else tr("all shown"))

    def noise(self) -> None:
        """Noise in place, or hidden."""
        scope = self._scope
        scope.hide_noise = not scope.hide_noise
        self._screen.jobs.reselect()
        self._screen.tell(tr("noise hidden; z shows it") if scope.hide_noise else tr("noise shown in place"))

    def take_back(self) -> None:
        """Take back what narrows the list: the selection, then filter and span."""
        screen, scope = self._screen, self._scope
        if screen.picked.anchor is not None:
            screen.picked.drop()
        elif scope.filter is not None:
            screen.query_one(FilterBar).use("")
        elif scope.span is not None:
            scope.span = None
            screen.jobs.reselect()
        self._say_span()
        screen.panes.all[0].focus()

    def _say_span(self) -> None:
        """The span stands on the scope's line, beside the filter."""
        span, desk = self._scope.span, self._screen.desk
        words = ""
        if span is not None:
            words = f"{desk.when(span[0])} + {short(span[1] - span[0])}, {tr('Esc removes it')}"
        self._screen.query_one(FilterBar).say_span(words)
