"""The display filter: one line with completion, checked while it is typed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, Vertical
from textual.widgets import Input, Label

from analyzer.model.filtering import Completion, compiled, completions, trouble
from analyzer.model.selection import Test

from .lines import Lines
from .messages import FilterChanged, FilterLeft, LineEntered
from .paint import Piece, fitted

_MOST = 8  # completions in sight


class Completions(Lines):
    """What could stand at the cursor, with a word of help each."""

    HEAD = 0
    can_focus = False

    def __init__(self, *, id: str) -> None:
        super().__init__(id=id)
        self.found: Sequence[Completion] = ()

    def show(self, found: Sequence[Completion]) -> None:
        """Other ones."""
        self.found = found
        self.display = bool(found)
        self.styles.height = min(_MOST, len(found))
        self.cursor = 0
        self.renewed()

    def count(self) -> int:
        return len(self.found)

    def pieces(self, line: int, width: int) -> Sequence[Piece]:
        own = self.found[line]
        return fitted([Piece(f" {own.text.strip():<20} "), Piece(own.help, "dim")], width)


class FilterInput(Input):
    """The line itself."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("tab", "complete", "Complete"),
        Binding("down", "pick(1)", "Next", show=False),
        Binding("up", "pick(-1)", "Previous", show=False),
        Binding("escape", "leave", "Leave", show=False),
    ]

    def action_complete(self) -> None:
        self.query_ancestor(FilterBar).complete()

    def action_pick(self, step: int) -> None:
        self.query_ancestor(FilterBar).pick(step)

    def action_leave(self) -> None:
        self.query_ancestor(FilterBar).leave()


class FilterBar(Vertical):
    """The line, what is wrong with it, and completions under it."""

    def __init__(self, *, id: str) -> None:
        super().__init__(id=id)
        self.text = ""  # the filter in use
        self._history: list[str] = []

    def compose(self) -> ComposeResult:
        with Horizontal(id="filter-line"):
            yield Label("Filter ", id="filter-label")
            yield FilterInput(placeholder="/ to type, e.g.  unit == 17 and exception", id="filter", compact=True)
            yield Label("", id="filter-trouble", markup=False)
        yield Completions(id="completions")

    def on_mount(self) -> None:
        self.query_one(Completions).display = False

    @property
    def line(self) -> FilterInput:
        return self.query_one(FilterInput)

    def use(self, text: str) -> None:
        """Filter by this, as if it was typed."""
        self.line.value = text
        self._use(text)

    def on_input_changed(self, event: Input.Changed) -> None:
        event.stop()
        wrong = trouble(event.value)
        self.line.set_class(wrong is not None, "-wrong")
        self._say("" if wrong is None or not event.value.strip() else f"column {wrong.column + 1}: {wrong}")
        self._suggest()

    def on_input_submitted(self, event: Input.Submitted) -> None:
        event.stop()
        if self._use(event.value):
            self.leave()

    def on_descendant_blur(self) -> None:
        self.query_one(Completions).show(())

    def on_descendant_focus(self) -> None:
        self._suggest()

    def on_line_entered(self, event: LineEntered) -> None:
        event.stop()
        self.complete()

    def _use(self, text: str) -> bool:
        text = text.strip()
        test: Test | None = None
        if text:
            wrong = trouble(text)
            if wrong is not None:
                self._say(f"column {wrong.column + 1}: {wrong}")
                self.line.cursor_position = min(wrong.column, len(text))
                return False
            test = compiled(text)
        self.text = text
        self._say("")
        self.post_message(FilterChanged(test, text))
        return True

    def _say(self, text: str) -> None:
        label = self.query_one("#filter-trouble", Label)
        label.update(Text(text, no_wrap=True, overflow="ellipsis"))
        label.display = bool(text)

    def _suggest(self) -> None:
        line = self.line
        found = completions(line.value, line.cursor_position) if line.has_focus else ()
        self.query_one(Completions).show(found)

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
            before, after = line.value[: own.start], line.value[line.cursor_position :]
            line.value = before + own.text + after
            line.cursor_position = len(before + own.text)

    def leave(self) -> None:
        """Back to the list."""
        self.query_one(Completions).show(())
        self.post_message(FilterLeft())
