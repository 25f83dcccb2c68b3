"""NO_COLOR: the terminal's own two colours alone; what has a background of its own stands out in reverse."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from typing import Final

from rich.color import Color as RichColour
from rich.segment import Segment
from rich.style import Style
from textual.color import Color
from textual.filter import LineFilter

_OWN: Final = Style.from_color(RichColour.default(), RichColour.default())
Rgb = tuple[int, int, int]


class Colourless(LineFilter):
    """Takes the colours out of lines."""

    def __init__(self, flat: Iterable[Rgb]) -> None:
        """`flat`: backgrounds that stand out nowhere: that of lists' heads, and what Textual takes the terminal's own
        for where a screen shines through another.
        """
        super().__init__()
        self._flat = frozenset(flat)

    def apply(self, segments: list[Segment], background: Color) -> list[Segment]:
        """`background`: that of the widget, which stands for none."""
        return [
            Segment(text, None if style is None else _plain(style, background.rgb, self._flat), control)
            for text, style, control in segments
        ]


@lru_cache(1024)
def _plain(style: Style, background: Rgb, flat: frozenset[Rgb]) -> Style:
    own = None if style.bgcolor is None or style.bgcolor.is_default else tuple(style.bgcolor.get_truecolor())
    shaded = own is not None and own not in flat and own != background
    return style + _OWN + Style(reverse=shaded != bool(style.reverse))
