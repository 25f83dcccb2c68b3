"""The help screen: every key, grouped by what one wants to do, and the filter language in brief."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import ClassVar, Final

from rich.console import Group
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
from .home import HomeList
from .keys import GROUPS, key_name
from .lines import Lines
from .octets import BytesPane
from .registerlist import RegisterList
from .timeline import Timeline
from .transactions import TransactionList
from .unitlist import UnitList

MARKS: Final = (
    ("E W N", "error, warning, note"), ("* R", "bookmark, time reference"),
    ("┌→ └←", "request, and its answer right after it"), ("╷→ ╵←", "the same, with other rows between"),
    (" →", "request without an answer"), ("?←", "answer to a request that is not known"), ("~~", "noise"),
)  # fmt: skip


_KEYS: Final = 14  # columns
_WIDGETS: Final[tuple[tuple[str, type[Widget]], ...]] = (
    ("At Home", HomeList), ("In Transactions", TransactionList), ("In Findings", FindingList), ("In Units", UnitList),
    ("In Registers", RegisterList), ("In the timeline", Timeline), ("In any list", Lines), ("In the fields", Details),
    ("In the bytes", BytesPane), ("In the filter's line", FilterInput),
)  # fmt: skip


class Help(ModalScreen[None]):
    """All keys."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("escape,q,question_mark,f1", "dismiss(None)", "Close"),
        Binding("up,k", "scroll(-1)", show=False),
        Binding("down,j", "scroll(1)", show=False),
    ]

    def __init__(self, mine: Mapping[str, str], view: Widget) -> None:
        """`mine`: the user's own keys, by the id of what they do; those of the view in sight come first."""
        super().__init__()
        self._mine, self._here = mine, [view, *view.query("*").results(Widget)]

    def compose(self) -> ComposeResult:
        with VerticalScroll(id="help"):
            yield Static(_page(self._mine, self._here))

    def on_mount(self) -> None:
        self.query_one("#help").focus()

    def action_scroll(self, lines: int) -> None:
        self.query_one("#help").scroll_relative(y=lines, animate=False)


def _keys(mine: Mapping[str, str], here: Sequence[Widget]) -> Iterator[tuple[str, Sequence[tuple[str, str]]]]:
    """Every binding there is: those of the view in sight, the screen's by group, then those of each widget."""
    groups = [(title, [*kind.BINDINGS]) for title, kind in _WIDGETS]
    first = [title for title, kind in _WIDGETS if any(type(widget) is kind for widget in here)]
    for title, group in sorted([*GROUPS, *groups], key=lambda each: each[0] not in first):
        own = [each for each in group if isinstance(each, Binding)]
        yield title, [(_shown(each, mine), tr(each.tooltip or each.description)) for each in own]


def _shown(binding: Binding, mine: Mapping[str, str]) -> str:
    """The keys of a binding, as they are written on a keyboard."""
    own = mine.get(binding.id or "")
    if own is None and binding.key_display:
        return binding.key_display
    return " ".join(key_name(key) for key in (own or binding.key).split(","))


def _page(mine: Mapping[str, str], here: Sequence[Widget]) -> Group:
    from ..model.selection import EXAMPLES

    parts: list[Text | Table] = []
    for title, keys in (*_keys(mine, here), ("In the list", [(sign, tr(words)) for sign, words in MARKS])):
        table = Table.grid(padding=(0, 1))
        table.add_column(width=_KEYS)
        table.add_column()
        for key, words in keys:
            table.add_row(Text(f"  {key}"), Text(words))
        parts += [Text(tr(title), "bold"), table]
    return Group(*parts, Text(tr("Filters"), "bold"), *(Text(f"  {example}") for example in EXAMPLES))
