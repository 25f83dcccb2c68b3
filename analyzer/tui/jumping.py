"""Going somewhere: to a row, its counterpart, a finding, a bookmark, a hit."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from textual import work
from textual.worker import get_current_worker

from analyzer.model import goto, search

from .messages import HitFound
from .part import Part
from .prompts import Ask, Choose

if TYPE_CHECKING:
    pass

_WAYS: Final = (
    ("h", "bytes: 03 02, 0x03,0x02", search.for_bytes),
    ("t", "text: in the bytes or in the words of the list", search.for_text),
    ("v", "value: a register such as 17216 or -5, a float such as 230.5", search.for_value),
)


class Jumping(Part):
    """The part of the main screen that goes places."""

    _hits: search.Hits | None = None
    _sought = ""

    def go(self, row: int) -> None:
        """Show a row in the frame list, or in the conversations where those are shown."""
        if self.view == "conversations":
            if not self.talk.go(row):
                self.tell("the line shown holds it, or comes before it")
            return
        if self.view != "frames":
            self.row = row
            self.action_view("frames")
        if not self.frames.go(row):
            self.tell("that row is not among those shown (Esc shows all); this one comes before it")
        self.frames.focus()

    def action_counterpart(self) -> None:
        """From a request to its answer, from an answer to its request."""
        partner = None if self.row is None else self.desk.bus.partner(self.row)
        if partner is None:
            self.tell("no counterpart is known")
        else:
            self.go(partner)

    def action_finding(self, step: int) -> None:
        """The next row with a finding, or the one before."""
        bus = self.desk.bus
        row = bus.found.next_row(-1 if self.row is None else self.row, step)
        if row is None:
            self.tell("no finding further on" if step > 0 else "no finding before this")
        else:
            self.go(row)

    def action_next_bookmark(self) -> None:
        """The next bookmark, from the first one on again."""
        table = self.desk.bus.table
        rows = sorted(row for row in (table.row_of_bytes(*place) for place in self.desk.notes.comments) if row >= 0)
        if not rows:
            self.tell("no bookmarks yet: m sets one")
            return
        here = -1 if self.row is None else self.row
        self.go(next((row for row in rows if row > here), rows[0]))

    @work
    async def action_goto(self) -> None:
        """Ask where, and go there."""
        bus, here = self.desk.bus, self.row or 0

        def wrong(text: str) -> str:
            try:
                goto.place(text, bus, here)
            except goto.GotoError as error:
                return str(error)
            return ""

        text = await self.app.push_screen_wait(Ask("Go to", goto.FORMS, wrong=wrong))
        if text is not None:
            self.go(goto.place(text, bus, here))

    @work
    async def action_find(self) -> None:
        """Ask what to look for, and look."""
        which = await self.app.push_screen_wait(Choose("Find", [(key, words) for key, words, _ in _WAYS]))
        if which is None:
            return
        _, hint, make = _WAYS[which]

        def wrong(text: str) -> str:
            try:
                make(text)
            except search.SearchError as error:
                return str(error)
            return ""

        text = await self.app.push_screen_wait(Ask("Find", hint, value=self._sought, wrong=wrong))
        if text is not None:
            self._sought, self._hits = text, make(text)
            self.action_find_on(False)

    def action_find_on(self, back: bool) -> None:
        """The next hit, or the one before."""
        if self._hits is None:
            self.action_find()
            return
        self.doing = f"looking for {self._sought[:20]}"
        self.say()
        self.look_for(self._hits, -1 if self.row is None else self.row, back)

    @work(thread=True, group="find", exclusive=True, exit_on_error=False)
    def look_for(self, hits: search.Hits, row: int, back: bool) -> None:
        """Look for it."""
        worker = get_current_worker()
        found = search.find(self.desk.bus, hits, row, back=back, stop=lambda: worker.is_cancelled)
        if not worker.is_cancelled:
            self.post_message(HitFound(found))

    def on_hit_found(self, event: HitFound) -> None:
        self.doing = ""
        if event.row is None:
            self.tell(f"{self._sought[:40]} is not found further on")
            self.say()
        else:
            self.go(event.row)
