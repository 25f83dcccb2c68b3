"""Going somewhere: to a row, its counterpart, a finding, a bookmark, a hit."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Final

from ..model import goto, search
from .burst import FINDING
from .frames import FrameList
from .prompts import Ask, Choose

if TYPE_CHECKING:
    from .screen import BusScreen

_WAYS: Final = (
    ("h", "bytes: 03 02, 0x03,0x02", search.for_bytes),
    ("t", "text: in the bytes or in the words of the list", search.for_text),
    ("v", "value: a register such as 17216 or -5, a float such as 230.5", search.for_value),
)


class Jumps:
    """How the main screen goes places."""

    def __init__(self, screen: BusScreen) -> None:
        self._screen = screen
        self._bus = screen.desk.bus
        self._hits: search.Hits | None = None
        self._sought = ""
        self._arrived: tuple[int | None, int] = (None, -1)  # where the cursor was put, and for which row
        self._waiting: deque[bool] = deque()  # steps to the next hit that are still to be made; True: back

    def go(self, row: int) -> None:
        """Show a row in the list that was last in sight: transactions or frames. Noise is in the frames alone."""
        screen = self._screen
        listed = screen.list_view
        shown = "frames" if self._bus.is_noise(row) else listed
        if screen.view != shown:
            screen.action_view(shown, row)
            screen.list_view = listed
        found = screen.query_one(f"#{shown}", FrameList)
        if not found.go(row):
            screen.tell("that row is not among those shown (Esc takes the filter back); this one comes before it")
        found.focus()
        self._arrived = found.row, row

    @property
    def here(self) -> int:
        """The row to go on from: where one last went, if the cursor is still there, else that of the cursor."""
        row = self._screen.row
        if row is None:
            return -1
        shown, meant = self._arrived
        return meant if shown == row else row

    def to_counterpart(self) -> None:
        """From a request to its answer, from an answer to its request."""
        partner = None if self.here < 0 else self._bus.partner(self.here)
        if partner is None:
            self._screen.tell("no counterpart is known")
        else:
            self.go(partner)

    def to_finding(self, step: int) -> None:
        """The next row with a finding, or the one before."""
        here, shown = self.here, self._screen.frames.rows
        rows = self._bus.found.rows_beyond(here, step)
        row = next((row for row in rows.tolist() if shown.row(shown.position(row)) == row), None)
        if row is None:
            self._screen.tell("no finding further on" if step > 0 else "no finding before this")
        else:
            self.go(row)

    async def ask_where(self) -> None:
        """Ask where to go, and go there."""
        here = self._screen.row or 0

        def wrong(text: str) -> str:
            try:
                goto.place(text, self._bus, here, self._screen.desk.zone)
            except goto.GotoError as error:
                return str(error)
            return ""

        text = await self._screen.app.push_screen_wait(Ask("Go to", goto.FORMS, wrong=wrong))
        if text is not None:
            self.go(goto.place(text, self._bus, here, self._screen.desk.zone))

    async def ask_what(self) -> None:
        """Ask what to look for, and look."""
        ask = self._screen.app.push_screen_wait
        which = await ask(Choose("Find", [(key, words) for key, words, _ in _WAYS]))
        if which is None:
            return
        _, hint, make = _WAYS[which]

        def wrong(text: str) -> str:
            try:
                make(text)
            except search.SearchError as error:
                return str(error)
            return ""

        text = await ask(Ask("Find", hint, value=self._sought, wrong=wrong))
        if text is not None:
            self._sought, self._hits = text, make(text)
            self._waiting.clear()
            self.find_on(back=False)

    def find_on(self, *, back: bool) -> None:
        """The next hit, or the one before."""
        screen, hits = self._screen, self._hits
        if hits is None:
            screen.action_find()
            return
        self._waiting.append(back)
        if len(self._waiting) == 1:
            screen.jobs.doing = f"looking for {self._sought[:20]}"
            screen.say()
            self._seek(hits, back=back)

    def _seek(self, hits: search.Hits, *, back: bool) -> None:
        screen = self._screen
        row = self.here
        screen.jobs.run(FINDING, lambda stop: search.find(self._bus, hits, row, back=back, stop=stop), self._sought_out)

    def _sought_out(self, row: int | None) -> None:
        """Go to the hit; where the key was pressed again meanwhile, on from there."""
        screen = self._screen
        self._waiting.popleft()
        if row is None:
            self._waiting.clear()
            screen.tell(f"{self._sought[:40]} is not found further on")
        else:
            self.go(row)
        if self._waiting and self._hits is not None:
            self._seek(self._hits, back=self._waiting[0])
            return
        screen.jobs.doing = ""
        screen.say()
