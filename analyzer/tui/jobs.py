"""What goes on in threads (`threads`): reading, testing rows, counting."""

from __future__ import annotations

import gc
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray
from textual.worker import get_current_worker

from ..failures import is_defect
from ..languages import error_words, tr
from ..model.scope import Scope, ScopedFigures
from ..model.selection import Everything, ListRows, Selection
from ..model.source import Grave
from ..words import data_size
from . import home
from .threads import ScreenThreads, Stop, give_memory_back
from .views import BY_NAME

if TYPE_CHECKING:
    from ..model.meanings import Meaning
    from ..model.registers import Spot
    from ..reports.model import Report
    from .screen import BusScreen

_PERIOD_S: Final = 0.1  # between two tellings
_SPELL_S: Final = 0.5  # the same of rows that are tested, once the first are told: each paints the list
_RATE: Final = 1500  # bytes a second to the terminal from which on a live view is painted less often
_QUIET_S: Final = 1.0  # between two while nothing comes
_REPORT_S: Final = 1.0
_FIRST_S: Final = 0.3  # reading waits at most so long for the first rows to be painted
_SCOPE_S: Final = 2.0  # between two countings of what the scope leaves, live
_SPARED: Final = 4  # times what a painting took of the processor, until the next
_SPARED_LIVE: Final = 24  # the same of a live view, beside which the capture is recorded: a twenty-fifth of a core
_LIVE_S: Final = 0.25  # between two paintings of a live view, at least
_LONGEST_S: Final = 2.0  # and at most, also where keys take the processor


