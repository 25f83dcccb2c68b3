"""The bytes of a frame: hex and characters, or bit by bit; a cursor that tells which field a byte belongs to."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import ClassVar

from textual import events
from textual.binding import Binding, BindingType
from textual.geometry import Offset

from .items import NOTHING, FrameDetail
from .lines import Lines
from .messages import OctetChosen
from .paint import StyledText

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

    def show(self, detail: FrameDetail, start: int, length: int) -> None:
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
