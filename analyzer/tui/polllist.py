"""The polls: the list that stands still. A line a poll: how often, how it is answered, what it holds and what moves."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import groupby, islice
from typing import TYPE_CHECKING, ClassVar, Final

import numpy as np
from textual import events
from textual.binding import Binding, BindingType

from dissectors.functions import function_code
from dissectors.values import harmless

from ..languages import counted, grouped, tr
from ..model.polls import TransactionValues, poll_values
from ..model.pollwatch import PollKey, WatchedPoll
from ..tables.schema import bounds_of
from ..tables.transactions import Status
from ..words import compact, rough_percent, short, short_bound
from .filterbar import FilterBar
from .items import NOTHING, FrameDetail, Item
from .lines import Lines
from .paint import StyledText, fitted
from .places import OF_FIGURES, Place, PollPlace
from .plot import sparkline
from .readings import carried_values
from .view import DoorCell, View, register_text, value_name

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from textual.widget import Widget

    from ..model.meanings import NamedReading
    from .desk import ViewState
    from .screen import BusScreen

_COLUMNS: Final = {
    "unit": 5, "fn": 4, "register": 9, "qty": 5, "asked": 7, "every": 8, "jitter": 8, "p50": 8, "p95": 8, "max": 8,
    "answers": 9, "bad": 8, "moved": 6,
}  # fmt: skip
_DROPPED: Final = ("answers", "jitter", "p95", "asked", "moved", "max", "fn", "every", "qty")  # for want of room
_LEAST_VALUES: Final = 24  # columns that the newest values have, at least
_AGE: Final = 8
_PICTURE: Final = 8
_MANY: Final = 0.05
_NARROW: Final = 56
_LISTED: Final = 128  # values that are told below
_ON_A_LINE: Final = 8  # of them, where they are plain numbers that stand still
_VALUE: Final = 6  # columns of such a one


def _ended_badly(poll: WatchedPoll) -> float:
    return -poll.bad / max(1, poll.facts.asked)


_SORTS: Final[dict[str, Callable[[WatchedPoll], float]]] = {
    "unit": lambda _: 0.0,
    "bad": _ended_badly,
    "p95": lambda poll: -(poll.time(0.95) or 0),
    "max": lambda poll: -poll.facts.slowest,
    "every": lambda poll: poll.every_ns or 0,
    "jitter": lambda poll: -(poll.jitter_ns or 0),
    "asked": lambda poll: -poll.facts.asked,
    "moved": lambda poll: -int(poll.moved.sum()),
    "age": lambda poll: poll.facts.t_answered_ns,
}
"""Orders of the list, by column; where two are alike, by unit, function and address."""


class PollList(Lines):
    """A line a poll. Their order is made when the user asks for one, or a poll is new: it does not move by itself."""

    EMPTY = "nothing was asked yet"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("enter", "enter", "Open", tooltip="The transactions of this poll alone"),
        Binding("s", "sort(1)", "Sort", tooltip="By the next column; a click on a head sorts by it"),
        Binding("n", "notch(True)", "Notch", tooltip="Ignore changes so far, to highlight the next ones"),
        Binding("N", "notch(False)", "No notch", show=False, tooltip="All that moves stands out again"),
        Binding("d", "moving", "Moving", tooltip="Only polls in which something moves"),
        Binding("space", "pin", "Pin", tooltip="Keep this poll on top, or let it go"),
        Binding("x", "screen.raw", "Words", tooltip="What registers mean, or the registers as they came", show=False),
        Binding("U", "screen.view('units')", "Units", tooltip="Every unit on a line: load, outcomes, answer times"),
    ]

    def __init__(self, desk: ViewState, *, id: str) -> None:
        super().__init__(id=id)
        self.desk = desk
        self.sort = "unit"
        self.only_moving = False
        self.pins: set[PollKey] = set()
        self._ignored: dict[PollKey, NDArray[np.bool_]] = {}  # registers whose moving is of no interest
        self._polls: list[WatchedPoll] = []
        self._laid_out: tuple[object, ...] = ()
        self._read: dict[int, TransactionValues] = {}  # by the row that begins the transaction
        self._looked_at = -1  # the answer that is told below

    @property
    def empty(self) -> str:
        return self.desk.emptied(self.EMPTY)

    @property
    def poll(self) -> WatchedPoll | None:
        """The one under the cursor."""
        return self._polls[self.cursor] if self.cursor < len(self._polls) else None

    def grown(self) -> None:
        before = self.poll
        self._lay_out()
        if before is not None:
            self.cursor = next((i for i, poll in enumerate(self._polls) if poll.key == before.key), self.cursor)
        self._fresh_until = 0.0
        super().grown()
        if self.poll is not None and self.poll.facts.answered != self._looked_at:
            self._looked_at = self.poll.facts.answered
            self._tell()

    def _lay_out(self) -> None:
        log = self.desk.figures.watched
        moving = tuple(poll.key for poll in log if self.moving(poll).any()) if self.only_moving else ()
        now = (id(log), len(log), self.sort, frozenset(self.pins), moving, self.only_moving)
        if now == self._laid_out:
            return
        self._laid_out = now
        polls = [poll for poll in log if not self.only_moving or poll.key in moving]
        by = _SORTS[self.sort]
        self._polls = sorted(polls, key=lambda poll: (poll.key not in self.pins, by(poll), poll.key))

    def moving(self, poll: WatchedPoll) -> NDArray[np.bool_]:
        """Its registers that moved, but for those that are left out."""
        ignored = self._ignored.get(poll.key)
        return poll.moved & ~ignored if ignored is not None and len(ignored) == len(poll.moved) else poll.moved

    def count(self) -> int:
        return len(self._polls)

    def columns(self, width: int) -> dict[str, int]:
        """Those that there is room for beside the values, and their widths."""
        columns = dict(_COLUMNS)
        for name in _DROPPED:
            if sum(columns.values()) + _LEAST_VALUES + self._age(width) > width:
                columns.pop(name, None)
        return columns

    def _age(self, width: int) -> int:
        return _AGE if width >= _NARROW and self.desk.bus.timed else 0

    def head(self, width: int) -> Sequence[StyledText]:
        columns = self.columns(width)
        parts = [StyledText(f"{self._title(name):>{room}}", self._kind(name)) for name, room in columns.items()]
        age = self._age(width)
        values = max(0, width - sum(columns.values()) - age)
        parts.append(StyledText(f"  {tr('newest values'):<{max(0, values - 2)}}"[:values]))
        parts.append(StyledText(f"{self._title('age'):>{age}}" if age else "", self._kind("age")))
        return fitted(parts, width)

    def _title(self, name: str) -> str:
        return f"{tr(name)}▾" if name == self.sort else tr(name)

    def _kind(self, name: str) -> str:
        return "strong" if name == self.sort else ""

    def pieces(self, line: int, width: int) -> Sequence[StyledText]:
        poll, columns, age = self._polls[line], self.columns(width), self._age(width)
        parts = [self._cell(poll, name, room) for name, room in columns.items()]
        room = max(0, width - sum(columns.values()) - age)
        parts += fitted([StyledText(" "), *self._values(poll, room - 1)], room)
        if age:
            since = "-" if poll.facts.answered < 0 else short(self.desk.bus.t_last - poll.facts.t_answered_ns)
            parts.append(StyledText(f"{since:>{age}}", "dim"))
        return fitted(parts, width)

    def carried(self, poll: WatchedPoll) -> TransactionValues | None:
        """What its newest good answer carries, with what moved and is not left out."""
        row = poll.facts.answered if poll.facts.answered >= 0 else poll.facts.row
        if not 0 <= row < self.desk.bus.count:
            return None
        carried, moving = self._read_at(row), self.moving(poll)
        changed = frozenset(i for i in carried.changed if i >= len(moving) or moving[i])
        before = tuple(
            old if i in changed else now
            for i, (old, now) in enumerate(zip(carried.before, carried.values, strict=False))
        )
        return replace(carried, changed=changed, before=before if len(before) == len(carried.values) else ())

    def _read_at(self, row: int) -> TransactionValues:
        """What the transaction of a row carries; those of all lines in sight are read at once."""
        if row not in self._read:
            top, count = self.scroll_offset.y, self.desk.bus.count
            polls = self._polls[top : top + self.room]
            rows = {poll.facts.answered if poll.facts.answered >= 0 else poll.facts.row for poll in polls} | {row}
            wanted = sorted(each for each in rows if 0 <= each < count and each not in self._read)
            self._read = {each: kept for each, kept in self._read.items() if each in rows}
            self._read.update((carried.row, carried) for carried in poll_values(self.desk.bus, wanted))
        return self._read[row]

    def _values(self, poll: WatchedPoll, room: int) -> list[StyledText]:
        carried = self.carried(poll)
        if carried is None or poll.facts.answered < 0:
            return [StyledText(f" {tr('no good answer yet')}", "dim")]
        return carried_values(self.desk, carried, room)

    def _cell(self, poll: WatchedPoll, name: str, room: int) -> StyledText:
        key, off_ns = poll.key, self.desk.bus.off_ns
        match name:
            case "unit":
                return StyledText(f"{'•' if key in self.pins else ' '}{key.unit:>{room - 1}}", "request")
            case "fn":
                return StyledText(f"{key.function:>{room}}", "request")
            case "register":
                return StyledText(f"{key.register:>{room}}", "place")
            case "qty":
                return StyledText(f"{f'×{key.quantity}' if key.quantity >= 0 else '':>{room}}", "dim")
            case "asked":
                return StyledText(f"{compact(poll.facts.asked):>{room}}", "dim")
            case "every" | "jitter":
                told = poll.every_ns if name == "every" else poll.jitter_ns
                text = short(told) if self.desk.bus.timed else "-"
                return StyledText(f"{text if name == 'every' or told is None else f'±{text}':>{room}}")
            case "p50" | "p95" | "max":
                took = {"p50": poll.time(0.5), "p95": poll.time(0.95), "max": poll.facts.slowest}[name]
                known = took is not None and took >= 0
                return StyledText(
                    f"{short_bound(bounds_of(took, off_ns) if known and took is not None else None):>{room}}"
                )
            case "answers":
                return StyledText(f" {sparkline(poll.times.astype(float), _PICTURE):<{room - 1}}", "response")
            case "bad":
                return self._bad(poll, room)
        count = int(self.moving(poll).sum())
        return StyledText(f"{f'▲{count}' if count else '=':>{room}}", "moved" if count else "dim")

    def _bad(self, poll: WatchedPoll, room: int) -> StyledText:
        rate = poll.bad / max(1, poll.facts.asked)
        if poll.bad:
            text = rough_percent(rate)
            return StyledText(f"{text:>{room}}", "error" if rate > _MANY else "warning")
        late = tr("{count} late", count=compact(poll.facts.late)) if poll.facts.late else "-"
        return StyledText(f"{late:>{room}}", "warning" if poll.facts.late else "dim")

    def look(self) -> FrameDetail:
        """The poll under the cursor in full: how it went, and what it holds value by value."""
        poll = self.poll
        if poll is None:
            return NOTHING
        carried = self.carried(poll)
        items = [*_facts(poll), *(self._items(carried) if carried is not None else ())]
        return FrameDetail(poll_words(poll.key), b"", tuple(items))

    def _items(self, carried: TransactionValues) -> Iterator[Item]:
        """A line a value; of plain numbers that stand still several."""
        readings = islice(self.desk.meanings.readings(carried), _LISTED)
        for still, run in groupby(readings, lambda reading: reading.meaning.is_plain and not reading.changed):
            some, size = list(run), (_ON_A_LINE if self.size.width >= _NARROW else _ON_A_LINE // 2) if still else 1
            for begin in range(0, len(some), size):
                yield _values_item(some[begin : begin + size])

    # Keys

    def action_sort(self, step: int) -> None:
        names = list(_SORTS)
        self._sort_by(names[(names.index(self.sort) + step) % len(names)])

    def _sort_by(self, name: str) -> None:
        self.sort, self._laid_out = name, ()
        self.grown()
        self.unpaint()

    def action_notch(self, wanted: bool) -> None:
        self._ignored = {poll.key: poll.moved.copy() for poll in self.desk.figures.watched} if wanted else {}
        self.grown()
        self.unpaint()

    def action_moving(self) -> None:
        self.only_moving = not self.only_moving
        self.grown()

    def action_pin(self) -> None:
        if self.poll is not None:
            self.pins ^= {self.poll.key}
            self.grown()

    def on_click(self, event: events.Click) -> None:
        offset = event.get_content_offset(self)
        if offset is None or offset.y >= self.HEAD:
            super().on_click(event)
            return
        right, width = 0, self.scrollable_content_region.width
        for name, room in self.columns(width).items():
            right += room
            if offset.x < right:
                if name in _SORTS:
                    self._sort_by(name)
                return
        if offset.x >= width - self._age(width):
            self._sort_by("age")


def poll_words(key: PollKey) -> str:
    """`unit 1, FC 4 (0x04), 30001 ×88`."""
    parts = [tr("unit {unit}", unit=key.unit), function_code(key.function)]
    return ", ".join([*parts, key.registers] if key.register else parts)


def _values_item(some: Sequence[NamedReading]) -> Item:
    first = some[0]
    label = f"{first.register} {harmless(first.meaning.name)}".rstrip()
    text = "".join(f"{harmless(each.text):<{_VALUE}}" for each in some).rstrip()
    was = tr(", was {old}", old=harmless(first.before)) if first.changed else ""
    return Item(value_name(first.spot), text + was, kind="moved" if first.changed else "", label=f"{label} ")


def _facts(poll: WatchedPoll) -> list[Item]:
    ended = (
        (Status.ANSWERED, "answered"), (Status.EXCEPTION, "refused"), (Status.UNANSWERED, "not answered"),
        (Status.DAMAGED, "damaged"),
    )  # fmt: skip
    words = [f"{tr(word)} {grouped(int(poll.ended[status]))}" for status, word in ended if poll.ended[status]]
    if poll.facts.late:
        words.append(f"{tr('late')} {grouped(poll.facts.late)}")
    asked = ": ".join(filter(None, (grouped(poll.facts.asked), ", ".join(words))))
    items = [Item("asked", asked, label=f"{tr('asked'):<11}", kind="strong")]
    moved = int(poll.moved.sum())
    if len(poll.moved):
        text = tr("{some} of {all} moved", some=moved, all=counted(len(poll.moved), "register", "registers"))
        items.append(Item("moved", text, label=f"{tr('moved'):<11}", kind="dim"))
    return items


def poll_filter(key: PollKey) -> str:
    """The filter that means a poll."""
    text = f"unit == {key.unit} and function == {key.function}"
    if key.register:
        text = f"{register_text(key.unit, key.register)} and function == {key.function}"
        text += f" and quantity == {key.quantity}" if key.quantity >= 0 else ""
    return text


def _refresh(screen: BusScreen) -> None:
    screen.query_one(PollList).grown()


def _chosen(screen: BusScreen, sender: Widget) -> None:
    assert isinstance(sender, PollList)
    if screen.view == VIEW.name:
        screen.detail.show_frame(sender.look())


def _entered(screen: BusScreen, sender: Widget) -> None:
    """The transactions of that poll alone."""
    assert isinstance(sender, PollList)
    if sender.poll is not None:
        screen.action_view("transactions")
        screen.query_one(FilterBar).use_filter(poll_filter(sender.poll.key))


def _shown(screen: BusScreen) -> None:
    screen.detail.show_frame(screen.query_one(PollList).look())


def _at(screen: BusScreen) -> Place:
    poll = screen.query_one(PollList).poll
    return None if poll is None else PollPlace(poll.key.unit, poll.facts.row)


def _cells(screen: BusScreen) -> list[DoorCell]:
    poll = screen.query_one(PollList).poll
    if poll is None:
        return []
    key = poll.key
    cells = [
        DoorCell("p", tr("this poll: {words}", words=poll_words(key)), poll_filter(key)),
        DoorCell("u", tr("unit {unit}", unit=key.unit), f"unit == {key.unit}"),
        DoorCell("f", function_code(key.function), f"function == {key.function}"),
    ]
    if key.register:
        words = tr("register {register} of unit {unit}", register=key.register, unit=key.unit)
        cells.append(DoorCell("r", words, register_text(key.unit, key.register)))
    return cells


def _copied(screen: BusScreen) -> str:
    """The line under the cursor."""
    listing = screen.query_one(PollList)
    if listing.poll is None:
        return ""
    carried = listing.carried(listing.poll)
    values = () if carried is None else screen.desk.meanings.readings(carried)
    return harmless(f"{poll_words(listing.poll.key)}: {', '.join(f'{each.name} {each.text}' for each in values)}")


VIEW: Final = View(
    name="polls", key="4", title="Polls",
    make=lambda desk: PollList(desk, id="polls"), refresh=_refresh,
    chosen=_chosen, entered=_entered, shown=_shown, at=_at, cells=_cells, copied=_copied,
    detail=True, offers=OF_FIGURES | {"copy"}, figures=True,
)  # fmt: skip
