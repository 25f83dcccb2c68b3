"""Single keys from a terminal."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any

from .terminal import places

if TYPE_CHECKING:
    from threading import Event


def keys_from_terminal() -> None:
    """Keys come from the terminal, where a pipe on standard input has given what it had (POSIX)."""
    if not sys.stdin.isatty() and places(sys.stdout):
        with suppress(OSError):  # no terminal of its own: `full_screen` tells
            descriptor = os.open("/dev/tty", os.O_RDWR)
            os.dup2(descriptor, sys.stdin.fileno())
            os.close(descriptor)


@contextmanager
def keys(pressed: Callable[[str], None]) -> Iterator[bool]:
    """Tell each key to `pressed`, from a thread of its own; whether there is a keyboard at all."""
    if not sys.stdin.isatty():
        yield False
        return
    from threading import Event, Thread

    ended = Event()
    listen = _windows if os.name == "nt" else _posix
    thread = Thread(target=listen, args=(pressed, ended), daemon=True)
    with _raw():
        thread.start()
        try:
            yield True
        finally:
            ended.set()
            thread.join(1)


@contextmanager
def _raw() -> Iterator[None]:
    """A terminal that gives keys at once, and Ctrl-C as ever."""
    if os.name == "nt":
        yield
        return
    import termios
    import tty

    descriptor = sys.stdin.fileno()
    before = termios.tcgetattr(descriptor)
    try:
        tty.setcbreak(descriptor)
        yield
    finally:
        with suppress(termios.error):
            termios.tcsetattr(descriptor, termios.TCSADRAIN, before)


def _posix(pressed: Callable[[str], None], ended: Event) -> None:
    import select

    while not ended.is_set():
        ready, _, _ = select.select([sys.stdin.fileno()], [], [], 0.2)
        if ready:
            data = os.read(sys.stdin.fileno(), 16)
            if not data:
                return
            pressed(data.decode(errors="replace"))


def _windows(pressed: Callable[[str], None], ended: Event) -> None:
    from importlib import import_module

    console: Any = import_module("msvcrt")
    while not ended.wait(0.05):
        while console.kbhit():
            pressed(console.getwch())
