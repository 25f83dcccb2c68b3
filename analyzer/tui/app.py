"""The application: one source, one screen, two themes, and every command by name."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, ClassVar

from textual import events
from textual._compositor import CompositorUpdate
from textual.app import App, SystemCommand
from textual.binding import Binding, BindingType
from textual.color import Color
from textual.command import CommandPalette
from textual.filter import Monochrome
from textual.screen import Screen

from ..languages import error_words, tr
from ..model.bus import Bus
from ..usernotes import Notes, NotesError
from .desk import Preferences, ViewState
from .filterbar import rules_of
from .keys import key_name
from .openfiles import NextFile
from .paint import DARK, DARK_16, HARMLESS, LIGHT, LIGHT_16, Colourless
from .screen import BusScreen
from .views import VIEWS
from .wire import KeyQueue, ThinWire

if TYPE_CHECKING:
    from rich.console import RenderableType
    from textual.filter import LineFilter

    from ..model.source import ViewSource

_FEW_COLOURS = ("standard", "windows")
_NARROW = 70  # columns under which bytes stand below the fields
_BROAD = 150  # columns from which on bytes stand 16 to a line: fields need the room before
_COMMANDS = (
    ("Filter", "display filter", "filter"), ("Find", "bytes, text or a value", "find"),
    ("Go to", "a frame's number or a time", "goto"), ("Counterpart", "from request to answer and back", "counterpart"),
    ("Next finding", "what is wrong further on", "finding(1)"), ("Bookmark", "set or take away", "bookmark"),
    ("Comment", "say something of this row", "comment"), ("Time reference", "count times from this row", "reference"),
    ("Time format", "since start, UTC, since previous", "time_base"), ("Noise", "show or hide", "noise"),
    ("Copy", "bytes as hex, C, Python, command", "copy"), ("Export", "selected or shown rows to a file", "export"),
    ("Follow", "the newest frame", "follow"), ("Help", "all keys", "help"),
)  # fmt: skip


class Rtuscope(App[NextFile | None]):
    """The terminal interface."""

    TITLE = "rtuscope"
    CSS_PATH = "style.tcss"
    BINDINGS: ClassVar[list[BindingType]] = []

    def __init__(
        self, source: ViewSource, *, view: str | None = None, light: bool = False, resumed: NextFile | None = None
    ) -> None:
        super().__init__()
        self.register_theme(DARK)
        for theme in (LIGHT, DARK_16, LIGHT_16):
            self.register_theme(theme)
        self._themes = DARK, LIGHT
        self._light = light
        self.theme = self._themes[light].name
        self._trouble = ""
        try:
            notes = Notes.beside(source.path)
        except NotesError as error:
            notes, self._trouble = Notes(), error_words(error)
        wishes = Preferences.of_user()
        self._trouble = self._trouble or wishes.trouble
        self.desk = ViewState(source, Bus.of(source), notes, wishes=wishes)
        self.desk.rules = list(rules_of(self.desk))
        self._view = view
        self._resumed = resumed
        self.wire = ThinWire()
        terminals = [each.background_color for each in (self.ansi_theme_dark, self.ansi_theme_light)]
        heads = [Color.parse(each.surface).rgb for each in (DARK, LIGHT) if each.surface]
        self._colourless = Colourless([*((r, g, b) for r, g, b in terminals), *heads])
        self.keys = KeyQueue(self, super().on_event)
        self._cursor_was = self.cursor_position
        self.HORIZONTAL_BREAKPOINTS = [(0, "-slim"), (_NARROW, "-narrow"), (_BROAD, "-broad")]

    def get_line_filters(self) -> Sequence[LineFilter]:
        theirs = super().get_line_filters()
        return [*(self._colourless if isinstance(each, Monochrome) else each for each in theirs), HARMLESS]

    def get_default_screen(self) -> Screen[None]:
        return BusScreen(self.desk, self.wire, view=self._view, resumed=self._resumed)

    def _display(self, screen: Screen[object], renderable: RenderableType | None) -> None:
        """What Textual would send, as the difference from what stands there."""
        if isinstance(renderable, CompositorUpdate) and not self.is_headless and not self._batch_count:
            renderable = self.wire.thin(renderable, self.console, self.size)
            if not renderable.text and self.cursor_position == self._cursor_was:
                renderable = None
            self._cursor_was = self.cursor_position
        super()._display(screen, renderable)

    async def on_event(self, event: events.Event) -> None:
        """A key's effect is there before the next key is taken up."""
        if isinstance(event, events.Key) and not event.is_forwarded:
            await self.keys.take(event)
        else:
            await super().on_event(event)

    def on_mount(self) -> None:
        sys.setswitchinterval(0.001)  # keys are answered while a thread reads the source
        if self.is_web:
            self.desk.wishes.path = None
            self.desk.notes.path = None  # whoever has the page writes no file of this machine
        elif self.desk.source.path is not None:
            self.desk.wishes.opened(self.desk.source.path)
        self.set_keymap(self.desk.wishes.keys)
        if not self.is_headless and self.console.color_system in _FEW_COLOURS:
            self.use_16_colours()
        if self._trouble:
            self.notify(self._trouble, severity="error", markup=False)

    def action_command_palette(self) -> None:
        """Every command by name."""
        if self.use_command_palette and not isinstance(self.screen, CommandPalette):
            self.push_screen(CommandPalette(placeholder=tr("Search for commands…"), id="--command-palette"))

    def get_key_display(self, binding: Binding) -> str:
        """A key in the footer, as it stands on a keyboard."""
        return binding.key_display or key_name(binding.key.split(",")[0])

    def use_16_colours(self) -> None:
        """Those that every terminal has."""
        self._themes = DARK_16, LIGHT_16
        self.theme = self._themes[self._light].name

    def action_theme_flip(self) -> None:
        """From dark to light and back."""
        dark, light = self._themes
        self.theme = (light if self.theme == dark.name else dark).name

    def get_system_commands(self, screen: Screen[None]) -> Iterable[SystemCommand]:
        if isinstance(screen, BusScreen):
            for name, words, action in _COMMANDS:
                yield SystemCommand(
                    tr(name), tr(words), lambda action=action: self.call_later(screen.run_action, action)
                )
            for view in VIEWS:
                yield SystemCommand(
                    tr("View: {title}", title=tr(view.title)),
                    tr("show it"),
                    lambda name=view.name: screen.action_view(name),
                )
        yield SystemCommand(tr("Dark or light"), tr("change the theme"), self.action_theme_flip)
        yield SystemCommand(tr("Screenshot"), tr("an SVG picture of the screen"), self.action_screenshot)
        yield SystemCommand(tr("Quit"), tr("leave"), self.exit)
