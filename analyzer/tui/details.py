"""The frame under study: its fields and its bytes, each lighting up what is chosen in the other.

The fields are a tree, open and closed like a folder; moving in it tells which bytes are meant. The bytes are hex and
characters, or bit by bit; a cursor in them tells which field a byte belongs to.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, ClassVar, NamedTuple

from textual import events
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal
from textual.geometry import Offset

from ..languages import tr
from .items import NOTHING, FrameDetail, Item, chosen
from .lines import Lines
from .messages import FieldChosen, OctetChosen
from .paint import StyledText

if TYPE_CHECKING:
    from .desk import ViewState

_LABEL = 16  # columns, at most
_INDENT = 4
Path = tuple[str, ...]


class TreeLine(NamedTuple):
    """A line of the tree: an item, or more of its text."""

    item: Item
    path: Path
    text: str
    first: bool
    label: int  # columns of the label

    @property
    def hanging(self) -> int:
        """Columns before further lines of a text: below its beginning, or less where that is far to the right."""
        aligned = (self.item.label or self.item.name).endswith(" ")
        return _INDENT if len(self.path) == 1 and not self.item.length and not aligned else self.label + 1


class Details(Lines):
    """The tree of one look. What the user opened or closed stays so on the next frame with the same fields."""

    HEAD = 0
    EMPTY = "no frame selected"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("right,l", "open(True)", "Open", show=False),
        Binding("left,h", "open(False)", "Close", show=False),
        Binding("space", "flip", "Open or close", show=False),
        Binding("v", "values", "Values", tooltip="All interpretations of register values"),
    ]

    def __init__(self, *, id: str) -> None:
        super().__init__(id=id)
        self.look = NOTHING
        self._turned: dict[Path, bool] = {}  # what the user opened (True) or closed
        self._values = False
        self._lines: list[TreeLine] = []
        self._broken_at = 0

    @property
    def empty(self) -> str:
        """Why there is nothing: no frame has come yet, or none was chosen."""
        desk: ViewState | None = getattr(self.app, "desk", None)
        if desk is None or desk.bus.count or desk.bus.whole:
            return super().empty
        return tr("no frames yet") if desk.source.live else tr("reading …")

    def show_frame(self, detail: FrameDetail, *, to: Path = ()) -> Item | None:
        """Another frame; the cursor goes to an item, or stays on the field of the same name. Gives it, tells nobody."""
        path = to or (self._lines[self.cursor].path if self.cursor < len(self._lines) else ())
        self.look = detail
        self._lay_out()
        self._announced = self._nearest(path)
        self.renewed(self._announced)
        return self.item

    def open(self, name: str) -> None:
        """Open one of the outermost items and go there, its last line in sight."""
        if any(item.name == name for item in self.look.items):
            self._turn((name,), True)
            top = self._nearest((name,))
            self.scroll_to(y=top, animate=False, immediate=True)

    def light(self, offset: int) -> None:
        """Put the cursor on the innermost visible item that means a byte, without telling."""
        best, least = None, len(self.look.data) + 1
        for i, line in enumerate(self._lines):
            item = line.item
            if line.first and item.start <= offset < item.start + item.length < item.start + least:
                best, least = i, item.length
        if best is not None:
            self._announced = best
            self.move_to(best)

    @property
    def item(self) -> Item | None:
        """The item under the cursor."""
        return self._lines[self.cursor].item if self.cursor < len(self._lines) else None

    def count(self) -> int:
        return len(self._lines)

    def pieces(self, line: int, width: int) -> Sequence[StyledText]:  # noqa: ARG002 - wrapped to the width before
        shown = self._lines[line]
        item = shown.item
        indent = "  " * (len(shown.path) - 1)
        if not shown.first:
            return [StyledText(f"{indent}  {' ' * shown.hanging}"), StyledText(shown.text, item.kind)]
        sign = " " if not item.children else "-" if self._is_open(item, shown.path) else "+"
        label = item.label or item.name
        return [
            StyledText(f"{indent}{sign} ", "dim"),
            StyledText(f"{label:<{shown.label}} ", item.kind if label[:1] in "!EWN" and item.kind else "dim"),
            StyledText(shown.text, item.kind),
        ]

    def _is_open(self, item: Item, path: Path) -> bool:
        return self._turned.get(path, item.ready or (self._values and item.values))

    def _lay_out(self) -> None:
        self._broken_at = max(20, self.scrollable_content_region.width)
        self._lines = list(self._laid_out(self.look.items, ()))

    def _laid_out(self, items: Sequence[Item], above: Path) -> Iterator[TreeLine]:
        widest = _widest(items, outermost=not above)
        for item in items:
            path = (*above, item.name)
            own = len(item.label or item.name)
            first = TreeLine(item, path, item.text, True, own if not above and not item.length else max(own, widest))
            room = max(12, self._broken_at - 2 * len(path))
            before, below = " " * min(first.label + 1, room - 8), " " * min(first.hanging, room - 8)
            parts = _wrapped(item.text, room, before, below) or [before]
            for i, part in enumerate(parts):
                yield first._replace(text=part[len(below if i else before) :], first=i == 0)
            if item.children and self._is_open(item, path):
                yield from self._laid_out(item.children, path)

    def _nearest(self, path: Path) -> int:
        for depth in range(len(path), 0, -1):
            for i, line in enumerate(self._lines):
                if line.path == path[:depth]:
                    return i
        return 0

    def resized(self) -> None:
        line = self._lines[self.cursor] if self.cursor < len(self._lines) else None
        self._lay_out()
        if line is not None:
            self.cursor = self._nearest(line.path)
        super().resized()

    def _tell(self) -> None:
        self._announced = self.cursor
        item = self.item
        if item is not None:
            self.post_message(FieldChosen(item.start, item.length))

    def action_open(self, wanted: bool) -> None:
        item = self.item
        if item is None:
            return
        path = self._lines[self.cursor].path
        if item.children and self._is_open(item, path) != wanted:
            self._turn(path, wanted)
        elif not wanted and len(path) > 1:
            self.move_to(self._nearest(path[:-1]))

    def action_flip(self) -> None:
        item = self.item
        if item is not None and item.children:
            path = self._lines[self.cursor].path
            self._turn(path, not self._is_open(item, path))

    action_enter = action_flip

    def action_values(self) -> None:
        """Open or close the interpretations of all registers."""
        path = self._lines[self.cursor].path if self._lines else ()
        self._values = not self._values
        self._turned = {where: turned for where, turned in self._turned.items() if not _values(self.look, where)}
        self._lay_out()
        self.renewed(self._nearest(path))

    def _turn(self, path: Path, wanted: bool) -> None:
        self._turned[path] = wanted
        self._lay_out()
        self.renewed(self._nearest(path))


def _widest(items: Sequence[Item], *, outermost: bool) -> int:
    """Columns of siblings' labels: their texts begin below each other."""
    labels = [item.label or item.name for item in items if item.length or not outermost]
    return min(max(map(len, labels), default=0), _LABEL)


