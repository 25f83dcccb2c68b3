"""Going somewhere: to a row, its counterpart, a finding, a bookmark, a hit."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Final, NamedTuple

from ..languages import tr
from ..model import search
from ..model.polls import carried_by
from ..model.rowstores import rows_showing
from ..model.times import FORMS, SPANS, GotoError, span
from ..words import TimeBase, is_clock, zone_name
from .frames import FrameList
from .keyqueue import FINDING
from .prompts import Ask
from .threads import Stop
from .view import LISTS, value_name

if TYPE_CHECKING:
    from ..causes.registry import Cause
    from .screen import BusScreen

_HINT: Final = 'bytes 03 02, a value 230.5, a time 08:29 or 12.5s, frame #120, or text; "…" is text'


class _Step(NamedTuple):
    """To the next hit, or the one before."""

    wanted: search.Wanted
    back: bool
    from_anew: bool  # whether it goes on from the other end of the capture


class Jumps:
    """How the main screen goes places."""

    def __init__(self, screen: BusScreen) -> None:
        self._screen = screen
        self._bus = screen.desk.bus
        self._wanted: search.Wanted | None = None
        self._sought = ""
        self._arrived: tuple[int | None, int] = (None, -1)  # where the cursor was put, and for which row
        self._waiting: deque[_Step] = deque()  # steps to the next hit that are still to be made

    def go_to_row(self, row: int) -> None:
        """Show a row in the list that was last in sight: transactions or frames. Noise is in the frames alone."""
        screen = self._screen
        if not screen.going_back:
            screen.trail.leave(screen.stop)
        listed = screen.list_view
        beside = listed == "transactions" and not screen.transactions.unfolds(row)
        shown = "frames" if self._bus.is_noise(row) and beside else listed
        if screen.view != shown:
            screen.action_view(shown, row)
            screen.list_view = listed
        self._arrive(shown, row)

    def _arrive(self, view: str, row: int) -> None:
        """Put the cursor of a list in sight on a row."""
        screen = self._screen
        listing = screen.query_one(f"#{view}", FrameList)
        if not listing.go_to_row(row):
            words = "that row is filtered out (Esc clears the filter); this is the one before it"
            screen.notify_of(tr(words))
        listing.focus()
        self._arrived = listing.row, row

    def along(self, step: int) -> None:
        """Back to where one was before, or forward again."""
        screen = self._screen
        stop = screen.trail.back(screen.stop) if step < 0 else screen.trail.forward(screen.stop)
        if stop is None:
            screen.notify_of(tr("nowhere to go back to") if step < 0 else tr("nowhere to go on to"))
            return
        screen.going_back = True
        try:
            if stop.view != screen.view:
                screen.action_view(stop.view, stop.row)
            if stop.row is not None and stop.view in LISTS:
                self._arrive(stop.view, stop.row)
        finally:
            screen.going_back = False

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
            self._screen.notify_of(tr("no counterpart known"))
        else:
            self.go_to_row(partner)

    def to_finding(self, step: int) -> None:
        """The next row with a finding, or the one before."""
        hits = search.with_findings(self._screen.frames.rows)
        self._step(_Step(search.Wanted(tr("a finding"), hits), step < 0, from_anew=False))

    def _asks(self, question: str) -> str:
        """A question that times of day may answer, with the zone that they are of."""
        if not self._bus.timed or not is_clock(self._bus.t_first):
            return tr(question)
        zone = zone_name(self._bus.t_last, self._screen.desk.zone)
        return tr("{question}  (times in {zone})", question=tr(question), zone=zone)

    async def ask_where(self) -> None:
        """Ask where to go, and go there."""
        begin, desk = self._screen.row or 0, self._screen.desk
        zero_ns = desk.reference_ns if desk.base is TimeBase.REFERENCE else None

        def wrong(text: str) -> str:
            try:
                search.row_named(text, self._bus, begin, desk.zone, zero_ns)
            except GotoError as error:
                return str(error)
            return ""

        text = await self._screen.app.push_screen_wait(Ask(self._asks("Go to"), tr(FORMS), wrong=wrong))
        if text is not None:
            self.go_to_row(search.row_named(text, self._bus, begin, desk.zone, zero_ns))

    async def ask_span(self) -> None:
        """Ask for a span of time, and narrow everything to it."""
        zone = self._screen.desk.zone

        def wrong(text: str) -> str:
            try:
                span(text, self._bus, zone)
            except GotoError as error:
                return str(error)
            return ""

        text = await self._screen.app.push_screen_wait(Ask(self._asks("Only the time"), tr(SPANS), wrong=wrong))
        if text is not None:
            self._screen.narrowing.to_span(span(text, self._bus, zone))

    async def ask_what(self) -> None:
        """Ask what to look for, tell what is understood while it is typed, and look; a place is gone to."""
        begin, zone, charts = max(0, self.here), self._screen.desk.zone, self._screen.desk.meanings.charts

        def understood(text: str) -> str:
            if not text.strip():
                return tr(_HINT)
            if _names_row(text):
                return tr("goes to {place}", place=text.strip())
            try:
                return tr("looks for {what}", what=search.wanted(text, charts).words)
            except search.SearchError as error:
                return str(error)

        def wrong(text: str) -> str:
            try:
                if _names_row(text):
                    search.row_named(text, self._bus, begin, zone)
                else:
                    search.wanted(text, charts)
            except (search.SearchError, GotoError) as error:
                return str(error)
            return ""

        text = await self._screen.app.push_screen_wait(
            Ask(tr("Find"), tr(_HINT), value=self._sought, wrong=wrong, understood=understood)
        )
        if text is None:
            return
        self._sought = text
        if _names_row(text):
            self.go_to_row(search.row_named(text, self._bus, begin, zone))
        else:
            self._wanted = search.wanted(text, charts)
            self._find_first()

    def _find_first(self) -> None:
        self._waiting.clear()
        self.find_on(back=False)

    def walk(self, cause: Cause) -> None:
        """Go to the first row that shows a cause; the next hit and the one before are the others, in wire order."""
        rows = rows_showing(self._bus, cause)
        if not len(rows):
            self._screen.notify_of(tr("no single frame shows it"))
            return
        hits: search.Hits = lambda _, first, last: rows[(rows >= first) & (rows < last)]  # noqa: E731
        self.stop()
        self._wanted = search.Wanted(tr("what shows the cause {name}", name=cause.cause), hits)
        self.go_to_row(int(rows[0]))
        where = tr("{count:,} rows show it: n goes to the next, N to the one before", count=len(rows))
        self._screen.notify_of(where)

    def find_by(self, words: str, hits: search.Hits) -> None:
        """Look for something that needs no asking."""
        self._wanted = search.Wanted(words, hits)
        self._find_first()

    def find_on(self, *, back: bool) -> None:
        """The next hit, or the one before."""
        screen, wanted = self._screen, self._wanted
        if wanted is None:
            screen.action_find()
            return
        self._step(_Step(wanted, back, from_anew=True))

    def _step(self, step: _Step) -> None:
        """Look for the next hit, once those before it were found."""
        self._waiting.append(step)
        if len(self._waiting) == 1:
            self._seek()

    def stop(self) -> bool:
        """Look no further; whether anything was looked for."""
        sought = bool(self._waiting)
        if sought:
            self._screen.jobs.drop(FINDING)
            self._given_up()
        return sought

    def _seek(self) -> None:
        row, bus, (wanted, back, from_anew) = self.here, self._bus, self._waiting[0]
        self._screen.jobs.doing = tr("looking for {what}, Esc stops", what=wanted.words[:30])
        self._screen.write_status()

        def seek(stop: Stop) -> tuple[int | None, bool]:
            hit = search.find(bus, wanted.hits, row, back=back, stop=stop)
            if hit is not None or stop() or not from_anew:
                return hit, False
            return search.find(bus, wanted.hits, bus.count if back else -1, back=back, stop=stop), True

        self._screen.jobs.run(FINDING, seek, lambda outcome: self._sought_out(*outcome), failed=self._given_up)

    def _given_up(self) -> None:
        """It could not be looked for: the next search begins anew."""
        self._waiting.clear()
        self._screen.jobs.doing = ""
        self._screen.write_status()

    def _sought_out(self, row: int | None, wrapped: bool) -> None:
        """Go to the hit, and light it; where the key was pressed again meanwhile, on from there."""
        screen = self._screen
        wanted, back, from_anew = self._waiting.popleft()
        if row is None:
            self._waiting.clear()
            screen.notify_of(tr("{what}: not found", what=wanted.words[:50]) if from_anew else _no_more(back=back))
        else:
            if wrapped:
                screen.notify_of(tr("wrapped to the end") if back else tr("wrapped to the beginning"))
            self._light(row, wanted.data)
            self.go_to_row(row)
            if wanted.value:
                self._point_at(row, wanted.value)
        if self._waiting:
            self._seek()
            return
        screen.jobs.doing = ""
        screen.write_status()

    def _point_at(self, row: int, text: str) -> None:
        """Put the cursor of the fields on the value that was looked for, where one has it by what it means."""
        desk = self._screen.desk
        poll = carried_by(desk.bus, row)
        for reading in desk.meanings.readings(poll) if poll is not None and not desk.raw else ():
            words = poll.values[reading.at : reading.at + reading.meaning.words] if poll is not None else ()
            name = reading.meaning.name
            if search.is_value(text, name, reading.text, reading.meaning.number(words)):
                self._screen.study_row(row, to=("values", value_name(reading.spot)))
                return

    def _light(self, row: int, data: bytes) -> None:
        """The bytes that were looked for, in the frame that holds them."""
        captured = self._bus.captured(row)
        at = captured.find(data) if data else -1
        self._screen.lit = (row, at, len(data)) if at >= 0 else None
        if self._screen.studied == row:
            self._screen.study_row(row)


def _no_more(*, back: bool) -> str:
    return tr("no findings above") if back else tr("no more findings below")


def _names_row(text: str) -> bool:
    """Whether a text names a place, not something to look for: `#120`, `12.5s`, `+200ms`, `08:29`, `50%`."""
    text = text.strip().lower()
    return search.is_place(text) and not text.isdecimal()
