"""What narrows the rows: span, noise, only what changed, and how it is taken back.

Every cell is a door: what stands under the cursor is filtered to, filtered out, added to the filter, followed.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from ..languages import tr
from ..model.search import for_test
from ..model.selection import compiled
from .filterbar import FilterBar
from .prompts import Choose
from .view import DoorCell
from .views import BY_NAME

if TYPE_CHECKING:
    from .screen import BusScreen

_WIDE: Final = 110  # columns from which on there is room to say how the span is taken back


class Narrowing:
    """The main screen's scope, as the user narrows it."""

    def __init__(self, screen: BusScreen) -> None:
        self._screen = screen
        self._scope = screen.desk.scope

    def to_span(self, span: tuple[int, int]) -> None:
        """Only this span of time from now on."""
        self._scope.span = span
        self.write_scope()
        self._screen.jobs.reselect()
        self._screen.refresh_view()

    def only_changed(self) -> None:
        """Only transactions whose answer differs from the last one to that poll; or all again."""
        scope = self._scope
        scope.only_changed = not scope.only_changed
        self.write_scope()
        self._screen.jobs.reselect()

    def noise(self) -> None:
        """Noise in place, or hidden."""
        scope = self._scope
        scope.hide_noise = not scope.hide_noise
        self.write_scope()
        self._screen.jobs.reselect()
        self._screen.notify_of(tr("noise hidden; z shows it") if scope.hide_noise else tr("noise shown in place"))

    def take_back(self) -> None:
        """Take back what narrows the list: the selection, then filter and span; nothing where none of it is shown."""
        screen, scope = self._screen, self._scope
        if not BY_NAME[screen.view].filtered:
            return  # keys that leave a field to type in would lead back into it
        if screen.picked.anchor is not None:
            screen.picked.drop()
        elif scope.filter is not None:
            screen.query_one(FilterBar).use_filter("")
        elif scope.span is not None:
            scope.span = None
            screen.jobs.reselect()
        self.write_scope()
        screen.panes.all[0].focus()

    def write_scope(self) -> None:
        """What narrows the rows stands on the scope's line, beside the filter."""
        scope, desk = self._scope, self._screen.desk
        words = [] if scope.span is None else [desk.span_words(scope.span)]
        if scope.only_changed:
            words.append(tr("changed only (d)"))
        if scope.hide_noise:
            words.append(tr("no noise (z)"))
        if scope.span is not None and scope.filter is None and self._screen.size.width >= _WIDE:
            words[0] += f" ({tr('Esc removes it')})"
        self._screen.query_one(FilterBar).say_scope("  ".join(words))


_ASKS: Final = {"=": "Filter to", "!": "Filter out", "&": "Add with and", "|": "Add with or", ".": "Go to the next of"}


class Doors:
    """The main screen's doors."""

    def __init__(self, screen: BusScreen) -> None:
        self._screen = screen

    async def go_through(self, sign: str) -> None:
        """Ask for a cell of the line where there are several, and go through it."""
        screen = self._screen
        cells = BY_NAME[screen.view].cells(screen)
        if not cells:
            screen.notify_of(tr("nothing under the cursor to filter by"))
            return
        which: int | None = 0
        if len(cells) > 1:
            which = await screen.app.push_screen_wait(
                Choose(tr(_ASKS[sign]), [(cell.key, cell.words) for cell in cells])
            )
        if which is not None:
            self._through(sign, cells[which])

    def _through(self, sign: str, cell: DoorCell) -> None:
        screen = self._screen
        bar = screen.query_one(FilterBar)
        old, text = bar.text, cell.text
        if sign == ".":
            screen.jumps.find_by(
                cell.words, for_test(compiled(text, screen.desk.bus.line, screen.desk.meanings.charts).test)
            )
        elif sign == "=":
            bar.use_filter(text)
        elif sign == "!":
            bar.use_filter(f"{_grouped(old)} and not ({text})" if old else f"not ({text})")
        else:
            word = "and" if sign == "&" else "or"
            bar.prepare(f"{_grouped(old)} {word} {_grouped(text)}" if old else text)


def _grouped(text: str) -> str:
    """A filter that can be joined to another."""
    return f"({text})" if " and " in text or " or " in text else text
