"""The conversations: a line a request, with what became of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from . import rows as words
from .frames import FrameList, at_the_row, shown_row, to_its_fields, under_cursor
from .paint import StyledText, fitted
from .view import View, grown

_OUTCOMES: Final = {"none": "no answer", "bcast": "broadcast", words.UNHEARD: "answer not heard", "": "…"}


class ConversationList(FrameList):
    """Requests, each with its answer on the same line."""

    EMPTY = "no requests yet"

    def head(self, width: int) -> Sequence[StyledText]:
        number, time, _ = self.columns(width)
        return [StyledText(f"  {'#':>{number}} {'time':>{time}} unit fn {'answer':>7}  request → what became of it")]

    def pieces(self, line: int, width: int) -> Sequence[StyledText]:
        row = self.rows.row(line)
        desk, table = self.desk, self.desk.bus.table
        number, time, _ = self.columns(width)
        answer = table.value("partner", row)
        before = self.rows.row(line - 1) if line else None
        asked, about = words.words(desk, row)
        said: list[StyledText] = []
        if answer >= 0:
            said, more = words.words(desk, answer)
            about += more
        ended = words.ended(desk, row if answer < 0 else answer)
        if answer < 0 and words.direction(desk, row) == "request":
            outcome = _OUTCOMES.get(ended.text, ended.text)
            said = [StyledText(outcome, ended.kind)]
        grave = max(table.value("mark", row), 0 if answer < 0 else table.value("mark", answer))
        mark = words.marks(desk, row)
        pieces = [
            StyledText(words.LETTER[grave] + mark.text[1], words.SEVERITY[grave] or mark.kind),
            StyledText(f"{table.value('frame', row):>{number}} ", "dim"),
            StyledText(f"{desk.time(row, before):>{time}} "),
            StyledText(f"{table.value('unit', row):>4} {table.value('function', row):02X} ", "request"),
            StyledText(f"{ended.text:>7}  ", ended.kind),
        ]
        room = max(0, width - sum(len(piece.text) for piece in pieces))
        arrow = StyledText(" → ", "response")
        both = [*asked, arrow, *said]
        if sum(len(piece.text) for piece in both) > room:
            both = [*fitted(asked, min(sum(len(piece.text) for piece in asked), room // 2)), arrow, *said]
        return [*pieces, *words.shared(both, about, room)]


VIEW: Final = View(
    name="conversations", key="2", title="Conversations", short="Talk",
    make=lambda desk: ConversationList(desk, id="conversations"), refresh=grown,
    chosen=shown_row, entered=to_its_fields, shown=at_the_row, at=under_cursor,
    detail=True, filtered=True,
)  # fmt: skip
