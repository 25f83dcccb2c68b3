"""The frame list: a line a row of the bus, requests and answers joined."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from analyzer.model.clock import TimeBase, short
from analyzer.model.selection import Everything, Rows

from . import rows as words
from .lines import Lines
from .paint import Piece, fitted

if TYPE_CHECKING:
    from .desk import Desk

_NARROW = 60  # columns from which on there is room for the silence before a row
_OUTCOMES = {"none": "no answer", "bcast": "broadcast", words.UNHEARD: "answer not heard", "": "…"}
_WIDE = 100  # columns from which on there is room for the answer's time


class FrameList(Lines):
    """Rows of the bus, all or a selection of them."""

    EMPTY = "no frames yet"

    def __init__(self, desk: Desk, *, id: str) -> None:
        super().__init__(id=id)
        self.desk = desk
        self.rows: Rows = Everything(desk.bus)
        self.pinned: int | None = None  # row from which on rows are selected

    def use(self, rows: Rows) -> None:
        """Show other rows; the cursor stays on its row, or on the last one before it."""
        row = self.row
        self.rows = rows
        self._told = -1
        self.renewed(0 if row is None or not rows.count else rows.position(row))

    @property
    def row(self) -> int | None:
        """The row under the cursor."""
        return self.rows.row(self.cursor) if self.cursor < self.rows.count else None

    def go(self, row: int) -> bool:
        """Put the cursor on a row; False where the list does not show it, and the nearest one before was taken."""
        if not self.rows.count:
            return False
        position = self.rows.position(row)
        self.following = False
        self.move_to(position, middle=True)
        return self.rows.row(position) == row

    def count(self) -> int:
        return self.rows.count

    def kind_of_line(self, line: int) -> str:
        row, here = self.rows.row(line), self.row
        if self.pinned is None or here is None:
            return ""
        return "lit" if min(self.pinned, here) <= row <= max(self.pinned, here) else ""

    def _columns(self, width: int) -> tuple[int, int, int]:
        """Widths: number, time, answer's time (0: not shown)."""
        time = {TimeBase.ABSOLUTE: 15, TimeBase.PREVIOUS: 7}.get(self.desk.base, 10)
        bus = self.desk.bus
        if self.desk.base in (TimeBase.START, TimeBase.REFERENCE):
            time = max(time, len(str((bus.t_last - bus.t_first) // 1_000_000_000)) + 8)
        if not bus.timed:
            time = 1
        return max(4, len(str(bus.frames))), time, 7 if width >= _WIDE else 0

    def head(self, width: int) -> Sequence[Piece]:
        number, time, answer = self._columns(width)
        base = self.desk.base
        title = {TimeBase.START: "time s", TimeBase.REFERENCE: "from R s", TimeBase.PREVIOUS: "delta"}.get(base, "UTC")
        if not self.desk.bus.timed:
            title = ""
        answers = f"{'answer':>{answer}} " if answer else ""
        gap = f" {'gap':>6}" if width >= _NARROW else ""
        return [Piece(f"  {'#':>{number}} {title:>{time}}{gap}     unit fn {answers} what")]

    def pieces(self, line: int, width: int) -> Sequence[Piece]:
        row = self.rows.row(line)
        desk, table = self.desk, self.desk.bus.table
        number, time, answer = self._columns(width)
        noise = desk.bus.is_noise(row)
        kind = words.direction(desk, row)
        before = self.rows.row(line - 1) if line else None
        index = "" if noise else str(table.value("frame", row))
        unit = "" if noise else str(table.value("unit", row))
        function = "" if noise else f"{table.value('function', row):02X}"
        pieces = [
            words.marks(desk, row),
            Piece(f"{index:>{number}} ", "dim"),
            Piece(f"{desk.time(row, before):>{time}} "),
            Piece(f"{short(desk.bus.gap_ns(row)):>6} " if width >= _NARROW else "", "dim"),
            Piece(f" {words.joint(desk, row)} ", kind),
            Piece(f"{unit:>4} {function:>2} ", kind),
        ]
        ended = words.ended(desk, row)
        if answer:
            pieces.append(Piece(f"{ended.text:>{answer}}  ", ended.kind))
        else:
            pieces.append(Piece(" "))
        said, about = words.words(desk, row)
        if not answer and ended.text == words.UNHEARD:
            about.append(Piece("  answer not heard", "dim"))
        elif not answer and ended.kind == "error" and not about:
            about.append(Piece(f"  {'unanswered' if ended.text == 'none' else 'bad answer'}", "error"))
        taken = sum(len(piece.text) for piece in pieces)
        return [*pieces, *words.shared(said, about, max(0, width - taken))]


class ConversationList(FrameList):
    """Requests, each with its answer on the same line."""

    EMPTY = "no requests yet"

    def head(self, width: int) -> Sequence[Piece]:
        number, time, _ = self._columns(width)
        return [Piece(f"  {'#':>{number}} {'time':>{time}} unit fn {'answer':>7}  request → what became of it")]

    def pieces(self, line: int, width: int) -> Sequence[Piece]:
        row = self.rows.row(line)
        desk, table = self.desk, self.desk.bus.table
        number, time, _ = self._columns(width)
        answer = table.value("partner", row)
        before = self.rows.row(line - 1) if line else None
        asked, about = words.words(desk, row)
        said: list[Piece] = []
        if answer >= 0:
            said, more = words.words(desk, answer)
            about += more
        ended = words.ended(desk, row if answer < 0 else answer)
        if answer < 0 and words.direction(desk, row) == "request":
            outcome = _OUTCOMES.get(ended.text, ended.text)
            said = [Piece(outcome, ended.kind)]
        grave = max(table.value("mark", row), 0 if answer < 0 else table.value("mark", answer))
        mark = words.marks(desk, row)
        pieces = [
            Piece(words.LETTER[grave] + mark.text[1], words.SEVERITY[grave] or mark.kind),
            Piece(f"{table.value('frame', row):>{number}} ", "dim"),
            Piece(f"{desk.time(row, before):>{time}} "),
            Piece(f"{table.value('unit', row):>4} {table.value('function', row):02X} ", "request"),
            Piece(f"{ended.text:>7}  ", ended.kind),
        ]
        room = max(0, width - sum(len(piece.text) for piece in pieces))
        arrow = Piece(" → ", "response")
        both = [*asked, arrow, *said]
        if sum(len(piece.text) for piece in both) > room:
            both = [*fitted(asked, min(sum(len(piece.text) for piece in asked), room // 2)), arrow, *said]
        return [*pieces, *words.shared(both, about, room)]
