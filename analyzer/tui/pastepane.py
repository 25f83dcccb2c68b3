"""The paste prompt: bytes in any form that `rtuscope parse` takes, read while they are typed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, ClassVar, Final

from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Vertical
from textual.widgets import Label, TextArea

from captures.errors import HexError

from ..languages import counted, error_words, tr
from ..paste import Paste, PasteError, read
from ..paste.model import PastedFrame, PastedNoise
from ..paste.trees import heading, hex_shown, trouble
from ..words import data_size
from .lines import Lines
from .look import NOTHING, FrameDetail, at_piece
from .messages import DetailWanted, LineChosen
from .paint import StyledText, fitted
from .view import View

if TYPE_CHECKING:
    from .screen import BusScreen

_LONGEST = 1 << 16  # characters that are read while they are typed


class PasteText(TextArea):
    """Where it is pasted; keys of the list below work from here too."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("escape", "app.focus_next", "Leave", tooltip="Back to the keys of the views"),
        Binding("ctrl+up", "older(1)", "Older", tooltip="What was pasted before"),
        Binding("ctrl+down", "older(-1)", "Newer", show=False),
        Binding("ctrl+l", "clear", "Clear"),
        Binding("f1", "screen.help", "Help"),
    ]

    def action_older(self, step: int) -> None:
        self.query_ancestor(PastePane).older(step)

    def action_clear(self) -> None:
        self.query_ancestor(PastePane).clear_text()


class PieceList(Lines):
    """The frames of a paste, and what is none."""

    HEAD = 0
    EMPTY = "paste or type bytes above: 11 03 00 6B …, 0x11,0x03, :1103…, lines of a log"

    def __init__(self, *, id: str) -> None:
        super().__init__(id=id)
        self.paste: Paste | None = None

    def show_paste(self, paste: Paste | None) -> None:
        """Another paste."""
        self.paste = paste
        self._announced = -1
        self.renewed()

    @property
    def piece(self) -> PastedFrame | PastedNoise | None:
        """The one under the cursor."""
        return self.paste.pieces[self.cursor] if self.paste and self.cursor < len(self.paste.pieces) else None

    def count(self) -> int:
        return len(self.paste.pieces) if self.paste else 0

    def pieces(self, line: int, width: int) -> Sequence[StyledText]:
        assert self.paste is not None
        pasted = self.paste.pieces[line]
        at = StyledText(f"{pasted.start:>5}  ", "dim")
        if isinstance(pasted, PastedNoise):
            length = counted(pasted.length, "byte", "bytes")
            return fitted(
                [at, StyledText(f"{tr('outside frames')}, {length}: {hex_shown(pasted.data, 12)}", "noise")], width
            )
        wrong = trouble(pasted)
        parts = [at, StyledText(heading(pasted), pasted.role.name.lower())]
        return fitted([*parts, StyledText(f"  {wrong}", "error")] if wrong else parts, width)


class PastePane(Vertical):
    """The prompt with what it was read as."""

    def __init__(self, *, id: str, pasted: str = "") -> None:
        """`pasted`: what stands there at first."""
        super().__init__(id=id)
        self._history: list[str] = []
        self._pasted = pasted

    def compose(self) -> ComposeResult:
        yield PasteText(id="paste-text", soft_wrap=True, show_line_numbers=False, tab_behavior="focus", compact=True)
        yield Label("", id="paste-why", markup=False)
        yield PieceList(id="pieces")

    def on_mount(self) -> None:
        if self._pasted:
            self._load(self._pasted)

    @property
    def look(self) -> FrameDetail:
        """What is under the cursor."""
        pasted = self.query_one(PieceList).piece
        return NOTHING if pasted is None else at_piece(pasted)

    def on_text_area_changed(self) -> None:
        text = self.query_one(PasteText).text
        why, paste = "", None
        if text.strip():
            try:
                paste = read(text[:_LONGEST])
                why = paste.why
                if len(text) > _LONGEST:
                    size = data_size(len(text.encode()))
                    cut = tr("only the first {first} of {size} are read here", first=data_size(_LONGEST), size=size)
                    why = f"{cut}; {tr('save it as a file and open that: rtuscope open FILE')}. {why}"
            except (PasteError, HexError) as error:
                why = error_words(error)
        label = self.query_one("#paste-why", Label)
        label.update(Text(why))
        label.set_class(bool(text.strip()) and paste is None, "-wrong")
        self.query_one(PieceList).show_paste(paste)
        self.post_message(DetailWanted(VIEW.name, self.look))
        if paste is not None and paste.holds_a_frame:
            self._remember(text)

    def on_line_chosen(self, event: LineChosen) -> None:
        event.stop()
        self.post_message(DetailWanted(VIEW.name, self.look))

    def _remember(self, text: str) -> None:
        """Keep it; what goes on from the newest one takes its place."""
        if self._history and (text.startswith(self._history[-1]) or self._history[-1].startswith(text)):
            self._history[-1] = text
        elif text not in self._history:
            self._history.append(text)

    def older(self, step: int) -> None:
        """What was pasted before, or after that."""
        if self._history:
            current = self.query_one(PasteText).text
            at = self._history.index(current) if current in self._history else len(self._history)
            at = max(0, min(at - step, len(self._history) - 1))
            self._load(self._history[at])

    def clear_text(self) -> None:
        """An empty prompt."""
        self._load("")

    def _load(self, text: str) -> None:
        area = self.query_one(PasteText)
        area.load_text(text)
        area.move_cursor(area.document.end)


def _shown(screen: BusScreen) -> None:
    screen.detail.show_frame(screen.query_one(PastePane).look)


VIEW: Final = View(
    name="paste", key="8,p", title="Paste",
    make=lambda desk: PastePane(id="paste", pasted=getattr(desk.source, "pasted", "")), shown=_shown,
    detail=True, filtered=False,
    offers=frozenset({"copy"}),
)  # fmt: skip