def _wrapped(text: str, room: int, before: str, below: str) -> list[str]:
    """The lines of a text; most have room on one, for which nobody has to look for words."""
    if text and len(before) + len(text) <= room and text.isprintable() and text == text.strip():
        return [before + text]
    return textwrap.wrap(text, room, break_on_hyphens=False, initial_indent=before, subsequent_indent=below)


def _values(detail: FrameDetail, path: Path) -> bool:
    item = chosen(detail, path)
    return item is not None and item.values


_GROUP = 8


class BytesPane(Lines):
    """The bytes of one look; those of the chosen field are lit."""

    HEAD = 0
    EMPTY = ""
    BARRED = False
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("left,h", "step(-1)", "Left", show=False),
        Binding("right,l", "step(1)", "Right", show=False),
        Binding("b", "bits", "Bits", tooltip="Bytes as hex, or bit by bit"),
    ]

    def __init__(self, *, id: str) -> None:
        super().__init__(id=id)
        self.look = NOTHING
        self.offset_at = 0
        self.bits = False
        self.lit = range(0)

    def show_frame(self, detail: FrameDetail, start: int, length: int) -> None:
        """Another frame, with the bytes of a field lit."""
        self.look = detail
        self.offset_at = min(start if length else self.offset_at, max(0, len(detail.data) - 1))
        self.lit = range(start, start + length)
        self.cursor = self.offset_at // self.across
        self._fresh_until = 0.0
        self.grown()
        self._into_sight(self.cursor, middle=False)

    def light(self, start: int, length: int) -> None:
        """Light the bytes of a field."""
        self.lit = range(start, start + length)
        if length:
            self.offset_at = start
            self.cursor = start // self.across
            self._into_sight(self.cursor, middle=False)
        self.unpaint()

    @property
    def across(self) -> int:
        """Bytes a line."""
        width = self.scrollable_content_region.width
        if self.bits:
            return 4 if width >= 5 + 4 * 11 else 2
        return 16 if width >= 5 + 16 * 4 + 2 else 8

    @property
    def _digits(self) -> int:
        """Columns of the offsets."""
        return max(3, len(str(len(self.look.data))))

    def count(self) -> int:
        return -(-len(self.look.data) // self.across)

    def pieces(self, line: int, width: int) -> Sequence[StyledText]:  # noqa: ARG002
        first = line * self.across
        octets = self.look.data[first : first + self.across]
        parts = [StyledText(f"{first:>{self._digits}}  ", "dim")]
        if self.bits:
            for i, octet in enumerate(octets, first):
                parts += [StyledText(f"{octet >> 4:04b} {octet & 15:04b}", self._light(i)), StyledText("  ")]
            return parts
        for i in range(self.across):
            text = f"{octets[i]:02X}" if i < len(octets) else "  "
            parts.append(StyledText(text, self._light(first + i) if i < len(octets) else ""))
            joined = first + i in self.lit and first + i + 1 in self.lit and i + 1 < len(octets)
            gap = "  " if i % _GROUP == _GROUP - 1 else " "
            parts.append(StyledText(gap, "lit" if joined else ""))
        parts.append(StyledText(" "))
        for i, octet in enumerate(octets, first):
            parts.append(StyledText(chr(octet) if 0x20 <= octet < 0x7F else "·", self._light(i)))
        return parts

    def _light(self, i: int) -> str:
        if i == self.offset_at and self.has_focus:
            return "lit-exact"
        return "lit" if i in self.lit else ""

    def action_bits(self) -> None:
        self.bits = not self.bits
        self._strips.clear()
        self.cursor = self.offset_at // self.across
        self.renewed(self.cursor)

    def action_step(self, step: int) -> None:
        self.choose(self.offset_at + step)

    def action_move(self, step: int) -> None:
        self.choose(self.offset_at + step * self.across)

    def action_page(self, pages: int) -> None:
        self.choose(self.offset_at + pages * self.room * self.across)

    def action_edge(self, edge: int) -> None:
        self.choose(0 if edge < 0 else len(self.look.data) - 1)

    def choose(self, offset: int) -> None:
        """Put the cursor on a byte, and tell."""
        if self.look.data:
            self.offset_at = max(0, min(offset, len(self.look.data) - 1))
            self.cursor = self.offset_at // self.across
            self._into_sight(self.cursor, middle=False)
            self.unpaint()
            self.post_message(OctetChosen(self.offset_at))

    def clicked(self, event: events.Click, offset: Offset) -> None:  # noqa: ARG002
        line = self.scroll_offset.y + offset.y
        for i, (low, high) in enumerate(self._columns()):
            if low <= offset.x < high:
                self.choose(line * self.across + i % self.across)

    def _columns(self) -> Iterator[tuple[int, int]]:
        """Where on a line each byte stands: as digits, then as a character."""
        at = self._digits + 2
        for i in range(self.across):
            size = 9 if self.bits else 2
            yield at, at + size + 1
            at += size + (2 if self.bits or i % _GROUP == _GROUP - 1 else 1)
        if not self.bits:
            for i in range(self.across):
                yield at + 1 + i, at + 2 + i


class DetailPane(Horizontal):
    """The pane below the views."""

    def __init__(self, *, id: str) -> None:
        super().__init__(id=id)
        self.look: FrameDetail = NOTHING

    def compose(self) -> ComposeResult:
        yield Details(id="details")
        yield BytesPane(id="octets")

    @property
    def fields(self) -> Details:
        return self.query_one(Details)

    @property
    def octets(self) -> BytesPane:
        return self.query_one(BytesPane)

    def show_frame(self, detail: FrameDetail, *, to: tuple[str, ...] = ()) -> None:
        """Show fields and bytes; the cursor of the fields goes to an item, or stays on the field it is on."""
        self.look = detail
        self.octets.display = bool(detail.data) or not detail.items
        item = self.fields.show_frame(detail, to=to)
        self.fields.border_title = detail.title
        start, length = (0, 0) if item is None else (item.start, item.length)
        self.octets.show_frame(detail, start, length)
        self._title_octets(start, length)

    def light(self, start: int, length: int) -> None:
        """Light some bytes, and the field that they belong to."""
        self.fields.light(start)
        self.octets.light(start, length)
        self._title_octets(start, length)

    def open(self, name: str) -> None:
        """Open an item, and let its tree have the keys."""
        self.fields.open(name)
        self.fields.focus()

    @property
    def chosen_bytes(self) -> bytes:
        """The bytes of the field that has the keys, or all."""
        item = self.fields.item
        if self.fields.has_focus and item is not None and item.length:
            return self.look.data[item.start : item.start + item.length]
        return self.look.data

    def on_field_chosen(self, event: FieldChosen) -> None:
        self.octets.light(event.start, event.length)
        self._title_octets(event.start, event.length)

    def on_octet_chosen(self, event: OctetChosen) -> None:
        self.fields.light(event.offset)
        item = self.fields.item
        if item is not None and item.length:
            self.octets.lit = range(item.start, item.start + item.length)
        self.octets.unpaint()
        self._title_octets(event.offset, 1)

    def _title_octets(self, start: int, length: int) -> None:
        self.octets.border_title = self.look.spot(start, length) if self.look.data else ""
