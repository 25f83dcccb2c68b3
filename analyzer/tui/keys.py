"""The keys of the main screen, by what one wants to do: bindings, the user's own keys and the help screen come from
here.

Help shows every key, and the filter language in brief.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import ClassVar, Final

from rich.console import Group
from rich.table import Table
from rich.text import Text
from textual.actions import parse
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import VerticalScroll
from textual.screen import ModalScreen
from textual.widget import Widget
from textual.widgets import Static

from ..languages import tr
from .against import ChangeList
from .details import BytesPane, Details
from .filterbar import FilterInput
from .findings import FindingList
from .home import HomeList
from .lines import Lines
from .pastepane import PasteText
from .polllist import PollList
from .registerlist import RegisterList
from .timeline import Timeline
from .transactions import TransactionList
from .unitlist import UnitList
from .views import VIEWS

KeyGroup = tuple[str, tuple[Binding, ...]]


def key(
    keys: str, action: str, words: str, about: str = "", *, shown: bool = False, as_: str | None = None, id: str = ""
) -> Binding:
    """A binding; `words` stand in the footer where it is `shown`, `about` in the help. Its id is the action's name."""
    name = id or action.replace("app.", "").replace("(", ".").replace(")", "").replace("'", "")
    return Binding(keys, action, words, show=shown, key_display=as_, tooltip=about, id=name)


GROUPS: Final[tuple[KeyGroup, ...]] = (
    ("Views", tuple(key(view.key, f"view('{view.name}')", view.title, view.title) for view in VIEWS)),
    ("Narrow", (
        key("slash", "filter", "Filter", "the filter; Tab completes, Enter uses it, Up: past ones", shown=True,
            as_="/"),
        key("equals_sign", "door('=')", "Filter to", "filter by the value under the cursor", shown=True, as_="=",
            id="door.to"),
        key("exclamation_mark", "door('!')", "Filter out", "filter it out", as_="!", id="door.out"),
        key("ampersand", "door('&')", "And", "put it into the filter's line, joined by and", as_="&", id="door.and"),
        key("vertical_line", "door('|')", "Or", "the same, joined by or", as_="|", id="door.or"),
        key("T", "span", "Span", "only a span of time: 14:00-16:00, yesterday 14-16", shown=True),
        key("S", "kept", "Kept filters", "use, keep or drop a filter; with a colour its rows are lit"),
        key("z", "noise", "Noise", "noise in place, or hidden"),
        key("escape", "whole", "Take back", "take back the selection, then the filter, then the span", as_="Esc"),
    )),
    ("Go", (
        key("f,ctrl+f", "find", "Find", "find bytes, a value, text or a time, whichever you type", shown=True, as_="f"),
        key("n", "find_on(False)", "Next hit", "the next hit", id="next"),
        key("N", "find_on(True)", "Previous hit", "the hit before", id="previous"),
        key("full_stop", "door('.')", "Next of", "the next row of this unit, register, poll", as_=".", id="door.next"),
        key("g,ctrl+g", "goto", "Go to", "a frame's number, a time, +200ms, 50%", shown=True, as_="g"),
        key("minus,alt+left", "back(-1)", "Back", "where you were before this jump", as_="-", id="back"),
        key("underscore,alt+right", "back(1)", "Forward", "forward again", as_="_", id="forward"),
        key("c", "counterpart", "Answer", "from a request to its answer and back"),
        key("right_square_bracket", "finding(1)", "Finding", "the next finding", shown=True, as_="]",
            id="finding.next"),
        key("left_square_bracket", "finding(-1)", "Previous finding", "the finding before", as_="[",
            id="finding.previous"),
        key("tab", "pane(1)", "Next pane", "from the list to the fields, to the bytes, and round", as_="Tab",
            id="pane.next"),
        key("shift+tab", "pane(-1)", "Previous pane", "the other way round", as_="Shift+Tab", id="pane.previous"),
    )),
    ("See", (
        key("w", "why", "Why", "why this frame's boundaries stand where they do", shown=True),
        key("t", "time_base", "Time",
            "times since the start, date and time, since the row before, since the reference"),
        key("r", "reference", "Reference", "make this row the time reference; again takes it back"),
        key("Z", "zoom", "Zoom", "the pane with the keys alone, and back"),
        key("less_than_sign", "size(-10)", "Smaller", "less room for the frame below", as_="<", id="size.less"),
        key("greater_than_sign", "size(10)", "Larger", "more room for the frame below", as_=">", id="size.more"),
        key("C", "columns", "Columns", "which columns the list of transactions or frames has"),
        key("D", "app.theme_flip", "Dark or light", "dark or light"),
    )),
    ("Keep", (
        key("m", "bookmark", "Mark", "set or remove a bookmark"),
        key("apostrophe", "next_bookmark", "Next mark", "the next bookmark", as_="'"),
        key("semicolon", "comment", "Comment", "a comment on a row", as_=";"),
        key("u", "undo", "Undo", "take back the last change of a bookmark or comment"),
        key("space", "select", "Select", "in a list: begin a selection; again ends and keeps it"),
        key("y", "copy", "Copy", "copy as hex, C array, Python, rtuscope parse"),
        key("e", "export", "Export", "export the selection, or the rows shown, to a file", shown=True),
    )),
    ("Live and files", (
        key("F", "follow", "Follow", "the newest row, of a file that grows too"),
        key("P", "pause", "Pause", "what comes is read and recorded, but not shown"),
        key("M", "mark_recording", "Mark it", "a note into the recording, at this moment"),
        key("W", "trigger", "Trigger", "live: ring, mark and bookmark when a filter or a cause comes true"),
        key("ctrl+r", "again", "Read anew", "the file, as it is now", as_="Ctrl+R"),
        key("ctrl+o", "open", "Open", "another file", as_="Ctrl+O"),
        key("question_mark,f1", "help", "Help", "this page", shown=True, as_="?"),
        key("q", "leave", "Quit", "quit; a recording does not end unasked", shown=True),
    )),
)  # fmt: skip
BINDINGS: Final = [binding for _, group in GROUPS for binding in group]
_ENGRAVED: Final = {
    "up": "↑", "down": "↓", "left": "←", "right": "→", "pageup": "PgUp", "pagedown": "PgDn",
    "home": "Home", "end": "End",
    "enter": "Enter", "tab": "Tab", "escape": "Esc", "plus": "+", "minus": "-", "equals_sign": "=",
}  # fmt: skip


