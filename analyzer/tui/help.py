"""The help screen: every key, grouped by what one wants to do, and the filter language in brief."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import ClassVar, Final

from rich.table import Table
from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import VerticalScroll
from textual.screen import ModalScreen
from textual.widget import Widget
from textual.widgets import Static

from ..languages import tr
from .details import Details
from .filterbar import FilterInput
from .findings import FindingList
from .keys import GROUPS
from .lines import Lines
from .octets import BytesPane
from .registerlist import RegisterList
from .timeline import Timeline
from .transactions import TransactionList

MARKS: Final = (
    ("E W N", "error, warning, note"), ("* R", "bookmark, time reference"),
    ("┌→ └←", "request, and its answer right after it"), ("╷→ ╵←", "the same, with other rows between"),
    (" →", "request without an answer"), ("?←", "answer to a request that is not known"), ("~~", "noise"),
)  # fmt: skip


_NAMES: Final = {
    "up": "↑", "down": "↓", "left": "←", "right": "→", "pageup": "PgUp", "pagedown": "PgDn",
    "home": "Home", "end": "End",
    "enter": "Enter", "space": "Space", "tab": "Tab", "escape": "Esc", "plus": "+", "minus": "-", "equals_sign": "=",
}  # fmt: skip
_WIDGETS: Final[tuple[tuple[str, type[Widget]], ...]] = (
    ("In any list", Lines), ("In Transactions", TransactionList), ("In Findings", FindingList),
    ("In Registers", RegisterList), ("In the timeline", Timeline), ("In the fields", Details),
    ("In the bytes", BytesPane), ("In the filter's line", FilterInput),
)  # fmt: skip


class Help(ModalScreen[None]):
    """All keys."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("escape,q,question_mark,f1", "dismiss(None)", "Close"),
        Binding("up,k", "scroll(-1)", show=False),
        Binding("down,j", "scroll(1)", show=False),
    ]

    def __init__(self, mine: Mapping[str, str]) -> None:
        """`mine`: the user's own keys, by the id of what they do."""
        super().__init__()
        self._mine = mine

    def compose(self) -> ComposeResult:
        with VerticalScroll(id="help"):
            yield Static(_page(self._mine))

    def on_mount(self) -> None:
        self.query_one("#help").focus()

    def action_scroll(self, lines: int) -> None:
        self.query_one("#help").scroll_relative(y=lines, animate=False)


def _keys(mine: Mapping[str, str]) -> Iterator[tuple[str, Sequence[tuple[str, str]]]]:
    """Every binding there is: the screen's by group, then those of each widget."""
    for title, group in GROUPS:
        yield title, [(_shown(each, mine), tr(each.tooltip or each.description)) for each in group]
    for title, widget in _WIDGETS:
        own = [each for each in widget.BINDINGS if isinstance(each, Binding)]
        yield title, [(_shown(each, mine), tr(each.tooltip or each.description)) for each in own]


def _shown(binding: Binding, mine: Mapping[str, str]) -> str:
    """The keys of a binding, as they are written on a keyboard."""
    own = mine.get(binding.id or "")
    if own is None and binding.key_display:
        return binding.key_display
    keys = (own or binding.key).split(",")
    return " ".join(_NAMES.get(key, key.replace("ctrl+", "Ctrl+").replace("shift+", "Shift+")) for key in keys)


def _page(mine: Mapping[str, str]) -> Table:
    page = Table.grid(padding=(0, 2))
    page.add_column(no_wrap=True)
    page.add_column()
    for title, keys in (*_keys(mine), ("In the list", [(sign, tr(words)) for sign, words in MARKS])):
        page.add_row(Text(tr(title), "bold"), "")
        for key, words in keys:
            page.add_row(Text(f"  {key}"), Text(words))
    from ..model.filtering import EXAMPLES

    page.add_row(Text(tr("Filters"), "bold"), "")
    for example in EXAMPLES:
        page.add_row("", Text(example))
    return page
