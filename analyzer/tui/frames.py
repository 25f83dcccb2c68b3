"""The frame list: a line a row of the bus, requests and answers joined, in pieces of text that conversations show too.

Which columns of the lists are shown is kept among the user's preferences.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, ClassVar, Final

import numpy as np
from rich.cells import cell_len

from dissectors.values import harmless

from ..languages import counted, tr, wording
from ..model.owners import owner
from ..model.polls import carried_by_each
from ..model.selection import Everything, ListRows
from ..model.table import RowState
from ..tables.schema import Kind
from ..tables.transactions import Status
from ..words import TimeBase, short, short_bound, zone_name
from .details import Details
from .items import NOTHING
from .lines import Lines
from .paint import StyledText, fitted
from .places import OF_ROWS, Place, RowPlace
from .prompts import Choose
from .readings import carried_values
from .view import View, cells_of_row, grown

if TYPE_CHECKING:
    from textual.widget import Widget

    from ..model.polls import TransactionValues
    from ..tables.findings import Finding
    from .desk import ViewState
    from .screen import BusScreen

SEVERITY: Final = ("", "note", "warning", "error")  # kind of text by mark
LETTER: Final = (" ", "N", "W", "E")
UNHEARD: Final = "unheard"  # an answer that the recording may have missed
_NOISE_BYTES: Final = 12
_ENDED: Final = {
    Status.UNANSWERED: ("none", "error"),
    Status.BROADCAST: ("bcast", "dim"),
    Status.DAMAGED: ("bad", "error"),
    Status.UNHEARD: (UNHEARD, "dim"),
}


def row_marks(desk: ViewState, row: int) -> StyledText:
    """Two characters: the gravest finding's letter, and `*` for a bookmark or `R` for the time reference."""
    mark = desk.bus.table.value("mark", row)
    place = desk.place(row)
    note = "R" if place == desk.notes.reference else "*" if place in desk.notes.comments else " "
    return StyledText(LETTER[mark] + note, SEVERITY[mark] or ("accent" if note != " " else ""))


def joint(desk: ViewState, row: int) -> str:
    """Two characters: how a row hangs together with its neighbour, and its direction."""
    table = desk.bus.table
    kind, partner = table.value("kind", row), table.value("partner", row)
    if kind == Kind.NOISE:
        return "~~"
    if kind == Kind.REQUEST:
        return "┌→" if partner == row + 1 else "╷→" if partner >= 0 else " →"
    return "└←" if partner == row - 1 and _mutual(desk, row, partner) else "╵←" if partner >= 0 else "?←"


def _mutual(desk: ViewState, row: int, partner: int) -> bool:
    return desk.bus.table.value("partner", partner) == row


def row_direction(desk: ViewState, row: int) -> str:
    """The kind of text of a row's direction."""
    return ("noise", "request", "response")[desk.bus.table.value("kind", row)]


def row_words(desk: ViewState, row: int) -> tuple[list[StyledText], list[StyledText]]:
    """A row in words; and what was said of it: codes of findings, the user's comment."""
    bus = desk.bus
    if bus.is_noise(row):
        octets = bus.captured(row)
        shown = octets[:_NOISE_BYTES].hex(" ").upper() + (" …" if len(octets) > _NOISE_BYTES else "")
        content = [StyledText(f"{tr('noise')}, {counted(len(octets), 'byte', 'bytes')}: {shown}", "noise")]
        findings = bus.findings(row)
    else:
        frame = bus.frame(row)
        findings = frame.findings
        content = [StyledText("" if frame.crc_ok else tr("CRC wrong: "), "error"), StyledText(frame.summary(wording()))]
    return content, _about(desk, row, findings)


def findings_beside(desk: ViewState, row: int) -> list[StyledText]:
    """What was said of a row: codes of findings, the user's comment."""
    return _about(desk, row, desk.bus.findings(row))


def _about(desk: ViewState, row: int, findings: Sequence[Finding]) -> list[StyledText]:
    codes = {finding.code: finding.severity for finding in reversed(findings)}
    parts = [StyledText(f"  {code}", SEVERITY[severity]) for code, severity in codes.items()]
    comment = desk.notes.comments.get(desk.place(row))
    if comment:
        parts.append(StyledText(f'  "{harmless(comment)}"', "accent"))
    return parts


