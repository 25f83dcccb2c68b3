"""The display filter: one line with completion, checked while it is typed; and the filters that the user keeps.

Those are used by name, lit in the lists by colour, a row each in the timeline.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, ClassVar

from rich.cells import cell_len
from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, Vertical
from textual.widgets import Input, Label

from captures.line import LineSettings
from dissectors.maps.files import UnitMaps

from ..filters import Completion, FilterError, check, complete
from ..languages import tr
from ..model.selection import compiled
from ..settings import COLOURS
from .desk import KeptFilter, Preferences
from .lines import Lines
from .messages import FilterChanged, FilterLeft, LineEntered
from .paint import StyledText, fitted
from .prompts import Ask, Choose

if TYPE_CHECKING:
    from ..model.selection import Test
    from .desk import ViewState
    from .screen import BusScreen

_MOST = 8  # completions in sight
_HINTS = ("/ to type, e.g.  unit == 17 and exception", "/ to type, e.g.  unit == 17", "/ to type")


class Completions(Lines):
    """What could stand at the cursor, with a word of help each."""

    HEAD = 0
    can_focus = False

    def __init__(self, *, id: str) -> None:
        super().__init__(id=id)
        self.found: Sequence[Completion] = ()

    def show_completions(self, completions: Sequence[Completion]) -> None:
        """Other ones."""
        self.found = completions
        self.display = bool(completions)
        self.styles.height = min(_MOST, len(completions))
        self.cursor = 0
        self.renewed()

    def count(self) -> int:
        return len(self.found)

    def pieces(self, line: int, width: int) -> Sequence[StyledText]:
        own = self.found[line]
        return fitted([StyledText(f" {own.text.strip():<20} "), StyledText(own.help, "dim")], width)


class FilterInput(Input):
    """The line itself."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("tab", "complete", "Complete"),
        Binding("enter", "submit", "Use", tooltip="Filter by it; a word that was only begun is completed"),
        Binding("down", "pick(1)", "Next", show=False),
        Binding("up", "pick(-1)", "Previous", show=False),
        Binding("ctrl+up", "past(-1)", "Past filters", show=False),
        Binding("ctrl+down", "past(1)", "Newer", show=False),
        Binding("escape", "leave", "Leave", tooltip="Back to the list; the filter in use stays"),
        Binding("f1", "screen.help", "Help"),
    ]

    def on_resize(self) -> None:
        hints = [tr(each) for each in _HINTS]
        self.placeholder = next((hint for hint in hints if cell_len(hint) < self.size.width), "")

    def action_past(self, step: int) -> None:
        self.query_ancestor(FilterBar).recall(step)

    def action_complete(self) -> None:
        self.query_ancestor(FilterBar).complete()

    def action_pick(self, step: int) -> None:
        if self.query_ancestor(FilterBar).recalled(self.value) or (step < 0 and not self.value):
            self.action_past(step)
            return
        self.query_ancestor(FilterBar).pick(step)

    def action_leave(self) -> None:
        self.query_ancestor(FilterBar).leave()


class FilterBar(Vertical):
    """The line, what is wrong with it, and completions under it."""

    def __init__(
        self,
        speaks: LineSettings,
        wishes: Preferences,
        charts: Callable[[], UnitMaps] = UnitMaps,
        *,
        id: str,
    ) -> None:
        """`charts` gives what registers mean as maps of units, whose names a filter may have."""
        super().__init__(id=id)
        self.text = ""  # the filter in use
        self._speaks = speaks
        self._wishes = wishes
        self._charts = charts
        self._back = 0  # how many past filters ago

    @property
    def _maps(self) -> UnitMaps:
        return self._charts()

    def compose(self) -> ComposeResult:
        with Horizontal(id="filter-line"):
            yield Label(tr("Filter "), id="filter-label")
            yield FilterInput(id="filter", compact=True)
            yield Label("", id="filter-scope", markup=False)
        with Vertical(id="filter-below"):
            yield Label("", id="filter-trouble", markup=False)
            yield Completions(id="completions")

    def on_mount(self) -> None:
        self.query_one(Completions).display = False

    @property
    def line(self) -> FilterInput:
        return self.query_one(FilterInput)

    def use_filter(self, text: str) -> None:
        """Filter by this, as if it was typed."""
        self.line.value = text
        self._use(text)

    def recalled(self, text: str) -> bool:
        """Whether a text is a past filter as it came into the line."""
        return bool(self._back) and text == self._wishes.past[-self._back]

    def recall(self, step: int) -> None:
        """A past filter into the line: the one before, or the one after."""
        past = self._wishes.past
        self._back = max(0, min(len(past), self._back - step))
        self.line.value = past[-self._back] if self._back else ""
        self.line.cursor_position = len(self.line.value)

    def prepare(self, text: str) -> None:
        """Put a text into the line, to be gone on with."""
        self.line.value = text
        self.line.focus()
        self.line.cursor_position = len(text)

    def on_input_changed(self, event: Input.Changed) -> None:
        event.stop()
        wrong = check(event.value, self._speaks, self._maps)
        self.line.set_class(wrong is not None, "-wrong")
        self._suggest()
        self._say("" if wrong is None or self._goes_on else str(wrong))

    @property
    def _goes_on(self) -> bool:
        """Whether what is typed may still become a word that is listed below."""
        line, shown = self.line, self.query_one(Completions).found
        return bool(shown and _begun(line.value[: line.cursor_position], shown[0].text))

    def on_input_submitted(self, event: Input.Submitted) -> None:
        """Use it; a word that was only begun is the one picked below."""
        event.stop()
        if check(event.value, self._speaks, self._maps) is not None and self._goes_on:
            self.complete()
        if self._use(self.line.value):
            self.leave()

    def on_descendant_blur(self) -> None:
        self.set_class(False, "-typing")
        self.query_one(Completions).show_completions(())

    def on_descendant_focus(self) -> None:
        self.set_class(True, "-typing")
        self._suggest()

    def on_line_entered(self, event: LineEntered) -> None:
        event.stop()
        self.complete()

    def _use(self, text: str) -> bool:
        text = text.strip()
        try:
            wanted = compiled(text, self._speaks, self._maps) if text else None
        except FilterError as error:
            self._say(str(error))
            self.line.cursor_position = min(error.column, len(text))
            return False
        self.text, self._back = text, 0
        if text:
            self._wishes.used(text)
        self._say("")
        self.post_message(FilterChanged(wanted))
        return True

    def _say(self, text: str) -> None:
        label = self.query_one("#filter-trouble", Label)
        label.update(Text(text, no_wrap=True, overflow="ellipsis"))
        label.display = bool(text)

    def say_scope(self, words: str) -> None:
        """What narrows the rows besides the filter."""
        label = self.query_one("#filter-scope", Label)
        label.update(Text(words, no_wrap=True, overflow="ellipsis"))
        label.set_class(bool(words), "-said")

    def _suggest(self) -> None:
        line = self.line
        completions = complete(line.value, line.cursor_position) if line.has_focus else ()
        self.query_one(Completions).show_completions(completions)

    def pick(self, step: int) -> None:
        """Another completion."""
        shown = self.query_one(Completions)
        if shown.found:
            shown.move_to(shown.cursor + step)

    def complete(self) -> None:
        """Put the picked completion into the line."""
        shown = self.query_one(Completions)
        if shown.found:
            line, own = self.line, shown.found[shown.cursor]
            before, after = line.value[: line.cursor_position], line.value[line.cursor_position :]
            before = before[: len(before) - len(_begun(before, own.text))]
            line.value = before + own.text + after
            line.cursor_position = len(before + own.text)

    def leave(self) -> None:
        """Back to the list; the line says again what is in use."""
        if self.line.value.strip() != self.text:
            self.line.value = self.text
        self.query_one(Completions).show_completions(())
        self.post_message(FilterLeft())


