"""Text with meaning, painted: a line is pieces, a piece names what it is, `INKS` says how that looks.

Whatever a widget shows passes `Harmless` on its way to the terminal, as all other output passes
`analyzer.terminal_text`.

Two themes are of the sixteen colours that every terminal has: each stands exactly on one of them. With NO_COLOR the
terminal's own two colours alone; what has a background of its own stands out in reverse.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from itertools import groupby
from operator import itemgetter
from typing import Final, NamedTuple

from rich.cells import cell_len, set_cell_size
from rich.color import Color as RichColour
from rich.segment import Segment
from rich.style import Style
from textual.color import Color
from textual.filter import LineFilter
from textual.strip import Strip
from textual.theme import Theme
from textual.widget import Widget

from dissectors.values import harmless


class StyledText(NamedTuple):
    """Some text of a line and what it is: names in `INKS`, or none for plain text."""

    text: str
    kind: str = ""


class Harmless(LineFilter):
    """The interface's gate: no segment reaches the terminal with a character that does not print as itself.

    Whoever shows foreign text escapes it so that it can be read; what was forgotten is one `?` a column here.
    """

    def apply(self, segments: list[Segment], background: Color) -> list[Segment]:  # noqa: ARG002
        """The same segments, as wide as before."""
        if all(segment.text.isprintable() for segment in segments):
            return segments
        return [Segment(_one_to_one(segment.text), segment.style) for segment in segments]


def _one_to_one(text: str) -> str:
    return "".join(c if c.isprintable() else (" " if c.isspace() else "?") * cell_len(c) for c in text)


HARMLESS: Final = Harmless()


class Ink(NamedTuple):
    """How a kind of text looks: the theme's names of its colours, none where it has the line's own."""

    front: str = ""
    back: str = ""
    text: str = ""  # bold, italic


INKS: Final = {
    "head": Ink("quiet", "surface"), "dim": Ink("quiet"), "request": Ink("asks"), "response": Ink("answers"),
    "noise": Ink("noise", text="italic"), "error": Ink("bad", text="bold"), "warning": Ink("warn"),
    "note": Ink("note"), "good": Ink("good"), "strong": Ink(text="bold"),
    "accent": Ink("accent"), "place": Ink("place"), "moved": Ink(text="bold"),
    "key": Ink("footer-key-foreground", text="bold"),
    "cursor": Ink("chosen-text", "chosen", "bold"), "cursor-away": Ink(back="chosen-away"),
    "lit": Ink("lit-text", "lit"), "lit-exact": Ink("chosen-text", "chosen", "bold"),
    **{f"tint-{colour}": Ink(back=f"tint-{colour}") for colour in ("red", "yellow", "green", "blue", "violet")},
}  # fmt: skip


def _inked(name: str, colours: Mapping[str, str]) -> Style:
    """The style of a kind of text in a theme's colours."""
    ink = INKS[name]
    front, back = (Color.parse(colours[each]).rich_color if each else None for each in ink[:2])
    bold, italic = (ink.text == each or None for each in ("bold", "italic"))
    return Style(color=front, bgcolor=back, bold=bold, italic=italic)


class Painted(Widget):
    """A widget that paints lines itself."""

    _looks: dict[str, Style] | None = None
    _base: Style | None = None

    def __init__(self, *, id: str | None = None, classes: str | None = None) -> None:
        super().__init__(id=id, classes=classes)
        self._joined: dict[tuple[Style, bool], dict[str, Style]] = {}  # by a line's own style, and what is over what

    def notify_style_update(self) -> None:
        super().notify_style_update()
        self._looks = self._base = None
        self._joined = {}
        self.repaint()

    def repaint(self) -> None:
        """Forget what was painted: colours changed."""

    def grown(self) -> None:
        """More is known than before."""
        self.refresh()

    @property
    def base(self) -> Style:
        """The widget's own style; asked for line by line."""
        if self._base is None:
            self._base = self.rich_style
        return self._base

    def style_of(self, kind: str) -> Style:
        """The style of names in `INKS`, a later one over an earlier."""
        if self._looks is None:
            self._looks = {"": Style.null()}
        if kind not in self._looks:
            self._looks[kind] = Style.combine([_inked(name, self.app.theme_variables) for name in kind.split()])
        return self._looks[kind]

    def strip(self, parts: Sequence[StyledText], width: int, base: Style, *, over: bool = False) -> Strip:
        """A line's pieces as one strip; `over`: the base's colours hide those of the pieces."""
        looks = self._joined.setdefault((base, over), {})
        segments = []
        for text, kind in parts:
            look = looks.get(kind)
            if look is None:
                own = self.style_of(kind)
                look = looks[kind] = own + base if over else base + own
            segments.append(Segment(harmless(text), look))
        return Strip(segments).adjust_cell_length(width, base)


def fitted(parts: Sequence[StyledText], width: int) -> list[StyledText]:
    """Pieces in exactly this many columns, cut with an ellipsis where they are more."""
    out: list[StyledText] = []
    left = width
    for part in parts:
        size = cell_len(part.text)
        if size > left:
            if not left and part.text.isspace():
                continue
            cut = part if left else out.pop() if out else StyledText("")
            while not left and out and not cut.text:
                cut = out.pop()
            room = left or cell_len(cut.text)
            return [*out, StyledText(set_cell_size(cut.text, room - 1) + "…", cut.kind)] if room else out
        out.append(part)
        left -= size
    out.append(StyledText(" " * left))
    return out


