"""Threads of the main screen. A thread changes nothing that is shown: it calls back, in the screen's own turn."""

from __future__ import annotations

import ctypes
import sys
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final, TypeVar

from textual.worker import get_current_worker

from ..languages import in_use, use_language

if TYPE_CHECKING:
    from .screen import BusScreen

_AGAIN_S: Final = 2.0  # between two reckonings of one thing, at least
_SPARE: Final = 12  # times what the last one took of the processor, until the next

T = TypeVar("T")
Stop = Callable[[], bool]


def _nothing() -> None:
    """Nothing is to be done."""


def give_memory_back() -> None:
    """What a capture took while it was read, and holds no more, is the system's again; glibc keeps a fifth of it."""
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None) if sys.platform == "linux" else None
    if trim is not None:
        trim(0)


class _Reckoning:
    """When something is to be reckoned again while rows come: the dearer it is, the later."""

    basis: object = None  # what it was reckoned of last
    next_at = 0.0
    running = False
    view = ""  # whose first lines it is to bring; empty once they have come


class ScreenThreads:
    """The threads of a screen, in groups, and what their outcomes are wanted for."""

    def __init__(self, screen: BusScreen) -> None:
        self._screen = screen
        self._ended = False
        self._pending: set[str] = set()  # what waits for the screen's turn
        self._reckoned: dict[str, _Reckoning] = {}
        self._wanted: dict[str, object] = {}  # by group, the one work whose outcome is still wanted

    @property
    def is_filling(self) -> bool:
        """Whether the view in sight is empty only because its first lines have not come yet."""
        return any(pace.view == self._screen.view for pace in self._reckoned.values())

    def wait_no_more(self) -> None:
        """Whoever waited for first lines has no more patience."""
        for pace in self._reckoned.values():
            pace.view = ""

    def end(self) -> None:
        """The screen is being left: what threads have to tell finds no widgets any more."""
        self._ended = True

    def _later(self, callback: Callable[..., object], *arguments: Any, **more: Any) -> None:
        """Call it in the screen's own turn, from whatever thread, unless the screen was left by then."""

        def unless_left() -> None:
            if not self._ended:
                callback(*arguments, **more)

        self._screen.call_later(unless_left)

    def _once(self, name: str, callback: Callable[[], object]) -> None:
        """The same, where none of that name waits for its turn yet: it discards the name from those that wait."""
        if name not in self._pending:
            self._pending.add(name)
            self._later(callback)

    def run(
        self,
        group: str,
        work: Callable[[Stop], T],
        then: Callable[[T], object],
        *,
        exclusive: bool = True,
        failed: Callable[[], object] = _nothing,
    ) -> None:
        """Work in a thread, and what to do with what it gives; an `exclusive` one takes the place of its group's last.

        `work` is given a function that says when its outcome is not wanted any more. An error in it stays told
        (`ViewState.failures`), and `failed` is called. Whoever was replaced or dropped says nothing more, even where
        its outcome was on its way.
        """
        ticket = object()
        if exclusive:
            self._wanted[group] = ticket

        def unless_replaced(what: Callable[..., object], *arguments: Any) -> None:
            if not exclusive or self._wanted.get(group) is ticket:
                what(*arguments)

        def shown(outcome: T) -> None:
            with self._screen.desk.failures.contained(group):
                then(outcome)
            self._screen.tell_failed()

        def thread() -> None:
            worker = get_current_worker()
            outcome = work(lambda: worker.is_cancelled)
            if not worker.is_cancelled:
                self._later(unless_replaced, shown, outcome)

        self._start(group, thread, exclusive=exclusive, failed=lambda: unless_replaced(failed))

    def reckon(
        self,
        name: str,
        basis: object,
        work: Callable[[Stop], T],
        then: Callable[[T], object],
        *,
        pause_s: float = 0.0,
        fills: str = "",
        failed: Callable[[], object] = _nothing,
    ) -> None:
        """The same of figures that grow with the capture: where `basis` is another one, and of rows that still come
        only after a pause of many times what the last reckoning took of the processor.

        `fills`: the view that has no line until the first of them come; keys typed ahead wait for those.
        """
        pace = self._reckoned.setdefault(name, _Reckoning())
        whole = self._screen.desk.bus.whole
        if basis == pace.basis or (not whole and (pace.running or time.monotonic() < pace.next_at)):
            return
        if pace.basis is None:
            pace.view = fills
        pace.basis, pace.running = basis, True

        def filled() -> None:
            pace.view = ""

        def came(outcome: T) -> None:
            filled()
            then(outcome)

        def came_not() -> None:
            filled()
            failed()

        def timed(stop: Stop) -> T:
            begun = time.thread_time()
            try:
                return work(stop)
            finally:
                took = time.thread_time() - begun
                pace.next_at, pace.running = time.monotonic() + max(pause_s or _AGAIN_S, _SPARE * took), False

        self.run(name, timed, came, failed=came_not)

    def drop(self, group: str) -> None:
        """Nobody wants the outcome of a group's work any more."""
        if self._wanted.pop(group, None) is not None:
            self._screen.workers.cancel_group(self._screen, group)

    def _start(
        self,
        group: str,
        thread: Callable[[], None],
        *,
        exclusive: bool = False,
        failed: Callable[[], object] = _nothing,
    ) -> None:
        """Begin a thread in the language in use; an error in it stays told, and `failed` is called."""
        language = in_use()

        def told() -> None:
            use_language(language)
            try:
                thread()
            except Exception as error:
                try:
                    self._screen.desk.failures.add(group, error)
                finally:
                    self._later(failed)
                    self._later(self._screen.write_status)

        self._screen.run_worker(told, thread=True, group=group, exclusive=exclusive, exit_on_error=False)
