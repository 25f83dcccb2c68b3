"""The transactions: a line a request and what became of it, its values in columns; frames, noise and bytes fold out."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, ClassVar, Final

from rich.cells import cell_len
from textual.binding import Binding, BindingType
from textual.cache import LRUCache

from ..languages import tr
from ..model.polls import TransactionValues, poll_values
from ..model.selection import ListRows, Selection, Unfolded, transactions
from ..model.table import RowState
from ..tables.schema import Kind
from ..tables.transactions import Status
from ..words import pointed_ms, unit_word
from .frames import (
    LETTER,
    SEVERITY,
    UNHEARD,
    FrameList,
    at_the_row,
    beside_content,
    findings_beside,
    outcome_beside,
    owner_words,
    row_direction,
    row_marks,
    row_words,
    shown_row,
    to_its_fields,
    under_cursor,
)
from .messages import OnlyChanged
from .paint import StyledText
from .places import OF_ROWS
from .readings import carried_values
from .view import View, cells_of_row, grown

if TYPE_CHECKING:
    from .desk import ViewState

_OUTCOMES: Final = {"none": "no answer", "bcast": "broadcast", UNHEARD: "answer not heard", "": "…"}
_WORDY: Final = 48  # columns from which on there is room for all of the head
_BLOCK: Final = 32  # lines that are read at once
_CACHED: Final = 2048  # transactions


class TransactionList(FrameList):
    """Requests, each with its answer on the same line."""

    EMPTY = "no requests yet"
    COLUMNS = ("number", "time", "unit", "function", "register", "quantity", "answer")
    DROPPED = ((48, ("number", "quantity", "answer", "function")), (64, ("number", "quantity")))
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("right,l", "fold(True)", "Unfold", tooltip="Its frames, the noise and the bytes, below the line"),
        Binding("left,h", "fold(False)", "Fold", show=False),
        Binding("d", "changed", "Changed", tooltip="Only transactions whose answer differs from the last to that poll"),
        Binding("x", "screen.raw", "Words", tooltip="What registers mean, or the registers as they came", show=False),
    ]

    def __init__(self, desk: ViewState, *, id: str) -> None:
        super().__init__(desk, id=id)
        self.rows = Selection(desk.bus, transactions)
        self._lines = Unfolded(desk.bus, self.rows)
        self._meant = -1  # a request that is meant itself, not its answer
        self._read: LRUCache[int, TransactionValues] = LRUCache(_CACHED)

    def use_rows(self, rows: ListRows) -> None:
        row = self._lines.place(self.cursor)[0] if self.cursor < self._lines.count else self._left
        self.rows, self._lines, self._left = rows, Unfolded(self.desk.bus, rows), row
        self._announced = -1
        self.renewed(0 if row is None or not rows.count else self._lines.line(row))

    @property
    def row(self) -> int | None:
        """The row that the line under the cursor stands for: a transaction's answer, where there is one."""
        return self._stands_for(self.cursor) if self.cursor < self._lines.count else None

    def _stands_for(self, line: int) -> int:
        row, below = self._lines.place(line)
        partner = self.desk.bus.partner(row)
        return row if below or row == self._meant or partner is None or partner >= self.desk.bus.count else partner

    def go_to_row(self, row: int) -> bool:
        """Put the cursor on the transaction that holds a row; False where it is none of the list's."""
        if not self.rows.count:
            return False
        partner = self.desk.bus.partner(row)
        if self.desk.bus.is_noise(row) and self.unfolds(row):
            return self._go_below(row)
        answers = partner is not None and self.desk.bus.table.value("kind", row) == Kind.RESPONSE
        begins = partner if answers and partner is not None else row
        self.following = False
        line = self._lines.line(begins)
        if row != self.row:
            self._announced = -1
        self._meant = row
        self.move_to(line, middle=True)
        return self._lines.place(line)[0] == begins

    def unfolds(self, row: int) -> bool:
        """Whether a row is among those that unfold below a transaction of the list."""
        return bool(self.rows.count) and row in self._lines.below(row)

    def _go_below(self, row: int) -> bool:
        """Unfold the transaction of a row, and put the cursor on that row below it."""
        line = self._lines.turn(self._lines.line(row), wanted=True)
        self._strips.clear()
        self.following, self._meant = False, -1
        self.grown()
        at = line + 1 + self._lines.below(row).index(row)
        self.move_to(at, middle=True)
        return True

    def _tell(self) -> None:
        if self.cursor < self._lines.count and self._lines.place(self.cursor)[0] != self._meant:
            self._meant = -1
        super()._tell()

    def count(self) -> int:
        return self._lines.count

    def kind_of_line(self, line: int) -> str:
        row, below = self._lines.place(line)
        own = super().kind_of_line(line)
        partner = -1 if own or below else self.desk.bus.table.value("partner", row)
        return own if partner < 0 or partner >= self.desk.bus.count else self.desk.tint(partner)

    def row_at(self, line: int) -> int:
        return self._lines.place(line)[0]

    def action_fold(self, wanted: bool) -> None:
        if self.cursor < self._lines.count:
            line = self._lines.turn(self.cursor, wanted)
            self._strips.clear()
            self.move_to(line)
            self.grown()

    def action_changed(self) -> None:
        self.post_message(OnlyChanged())

    def head(self, width: int) -> Sequence[StyledText]:
        number, time, _ = self.columns(width)
        title = "" if time == 1 else self.time_title()
        what = tr("outcome") if width >= _WORDY else tr("what")
        heads = (
            ("", "  "), ("number", f"{'#':>{number}} "), ("time", f"{title:>{time}} "), ("unit", f"{tr('unit'):>4} "),
            ("function", f"{tr('fn'):>3} "), ("register", f"{tr('register'):>8} "),
            ("quantity", f"{tr('qty'):<5}"), ("answer", f"{unit_word('ms'):>6}     "), ("", what),
        )  # fmt: skip
        return self.shown([(column, StyledText(text)) for column, text in heads], width)

    def pieces(self, line: int, width: int) -> Sequence[StyledText]:
        row, below = self._lines.place(line)
        if below:
            return [StyledText("  │ ", "dim"), *self.row_pieces(row, None, width - 4)]
        desk, table = self.desk, self.desk.bus.table
        number, time, _ = self.columns(width)
        carried = self._values(line, row)
        answer = carried.answer
        ended = outcome_beside(desk, row if answer < 0 else answer)
        grave = max(table.value("mark", row), 0 if answer < 0 else table.value("mark", answer))
        own = (row_marks(desk, each) for each in (row, answer) if each >= 0)
        mark = next(filter(_is_noted, own), StyledText("  "))  # the user's, on the request or on its answer
        took = desk.bus.response(answer) if answer >= 0 else None
        quantity = "" if carried.quantity < 0 else f"×{carried.quantity}"
        parts = self.shown([
            ("", StyledText(LETTER[grave] + mark.text[1], SEVERITY[grave] or mark.kind)),
            ("number", StyledText(f"{table.value('frame', row):>{number}} ", "dim")),
            ("time", StyledText(f"{self.time(row, self.row_at(line - 1) if line else None, width):>{time}} ")),
            ("unit", StyledText(f"{table.value('unit', row):>4} ", "request")),
            ("function", StyledText(f"{table.value('function', row):>3} ", "request")),
            ("register", StyledText(f"{carried.register:>8} ", "place")),
            ("quantity", StyledText(f"{quantity:<5}", "dim")),
            ("answer", StyledText(f"{'' if took is None else pointed_ms(*took):<11}")),
        ], width)  # fmt: skip
        room = max(0, width - sum(cell_len(part.text) for part in parts))
        return [*parts, *self._outcome(carried, ended, room)]

    def _outcome(self, carried: TransactionValues, ended: StyledText, room: int) -> Sequence[StyledText]:
        """What came of it: values in columns, or words where there are none."""
        desk, row, answer = self.desk, carried.row, carried.answer
        table = desk.bus.table
        about = findings_beside(desk, row)
        about += [*owner_words(desk, answer), *findings_beside(desk, answer)] if answer >= 0 else []
        bad = answer >= 0 and (table.value("exception", answer) > 0 or not table.value("check", answer))
        if bad:
            about = [each for each in about if each.text.strip() != "exception"]
        outcome: list[StyledText] = []
        if answer < 0 and table.value("state", row) & RowState.STATUS == Status.ANSWERED + 1:
            unsure = StyledText(tr("an answer came; it is unclear to which request"), "warning")
            return beside_content([*row_words(desk, row)[0], StyledText(" → ", "response"), unsure], about, room)
        if answer < 0 and not ended.text and desk.bus.whole:
            return beside_content(row_words(desk, row)[0], about, room)  # nobody can say what became of it
        if answer < 0 and row_direction(desk, row) == "request":
            outcome = [StyledText(tr(_OUTCOMES.get(ended.text, ended.text)), ended.kind)]
            if carried.register and carried.values:
                outcome += [StyledText(": "), *carried_values(desk, carried, room)]
        elif carried.values and not bad:
            changes = desk.scope.only_changed and bool(carried.changed)
            told = carried_values(desk, carried, room, only_changed=changes)
            if desk.scope.only_changed and not changes:
                told = [StyledText(tr("new "), "dim"), *told]
            return beside_content(told, about, room)
        elif answer >= 0:
            outcome = row_words(desk, answer)[0]
        if not carried.register:
            outcome = [*row_words(desk, row)[0], *([StyledText(" → ", "response")] if outcome else []), *outcome]
        return beside_content(outcome, about, room)

    def _values(self, line: int, row: int) -> TransactionValues:
        """What a line carries; a block of lines is read at once."""
        table, read = self.desk.bus.table, self._read
        ready = read.get(row)
        if ready is not None and ready.answer == table.value("partner", row):
            return ready
        first = line // _BLOCK * _BLOCK
        spots = [self._lines.place(i) for i in range(first, min(first + _BLOCK, self._lines.count))]
        for carried in poll_values(self.desk.bus, [each for each, below in spots if not below]):
            read[carried.row] = carried
        return read[row]


def _is_noted(mark: StyledText) -> bool:
    return mark.text[1] != " "


VIEW: Final = View(
    name="transactions", key="1", title="Transactions", short="Trans",
    make=lambda desk: TransactionList(desk, id="transactions"), refresh=grown,
    chosen=shown_row, entered=to_its_fields, shown=at_the_row, at=under_cursor, cells=cells_of_row,
    detail=True, offers=OF_ROWS,
)  # fmt: skip