def in_runs(cells: Iterable[str], kinds: Iterable[str]) -> list[StyledText]:
    """Single cells as pieces: those of one kind beside each other are one piece, since each costs as much as a line."""
    return [
        StyledText("".join(cell for cell, _ in run), kind)
        for kind, run in groupby(zip(cells, kinds, strict=True), key=itemgetter(1))
    ]


# Colours, dark and light. Nothing is told by colour alone; these only help the eye. Each means one thing: the accent is
# the user's (keys, cursor, marks, filter), a place a register, red and yellow are troubles; what moved is only bold.


DARK: Final = Theme(
    name="rtuscope-dark",
    primary="#5fafd7", secondary="#87afaf", accent="#ffaf5f", foreground="#d7dae0", background="#16191d",
    surface="#1d2126", panel="#272c33", success="#8fc87a", warning="#f0d85a", error="#ff7b72", dark=True,
    variables={
        "quiet": "#8b949e", "rule": "#3a414a", "asks": "#79c0ff", "answers": "#8fd694", "noise": "#a89cc8",
        "place": "#5fc7b8", "bad": "#ff7b72", "warn": "#f0d85a", "note": "#a5b4c8", "good": "#8fc87a",
        "chosen": "#2f5f8f", "chosen-text": "#ffffff", "chosen-away": "#2c333c",
        "lit": "#5c4a1e", "lit-text": "#ffe8b0",
        "tint-red": "#4a1f22", "tint-yellow": "#45391a", "tint-green": "#1f3a24", "tint-blue": "#1d3350",
        "tint-violet": "#3a2550",
        "footer-key-foreground": "#ffaf5f",
    },
)  # fmt: skip
LIGHT: Final = Theme(
    name="rtuscope-light",
    primary="#005f87", secondary="#44606e", accent="#a3128a", foreground="#1f2328", background="#ffffff",
    surface="#f3f4f6", panel="#e4e7eb", success="#1a7f37", warning="#806000", error="#b3261e", dark=False,
    variables={
        "quiet": "#59636e", "rule": "#c4cad1", "asks": "#0550ae", "answers": "#116329", "noise": "#6639ba",
        "place": "#00696b", "bad": "#b3261e", "warn": "#806000", "note": "#4a5968", "good": "#1a7f37",
        "chosen": "#0a58a5", "chosen-text": "#ffffff", "chosen-away": "#d5dde6",
        "lit": "#ffe08a", "lit-text": "#3d2c00",
        "tint-red": "#ffd9d6", "tint-yellow": "#fff1c2", "tint-green": "#d6f2da", "tint-blue": "#d6e8ff",
        "tint-violet": "#ecdcff",
        "footer-key-foreground": "#a3128a",
    },
)  # fmt: skip


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
            Segment(text, None if style is None else _unshaded(style, background.rgb, self._flat), control)
            for text, style, control in segments
        ]


@lru_cache(1024)
def _unshaded(style: Style, background: Rgb, flat: frozenset[Rgb]) -> Style:
    own = None if style.bgcolor is None or style.bgcolor.is_default else tuple(style.bgcolor.get_truecolor())
    shaded = own is not None and own not in flat and own != background
    return style + _OWN + Style(reverse=shaded != bool(style.reverse))


DARK_16: Final = Theme(
    name="rtuscope-dark-16",
    primary="#55ffff", secondary="#00aaaa", accent="#ff55ff", foreground="#ffffff", background="#000000",
    surface="#000000", panel="#0000aa", success="#55ff55", warning="#ffff55", error="#ff5555", dark=True,
    variables={
        "quiet": "#aaaaaa", "rule": "#555555", "asks": "#55ffff", "answers": "#55ff55", "noise": "#aaaaaa",
        "place": "#00aaaa", "bad": "#ff5555", "warn": "#ffff55", "note": "#aaaaaa", "good": "#55ff55",
        "chosen": "#00aaaa", "chosen-text": "#000000", "chosen-away": "#0000aa",
        "lit": "#aa5500", "lit-text": "#ffffff",
        "tint-red": "#aa0000", "tint-yellow": "#aa5500", "tint-green": "#00aa00", "tint-blue": "#0000aa",
        "tint-violet": "#aa00aa", "footer-key-foreground": "#ff55ff",
    },
)  # fmt: skip
LIGHT_16: Final = Theme(
    name="rtuscope-light-16",
    primary="#0000aa", secondary="#00aaaa", accent="#aa00aa", foreground="#000000", background="#ffffff",
    surface="#ffffff", panel="#55ffff", success="#00aa00", warning="#aa5500", error="#aa0000", dark=False,
    variables={
        "quiet": "#555555", "rule": "#aaaaaa", "asks": "#0000aa", "answers": "#00aa00", "noise": "#555555",
        "place": "#0000aa", "bad": "#aa0000", "warn": "#aa5500", "note": "#555555", "good": "#00aa00",
        "chosen": "#0000aa", "chosen-text": "#ffffff", "chosen-away": "#55ffff",
        "lit": "#ffff55", "lit-text": "#000000",
        "tint-red": "#ff5555", "tint-yellow": "#ffff55", "tint-green": "#55ff55", "tint-blue": "#55ffff",
        "tint-violet": "#ff55ff", "footer-key-foreground": "#aa00aa",
    },
)  # fmt: skip
