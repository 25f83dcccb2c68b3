"""The main screen: views of the bus on top, the frame under the cursor below, and what ties them together.

What happens here is only who is told what. The views are records (`views`): the screen makes their widgets, and asks
the record what a line that is chosen or opened means. Jumping about is in `jumps`, the file and notes on it in
`openfiles`, rows that are copied or exported in `picking`, what narrows the rows in `narrowing`, what has the keys and
the room in `bars`, work in threads in `jobs`; each is a member that is handed the screen.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from textual.app import ComposeResult
from textual.binding import ActiveBinding, BindingType
from textual.screen import Screen
from textual.widget import Widget
from textual.widgets import ContentSwitcher

from dissectors.values import harmless

from ..failures import FailedPart, failed_words
from ..languages import retold, tr
from .bars import KeyLine, Panes, StatusLine, Tabs, fitting
from .details import DetailPane
from .filterbar import FilterBar, KeptFilters
from .frames import FrameList, ShownColumns
from .jobs import Jobs
from .jumps import Jumps
from .keyqueue import put_question
from .keys import BINDINGS
from .lines import Lines
from .look import at_row
from .messages import (
    DetailWanted,
    FilterChanged,
    FilterLeft,
    LineChosen,
    LineEntered,
    RowWanted,
    SpanChosen,
    ViewWanted,
)
from .narrowing import Doors, Narrowing
from .openfiles import Bookmarks, NextFile, OpenFiles
from .picking import PickedRows
from .places import OFFERED, Place, RowPlace, Trail, Visited
from .transactions import TransactionList
from .triggers import Triggers
from .view import LISTS, View
from .views import BY_NAME, VIEWS

if TYPE_CHECKING:
    from .desk import ViewState
    from .wire import ThinWire


class BusScreen(Screen[None]):
    """Everything about one source."""

    AUTO_FOCUS = ""  # else keys pressed while it starts would go to the filter, its first widget
    BINDINGS: ClassVar[list[BindingType]] = [*BINDINGS]

    def __init__(
        self, desk: ViewState, wire: ThinWire, *, view: str | None = None, resumed: NextFile | None = None
    ) -> None:
        """`view`: what comes up; None: the transactions, or Home once there are causes to tell."""
        super().__init__()
        self.desk = desk
        self.view = view or LISTS[0]
        self.list_view = view if view in LISTS else LISTS[0]  # the list that jumps go to
        self.files = OpenFiles(self, resumed)
        self.undecided = view is None and not desk.source.live  # Home may still come up by itself
        self.lit: tuple[int, int, int] | None = None  # a row, and the bytes of it that were looked for
        self.studied: int | None = None  # the row that was last shown below
        self.trail = Trail()
        self.came_up = self.going_back = False  # whether a view stands, whether it is gone back to
        self.wire = wire
        self.jobs = Jobs(self)
        self.jumps = Jumps(self)
        self.bookmarks = Bookmarks(self)
        self.picked = PickedRows(self)
        self.doors = Doors(self)
        self.kept = KeptFilters(self)
        self.narrowing = Narrowing(self)
        self.triggers = Triggers(self)
        self.panes = Panes(self)
        self.shown_columns = ShownColumns(self)
        self._failed: set[FailedPart] = set()  # that were told

    def compose(self) -> ComposeResult:
        yield Tabs(id="tabs")
        desk = self.desk
        yield FilterBar(desk.source.line, desk.wishes, lambda: desk.meanings.charts, id="filter-bar")
        with ContentSwitcher(id="views", initial=self.view):
            for view in VIEWS:
                yield view.make(self.desk)
        yield DetailPane(id="study")
        yield StatusLine(self.desk, id="status")
        yield KeyLine()

    def on_mount(self) -> None:
        for each in self.query(FrameList):
            each.live = each.following = self.desk.source.live
        self.action_view(self.view)
        self.came_up = True
        self.jobs.begin()

    # The parts

    @property
    def place(self) -> Place:
        """What the cursor of the view in sight stands on: what actions are about."""
        return BY_NAME[self.view].at(self)

    @property
    def row(self) -> int | None:
        """The row that it stands on; None where that is no row."""
        place = self.place
        return place.row if isinstance(place, RowPlace) else None

    @property
    def stop(self) -> Visited:
        """Where one is, to come back to."""
        return Visited(self.view, self.row)

    @property
    def touched(self) -> bool:
        """Whether a key was pressed."""
        return bool(getattr(self.app, "keys").taken)  # noqa: B009 - the application is known as an App here

    @property
    def frames(self) -> FrameList:
        return self.query_one("#frames", FrameList)

    @property
    def transactions(self) -> TransactionList:
        return self.query_one("#transactions", TransactionList)

    @property
    def detail(self) -> DetailPane:
        return self.query_one(DetailPane)

    # Views

    def action_view(self, view: str, row: int | None = None) -> None:
        """Show a view; its cursor goes to a row, or to the one under study."""
        record = BY_NAME[view]
        if self.came_up and not self.going_back:
            self.trail.leave(self.stop)
        own = self.row if row is None else row
        self.studied = self.studied if own is None else own
        self.view = view
        self.list_view = view if view in LISTS else self.list_view
        self.panes.arrange(record)
        record.shown(self)
        self.jobs.count_scope()
        self.refresh_view()
        self.refresh_bindings()
        self.panes.all[0].focus()

    def refresh_view(self) -> None:
        """The view that is shown, with what came since."""
        BY_NAME[self.view].refresh(self)
        self.write_status()

    def write_status(self) -> None:
        """The status line, as things are."""
        self.query_one(StatusLine).take_state_of(self)
        self.tell_failed()

    def tell_failed(self) -> None:
        """What failed since this was told last; the status line has it from then on."""
        if new := [part for part in self.desk.failed if part not in self._failed]:
            self._failed.update(new)
            self.notify_of(retold(failed_words(new)), wrong=True)
            self.write_status()

    def study_row(self, row: int, *, to: tuple[str, ...] = ()) -> None:
        """Show a row's fields and bytes; the cursor of the fields goes to an item."""
        self.studied = row
        self.detail.show_frame(at_row(self.desk, row), to=to)
        if self.lit is not None and self.lit[0] == row:
            self.detail.light(*self.lit[1:])
        if self.picked.anchor is not None:
            self.frames.unpaint()
        self.write_status()

    # Who is told what

    def on_line_chosen(self, event: LineChosen) -> None:
        view = _view_of(event.sender)
        if view is not None:
            view.chosen(self, event.sender)

    def on_line_entered(self, event: LineEntered) -> None:
        view = _view_of(event.sender)
        if view is not None:
            view.entered(self, event.sender)

    def on_view_wanted(self, event: ViewWanted) -> None:
        self.action_view(event.view)

    def on_detail_wanted(self, event: DetailWanted) -> None:
        if event.view == self.view:
            self.detail.show_frame(event.look)

    def on_row_wanted(self, event: RowWanted) -> None:
        self.jumps.go_to_row(event.row)

    def on_filter_changed(self, event: FilterChanged) -> None:
        self.jobs.scope.filter = event.filter
        self.narrowing.write_scope()
        self.jobs.reselect()

    def on_span_seen(self) -> None:
        self.refresh_view()

    def on_only_changed(self) -> None:
        self.narrowing.only_changed()

    def on_filter_left(self, event: FilterLeft) -> None:
        event.stop()
        self.panes.all[0].focus()

    def on_span_chosen(self, event: SpanChosen) -> None:
        self.narrowing.to_span((event.t_start, event.t_end))
        self.action_view(self.list_view)

    # Keys

    @property
    def active_bindings(self) -> dict[str, ActiveBinding]:
        """Those that the footer shows, in the language in use."""
        return fitting(super().active_bindings, self.app.get_key_display, self.size.width, self.focused)

    def on_resize(self) -> None:
        self.refresh_bindings()

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        """An action is there where the view offers it."""
        view = BY_NAME[self.view]
        if (action in OFFERED and action not in view.offers) or (action == "trigger" and self.triggers.source is None):
            return False
        if (action == "span" and self.desk.is_untimed) or (action in ("filter", "span", "kept") and not view.filtered):
            return False
        return super().check_action(action, parameters)

    def action_filter(self) -> None:
        if not BY_NAME[self.view].filtered:
            self.action_view(self.list_view)
        self.query_one(FilterBar).line.focus()

    def action_whole(self) -> None:
        if not self.jumps.stop():
            self.narrowing.take_back()

    def action_noise(self) -> None:
        self.narrowing.noise()

    def action_pane(self, step: int) -> None:
        self.panes.step(step)

    def action_zoom(self) -> None:
        self.panes.zoom()

    def action_size(self, step: int) -> None:
        self.panes.size(step)

    def action_time_base(self) -> None:
        self.desk.next_base()
        self.repaint_lists()

    def action_raw(self) -> None:
        """What registers mean, or the registers as they came."""
        self.desk.raw = not self.desk.raw
        self.reworded()

    def action_follow(self) -> None:
        wanted = not self.query_one(f"#{self.list_view}", FrameList).following
        for each in self.query(FrameList):
            each.live = each.following = wanted
            each.grown()
        self.write_status()

    def action_pause(self) -> None:
        """What comes is not shown until the same key again."""
        if not self.desk.source.live or self.desk.bus.whole:
            self.notify_of(tr("nothing is arriving, so there is nothing to pause"))
            return
        self.desk.paused = not self.desk.paused
        if self.desk.paused:
            self.write_status()
        else:
            self.refresh_view()

    def action_mark_recording(self) -> None:
        put_question(self, self.bookmarks.ask_mark)

    def action_trigger(self) -> None:
        put_question(self, self.triggers.ask)

    def action_again(self) -> None:
        self.files.again()

    def action_open(self) -> None:
        put_question(self, self.files.ask)

    def action_find(self) -> None:
        put_question(self, self.jumps.ask_what)

    def action_find_on(self, back: bool) -> None:
        self.jumps.find_on(back=back)

    def action_span(self) -> None:
        put_question(self, self.jumps.ask_span)

    def action_door(self, way: str) -> None:
        put_question(self, self.doors.go_through, way)

    def action_columns(self) -> None:
        put_question(self, self.shown_columns.choose)

    def action_kept(self) -> None:
        put_question(self, self.kept.choose)

    def reworded(self) -> None:
        """Registers mean something else now."""
        self.refresh_view()
        self.repaint_lists()
        if self.studied is not None and self.view in LISTS:
            self.study_row(self.studied)
        for each in self.query_one(f"#{self.view}").query(Lines):
            each.tell_again()

    def repaint_lists(self) -> None:
        """Every list looks otherwise now."""
        for each in self.query(Lines):
            each.unpaint()

    def action_goto(self) -> None:
        put_question(self, self.jumps.ask_where)

    def action_counterpart(self) -> None:
        self.jumps.to_counterpart()

    def action_why(self) -> None:
        """The evidence of the boundaries, opened below."""
        self.detail.open("why")

    def action_back(self, step: int) -> None:
        self.jumps.along(step)

    def action_finding(self, step: int) -> None:
        self.jumps.to_finding(step)

    def action_bookmark(self) -> None:
        self.bookmarks.toggle()

    def action_undo(self) -> None:
        self.bookmarks.undo()

    def action_next_bookmark(self) -> None:
        self.bookmarks.next()

    def action_comment(self) -> None:
        put_question(self, self.bookmarks.ask_comment)

    def action_reference(self) -> None:
        self.bookmarks.refer()

    def action_select(self) -> None:
        self.picked.toggle()

    def action_copy(self) -> None:
        put_question(self, self.picked.copy)

    def action_export(self) -> None:
        put_question(self, self.picked.export)

    def action_leave(self) -> None:
        self.leave()

    def leave(self, following: NextFile | None = None) -> None:
        """Quit, or go on to a file, as far as the application lets one."""
        getattr(self.app, "leave")(following)  # noqa: B009 - the application is known as an App here

    def action_help(self) -> None:
        from .keys import Help

        self.app.push_screen(Help(self.desk.wishes.keys, self.query_one(f"#{self.view}")))

    def notify_of(self, text: str, *, wrong: bool = False) -> None:
        """A short notice; nothing in it is markup."""
        self.notify(
            harmless(text), severity="error" if wrong else "information", markup=False, timeout=6 if wrong else 3
        )


def _view_of(widget: Widget) -> View | None:
    """The view that a widget belongs to."""
    names = (node.id for node in widget.ancestors_with_self)
    return next((BY_NAME[name] for name in names if name in BY_NAME), None)
