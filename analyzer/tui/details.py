"""The detail tree: every field of a frame, open and closed like a folder; moving in it tells which bytes are meant."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, ClassVar, NamedTuple

from textual.binding import Binding, BindingType

from ..languages import tr
from .items import NOTHING, FrameDetail, Item, chosen
from .lines import Lines
from .messages import FieldChosen
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


class Details(Lines):
    """The tree of one look. What the user opened or closed stays so on the next frame with the same fields."""

    HEAD = 0
    EMPTY = "no frame chosen"
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

    def show(self, detail: FrameDetail, *, to: Path = ()) -> Item | None:
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
            return [StyledText(f"{indent}  {' ' * self._hanging(shown)}"), StyledText(shown.text, item.kind)]
        sign = " " if not item.children else "-" if self._is_open(item, shown.path) else "+"
        label = item.label or item.name
        return [
            StyledText(f"{indent}{sign} ", "dim"),
            StyledText(f"{label:<{self._label(shown)}} ", item.kind if label[:1] in "!EWN" and item.kind else "dim"),
            StyledText(shown.text, item.kind),
        ]

    def _label(self, shown: TreeLine) -> int:
        """Columns of the label: siblings' texts begin below each other."""
        if len(shown.path) == 1 and not shown.item.length:
            return len(shown.item.label or shown.item.name)
        siblings = [item for item in self._siblings(shown.path) if item.length or len(shown.path) > 1]
        widest = max((len(item.label or item.name) for item in siblings), default=0)
        own = len(shown.item.label or shown.item.name)
        return max(own, min(widest, _LABEL))

    def _hanging(self, shown: TreeLine) -> int:
        """Columns before further lines of a text: below its beginning, or less where that is far to the right."""
        aligned = (shown.item.label or shown.item.name).endswith(" ")
        return _INDENT if len(shown.path) == 1 and not shown.item.length and not aligned else self._label(shown) + 1

    def _siblings(self, path: Path) -> Sequence[Item]:
        parent = chosen(self.look, path[:-1])
        return self.look.items if parent is None else parent.children

    def _is_open(self, item: Item, path: Path) -> bool:
        return self._turned.get(path, item.ready or (self._values and item.values))

    def _lay_out(self) -> None:
        self._broken_at = max(20, self.scrollable_content_region.width)
        self._lines = list(self._laid_out(self.look.items, ()))

    def _laid_out(self, items: Sequence[Item], above: Path) -> Iterator[TreeLine]:
        for item in items:
            path = (*above, item.name)
            first = TreeLine(item, path, item.text, True)
            room = max(12, self._broken_at - 2 * len(path))
            before, below = " " * min(self._label(first) + 1, room - 8), " " * min(self._hanging(first), room - 8)
            parts = textwrap.wrap(item.text, room, initial_indent=before, subsequent_indent=below) or [before]
            for i, part in enumerate(parts):
                yield TreeLine(item, path, part[len(below if i else before) :], i == 0)
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


def _values(detail: FrameDetail, path: Path) -> bool:
    item = chosen(detail, path)
    return item is not None and item.values
