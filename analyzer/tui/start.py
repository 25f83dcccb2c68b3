"""The start screen: one line that takes bytes, a file or a port, and below it what is at hand.

It gives what was chosen; whoever shows it decides what that asks for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from rich.text import Text
from textual import events
from textual.app import App, ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Vertical
from textual.screen import Screen
from textual.widgets import Input, Label

from ..languages import tr
from .lines import Lines
from .messages import LineEntered
from .paint import DARK, HARMLESS, LIGHT, StyledText, fitted
from .viewer import reading_any_byte, shown

if TYPE_CHECKING:
    from textual.driver import Driver
    from textual.filter import LineFilter


@dataclass(frozen=True, slots=True)
class AtHand:
    """Something to begin with: `kind` is what it is, in a word; `noun` is typed for it; `words` say more."""

    kind: str
    noun: str
    words: str = ""


class NounInput(Input):
    """The line; a paste of several lines is taken whole."""

    BINDINGS: ClassVar[list[BindingType]] = [Binding("down", "app.focus_next", show=False)]

    def on_paste(self, event: events.Paste) -> None:
        if "\n" in event.text.strip():
            event.prevent_default()
            event.stop()
            self.app.exit(event.text)


class HandList(Lines):
    """What is at hand."""

    HEAD = 0
    EMPTY = "no serial port and no recent capture here"

    def __init__(self, things: Sequence[AtHand], *, id: str) -> None:
        super().__init__(id=id)
        self.things = things

    def count(self) -> int:
        return len(self.things)

    def pieces(self, line: int, width: int) -> Sequence[StyledText]:
        thing = self.things[line]
        parts = [StyledText(f"  {tr(thing.kind):<9}", "dim"), StyledText(thing.noun)]
        return fitted([*parts, StyledText(f"  {thing.words}", "dim")], width)


class StartScreen(Screen[None]):
    """The line on top, the list below."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("escape,ctrl+q", "app.quit", "Quit"),
        Binding("f1", "help", "Help", show=False),
    ]

    def __init__(self, things: Sequence[AtHand], wrong: str = "") -> None:
        super().__init__()
        self._things, self._wrong = things, wrong

    def compose(self) -> ComposeResult:
        yield Label(Text.assemble(("rtuscope  ", "bold"), tr("what is wrong with a Modbus RTU bus")), id="start-title")
        yield Label(Text(tr("Paste bytes, or type a capture's name or a port, then press Enter:")), id="start-ask")
        yield NounInput(placeholder="11 03 00 6B 00 03 76 87", id="start-noun", compact=True)
        yield Label(Text(self._wrong), id="start-wrong")
        with Vertical(id="start-below"):
            yield Label(Text(tr("At hand (↓, then Enter):")), id="start-hand")
            yield HandList(self._things, id="hand")
        yield Label(Text(tr("Enter starts · Esc quits · rtuscope --help lists all commands")), id="start-keys")

    def on_mount(self) -> None:
        self.query_one(NounInput).focus()

    def on_input_submitted(self, event: Input.Submitted) -> None:
        event.stop()
        if event.value.strip():
            self.app.exit(event.value)

    def on_line_entered(self, event: LineEntered) -> None:
        event.stop()
        self.app.exit(self._things[event.line].noun)


class StartApp(App[str]):
    """The screen alone."""

    TITLE = "rtuscope"
    CSS_PATH = "style.tcss"
    ENABLE_COMMAND_PALETTE = False

    def __init__(self, things: Sequence[AtHand], *, light: bool = False, wrong: str = "") -> None:
        super().__init__()
        self.register_theme(DARK)
        self.register_theme(LIGHT)
        self.theme = (LIGHT if light else DARK).name
        self._things, self._wrong = things, wrong

    def get_driver_class(self) -> type[Driver]:
        return reading_any_byte(super().get_driver_class())

    def get_line_filters(self) -> Sequence[LineFilter]:
        return [*super().get_line_filters(), HARMLESS]

    def get_default_screen(self) -> Screen[None]:
        return StartScreen(self._things, self._wrong)


def begin(things: Sequence[AtHand], wrong: str = "") -> str | None:
    """What the user typed, pasted or chose; None where they left. `wrong`: why the last choice could not be used."""
    return shown(StartApp(things, wrong=wrong))
