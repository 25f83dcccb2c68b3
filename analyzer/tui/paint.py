"""Text with meaning, painted: a line is pieces, a piece names what it is, the style sheet says how that looks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar, NamedTuple

from rich.cells import cell_len, set_cell_size
from rich.segment import Segment
from rich.style import Style
from textual.strip import Strip
from textual.widget import Widget


class Piece(NamedTuple):
    """Some text of a line and what it is: names of component classes, or none for plain text."""

    text: str
    kind: str = ""


class Painted(Widget):
    """A widget that paints lines itself."""

    COMPONENT_CLASSES: ClassVar[set[str]] = {
        "head", "dim", "request", "response", "noise", "error", "warning", "note", "good", "strong", "accent",
        "cursor", "cursor-away", "lit", "lit-exact",
    }  # fmt: skip
    _looks: dict[str, Style] | None = None
    _base: Style | None = None

    def notify_style_update(self) -> None:
        super().notify_style_update()
        self._looks = self._base = None
        self.repaint()

    def repaint(self) -> None:
        """Forget what was painted: colours changed."""

    @property
    def base(self) -> Style:
        """The widget's own style; asked for line by line."""
        if self._base is None:
            self._base = self.rich_style
        return self._base

    def style_of(self, kind: str) -> Style:
        """The style of component classes, a later one over an earlier."""
        if self._looks is None:
            self._looks = {"": Style.null()}
        if kind not in self._looks:
            self._looks[kind] = self.get_component_rich_style(*kind.split(), partial=True)
        return self._looks[kind]

    def strip(self, pieces: Sequence[Piece], width: int, base: Style, *, over: bool = False) -> Strip:
        """A line's pieces as one strip; `over`: the base's colours hide those of the pieces."""
        segments = []
        for text, kind in pieces:
            style = self.style_of(kind)
            segments.append(Segment(text, style + base if over else base + style))
        return Strip(segments).adjust_cell_length(width, base)


def fitted(pieces: Sequence[Piece], width: int) -> list[Piece]:
    """Pieces in exactly this many columns, cut with an ellipsis where they are more."""
    out: list[Piece] = []
    left = width
    for piece in pieces:
        size = cell_len(piece.text)
        if size > left:
            if left:
                out.append(Piece(set_cell_size(piece.text, left - 1) + "…", piece.kind))
            return out
        out.append(piece)
        left -= size
    out.append(Piece(" " * left))
    return out