def beside_content(content: list[StyledText], about: list[StyledText], width: int) -> list[StyledText]:
    """Both in this many columns: at least half for the words, the rest for what was said of them."""
    need = sum(cell_len(part.text) for part in about)
    if not need:
        return fitted(content, width)
    room = max(width - need, width // 2)
    size = sum(cell_len(part.text) for part in content)
    return fitted([*(fitted(content, room) if size > room else content), *about], width)


def outcome_beside(desk: ViewState, row: int) -> StyledText:
    """How long an answer took; of a request, that there was none."""
    table = desk.bus.table
    kind = table.value("kind", row)
    if kind == Kind.RESPONSE:
        return StyledText(short_bound(desk.bus.response(row)), "")
    if kind == Kind.REQUEST and table.value("partner", row) < 0:
        status = table.value("state", row) & RowState.STATUS
        if status:
            return StyledText(*_ENDED.get(Status(status - 1), ("", "")))
    return StyledText("", "")


_WORDS: Final = {
    "number": "number of the frame", "time": "time", "gap": "silence before it", "unit": "unit",
    "function": "function", "register": "register", "quantity": "quantity", "answer": "time of the answer",
}  # fmt: skip


class ShownColumns:
    """The columns of the list that is shown."""

    def __init__(self, screen: BusScreen) -> None:
        self._screen = screen

    async def choose(self) -> None:
        """Show and hide them one by one, until Esc."""
        screen, wishes = self._screen, self._screen.desk.wishes
        listing = screen.query_one(f"#{screen.list_view}", FrameList)
        at: int | None = 0
        while at is not None:
            names = [f"{listing.id}.{column}" for column in listing.COLUMNS]
            choices = [
                (str(i), f"{'·' if name in wishes.hidden else '✓'} {tr(_WORDS[column])}")
                for i, (name, column) in enumerate(zip(names, listing.COLUMNS, strict=True), 1)
            ]
            at = await screen.app.push_screen_wait(Choose(tr("Columns; Esc: done"), choices, at=at))
            if at is not None:
                wishes.hidden ^= {names[at]}
                wishes.save()
                listing.unpaint()


Dropped = tuple[tuple[int, tuple[str, ...]], ...]  # columns of the screen under which columns of the list are left out
_SLIM = 48  # columns under which times are shorter
_NARROW = 60  # columns from which on there is room for the silence before a row
_WIDE = 100  # columns from which on there is room for the answer's time


class FrameList(Lines):
    """Rows of the bus, all or a selection of them."""

    EMPTY = "no frames yet"
    COLUMNS: ClassVar[tuple[str, ...]] = ("number", "time", "gap", "unit", "function", "answer")
    DROPPED: ClassVar[Dropped] = ((_SLIM, ("number", "function")),)

    @property
    def empty(self) -> str:
        if self.desk.bus.count and self.desk.scope.only_changed and not self.desk.scope.narrows:
            return tr("no answer changed; d shows all")
        return self.desk.emptied(self.EMPTY)

    def __init__(self, desk: ViewState, *, id: str) -> None:
        super().__init__(id=id)
        self.desk = desk
        self.rows: ListRows = Everything(desk.bus)
        self._left: int | None = None  # the row that the cursor was on before a scope emptied the list
        self.pinned: int | None = None  # row from which on rows are selected
        self.pinned_to: int | None = None  # and up to which; None: up to the cursor
        self._carry: dict[int, TransactionValues | None] = {}  # what rows in sight carry

    def use_rows(self, rows: ListRows) -> None:
        """Show other rows; the cursor stays on its row, or on the last one before it."""
        row = self._left if self.row is None else self.row
        self.rows, self._left = rows, row
        self._announced = -1
        self.renewed(0 if row is None or not rows.count else rows.position(row))

    @property
    def row(self) -> int | None:
        """The row under the cursor."""
        return self.rows.row(self.cursor) if self.cursor < self.rows.count else None

    def go_to_row(self, row: int) -> bool:
        """Put the cursor on a row; False where the list does not show it, and the nearest one before was taken."""
        if not self.rows.count:
            return False
        position = self.rows.position(row)
        self.following = False
        self.move_to(position, middle=True)
        return self.rows.row(position) == row

    def count(self) -> int:
        return self.rows.count

    def row_at(self, line: int) -> int:
        """The row on a line."""
        return self.rows.row(line)

    def kind_of_line(self, line: int) -> str:
        row, end = self.row_at(line), self.row if self.pinned_to is None else self.pinned_to
        if self.pinned is not None and end is not None and min(self.pinned, end) <= row <= max(self.pinned, end):
            return "lit"
        return self.desk.tint(row)

    def columns(self, width: int) -> tuple[int, int, int]:
        """Widths: number, time, answer's time (0: not shown)."""
        bus = self.desk.bus
        time = {TimeBase.ABSOLUTE: 21, TimeBase.PREVIOUS: 7}.get(self.desk.base, 10)
        if self.desk.base in (TimeBase.START, TimeBase.REFERENCE):
            time = max(time, len(str((bus.t_last - bus.t_first) // 1_000_000_000)) + 8)
        if not bus.timed:
            time = 1
        elif width < _SLIM:
            time = len(self._as_short("0" * time))
        return max(4, len(str(bus.frames))), time, 7 if width >= _WIDE else 0

    def time(self, row: int, before: int | None, width: int) -> str:
        """When a row began, as exact as there is room for."""
        text = self.desk.time(row, before)
        return self._as_short(text) if width < _SLIM and self.desk.bus.timed else text

    def _as_short(self, text: str) -> str:
        """Milliseconds, and no date."""
        base = self.desk.base
        return text if base is TimeBase.PREVIOUS else text[6:-3] if base is TimeBase.ABSOLUTE else text[:-3]

    def time_title(self) -> str:
        """What stands over the times."""
        desk, base = self.desk, self.desk.base
        title = {TimeBase.START: "time s", TimeBase.REFERENCE: "from R s", TimeBase.PREVIOUS: "delta"}.get(base)
        dated = tr("date, {zone}", zone=zone_name(desk.bus.t_first, desk.zone)) if desk.bus.timed else ""
        return dated if title is None or not dated else tr(title)

    def shown(self, cells: Sequence[tuple[str, StyledText]], width: int) -> list[StyledText]:
        """Cells by column, without those that the user hid, nor some where else there was no room for what happened."""
        hidden = self.desk.wishes.hidden
        dropped = next((names for least, names in self.DROPPED if width < least), ())
        return [cell for column, cell in cells if f"{self.id}.{column}" not in hidden and column not in dropped]

    def states(self, lines: range) -> Sequence[object] | None:
        """Their rows, what was said of these, and of those that they answer or that answer them."""
        bus = self.desk.bus
        rows = np.array([self.row_at(line) for line in lines], np.int64)
        partners = bus.table.take_column("partner", rows).astype(np.int64)
        partners[partners >= bus.count] = -1
        beside = np.where(partners < 0, rows, partners)
        read = bus.table.take_column
        columns = [rows, partners, read("partner", beside), *(read("state", each) for each in (rows, beside))]
        marks = [read("mark", each) for each in (rows, beside)]
        found = np.where(marks[0] | marks[1], bus.found.count, 0)
        common = bus.t_first, bus.off_ns, bus.whole, self.columns(self.scrollable_content_region.width)
        return [(common, *each) for each in zip(*(part.tolist() for part in (*columns, *marks, found)), strict=True)]

    def grown(self) -> None:
        self._carry = {}
        super().grown()

    def unpaint(self) -> None:
        self._carry = {}
        super().unpaint()

    def _carried(self, row: int) -> TransactionValues | None:
        """What a row carries; that of all rows in sight is read at once."""
        if row not in self._carry:
            top = self.scroll_offset.y
            lines = range(top, min(top + self.room, self.count()))
            self._carry = carried_by_each(self.desk.bus, list({row, *(self.row_at(line) for line in lines)}))
        return self._carry[row]

    def head(self, width: int) -> Sequence[StyledText]:
        number, time, answer = self.columns(width)
        heads = (
            ("", "  "), ("number", f"{'#':>{number}} "), ("time", f"{self.time_title():>{time}} "),
            ("gap", f"{tr('gap'):>6} " if width >= _NARROW else ""), ("", "    "),
            ("unit", f"{tr('unit'):>4} "), ("function", f"{tr('fn'):>3} "),
            ("answer", f"{tr('answer'):>{answer}}  " if answer else " "), ("", tr("what")),
        )  # fmt: skip
        return self.shown([(column, StyledText(text)) for column, text in heads], width)

    def pieces(self, line: int, width: int) -> Sequence[StyledText]:
        return self.row_pieces(self.rows.row(line), self.rows.row(line - 1) if line else None, width)

    def row_pieces(self, row: int, before: int | None, width: int) -> Sequence[StyledText]:
        """A row on a line of its own, `before` the one above it."""
        desk, table = self.desk, self.desk.bus.table
        number, time, answer = self.columns(width)
        noise = desk.bus.is_noise(row)
        kind = row_direction(desk, row)
        index = "" if noise else str(table.value("frame", row))
        unit = "" if noise else str(table.value("unit", row))
        function = "" if noise else str(table.value("function", row))
        ended = outcome_beside(desk, row)
        parts = self.shown([
            ("", row_marks(desk, row)),
            ("number", StyledText(f"{index:>{number}} ", "dim")),
            ("time", StyledText(f"{self.time(row, before, width):>{time}} ")),
            ("gap", StyledText(f"{short(desk.bus.gap_ns(row)):>6} " if width >= _NARROW else "", "dim")),
            ("", StyledText(f" {joint(desk, row)} ", kind)),
            ("unit", StyledText(f"{unit:>4} ", kind)),
            ("function", StyledText(f"{function:>3} ", kind)),
            ("answer", StyledText(f"{tr(ended.text):>{answer}}  ", ended.kind) if answer else StyledText(" ")),
        ], width)  # fmt: skip
        content, about = row_words(desk, row)
        about += owner_words(desk, row)
        used = sum(len(part.text) for part in parts)
        if not desk.raw:
            content = _by_meaning(desk, self._carried(row), content, width - used)
        if not answer and ended.text == UNHEARD:
            about.append(StyledText(f"  {tr('answer not heard')}", "dim"))
        elif not answer and ended.kind == "error" and not about:
            why = tr("unanswered") if ended.text == "none" else tr("bad answer")
            about.append(StyledText(f"  {why}", "error"))
        return [*parts, *beside_content(content, about, max(0, width - used))]


def _by_meaning(
    desk: ViewState, poll: TransactionValues | None, content: list[StyledText], room: int
) -> list[StyledText]:
    """The words of a frame with its registers as what they mean, where that is known."""
    if poll is None or not desk.meanings.means(poll):
        return content
    words = "".join(part.text for part in content).partition(":")[0]
    return [StyledText(f"{words}: "), *carried_values(desk, poll, room - len(words))]


def owner_words(desk: ViewState, row: int) -> list[StyledText]:
    """Whose answer a row is, where that is not the request that the client takes it for, or nobody can tell."""
    said = owner(desk.bus, row)
    return [StyledText(f"  {said}", "error")] if said else []


def shown_row(screen: BusScreen, sender: Widget) -> None:
    """The row under the cursor is the one under study, where the list is in sight."""
    assert isinstance(sender, FrameList)
    if sender.id != screen.view:
        return
    if sender.row is None:
        screen.detail.show_frame(NOTHING)
    else:
        screen.study_row(sender.row)


def to_its_fields(screen: BusScreen, sender: Widget) -> None:  # noqa: ARG001
    """A row was opened: the keys go to its fields."""
    screen.query_one(Details).focus()


def at_the_row(screen: BusScreen) -> None:
    """The list that has come up is at the row under study, which stands below; at its end if all lists follow that."""
    listing = screen.query_one(f"#{screen.view}", FrameList)
    if all(each.following for each in screen.query(FrameList)):
        listing.grown()
    elif screen.studied is not None:
        listing.go_to_row(screen.studied)
    if screen.studied is not None and listing.row is not None:
        screen.study_row(listing.row)


def under_cursor(screen: BusScreen) -> Place:
    """The row that the list's cursor stands on."""
    row = screen.query_one(f"#{screen.view}", FrameList).row
    return None if row is None else RowPlace(row)


VIEW: Final = View(
    name="frames", key="2", title="Frames",
    make=lambda desk: FrameList(desk, id="frames"), refresh=grown,
    chosen=shown_row, entered=to_its_fields, shown=at_the_row, at=under_cursor, cells=cells_of_row,
    detail=True, offers=OF_ROWS,
)  # fmt: skip
