"""The interface's viewer, a terminal or a browser's tab: whatever it sends, where it is gone, how the interface ended.

Textual's driver for browsers stops reading where its input ends, as it does when the server is killed, and the
application would wait for keys for ever: it ends with that server. That for terminals reads nothing again and again.
Who closes a terminal ends the interface by a signal, as whoever ends its process does; where that is ignored (`nohup`)
it goes on without keys, and so does what it records. A byte that is no UTF-8, pasted or typed in another encoding, ends
the thread that reads keys, and with it the application: it is read as U+FFFD here.
"""

from __future__ import annotations

import asyncio
import os
import select
import signal
import sys
from codecs import IncrementalDecoder, getincrementaldecoder
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any, Final, TextIO, TypeVar, cast

from rich.console import Console
from textual import messages
from textual.driver import Driver

from ..errors import RtuscopeError

if TYPE_CHECKING:
    from textual.app import App
    from textual.timer import Timer

_T = TypeVar("_T")

_PATIENCE_S: Final = 5.0
_LOOK_S: Final = 2.0
_DECODERS: Final = "getincrementaldecoder"  # as Textual's drivers import it


class InterfaceError(RtuscopeError):
    """A defect ended the interface; Textual has told it."""


def shown(app: App[_T]) -> _T | None:
    """Run an application to its end; what it gives. InterfaceError where it did not end by itself."""
    app.error_console = Console(markup=False, highlight=False, stderr=True, color_system=None)  # of escapes none pass
    given = app.run()
    if app.return_code:
        raise InterfaceError("the interface failed, as told above; please report it")
    return given


def reading_any_byte(driver: type[Driver]) -> type[Driver]:
    """The same driver, for which no byte is an error: it makes its decoder by a name of its own module."""
    module = sys.modules[driver.__module__]
    if hasattr(module, _DECODERS):
        setattr(module, _DECODERS, _replacing)
    return driver


def _replacing(encoding: str) -> Callable[[], IncrementalDecoder]:
    return partial(getincrementaldecoder(encoding), errors="replace")


def heed_lost_terminal(app: App[Any]) -> None:
    """From here on, take no more keys of a terminal that is gone."""
    if sys.platform == "win32":
        return
    poller = select.poll()
    poller.register(cast(TextIO, sys.__stdin__), 0)  # POLLHUP is told unasked

    def look() -> None:
        told = [event for _, event in poller.poll(0)]  # macOS also tells that it cannot look at a terminal
        if select.POLLHUP & sum(told):
            cast(Any, app._driver).exit_event.set()  # `disable_input` would write to it first
            timer.stop()

    timer: Timer = app.set_interval(_LOOK_S, look)


def heed_signals(app: App[Any]) -> None:
    """From here on, end as by `q` but unasked where somebody ends the process: the terminal is as it was, and a
    recording is whole. A signal that is ignored (`nohup`) stays so."""
    if sys.platform == "win32":
        return
    loop = asyncio.get_running_loop()
    for number in (signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) is not signal.SIG_IGN:
            loop.add_signal_handler(number, app.exit)


def ending_with_its_server(driver: type[Driver]) -> type[Driver]:
    """The same driver, for Textual's in a browser; others end with their terminal."""
    from textual.drivers.web_driver import WebDriver

    if not issubclass(driver, WebDriver):
        return driver

    class ViewerDriver(WebDriver):
        def run_input_thread(self) -> None:
            super().run_input_thread()
            if self.exit_event.is_set():
                return
            self._app.post_message(messages.ExitApp())
            if not self.exit_event.wait(_PATIENCE_S):  # nobody takes what it writes, nor waits for its status
                os._exit(1)

        def stop_application_mode(self, *arguments: Any) -> None:
            try:
                super().stop_application_mode(*arguments)
            except BrokenPipeError:  # the server is gone: nobody is to be told
                self.exit_event.set()

    return ViewerDriver
