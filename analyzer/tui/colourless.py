"""NO_COLOR: the terminal's own two colours alone; what has a background of its own stands out in reverse."""

from __future__ import annotations

from functools import lru_cache
from typing import Final

from rich.color import Color as RichColour
from rich.segment import Segment
from rich.style import Style
from textual.color import Color
from textual.filter import LineFilter

_OWN: Final = Style.from_color(RichColour.default(), RichColour.default())


class Colourless(LineFilter):
    """Takes the colours out of lines."""

    def apply(self, segments: list[Segment], background: Color) -> list[Segment]:
        """`background`: that of the widget, which stands for none."""
        return [
            Segment(text, None if style is None else _plain(style, background.rgb), control)
            for text, style, control in segments
        ]


@lru_cache(1024)
def _plain(style: Style, background: tuple[int, int, int]) -> Style:
    own = style.bgcolor
    shaded = own is not None and not own.is_default and tuple(own.get_truecolor()) != background
    return style + _OWN + Style(reverse=shaded != bool(style.reverse))


COLOURLESS: Final = Colourless()
