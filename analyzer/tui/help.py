"""The help screen: every key, grouped by what one wants to do, and the filter language in brief."""

from __future__ import annotations

from typing import ClassVar, Final

from rich.table import Table
from rich.text import Text
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import VerticalScroll
from textual.screen import ModalScreen
from textual.widgets import Static

from .views import VIEWS

KEYS: Final[tuple[tuple[str, tuple[tuple[str, str], ...]], ...]] = (
    ("Move", (
        ("↑ ↓ PgUp PgDn Home End", "in any list; j and k too"),
        ("Tab, Shift+Tab", "from the list to the fields, to the bytes, and back"),
        (f"0 … {len(VIEWS) - 1}", "the views; 0 or H is Home"),
        ("g", "go to a frame's number, a time, +200ms, 50%"),
        ("c", "the counterpart: from a request to its answer and back"),
        ("] and [", "next and previous finding"),
        ("F", "follow the newest frame (live); moving up stops it"),
    )),
    ("See", (
        ("t", "times since start, date and time, since the previous row, since the reference"),
        ("r", "make this row the time reference; again takes it back"),
        ("z", "noise shown in place, or hidden"),
        ("v", "register values in every interpretation; in Registers the next type"),
        ("b", "bytes as hex, or bit by bit"),
        ("→ ← Space", "open and close fields"),
    )),
    ("Find", (
        ("/", "display filter; Tab completes, Enter uses it, empty shows all"),
        ("Esc", "take back the selection, then the filter, then the span"),
        ("f or Ctrl+F", "find bytes, text or a value; n and N go on"),
        ("Space in the list", "begin a selection; again ends and keeps it"),
    )),
    ("Keep", (
        ("m, '", "bookmark on or off; go to the next bookmark"),
        ("u", "take back the last change of a bookmark or comment"),
        (";", "comment on a row"),
        ("y", "copy: hex, C array, Python, rtuscope parse"),
        ("e", "export the selection, or the rows shown"),
    )),
    ("Timeline", (
        ("← →, + -", "move, zoom; 0 shows the whole"),
        ("Space, Enter", "begin a span; show it in the list"),
    )),
    ("Registers", (
        ("v, x", "the next type for this register; as its map or its values tell"),
        ("Space, ← →", "pin into the plot; move the plot's cursor"),
    )),
    ("Findings", (("s, o", "by severity, by code"), ("Enter", "the frame in the list"))),
    ("Else", (("p", "paste bytes"), ("d", "dark or light"), ("Ctrl+P", "every command by name"), ("q", "quit"))),
)  # fmt: skip
MARKS: Final = (
    ("E W N", "error, warning, note"), ("* R", "bookmark, time reference"),
    ("┌→ └←", "request, and its answer right after it"), ("╷→ ╵←", "the same, with other rows between"),
    (" →", "request without an answer"), ("?←", "answer to a request that is not known"), ("~~", "noise"),
)  # fmt: skip


class Help(ModalScreen[None]):
    """All keys."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("escape,q,question_mark,f1", "dismiss(None)", "Close"),
        Binding("up,k", "scroll(-1)", show=False),
        Binding("down,j", "scroll(1)", show=False),
    ]

    def compose(self) -> ComposeResult:
        with VerticalScroll(id="help"):
            yield Static(_page())

    def on_mount(self) -> None:
        self.query_one("#help").focus()

    def action_scroll(self, lines: int) -> None:
        self.query_one("#help").scroll_relative(y=lines, animate=False)


def _page() -> Table:
    page = Table.grid(padding=(0, 2))
    page.add_column(no_wrap=True)
    page.add_column()
    for title, keys in (*KEYS, ("In the list", MARKS)):
        page.add_row(Text(title, "bold"), "")
        for key, words in keys:
            page.add_row(Text(f"  {key}"), Text(words))
    from ..model.filtering import EXAMPLES

    page.add_row(Text("Filters", "bold"), "")
    for example in EXAMPLES:
        page.add_row("", Text(example))
    return page
