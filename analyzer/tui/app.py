"""The application: one source, one screen, two themes, and every command by name."""

from __future__ import annotations

import asyncio
import gc
import os
import sys
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from textual import events
from textual._compositor import CompositorUpdate
from textual.app import App, ComposeResult, ScreenStackError, SystemCommand
from textual.await_complete import AwaitComplete
from textual.binding import Binding, BindingType
from textual.color import Color
from textual.command import CommandList, CommandPalette
from textual.driver import Driver
from textual.filter import Monochrome
from textual.screen import ModalScreen, Screen
from textual.widgets import Input, TextArea

from dissectors.values import harmless

from ..failures import Failures
from ..languages import error_words, tr
from ..model.bus import Bus
from ..model.scope import Scope
from ..model.source import CaptureSource
from ..usernotes import Notes, NotesError
from .desk import Preferences, ViewState
from .filterbar import rules_of
from .keyqueue import CLICKS, KeyQueue, put_question
from .keys import command_name, commands, key_name, keys_written
from .openfiles import NextFile
from .paint import DARK, DARK_16, HARMLESS, LIGHT, LIGHT_16, Colourless
from .prompts import Choose
from .screen import BusScreen
from .viewer import ending_with_its_server, heed_lost_terminal, heed_signals, reading_any_byte
from .wire import ThinWire

if TYPE_CHECKING:
    from rich.console import RenderableType
    from textual.filter import LineFilter

    from ..model.source import ViewSource

_FEW_COLOURS = ("standard", "windows")
_LONG_S = 8.0  # for words that say why nothing happened
_NARROW = 70  # columns under which bytes stand below the fields
_BROAD = 150  # columns from which on bytes stand 16 to a line: fields need the room before


class CommandHits(CommandList, can_focus=False):
    """The commands that were found."""

    def on_click(self, event: events.Click) -> None:
        """What was pointed at may be gone by now, of which Textual's own handler knows nothing."""
        pointed = event.style.meta.get("option")
        if pointed is not None and pointed >= self.option_count:
            event.prevent_default()


class CommandSearch(CommandPalette):
    """Every command by name."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("pagedown", "page('down')", "Next page", show=False),
        Binding("pageup", "page('up')", "Previous page", show=False),
    ]

    def compose(self) -> ComposeResult:
        for widget in super().compose():
            yield CommandHits() if isinstance(widget, CommandList) else widget

    def dismiss(self, result: Any = None) -> AwaitComplete:
        """Once: a second click beside it, or on a command, comes when it is gone already."""
        return super().dismiss(result) if self.is_current else AwaitComplete()

    def action_page(self, way: str) -> None:
        """A page further; nowhere while the list has not been laid out, of which Textual's own action knows nothing."""
        with suppress(LookupError):
            getattr(self.query_one(CommandList), f"action_page_{way}")()