class Jobs(ScreenThreads):
    """The main screen's work. `doing` says what goes on; `selection` are the rows that the scope leaves."""

    def __init__(self, screen: BusScreen) -> None:
        super().__init__(screen)
        self._bus, self._source = screen.desk.bus, screen.desk.source
        self.doing = ""
        self.scope: Scope = screen.desk.scope
        self.selection: Selection | None = None
        _, self._transactions = self.scope.selections(self._bus)
        self._waiting: tuple[ListRows, Selection] | None = None  # shown once both have come as far as the cursor
        self._counted: Selection | None = None  # the selection whose figures were asked for, its rows, when again
        self._counted_to, self._count_next = -1, 0.0
        self._notices: set[str] = set()
        self._painted_at = -_LONGEST_S  # when the last painting began, and what the screen's thread had taken by then
        self._painted_cpu = 0.0
        self._standing = threading.Event()  # the first rows are on the screen

    @property
    def narrowed(self) -> Selection | None:
        """The rows that filter and span leave; None where neither narrows."""
        return self.selection if self.scope.narrows else None

    def begin(self) -> None:
        """Read the source."""
        self._screen.transactions.use_rows(self._transactions)
        self._start("load", self._load)
        self._select()

    # Reading

    def _load(self) -> None:
        """The source into the model."""
        worker = get_current_worker()
        shown_at, came, trouble = 0.0, False, ""
        failure: Exception | None = None
        try:
            for analysed in self._source.steps(lambda: worker.is_cancelled):
                if worker.is_cancelled:
                    return
                self._bus.line = self._source.line  # a tap may find it out as it listens
                self._bus.feed(analysed)
                now = time.monotonic()
                came = came or len(analysed.batch) > 0
                if now - shown_at >= (_PERIOD_S if came else _QUIET_S):
                    shown_at, came = now, False
                    self._once("rows", self._rows_came)
                    if self._bus.count and not self._source.live:
                        self._standing.wait(_FIRST_S)  # the two would take time from each other
        except Exception as error:  # what was read stays
            trouble = error_words(error)
            if is_defect(error):
                failure = error
        try:
            self._bus.close()
            give_memory_back()
        finally:
            self._later(self._loaded, trouble)
        if failure is not None:
            self._screen.desk.failures.add("reading", failure)

    def _rows_came(self) -> None:
        self._pending.discard("rows")
        live = self._source.live
        self.doing = "" if live else tr("reading, {size}", size=data_size(self._bus.store.size))
        self._first_row()
        if live:
            self._tell_notices()
            self._screen.triggers.ring()
        self._paint()

    def _paint(self) -> None:
        """The view anew, as often as its painting leaves the keys their time; live, as often as the terminal takes."""
        now = time.monotonic()
        left = 0.0 if self._bus.whole else self._painted_at + self._pause() - now
        if left > 0:
            if "painting" not in self._pending:
                self._pending.add("painting")
                self._screen.set_timer(left, self._paint_late)
            return
        self._painted_at, self._painted_cpu = now, time.thread_time()
        self.tell_meanings()
        if self._screen.desk.paused and not self._bus.whole:
            self._screen.write_status()
            return
        self._screen.refresh_view()
        home.come_up_first(self._screen)

    def _pause(self) -> float:
        """Seconds between two paintings, by all that the screen's thread took of the processor since the last began:
        lists tell others of their cursor, and what these paint comes later.
        """
        took = time.thread_time() - self._painted_cpu
        if not self._source.live:
            return min(_SPARED * took, _LONGEST_S)
        for_wire = _LIVE_S * max(1.0, self._screen.wire.rate() / _RATE)
        return max(for_wire, min(_SPARED_LIVE * took, _LONGEST_S))

    def _paint_late(self) -> None:
        """What came while there was a rest from painting."""
        self._pending.discard("painting")
        if not self._ended:
            self._paint()

    def tell_meanings(self) -> None:
        """What values tell of registers, in a thread: when all is read, and live or beside Registers now and then."""
        meanings = self._screen.desk.meanings
        if meanings.is_due(often=self._source.live or self._screen.view == "registers"):
            self.reckon("meanings", (self._bus.count, self._bus.whole), meanings.ask, self._use_meanings)

    def _use_meanings(self, told: Mapping[Spot, Meaning]) -> None:
        meanings, screen = self._screen.desk.meanings, self._screen
        before = meanings.version
        meanings.use_meanings(told)
        if meanings.version != before:
            screen.reworded()

    def _first_row(self) -> None:
        if self._screen.studied is None and self._bus.count:
            self._screen.studied = 0  # Home may come up before any list has a row to stand on
            self._screen.frames.renewed()
        if not self._standing.is_set():
            self._screen.call_after_refresh(self._begun)

    def _begun(self) -> None:
        """The first picture stands: from now on there is garbage to be looked for, but not in what was built so far."""
        self._standing.set()
        if not gc.isenabled():
            gc.freeze()
            gc.enable()

    def _tell_notices(self) -> None:
        """What the source has to say, each thing once."""
        for notice in self._source.notices():
            if notice not in self._notices:
                self._notices.add(notice)
                grave = isinstance(notice, Grave)
                self._screen.desk.losses += grave
                self._screen.notify_of(notice, wrong=grave)

    def _loaded(self, trouble: str) -> None:
        """No more rows come; `trouble` says why if it is not that the source was read to its end."""
        self.doing = ""
        if self.scope.settled:
            self.reselect()
        self._first_row()
        self._screen.detail.fields.unpaint()
        self._screen.refresh_view()
        home.come_up_first(self._screen)
        self.tell_meanings()
        self._screen.files.read(self._source)
        self._screen.files.resume()
        if trouble:
            self._screen.desk.ended = trouble
            self._screen.notify_of(tr("reading ended: {trouble}", trouble=trouble), wrong=True)
        self._tell_notices()
        told = self._screen.undecided or self._screen.view in ("home", "paste")
        if not self._bus.frames and not trouble and not told:
            self._screen.notify_of(tr("no Modbus frames found"), wrong=True)

    # Testing rows

    def reselect(self) -> None:
        """The rows that the scope leaves."""
        self.selection, self._transactions = self.scope.selections(self._bus)
        self._waiting = self.selection or Everything(self._bus), self._transactions
        self._screen.desk.narrowed = None
        self.drop("scope")  # figures of another scope
        self.doing = "" if self._bus.whole else self.doing
        self.count_scope()
        self._select()

    def _select(self) -> None:
        """Test rows as they come, until there are no more of them."""
        selections = self._selections

        def thread() -> None:
            worker = get_current_worker()
            spell = _PERIOD_S
            while not worker.is_cancelled:
                ended = self._bus.whole
                while not worker.is_cancelled and _extended(selections, spell, lambda: worker.is_cancelled):
                    self._once("selection", self._selection_grew)
                    spell = _SPELL_S
                if ended:
                    self._later(self._selection_grew)
                    return
                time.sleep(_PERIOD_S)

        self._start("select", thread, exclusive=True, failed=self.rest)

    @property
    def unsettled(self) -> bool:
        """Whether the lists still show the rows of the scope before."""
        return self._waiting is not None

    @property
    def _selections(self) -> list[Selection]:
        return [each for each in (self.selection, self._transactions) if each is not None]

    @property
    def shown_count(self) -> int | None:
        """Rows that the scope leaves; None where they are not counted yet."""
        counted = self._transactions if self._of_transactions else self.selection
        if counted is None:
            return self._bus.count
        return None if self.unsettled or counted.done < counted.upto or self._of_transactions else counted.count

    @property
    def _of_transactions(self) -> bool:
        """Whether the rows shown are those of some transactions alone."""
        return self.scope.only_changed and self._screen.list_view == "transactions"

    def shown(self) -> Callable[[Stop], NDArray[np.int64]]:
        """What finds the rows that the scope leaves now, all of them, in a thread: who waits for the lists has some."""
        rows, begins = self.scope.selections(self._bus)
        of_transactions = self._of_transactions

        def found(stop: Stop) -> NDArray[np.int64]:
            if of_transactions:
                begins.extend(stop)
                partners = self._bus.table.take_column("partner", begins.rows()).astype(np.int64)
                return np.union1d(begins.rows(), partners[partners >= 0])
            if rows is None:
                return np.arange(self._bus.count)
            rows.extend(stop)
            return rows.rows()

        return found

    def rest(self) -> None:
        """Nothing goes on that the status line would tell."""
        self.doing = ""
        self._screen.write_status()

    def _selection_grew(self) -> None:
        self._pending.discard("selection")
        waiting, row = self._waiting, self._screen.row
        row = self._screen.studied if row is None else row  # a list that is empty now goes back to where it was
        if waiting is not None and (row is None or all(each.has_tested(row) for each in self._selections)):
            self._waiting = None
            self._screen.frames.use_rows(waiting[0])
            self._screen.transactions.use_rows(waiting[1])
        if self.selection is not None and self._bus.whole:
            tested, count = self.selection.done, self._bus.count
            self.doing = tr("filtering {share:.0%}", share=tested / max(1, count)) if tested < count else ""
        self.count_scope()
        self._paint()

    # Counting

    def count_scope(self) -> None:
        """The figures of the rows that the scope leaves, once all of them are known; live, now and then."""
        selection = self.narrowed
        if selection is None or not BY_NAME[self._screen.view].figures:
            return
        now, bus = time.monotonic(), self._bus
        if selection is self._counted and (selection.done == self._counted_to or now < self._count_next):
            return
        if bus.whole and selection.done < bus.count:
            return
        self._counted, self._counted_to, self._count_next = selection, selection.done, now + _SCOPE_S
        if bus.whole:
            self.doing = tr("counting the rows shown")
        self.run("scope", lambda stop: ScopedFigures(bus, selection.rows(), stop), self._use_figures, failed=self.rest)

    def _use_figures(self, figures: ScopedFigures) -> None:
        self._screen.desk.narrowed = figures
        self.doing = "" if self._bus.whole else self.doing
        self._screen.refresh_view()

    def count_report(
        self,
        view: str,
        then: Callable[[Report], None],
        *,
        story: bool = False,
        failed: Callable[[], object],
    ) -> None:
        """Newer figures for a view, not too often; `story`: with the causes."""
        figures, bus = self._screen.desk.figures, self._bus
        basis = id(figures), bus.whole, bus.count, bus.found.count
        self.reckon(
            view,
            basis,
            lambda _: figures.report(self._source, story=story),
            then,
            pause_s=_REPORT_S,
            fills=view,
            failed=failed,
        )


def _extended(selections: Sequence[Selection], seconds: float, stop: Stop) -> bool:
    """Test rows for so long, piece by piece for all; whether any were there to test."""
    until, tested = time.monotonic() + seconds, False
    while not stop() and time.monotonic() < until:
        grew = [selection.extend_by_piece() for selection in selections]
        if not any(grew):
            return tested
        tested = True
    return tested
