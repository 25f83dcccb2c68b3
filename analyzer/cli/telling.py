"""What a command that listens tells on standard error.

A terminal that is held (Ctrl-S, a selection in the Windows console) or a pipe that nobody reads blocks whoever writes
to it. That must never be the thread that records, so a `Teller` writes by a thread of its own.
"""

from __future__ import annotations

import os
import queue
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from contextvars import copy_context
from functools import partial
from typing import Final

from dissectors.values import harmless

from ..terminal_text import ERASE_LINE, terminal_text
from .terminal import places

_WAITING: Final = 1000  # lines at most
_PATIENCE_S: Final = 0.3


class Teller:
    """Tells lines, and on a terminal a status line below them, without waiting for anybody. A context manager."""

    def __init__(self) -> None:
        self._shows = places(sys.stderr)
        self._texts: queue.SimpleQueue[Callable[[], str] | None] = queue.SimpleQueue()
        self._left_out = 0
        self._thread = threading.Thread(target=copy_context().run, args=(self._write,), daemon=True)
        self._thread.start()

    def __call__(self, text: str) -> None:
        """A line; left out, and counted, where a thousand wait already."""
        if self._texts.qsize() >= _WAITING:
            self._left_out += 1
            return
        if self._left_out:
            self._texts.put(partial(_line, f"{self._left_out} lines could not be shown"))
            self._left_out = 0
        self._texts.put(partial(_line, text))

    def status(self, text: str) -> None:
        """The status line, unless something waits to be shown."""
        if self._shows and self._texts.empty():
            self._texts.put(partial(terminal_text, ERASE_LINE, harmless(text)))

    def close(self) -> None:
        """Take the status line away, and end when all was shown, or soon."""
        if self._shows:
            self._texts.put(partial(terminal_text, ERASE_LINE))
        self._texts.put(None)
        self._thread.join(_PATIENCE_S)

    def __enter__(self) -> Teller:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _write(self) -> None:
        while (text := self._texts.get()) is not None:
            with suppress(OSError, ValueError):  # nobody listens any more
                _write_unbuffered(text())


def _write_unbuffered(text: str) -> None:
    """Write it past Python's buffer where that goes, whose lock would keep the process from its end."""
    if os.name != "posix":
        sys.stderr.write(text)
        sys.stderr.flush()
        return
    data = memoryview(text.encode(sys.stderr.encoding, "backslashreplace"))
    while data:
        data = data[os.write(sys.stderr.fileno(), data) :]


def _line(text: str) -> str:
    """A line of the program's, in the language in use: words are looked up by the thread that writes."""
    from ..languages.retelling import retold

    erase = ERASE_LINE if places(sys.stderr) else ""
    return terminal_text(erase, f"rtuscope: {harmless(retold(text))}\n")
