"""Then and now: this capture beside another one, or two spans of it; what is new, gone, worse, better, what moved."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, ClassVar, Final

from textual.binding import Binding, BindingType

from ..languages import counted, tr
from ..model.thenandnow import Change, Compared, changes, read_side, span_side, whole_side
from ..model.times import GotoError, span
from .filterbar import FilterBar
from .items import NOTHING, FrameDetail, Item
from .keyqueue import put_question
from .lines import Lines
from .openfiles import no_capture
from .paint import StyledText, fitted
from .places import OF_FIGURES, Place, RegisterPlace, UnitPlace
from .prompts import Ask, typed_path
from .view import DoorCell, View, cells_of_units

if TYPE_CHECKING:
    from textual.widget import Widget

    from .desk import ViewState
    from .screen import BusScreen
    from .threads import Stop

_KINDS: Final = {"new": "strong", "worse": "error", "moved": "moved", "better": "good", "gone": "dim"}
_KIND: Final = 9
_ABOUT: Final = 9
_ROOMY: Final = 60
_SPANS: Final = "|"  # between two spans


class ChangeList(Lines):
    """A line a thing that is otherwise."""

    HEAD = 1
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("enter", "enter", "Open", tooltip="A value: its register; a unit: only its rows"),
        Binding("o", "choose", "Compare with", tooltip="Another capture, or two spans of this one: 0s-10s | 10s-20s"),
    ]

    def __init__(self, desk: ViewState, *, id: str) -> None:
        super().__init__(id=id)
        self.desk = desk
        self.sides = ("", "")  # then and now
        self.changes: Sequence[Change] | None = None

    @property
    def empty(self) -> str:
        if self.changes is None:
            return tr("o chooses what to compare with: another capture, or two spans of this one")
        return tr("no differences")

    @property
    def change(self) -> Change | None:
        """The one under the cursor."""
        told = self.changes or ()
        return told[self.cursor] if self.cursor < len(told) else None

    def show_changes(self, then: str, now: str, told: Sequence[Change]) -> None:
        """Another comparison."""
        self.sides, self.changes = (then, now), told
        self._announced = -1
        self.renewed()
        self._tell()

    def count(self) -> int:
        return len(self.changes or ())

    def head(self, width: int) -> Sequence[StyledText]:
        if self.changes is None:
            return fitted([StyledText(f"  {tr('then and now')}")], width)
        then, now = self.sides
        told = counted(len(self.changes), "difference", "differences")
        return fitted([StyledText(f"  {told}: "), StyledText(tr("{now} beside {then}", now=now, then=then))], width)

    def pieces(self, line: int, width: int) -> Sequence[StyledText]:
        assert self.changes is not None
        change = self.changes[line]
        parts = [StyledText(f"  {tr(change.kind):<{_KIND}}", _KINDS[change.kind])]
        if width >= _ROOMY:
            parts.append(StyledText(f"{tr(change.about):<{_ABOUT}}", "dim"))
        return fitted([*parts, StyledText(change.text)], width)

    def look(self) -> FrameDetail:
        """The one under the cursor in full."""
        change = self.change
        if change is None:
            return NOTHING
        item = Item("what", change.text, kind="strong", label=f"{tr(change.kind):<11}")
        sides = [
            Item(label, name, kind="dim", label=f"{tr(label):<11}")
            for label, name in zip(("then", "now"), self.sides, strict=True)
        ]
        return FrameDetail(tr("then and now"), b"", (item, *sides))

    def action_choose(self) -> None:
        put_question(self.screen, _choose, self.screen)


async def _choose(screen: BusScreen) -> None:
    """Ask what to compare, and compare it in a thread."""
    desk = screen.desk

    def wrong(text: str) -> str:
        if _SPANS not in text:
            return no_capture(text)
        try:
            _spans_of(text, desk)
        except GotoError as error:
            return str(error)
        return ""

    hint = tr("a capture's path; or two spans, then | now: 0s-10s | 10s-20s, 08:00-09:00 | 14:00-15:00")
    text = await screen.app.push_screen_wait(Ask(tr("Compare with"), hint, wrong=wrong))
    if text:
        compare(screen, text)


def _spans_of(text: str, desk: ViewState) -> list[tuple[int, int]]:
    one, _, other = text.partition(_SPANS)
    return [span(each, desk.bus, desk.zone) for each in (one, other)]


def compare(screen: BusScreen, text: str) -> None:
    """What is otherwise than in a capture of this name, or from one span to another."""
    desk, listing = screen.desk, screen.query_one(ChangeList)
    bus, source, meanings = desk.bus, desk.source, desk.meanings
    reader = getattr(screen.app, "reader")  # noqa: B009 - the application is known as an App here

    def work(stop: Stop) -> tuple[Compared, Compared, list[Change]]:
        if _SPANS in text:
            then, now = (span_side(bus, source, each, desk.span_words(each), stop) for each in _spans_of(text, desk))
        else:
            then, now = read_side(reader(typed_path(text)), stop), whole_side(bus, source)
        return then, now, changes(now, then, meanings)

    def show_compared(told: tuple[Compared, Compared, list[Change]]) -> None:
        then, now, differences = told
        screen.jobs.doing = ""
        listing.show_changes(then.name, now.name, differences)
        screen.write_status()

    screen.jobs.doing = tr("comparing")
    screen.write_status()
    screen.jobs.run("compare", work, show_compared, failed=screen.jobs.rest)


def _chosen(screen: BusScreen, sender: Widget) -> None:
    assert isinstance(sender, ChangeList)
    if screen.view == VIEW.name:
        screen.detail.show_frame(sender.look())


def _entered(screen: BusScreen, sender: Widget) -> None:
    """A value: its register. A unit: its rows alone."""
    from .registerlist import RegisterList

    assert isinstance(sender, ChangeList)
    change = sender.change
    if change is None:
        return
    if change.spot is not None:
        screen.action_view("registers")
        screen.query_one(RegisterList).go_to_spot(change.spot)
    elif len(change.units) == 1:
        screen.action_view(screen.list_view)
        screen.query_one(FilterBar).use_filter(f"unit == {change.units[0]}")


def _shown(screen: BusScreen) -> None:
    listing = screen.query_one(ChangeList)
    screen.detail.show_frame(listing.look())
    if listing.changes is None and screen.came_up:
        listing.action_choose()


def _at(screen: BusScreen) -> Place:
    change = screen.query_one(ChangeList).change
    if change is None:
        return None
    if change.spot is not None:
        return RegisterPlace(change.spot)
    return UnitPlace(change.units[0]) if len(change.units) == 1 else None


def _cells(screen: BusScreen) -> list[DoorCell]:
    change = screen.query_one(ChangeList).change
    return [] if change is None else cells_of_units(change.units)


def _copied(screen: BusScreen) -> str:
    """All of them, a line each."""
    return "\n".join(f"{tr(each.kind)}: {each.text}" for each in screen.query_one(ChangeList).changes or ())


VIEW: Final = View(
    name="against", key="A", title="Then and now", short="Then", tab=False,
    make=lambda desk: ChangeList(desk, id="against"),
    chosen=_chosen, entered=_entered, shown=_shown, at=_at, cells=_cells, copied=_copied,
    detail=True, filtered=False, offers=(OF_FIGURES | {"copy"}) - {"export", "noise"},
)  # fmt: skip