_FUNCTION: Final = re.compile(r"f\d+")


def key_name(key: str) -> str:
    """A key as it stands on a keyboard."""
    *held, last = key.split("+")
    name = tr("Space") if last == "space" else _ENGRAVED.get(last, last)
    if (held and len(name) == 1) or _FUNCTION.fullmatch(name):
        name = name.upper()
    return "+".join([*map(str.capitalize, held), name])


MARKS: Final = (
    ("E W N", "error, warning, note"), ("* R", "bookmark, time reference"),
    ("┌→ └←", "request, and its answer right after it"), ("╷→ ╵←", "the same, with other rows between"),
    (" →", "request without an answer"), ("?←", "answer to a request that is not known"), ("~~", "noise"),
)  # fmt: skip


_KEYS: Final = 14  # columns
_WIDGETS: Final[tuple[tuple[str, type[Widget]], ...]] = (
    ("At Home", HomeList), ("In Transactions", TransactionList), ("In Findings", FindingList), ("In Polls", PollList),
    ("In Units", UnitList), ("In Then and now", ChangeList),
    ("In Registers", RegisterList), ("In the timeline", Timeline), ("In any list", Lines), ("In the fields", Details),
    ("In the bytes", BytesPane), ("In the filter's line", FilterInput), ("Where bytes are typed", PasteText),
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
        yield title, [(keys_written(each, mine), tr(each.tooltip or each.description)) for each in own]


def commands(screen: Widget, view: Widget) -> Iterator[tuple[Widget, Binding]]:
    """What can be done in the view in sight, each action once with the widget that does it."""
    own = [(widget, each) for widget in (view, *view.query("*").results(Widget)) for each in type(widget).BINDINGS]
    wanted = [*((screen, binding) for binding in BINDINGS), *own]
    for node, binding in wanted:
        if not isinstance(binding, Binding) or not (binding.tooltip or binding.show or node is screen):
            continue
        name, parameters = parse(binding.action.removeprefix("app."))[1:]
        if node.check_action(name, parameters) is not False:
            yield node, binding


def command_name(binding: Binding) -> str:
    """What an action is called among all commands."""
    title = tr(binding.description)
    return tr("View: {title}", title=title) if binding.action.startswith("view(") else title


def keys_written(binding: Binding, mine: Mapping[str, str]) -> str:
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
