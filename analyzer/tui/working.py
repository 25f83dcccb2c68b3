"""What goes on in threads: reading, testing rows, counting. Workers only post; handlers change what is shown."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from rich.text import Text
from textual import work
from textual.widgets import Static
from textual.worker import Worker, get_current_worker

from analyzer.model.registers import Register, history
from analyzer.model.selection import Everything, Selection, Test, both, conversations, frames_only, within

from .messages import HistoryRead, LoadingEnded, ReportCounted, RowsCame, SelectionGrew
from .part import Part
from .registerlist import History, RegisterList, plotted
from .unitlist import UnitList

if TYPE_CHECKING:
    from analyzer.model.filtering import Compiled


_PERIOD_S = 0.1  # between two tellings
_QUIET_S = 1.0  # between two while nothing comes
_REPORT_S = 1.0
_LAG = 64  # rows: by then what was found about one is known, as a rule


class Working(Part):
    """The part of the main screen that has work done."""

    def prepare_work(self) -> None:
        """Nothing is selected, nothing goes on."""
        self.doing = ""
        self.filter: Compiled | None = None
        self.span: tuple[int, int] | None = None
        self.hide_noise = False
        self.selection: Selection | None = None
        self.pinned: int | None = None  # row where the user's selection begins
        self._conversation = Selection(self.desk.bus, conversations)
        self._waiting: Selection | None = None  # will be shown once it has come as far as the cursor
        self._counted_at = 0.0
        self._told_notices: set[str] = set()

    def begin_work(self) -> None:
        """Read the source."""
        self.talk.rows = self._conversation
        self.load()
        self.select(self.selection, self._conversation)

    # Reading

    @work(thread=True, group="load", exit_on_error=False)
    def load(self) -> None:
        """The source into the model."""
        worker = get_current_worker()
        bus, told, came, trouble = self.desk.bus, 0.0, False, ""
        try:
            for batch in self.desk.source.batches(lambda: worker.is_cancelled):
                if worker.is_cancelled:
                    return
                bus.line = self.desk.source.line  # a tap may find it out as it listens
                bus.feed(batch)
                now = time.monotonic()
                came = came or len(batch) > 0
                if now - told >= (_PERIOD_S if came else _QUIET_S):
                    told, came = now, False
                    self.post_message(RowsCame())
        except Exception as error:  # told in one line; what was read stays
            trouble = str(error) or type(error).__name__
        bus.close()
        self.post_message(LoadingEnded(trouble))

    def on_rows_came(self) -> None:
        bus = self.desk.bus
        self.doing = "listening" if self.desk.source.live else f"reading, {bus.store.size / 1e6:,.0f} MB"
        if self.row is None and bus.count:
            self.frames.renewed()
        if self.desk.source.live:
            self.tell_notices()
        self.refresh_view()

    def tell_notices(self) -> None:
        """What the source has to say, each thing once."""
        for notice in self.desk.source.notices():
            if notice not in self._told_notices:
                self._told_notices.add(notice)
                self.tell(notice, wrong=True)

    def on_loading_ended(self, event: LoadingEnded) -> None:
        self.doing = ""
        if self.filter is not None and self.filter.settled:
            self.reselect()
        if self.row is None and self.desk.bus.count:
            self.frames.renewed()
        self.refresh_view()
        if event.trouble:
            self.tell(f"reading ended: {event.trouble}", wrong=True)
        self.tell_notices()
        if not self.desk.bus.frames and not event.trouble and self.view != "paste":
            self.tell("no Modbus frame was found", wrong=True)

    # Testing rows

    def reselect(self) -> None:
        """The rows that filter, span and noise leave."""
        tests: list[Test] = []
        if self.hide_noise:
            tests.append(frames_only)
        if self.span is not None:
            tests.append(within(*self.span))
        if self.filter is not None:
            tests.append(self.filter.test)
        bus = self.desk.bus
        lag = _LAG if self.filter is not None and self.filter.settled else 0
        self._waiting = Selection(bus, both(tests), lag=lag) if tests else None
        self._conversation = Selection(bus, both([conversations, *tests]), lag=lag)
        self.selection = self._waiting
        if self._waiting is None:
            self.frames.use(Everything(bus))
        self.talk.use(self._conversation)
        self.select(self._waiting, self._conversation)

    @work(thread=True, group="select", exclusive=True, exit_on_error=False)
    def select(self, *selections: Selection | None) -> None:
        """Test rows as they come, until there are no more of them."""
        worker = get_current_worker()
        while not worker.is_cancelled:
            whole = self.desk.bus.whole
            for selection in filter(None, selections):
                while not worker.is_cancelled and self._extended(selection, worker):
                    self.post_message(SelectionGrew())
            if whole:
                self.post_message(SelectionGrew())
                return
            time.sleep(_PERIOD_S)

    def _extended(self, selection: Selection, worker: Worker[None]) -> bool:
        """Test rows for a little while; whether any were there to test."""
        before, until = selection.done, time.monotonic() + _PERIOD_S
        selection.extend(lambda: worker.is_cancelled or time.monotonic() > until)
        return selection.done > before

    def on_selection_grew(self) -> None:
        waiting = self._waiting
        if waiting is not None and (self.row is None or waiting.done > self.row or waiting.done >= self.desk.bus.count):
            self._waiting = None
            self.frames.use(waiting)
        if self.selection is not None:
            done, count = self.selection.done, self.desk.bus.count
            if self.desk.bus.whole:
                self.doing = f"filtering {done / max(1, count):.0%}" if done < count else ""
        self.refresh_view()

    # Counting

    def count_report(self) -> None:
        """Newer figures for units and report, not too often."""
        now = time.monotonic()
        if now - self._counted_at >= _REPORT_S or self.desk.bus.whole:
            self._counted_at = now
            self.count_up()

    @work(thread=True, group="report", exclusive=True, exit_on_error=False)
    def count_up(self) -> None:
        """The report."""
        report = self.desk.bus.report(self.desk.source)
        if not get_current_worker().is_cancelled:
            self.post_message(ReportCounted(report))

    def on_report_counted(self, event: ReportCounted) -> None:
        from analyzer.reports import text
        from dissectors.text import harmless

        self.query_one(UnitList).use(event.report)
        page = "\n".join(harmless(line) for line in text(event.report).splitlines())
        self.query_one("#page", Static).update(Text(page))

    # A register's history

    def show_history(self, found: RegisterList) -> None:
        """Read it, then show it."""
        if found.register is not None:
            self.query_one("#history", History).show(" reading …", ())
            self.read_history(found.register)

    @work(thread=True, group="history", exclusive=True, exit_on_error=False)
    def read_history(self, register: Register) -> None:
        """What a register was."""
        worker = get_current_worker()
        readings = history(self.desk.bus, register, stop=lambda: worker.is_cancelled)
        if not worker.is_cancelled:
            self.post_message(HistoryRead(register, readings))

    def on_history_read(self, event: HistoryRead) -> None:
        from dissectors.values import AREAS, logical

        found = self.query_one(RegisterList)
        register = event.register
        area = tuple(AREAS)[register.area]
        points = plotted(found, event.readings, register)
        span = ""
        if len(event.readings) > 1 and self.desk.bus.timed:
            from analyzer.model.clock import short

            span = f" over {short(event.readings[-1].t_ns - event.readings[0].t_ns)}"
        title = f" unit {register.unit}, {logical(register.address, area)}: {len(event.readings)} readings{span}"
        self.query_one("#history", History).show(title, points)
