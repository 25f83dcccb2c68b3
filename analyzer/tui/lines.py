"""A list of any length: only the lines in sight are painted, so that ten million cost what ten do.

A list draws `count` lines under one fixed head. It has a cursor, and follows the end while `following`: it stops when
the user moves away from the end, and goes on when they return to it.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from textwrap import wrap
from typing import TYPE_CHECKING, ClassVar, Final

from textual import events
from textual.binding import Binding, BindingType
from textual.cache import LRUCache
from textual.geometry import Offset, Size
from textual.scroll_view import ScrollView
from textual.strip import Strip
from textual.widget import Widget

from ..languages import tr
from .messages import LineChosen, LineEntered
from .paint import Painted, StyledText

if TYPE_CHECKING:
    from textual.timer import Timer

_CACHED: Final = 512  # painted lines
_TICK_S: Final = 1 / 60  # between two pictures
_EMPTY: Final = 2  # lines that say why there are none
_FRESH_S: Final = 0.5  # lines in sight are painted anew so often while others come


class Lines(Painted, ScrollView, can_focus=True):
    """The list; a kind of list says how many lines there are (`count`) and what is on each (`pieces`)."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("up,k", "move(-1)", "Up", show=False),
        Binding("down,j", "move(1)", "Down", show=False),
        Binding("pageup,ctrl+b", "page(-1)", "Page up", show=False),
        Binding("pagedown", "page(1)", "Page down", show=False),
        Binding("home", "edge(-1)", "First", show=False),
        Binding("end,G", "edge(1)", "Last", show=False),
        Binding("enter", "enter", "Open", show=False),
    ]
    HEAD: int = 1  # fixed lines on top
    EMPTY: ClassVar[str] = "nothing here"
    BARRED: ClassVar[bool] = True  # whether the cursor is a bar over the line

    def __init__(self, *, id: str | None = None, classes: str | None = None) -> None:
        super().__init__(id=id, classes=classes)
        self.cursor = 0
        self.following = False
        self._strips: LRUCache[tuple[int, bool], tuple[object, Strip]] = LRUCache(_CACHED)
        self._states: dict[int, object] = {}  # of the lines in sight
        self._shown_count = 0

    # What a kind of list says

    @property
    def empty(self) -> str:
        """What stands there where there is no line."""
        return tr(self.EMPTY)

    def count(self) -> int:
        """Lines now."""
        return 0

    def pieces(self, line: int, width: int) -> Sequence[StyledText]:
        """What is on a line."""
        raise NotImplementedError

    def head(self, width: int) -> Sequence[StyledText]:
        """What is on the fixed line."""
        raise NotImplementedError

    def heads(self, y: int, width: int) -> Sequence[StyledText]:  # noqa: ARG002 - for lists with several fixed lines
        """What is on fixed line `y`."""
        return self.head(width)

    def kind_of_line(self, line: int) -> str:  # noqa: ARG002 - for kinds of lists that light lines up
        """The kind (`paint.INKS`) that the whole line has beneath its pieces'."""
        return ""

    def states(self, lines: range) -> Sequence[object] | None:  # noqa: ARG002 - for lists that know
        """What the looks of these lines hang on while others come; None: nobody knows, they are painted anew."""
        return None

    # Growing

    def grown(self) -> None:
        """Lines came or changed."""
        count = self.count()
        now = time.monotonic()
        before, self._states = self._states, self._states_in_sight(count)
        if self._states and self._states == before and not self.following and self.cursor < count:
            self._fit(count, quietly=True)
            return
        below = self.scroll_offset.y + self.room < self._shown_count <= count
        if below and not self.following and now < self._fresh_until:
            self._fit(count, quietly=True)  # no line in sight is new; what they say may be, and no other call may come
            if self._later is None:
                self._later = self.set_timer(self._fresh_until - now, self._freshen)
            return
        self._fresh_until = now + _FRESH_S
        if not self._states:
            self._strips.clear()
        self._fit(count)
        if self.following and count:
            self.cursor = count - 1
            self._to_end()
            if self.cursor != self._announced:
                self._tell()
        elif self.cursor >= count > 0:
            self.cursor = count - 1
        if count and self._announced < 0:  # the first lines of a list that began empty
            self._tell()
        elif not count:
            self._tell_emptied()
        self.refresh()

    def _states_in_sight(self, count: int) -> dict[int, object]:
        """Of each line in sight; of none where nobody knows."""
        top = self.scroll_offset.y
        lines = range(top, min(top + self.room + 1, count))
        return dict(zip(lines, self.states(lines) or (), strict=False))

    def _state(self, line: int, count: int) -> object:
        """What the looks of a line in sight hang on; None where nobody knows."""
        if line not in self._states:
            self._states = self._states_in_sight(count)
        return self._states.get(line)

    _fresh_until = 0.0
    _later: Timer | None = None

    def _freshen(self) -> None:
        self._later = None
        self.unpaint()

    def renewed(self, cursor: int = 0) -> None:
        """The list is another one now."""
        self._strips.clear()
        self._states = {}
        count = self.count()
        self._fit(count)
        self.move_to(max(0, min(cursor, count - 1)), middle=True)
        self.refresh()

    _announced = -1  # the cursor as last told

    def _fit(self, count: int, *, quietly: bool = False) -> None:
        """`quietly`: no line in sight looks otherwise."""
        self._shown_count = count
        size = Size(max(1, self.scrollable_content_region.width), count + self.HEAD)
        if self.styles.auto_dimensions:  # as high as its lines, or as the words that stand for them
            self.virtual_size = size if count else Size(size.width, _EMPTY + self.HEAD)
        elif size != self.virtual_size:  # as wide and high as before: no other widget has to be laid out or painted
            self.set_reactive(Widget.virtual_size, size)
            self._scroll_update(size)
            if not quietly:
                self.refresh()

    # Moving

    def move_to(self, line: int, *, middle: bool = False) -> None:
        """Put the cursor on a line, and that line in sight."""
        count = self.count()
        if not count:
            self.cursor = 0
            self._tell_emptied()
            return
        line = max(0, min(line, count - 1))
        before, self.cursor = self.cursor, line
        for each in {before, line}:
            self._strips.discard((each, True))
            self._strips.discard((each, False))
            self.refresh_lines(each + self.HEAD)
        if count != self._shown_count:
            self._fit(count)
        self._into_sight(line, middle=middle)
        if line != self._announced:
            self._tell()

    def _tell(self) -> None:
        self._announced, self._told = self.cursor, True
        self.post_message(LineChosen(self, self.cursor))

    def tell_again(self) -> None:
        """What the line under the cursor says may be another thing now: whoever shows more of it shows that."""
        if self._told:
            self._tell()

    def _tell_emptied(self) -> None:
        """Nothing is chosen any more: what stands below the list goes."""
        if self._told:
            self._announced, self._told = -1, False
            self.post_message(LineChosen(self, 0))

    _told = False  # whether a line was told since the list was last empty

    @property
    def room(self) -> int:
        """Lines in sight."""
        return max(1, self.scrollable_content_region.height - self.HEAD)

    def _into_sight(self, line: int, *, middle: bool) -> None:
        top, room = self.scroll_offset.y, self.room
        if top <= line < top + room or not self.scrollable_content_region.height:  # not laid out yet: `resized` comes
            return
        top = line - room // 2 if middle else line if line < top else line - room + 1
        self.scroll_to(y=max(0, top), animate=False, immediate=True)

    def _to_end(self) -> None:
        self.scroll_to(y=max(0, self._shown_count - self.room), animate=False, immediate=True)

    def action_move(self, step: int) -> None:
        self._by_user(self.cursor + step)

    def action_page(self, pages: int) -> None:
        step = pages * max(1, self.room - 1)
        top = self.scroll_offset.y
        self.scroll_to(y=max(0, top + step), animate=False, immediate=True)
        self._by_user(self.cursor + step)

    def action_edge(self, edge: int) -> None:
        self._by_user(0 if edge < 0 else self.count() - 1)

    def action_enter(self) -> None:
        if self.count():
            self.post_message(LineEntered(self, self.cursor))

    def _by_user(self, line: int) -> None:
        count = self.count()
        if self.live:
            self.following = line >= count - 1
        self.move_to(line)
        self._show_at_once()

    def _show_at_once(self) -> None:
        """Paint the list before anybody else is told of its cursor; not for each of many keys typed ahead."""
        keys, now = getattr(self.app, "keys", None), time.monotonic()
        if keys is not None and not keys.waiting and now - self._painted_at > _TICK_S:
            self._painted_at = now
            self.screen._dirty_widgets.add(self)
            self.screen._on_timer_update()

    _painted_at = 0.0

    live = False  # whether moving to the end means following it

    # Mouse

    def on_click(self, event: events.Click) -> None:
        offset = event.get_content_offset(self)
        if offset is not None and offset.y >= self.HEAD:
            self.clicked(event, offset)

    def clicked(self, event: events.Click, offset: Offset) -> None:
        """The mouse was clicked on something that is no head."""
        line = self.scroll_offset.y + offset.y - self.HEAD
        if line < self.count():
            self._by_user(line)
            if event.chain > 1:
                self.action_enter()

    def on_mouse_scroll_up(self) -> None:
        self.following = False

    # Painting

    def repaint(self) -> None:
        self._strips.clear()

    def on_resize(self) -> None:
        self.resized()

    def resized(self) -> None:
        """There is more or less room. A cursor that was in sight stays so; where it had been scrolled away, it is."""
        self._strips.clear()
        self._fit(self.count())
        top, room, self._had_room = self.scroll_offset.y, self._had_room, self.room
        if self.following:
            self._to_end()
        elif self._shown_count and (not room or top <= self.cursor < top + room):
            self._into_sight(self.cursor, middle=False)

    _had_room = 0  # lines, before it was resized

    def on_focus(self) -> None:
        self.unpaint()

    def on_blur(self) -> None:
        self.unpaint()

    def unpaint(self) -> None:
        """Paint everything in sight anew."""
        self._strips.clear()
        self.refresh()

    def render_line(self, y: int) -> Strip:
        width = self.scrollable_content_region.width
        if y < self.HEAD:
            return self.strip(self.heads(y, width), width, self.base + self.style_of("head"))
        line = self.scroll_offset.y + y - self.HEAD
        count = self.count()
        if line >= count:
            told = wrap(self.empty, max(1, width - 3)) if count == 0 else []
            text = f"  {told[y - self.HEAD]}" if y - self.HEAD < len(told) else ""
            return self.strip([StyledText(text, "dim")], width, self.base)
        barred = self.BARRED and line == self.cursor
        state, kept = self._state(line, count), self._strips.get((line, barred))
        strip = None if kept is None or kept[0] != state else kept[1]
        if strip is None or strip.cell_length != width:
            base = self.base
            kind = self.kind_of_line(line)
            if kind:
                base += self.style_of(kind)
            if barred:
                base += self.style_of("cursor" if self.has_focus else "cursor-away")
            strip = self.strip(self.pieces(line, width), width, base, over=barred and self.has_focus)
            self._strips[line, barred] = state, strip
        return strip
