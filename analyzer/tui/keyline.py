"""The line of keys at the bottom: those that mean something where the focus is, clickable.

Textual's own makes a dozen widgets anew whenever the focus moves, some 15 ms of work before the first rows and behind
many a key; this line is painted, and only when other keys stand in it.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from rich.cells import cell_len
from textual import events
from textual.screen import Screen
from textual.strip import Strip

from .paint import Painted, StyledText, fitted


class KeyInLine(NamedTuple):
    """A key as it stands there."""

    key: str
    display: str
    description: str
    enabled: bool
    tooltip: str

    @property
    def width(self) -> int:
        """Its columns, the blank behind it among them."""
        return cell_len(f"{self.display} {self.description} ")


class KeyLine(Painted):
    """The keys that the screen's bindings show."""

    ALLOW_SELECT = False

    def __init__(self) -> None:
        super().__init__()
        self.keys: tuple[KeyInLine, ...] = ()
        self._waiting = False

    def on_mount(self) -> None:
        self.screen.bindings_updated_signal.subscribe(self, self._bindings_changed)

    def _bindings_changed(self, screen: Screen[object]) -> None:
        if self._waiting or not self.app.app_focus or screen is not self.screen:
            return
        self._waiting = True
        self.call_after_refresh(self._look)

    def _look(self) -> None:
        self._waiting = False
        keys = tuple(self._shown_keys())
        if self.is_attached and keys != self.keys:
            self.keys = keys
            self.refresh()

    def _shown_keys(self) -> Iterator[KeyInLine]:
        """A key for each action, the first that its bindings name."""
        actions = set()
        for _, binding, enabled, tooltip in self.screen.active_bindings.values():
            if binding.show and binding.action not in actions:
                actions.add(binding.action)
                yield KeyInLine(binding.key, self.app.get_key_display(binding), binding.description, enabled, tooltip)

    def render_line(self, y: int) -> Strip:
        width = self.content_size.width
        if y:
            return Strip.blank(width, self.base)
        parts = []
        for key in self.keys:
            parts.append(StyledText(key.display, "key" if key.enabled else "dim"))
            parts.append(StyledText(f" {key.description} ", "" if key.enabled else "dim"))
        return self.strip(fitted(parts, width), width, self.base)

    def _under(self, event: events.MouseEvent) -> KeyInLine | None:
        right = 0
        for key in self.keys:
            right += key.width
            if event.x < right:
                return key
        return None

    def on_mouse_down(self, event: events.MouseDown) -> None:
        key = self._under(event)
        if key is not None and key.enabled:
            self.app.simulate_key(key.key)

    def on_mouse_move(self, event: events.MouseMove) -> None:
        key = self._under(event)
        told = (key.tooltip or None) if key is not None else None
        if told != self.tooltip:
            self.tooltip = told
