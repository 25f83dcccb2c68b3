"""Small questions on top of everything: a line of text, or one of several things."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Vertical
from textual.screen import ModalScreen
from textual.widgets import Input, Label

from ..languages import error_words, tr
from .lines import Lines
from .messages import LineEntered
from .paint import StyledText, fitted

if TYPE_CHECKING:
    from .screen import BusScreen


class Ask(ModalScreen[str | None]):
    """A line of text; `wrong` says what is the matter with it, or "" where nothing is."""

    BINDINGS: ClassVar[list[BindingType]] = [Binding("escape", "dismiss(None)", "Cancel", show=False)]

    def __init__(
        self,
        question: str,
        hint: str,
        *,
        value: str = "",
        wrong: Callable[[str], str] = lambda _: "",
        understood: Callable[[str], str] | None = None,
        selected: bool = True,
    ) -> None:
        """`understood`: what a text means, told in the hint's place while it is typed."""
        super().__init__()
        self._question, self._hint, self._value, self._wrong = question, hint, value, wrong
        self._understood, self._selected = understood, selected

    def compose(self) -> ComposeResult:
        with Vertical(classes="prompt"):
            yield Label(Text(self._question), classes="question")
            yield Input(value=self._value, id="answer", compact=True, select_on_focus=self._selected)
            yield Label(Text(self._hint), id="hint")

    def on_input_changed(self, event: Input.Changed) -> None:
        if self._understood is not None:
            self._hint = self._understood(event.value)
        self._say("")

    def on_input_submitted(self, event: Input.Submitted) -> None:
        event.stop()
        try:
            wrong = self._wrong(event.value)
        except (OSError, ValueError) as error:  # no name that a file can have
            wrong = error_words(error)
        if wrong:
            self._say(wrong)
        else:
            self.dismiss(event.value)

    def _say(self, wrong: str) -> None:
        hint = self.query_one("#hint", Label)
        hint.set_class(bool(wrong), "-wrong")
        hint.update(Text(wrong or self._hint))


class Choices(Lines):
    """What can be chosen."""

    HEAD = 0

    def __init__(self, choices: Sequence[tuple[str, str]]) -> None:
        super().__init__(id="choices")
        self.choices = choices

    def count(self) -> int:
        return len(self.choices)

    def pieces(self, line: int, width: int) -> Sequence[StyledText]:
        key, words = self.choices[line]
        return fitted([StyledText(f" {key} ", "accent"), StyledText(f" {words}")], width)


class Choose(ModalScreen[int | None]):
    """One of several things, by cursor or by its key; gives its number."""

    BINDINGS: ClassVar[list[BindingType]] = [Binding("escape", "dismiss(None)", "Cancel", show=False)]

    def __init__(self, question: str, choices: Sequence[tuple[str, str]], *, at: int = 0) -> None:
        """`at`: the choice that the cursor begins on."""
        super().__init__()
        self._question, self._choices, self._at = question, choices, at

    def compose(self) -> ComposeResult:
        with Vertical(classes="prompt"):
            yield Label(Text(self._question), classes="question")
            choices = Choices(self._choices)
            choices.styles.height = len(self._choices)
            yield choices

    def on_mount(self) -> None:
        choices = self.query_one(Choices)
        choices.cursor = self._at
        choices.focus()

    def on_key(self, event: object) -> None:
        key = getattr(event, "character", None)
        for number, (own, _) in enumerate(self._choices):
            if key == own:
                event.stop()  # type: ignore[attr-defined]
                self.dismiss(number)

    def on_line_entered(self, event: LineEntered) -> None:
        event.stop()
        self.dismiss(event.line)


def typed_path(text: str) -> Path:
    """A path as a user writes it; `~name` of nobody is a name like any other."""
    return Path(os.path.expanduser(text))  # noqa: PTH111 - pathlib's raises where there is no such user


def names_file(path: Path) -> bool:
    """Whether a file is there; not where a path cannot be one: too long, with a NUL."""
    return os.path.isfile(path)  # noqa: PTH113 - pathlib's raises then


def names_folder(path: Path) -> bool:
    """The same of a folder."""
    return os.path.isdir(path)  # noqa: PTH112


async def may_write(screen: BusScreen, path: Path) -> bool:
    """Whether a file may be written: one that is there is asked about. A browser downloads what it gets."""
    if screen.app.is_web or not os.path.lexists(path):  # False where that is no name of a file: writing tells why
        return True
    choices = [("n", tr("keep it")), ("o", tr("overwrite it"))]
    if await screen.app.push_screen_wait(Choose(tr("{file} already exists", file=path.name), choices)):
        return True
    screen.notify_of(tr("{file} left unchanged", file=path.name))
    return False
