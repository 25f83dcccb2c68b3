"""The main screen: views of the bus on top, the frame under the cursor below, and what ties them together.

What happens here is only who is told what: a row is chosen in any list, so the fields and bytes show it; a field is
chosen, so its bytes light up. Jumping about is in `jumping`, keeping things in `keeping`, work in threads in `working`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, Vertical, VerticalScroll
from textual.widget import Widget
from textual.widgets import ContentSwitcher, Footer, Static

from .details import Details
from .filterbar import FilterBar
from .findings import FindingList
from .frames import ConversationList, FrameList
from .jumping import Jumping
from .keeping import Keeping
from .lines import Lines
from .look import NOTHING, Look
from .messages import (
    FilterChanged,
    FilterLeft,
    LineChosen,
    LineEntered,
    RowWanted,
    SpanChosen,
    ViewWanted,
)
from .octets import Octets
from .pastepane import PastePane, PasteText
from .registerlist import History, RegisterList
from .status import StatusLine
from .studying import Studying
from .tabs import VIEWS, Tabs
from .timeline import Timeline
from .unitlist import UnitList
from .working import Working

if TYPE_CHECKING:
    from .desk import Desk

_STUDIED = ("frames", "conversations", "findings", "paste")  # views with the frame under the cursor below
_JUMPS = ("find", "find_on", "goto", "counterpart", "finding")
_UNUSED = {  # actions that mean nothing in a view
    "paste": ("filter", *_JUMPS, "time_base", "select", "bookmark", "comment", "export", "reference"),
    "findings": ("find", "find_on", "select"),
    "units": (*_JUMPS, "select"),
    "registers": (*_JUMPS, "select"),
    "timeline": (*_JUMPS, "select", "time_base"),
    "report": (*_JUMPS, "select"),
}


class BusScreen(Jumping, Keeping, Studying, Working):
    """Everything about one source."""

    AUTO_FOCUS = ""  # else keys pressed while it starts would go to the filter, its first widget
    BINDINGS: ClassVar[list[BindingType]] = [
        *(Binding(str(i), f"view('{view.id}')", view.name, show=False) for i, view in enumerate(VIEWS, 1)),
        Binding("slash", "filter", "Filter", key_display="/"),
        Binding("f,ctrl+f", "find", "Find", key_display="f"),
        Binding("n", "find_on(False)", "Next hit", show=False),
        Binding("N", "find_on(True)", "Previous hit", show=False),
        Binding("g,ctrl+g", "goto", "Go to", key_display="g"),
        Binding("c", "counterpart", "Answer", tooltip="From a request to its answer and back"),
        Binding("right_square_bracket", "finding(1)", "Finding", key_display="]"),
        Binding("left_square_bracket", "finding(-1)", "Previous finding", show=False),
        Binding("t", "time_base", "Time"),
        Binding("r", "reference", "Reference", show=False),
        Binding("z", "noise", "Noise", show=False),
        Binding("F", "follow", "Follow", show=False),
        Binding("space", "select", "Select", show=False),
        Binding("m", "bookmark", "Mark", show=False),
        Binding("apostrophe", "next_bookmark", "Next mark", show=False),
        Binding("semicolon", "comment", "Comment", show=False),
        Binding("y", "copy", "Copy", show=False),
        Binding("e", "export", "Export", show=False),
        Binding("p", "view('paste')", "Paste", show=False),
        Binding("d", "app.theme_flip", "Dark or light", show=False),
        Binding("tab", "pane(1)", "Next pane", show=False),
        Binding("shift+tab", "pane(-1)", "Previous pane", show=False),
        Binding("escape", "whole", "Take back", show=False),
        Binding("question_mark,f1", "help", "Help", key_display="?"),
        Binding("q", "app.quit", "Quit"),
    ]

    def __init__(self, desk: Desk, *, view: str = "frames") -> None:
        super().__init__()
        self.desk = desk
        self.view = view
        self.look: Look = NOTHING
        self.row: int | None = None  # under study
        self.prepare_work()

    def compose(self) -> ComposeResult:
        desk = self.desk
        yield Tabs(id="tabs")
        yield FilterBar(desk.source.line, id="filter-bar")
        with ContentSwitcher(id="views", initial=self.view):
            yield FrameList(desk, id="frames")
            yield ConversationList(desk, id="conversations")
            yield FindingList(desk, id="findings")
            with Vertical(id="units"):
                yield UnitList(desk, id="unit-list")
                yield History(id="unit-history", classes="history")
            with Vertical(id="registers"):
                yield RegisterList(desk, id="register-list")
                yield History(id="history", classes="history")
            yield Timeline(desk, id="timeline")
            with VerticalScroll(id="report"):
                yield Static("", id="page", markup=False)
            yield PastePane(id="paste")
        with Horizontal(id="study"):
            yield Details(id="details")
            yield Octets(id="octets")
        yield StatusLine(desk, id="status")
        yield Footer(compact=True, show_command_palette=False)

    def on_mount(self) -> None:
        live = self.desk.source.live
        for each in (self.frames, self.talk):
            each.live = each.following = live
        self.action_view(self.view)
        self.begin_work()

    # The parts

    @property
    def frames(self) -> FrameList:
        return self.query_one("#frames", FrameList)

    @property
    def talk(self) -> ConversationList:
        return self.query_one("#conversations", ConversationList)

    @property
    def found(self) -> FindingList:
        return self.query_one(FindingList)

    @property
    def listing(self) -> Widget:
        """What has the keys in the view shown."""
        part = self.query_one(f"#{self.view}")
        return part if part.focusable else next((w for w in part.query("*") if w.focusable), part)

    # Views

    def action_view(self, view: str) -> None:
        """Show a view; its cursor goes to the row under study."""
        self.view = view
        self.query_one("#views", ContentSwitcher).current = view
        self.query_one(Tabs).choose(view)
        self.query_one("#study").display = view in _STUDIED
        self.query_one(FilterBar).display = view in ("frames", "conversations")
        self.set_class(view == "paste", "-paste")
        part = self.query_one(f"#{view}")
        if self.row is not None and isinstance(part, FrameList | FindingList):
            if isinstance(part, FindingList):
                part.grown()
            part.go(self.row)
        self.refresh_view()
        self.refresh_bindings()
        self.listing.focus()
        if view == "paste":
            self.study(self.query_one(PastePane).look)

    def refresh_view(self) -> None:
        """The view that is shown, with what came since."""
        part = self.query_one(f"#{self.view}")
        if isinstance(part, Lines | Timeline):
            part.grown()
        if self.view == "registers":
            self.query_one(RegisterList).grown()
        if self.view in ("units", "report"):
            self.count_report()
        self.say()

    def say(self) -> None:
        """The status line, as things are."""
        bus, frames = self.desk.bus, self.frames
        where = f"{bus.frames:,} frames" + (f", {bus.noise:,} noise" if bus.noise else "")
        if self.selection is not None:
            where = f"{frames.rows.count:,} of {bus.count:,} rows shown"
        waiting = frames.count() - 1 - frames.cursor
        if frames.live and not bus.whole:
            where += ", following" if frames.following else f", {waiting:,} below (F follows)"
        if self.pinned is not None and self.row is not None:
            where += f", {len(self.selected()):,} selected"
        self.query_one(StatusLine).say(where, self.doing)

    def on_view_wanted(self, event: ViewWanted) -> None:
        self.action_view(event.view)

    # Who is told what

    def on_line_chosen(self, event: LineChosen) -> None:
        part = event.sender
        if isinstance(part, FindingList):
            if part.id == self.view and part.finding is not None:
                self.study_finding(part.finding, part.row)
        elif isinstance(part, FrameList):
            if part.id == self.view and part.row is not None:
                self.study_row(part.row)
        elif isinstance(part, UnitList):
            self.query_one("#unit-history", History).show(*part.history(), from_zero=True)
        elif isinstance(part, RegisterList) and part.register is not None:
            self.show_history(part)

    def on_line_entered(self, event: LineEntered) -> None:
        part = event.sender
        if isinstance(part, FindingList) and part.row is not None:
            self.go(part.row)
        elif isinstance(part, FrameList):
            self.query_one(Details).focus()
        elif isinstance(part, UnitList) and part.unit is not None:
            self.action_view("frames")
            self.query_one(FilterBar).use(f"unit == {part.unit}")
        elif isinstance(part, RegisterList) and part.register is not None:
            self.go(part.register.row)

    def on_row_wanted(self, event: RowWanted) -> None:
        self.go(event.row)

    def on_filter_changed(self, event: FilterChanged) -> None:
        self.filter = event.filter
        self.reselect()

    def on_filter_left(self, event: FilterLeft) -> None:
        event.stop()
        self.listing.focus()

    def on_span_chosen(self, event: SpanChosen) -> None:
        self.span = event.t_start, event.t_end
        self.reselect()
        self.action_view("frames")

    # Keys

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        """Keys that mean nothing in a view are not shown there."""
        if action in _UNUSED.get(self.view, ()):
            return False
        return super().check_action(action, parameters)

    def action_filter(self) -> None:
        if self.view not in ("frames", "conversations"):
            self.action_view("frames")
        self.query_one(FilterBar).line.focus()

    def action_whole(self) -> None:
        """Take back what narrows the list: the selection, then span and filter."""
        if self.pinned is not None:
            self.action_select()
        elif self.filter is not None or self.span is not None:
            self.filter = self.span = None
            self.query_one(FilterBar).use("")
        self.listing.focus()

    def action_pane(self, step: int) -> None:
        """From the list to the fields, to the bytes, and round."""
        panes: list[Widget] = [self.listing]
        if self.view in _STUDIED:
            panes += [self.query_one(Details), self.query_one(Octets)]
        if self.view == "paste":
            panes = [self.query_one(PasteText), self.query_one("#pieces"), *panes[1:]]
        at = next((i for i, pane in enumerate(panes) if pane.has_focus), -1)
        panes[(at + step) % len(panes) if at >= 0 else 0].focus()

    def action_time_base(self) -> None:
        self.desk.next_base()
        self.frames.unpaint()
        self.talk.unpaint()
        self.found.unpaint()

    def action_noise(self) -> None:
        self.hide_noise = not self.hide_noise
        self.reselect()
        self.tell("noise hidden; z shows it" if self.hide_noise else "noise shown in place")

    def action_follow(self) -> None:
        frames = self.frames
        frames.live = frames.following = not frames.following
        frames.grown()
        self.say()

    def action_help(self) -> None:
        from .help import Help

        self.app.push_screen(Help())

    def tell(self, text: str, *, wrong: bool = False) -> None:
        """A short notice; nothing in it is markup."""
        from dissectors.text import harmless

        self.notify(
            harmless(text), severity="error" if wrong else "information", markup=False, timeout=6 if wrong else 3
        )