def _begun(typed: str, word: str) -> str:
    """The end of what was typed that `word` goes on from."""
    for size in range(min(len(typed), len(word)), 0, -1):
        if word[:size].casefold() == typed[-size:].casefold():
            return typed[-size:]
    return ""


_SHOWN = 9  # of the user's own, and of the settings files' as many
_KEYS = "123456789abcefghij"


class KeptFilters:
    """The main screen's kept filters."""

    def __init__(self, screen: BusScreen) -> None:
        self._screen = screen

    async def choose(self) -> None:
        """Use one, keep the one in use, drop one."""
        screen = self._screen
        wishes, ask = screen.desk.wishes, screen.app.push_screen_wait
        bar = screen.query_one(FilterBar)
        own = wishes.filters[:_SHOWN]
        shown = [*own, *wishes.presets][: 2 * _SHOWN]
        choices = [(_KEYS[i], _entry_words(entry)) for i, entry in enumerate(shown)]
        choices += [("k", tr("save the current filter: {filter}", filter=bar.text))] if bar.text else []
        choices += [("d", tr("drop one"))] if own else []
        if not choices:
            screen.notify_of(tr("no saved filters yet: apply one, then press S"))
            return
        which = await ask(Choose(tr("Kept filters"), choices))
        if which is None:
            return
        if which < len(shown):
            bar.use_filter(shown[which].text)
        elif choices[which][0] == "k":
            await self._keep(bar.text)
        else:
            gone = await ask(Choose(tr("Drop"), choices[: len(own)]))
            if gone is not None:
                wishes.drop(own[gone].name)
        self._again()

    async def _keep(self, text: str) -> None:
        hint = tr("a name; add a colour to highlight its rows: {colours}", colours=", ".join(COLOURS))
        answer = await self._screen.app.push_screen_wait(Ask(tr("Keep as"), hint, wrong=_no_name))
        if answer is None:
            return
        name, _, colour = answer.strip().rpartition(" ")
        if colour not in COLOURS or not name:
            name, colour = answer.strip(), ""
        self._screen.desk.wishes.keep(KeptFilter(name, text, colour))

    def _again(self) -> None:
        """Colours are others now."""
        self._screen.desk.rules = list(rules_of(self._screen.desk))
        self._screen.repaint_lists()
        self._screen.refresh_view()


def rules_of(desk: ViewState) -> Iterator[tuple[Test, str]]:
    """Kept filters with a colour and the settings' rules, as tests with the kind (`paint.INKS`) of their rows."""
    for entry in (*desk.wishes.filters, *desk.wishes.presets):
        if entry.colour:
            try:
                yield compiled(entry.text, desk.source.line, desk.meanings.charts).test, f"tint-{entry.colour}"
            except FilterError:
                continue  # kept for captures with a map, or by another version


def kept_tests(desk: ViewState) -> Iterator[tuple[str, Test]]:
    """All of them, by name."""
    for entry in desk.wishes.filters:
        try:
            yield entry.name, compiled(entry.text, desk.source.line, desk.meanings.charts).test
        except FilterError:
            continue


def _entry_words(entry: KeptFilter) -> str:
    return f"{entry.name}: {entry.text}" + (f" ({entry.colour})" if entry.colour not in ("", entry.name) else "")


def _no_name(text: str) -> str:
    return "" if text.strip() else tr("a name is needed")