class Rtuscope(App[None]):
    """The terminal interface. Every way out of it, and to another file, goes by `leave`."""

    TITLE = "rtuscope"
    CSS_PATH = "style.tcss"
    DEFAULT_MODE = "source 0"  # one a source: screens of the one before go all at once
    BINDINGS: ClassVar[list[BindingType]] = []

    def __init__(
        self,
        source: ViewSource,
        *,
        view: str | None = None,
        light: bool = False,
        reader: Callable[[Path], ViewSource] | None = None,
    ) -> None:
        """`reader` opens a file when the user wants another one, or the same anew."""
        super().__init__()
        self.animation_level = "none"  # each step of one would be painted, and sent
        self.register_theme(DARK)
        for theme in (LIGHT, DARK_16, LIGHT_16):
            self.register_theme(theme)
        self._themes = DARK, LIGHT
        self._light = light
        self.theme = self._themes[light].name
        self.reader = reader or capture_source
        self._leaving = self._asking = False
        self._then: list[NextFile | None] = []  # where to once one is there: one place at most
        notes, trouble = _notes_of(source)
        wishes = Preferences.of_user()
        self._trouble = trouble or wishes.trouble
        self.desk = ViewState(source, Bus.of(source), notes, wishes=wishes)
        self.desk.rules = list(rules_of(self.desk))
        self._sources = 0  # shown before this one
        self.wire = ThinWire()
        self.add_mode(self.DEFAULT_MODE, partial(BusScreen, self.desk, self.wire, view=view))
        terminals = [each.background_color for each in (self.ansi_theme_dark, self.ansi_theme_light)]
        heads = [Color.parse(each.surface).rgb for each in (DARK, LIGHT) if each.surface]
        self._colourless = Colourless([*((r, g, b) for r, g, b in terminals), *heads])
        self.keys = KeyQueue(self, super().on_event)
        self._cursor_was = self.cursor_position
        self.HORIZONTAL_BREAKPOINTS = [(0, "-slim"), (_NARROW, "-narrow"), (_BROAD, "-broad")]

    def get_driver_class(self) -> type[Driver]:
        driver = reading_any_byte(super().get_driver_class())
        return ending_with_its_server(driver) if "TEXTUAL_DRIVER" in os.environ else driver

    def get_line_filters(self) -> Sequence[LineFilter]:
        theirs = super().get_line_filters()
        return [*(self._colourless if isinstance(each, Monochrome) else each for each in theirs), HARMLESS]

    def _display(self, screen: Screen[object], renderable: RenderableType | None) -> None:
        """What Textual would send, as the difference from what stands there."""
        if isinstance(renderable, CompositorUpdate) and not self.is_headless and not self._batch_count:
            renderable = self.wire.thin(renderable, self.console, self.size)
            if not renderable.text and self.cursor_position == self._cursor_was:
                renderable = None
            self._cursor_was = self.cursor_position
        super()._display(screen, renderable)

    def clear_selection(self) -> None:
        """Nothing is selected before there is a screen: from Python 3.12 on a field to type in is made that early."""
        with suppress(ScreenStackError):
            super().clear_selection()

    async def on_event(self, event: events.Event) -> None:
        """A key's effect is there before the next key, or click, is taken up."""
        if isinstance(event, events.Key) and not event.is_forwarded:
            await self.keys.take_key(event)
            return
        if isinstance(event, CLICKS) and not event.is_forwarded:
            await self.keys.take_click(event)
            return
        await super().on_event(event)
        if isinstance(event, events.Resize):
            self._redraw()

    def _redraw(self) -> None:
        """The terminal has another size, or had one for a moment: nobody knows what it shows."""
        self.wire.forget()
        with suppress(ScreenStackError):
            self.screen.refresh()

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
        if not (self.is_headless or self.is_web):
            heed_lost_terminal(self)
            heed_signals(self)
        self._tell_trouble()

    def exit(self, *result: Any, **more: Any) -> None:
        """End. Keys that wait would find no screen any more."""
        self.keys.close()
        self._end_jobs()
        super().exit(*result, **more)

    def _end_jobs(self) -> None:
        with suppress(ScreenStackError):  # it has not begun, or has ended already
            for screen in self.screen_stack:
                if isinstance(screen, BusScreen):
                    screen.jobs.end()

    def _tell_trouble(self) -> None:
        if self._trouble:
            self.notify(self._trouble, severity="error", markup=False)

    # Leaving, and coming back

    async def action_quit(self) -> None:
        self.leave()

    def action_help_quit(self) -> None:
        """Ctrl+C: no way out of its own, it names the one there is."""
        typing = isinstance(self.focused, Input | TextArea)
        way = tr("Ctrl+Q quits, q is typed here") if typing else tr("q quits")
        self.notify(tr("{way}; a running recording asks first", way=way), markup=False)

    def leave(self, following: NextFile | None = None) -> None:
        """Quit, or go on to a file; while one goes somewhere, after that. A recording does not end unasked, and what is
        shown stays where the file cannot be opened."""
        if self._leaving:
            self._then = [] if self._asking else [following]
        else:
            self._leaving = True
            put_question(self, self._leave, following)

    async def _leave(self, following: NextFile | None) -> None:
        try:
            source = None
            if following is not None:
                try:
                    source = await asyncio.to_thread(self._opened, following.path)
                except Exception as error:  # whatever is wrong with a file, what is shown stays
                    trouble = tr("not opened, the view is unchanged: {trouble}", trouble=error_words(error))
                    self.notify(harmless(trouble), severity="error", markup=False, timeout=_LONG_S)
                    return
            if not await self._may_leave():
                return
            if source is None or following is None:
                self.exit()
            else:
                await self._show(source, following)
        finally:
            self._leaving = False
            while self._then and self.return_code is None:
                self.leave(self._then.pop())

    def _opened(self, path: Path) -> ViewSource:
        """A file as a source whose first bytes were read: raises what is wrong with it."""
        for _ in self.reader(path).steps(lambda: False):
            break
        return self.reader(path)

    async def _may_leave(self) -> bool:
        """Whether a recording, if there is one, may end."""
        record = getattr(self.desk.source, "recording", None)
        if record is None or self.desk.bus.whole:
            return True
        name = "" if record.path is None else f" {harmless(record.path.name)}"
        choices = [("s", tr("keep recording")), ("q", tr("end it and quit"))]
        self._asking, self._then = True, []
        try:
            chosen = await self.push_screen_wait(Choose(tr("The recording{name} would end", name=name), choices))
        finally:
            self._asking = False
        return bool(chosen)

    async def _show(self, source: ViewSource, following: NextFile) -> None:
        """Another source in the place of the one that is shown, which ends."""
        gc.unfreeze()  # what was shown so far may be garbage from now on
        old = self.desk
        notes, self._trouble = (old.notes, "") if source.path == old.source.path else _notes_of(source)
        if self.is_web:
            notes.path = None
        self.desk = replace(old, source=source, bus=Bus.of(source), notes=notes, scope=Scope(), narrowed=None, ended="")
        self.desk.paused, self.desk.losses, self.desk.failures = False, 0, Failures()
        self.desk.rules = list(rules_of(self.desk))
        self._end_jobs()
        before, self._sources = self.current_mode, self._sources + 1
        mode = f"source {self._sources}"
        self.add_mode(mode, partial(BusScreen, self.desk, self.wire, view=following.view, resumed=following))
        await self.switch_mode(mode)
        await self.remove_mode(before)  # with its questions and threads
        self._tell_trouble()

    def action_command_palette(self) -> None:
        """Every command by name; not over a question, behind which commands would act."""
        if self.use_command_palette and not isinstance(self.screen, ModalScreen):
            self.push_screen(CommandSearch(placeholder=tr("Search for commands…"), id="--command-palette"))

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
        """Every action that exists in the view in sight, from the table that keys and help are made of."""
        if isinstance(screen, BusScreen):
            here = screen.query_one(f"#{screen.view}")
            for node, binding in commands(screen, here):
                yield SystemCommand(
                    command_name(binding),
                    f"{tr(binding.tooltip or binding.description)} ({keys_written(binding, self.desk.wishes.keys)})",
                    partial(self.call_later, node.run_action, binding.action),
                )
        yield SystemCommand(tr("Screenshot"), tr("an SVG picture of the screen"), self.action_screenshot)


def capture_source(path: Path) -> ViewSource:
    """A file as it is."""
    import captures

    return CaptureSource(captures.open(path), path.name)


def _notes_of(source: ViewSource) -> tuple[Notes, str]:
    """The notes beside a source; none, and why, where they cannot be read."""
    try:
        return Notes.beside(source.path), ""
    except NotesError as error:
        return Notes(), error_words(error)
