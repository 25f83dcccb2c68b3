"""What commands say, and what a terminal adds: progress, colour, and Ctrl-C that keeps what was done.

Nothing of the latter shows on a pipe. Colour follows the terminal and NO_COLOR.
"""

from __future__ import annotations

import os
import re
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import IO, BinaryIO

from dissectors.values import harmless

from ..terminal_text import ERASE_LINE, painted, terminal_text

_PERIOD_S = 0.2
_LEAST_SHARE = 0.01  # and seconds, before which nobody can tell how long it takes
_LEAST_S = 1.0


class Progress:
    """A line on a terminal's standard error that tells how far long work has come; silent elsewhere."""

    def __init__(self, label: str, counted: str = "frames") -> None:
        self._label, self._counted = label, counted
        self._shown = False
        self._begun = time.monotonic()
        self._next = self._begun + 2 * _PERIOD_S if places(sys.stderr) else float("inf")

    def __call__(self, count: int, octets: int) -> None:
        """Say it, if the last time is long enough ago."""
        now = time.monotonic()
        if now < self._next:
            return
        from captures.files import share_read

        self._next = now + _PERIOD_S
        self._shown = True
        words = progress_words(share_read(), count, octets, now - self._begun, self._counted)
        say_in_place(f"{self._label}: {words}")

    def clear(self) -> None:
        """Take the line away."""
        if self._shown:
            say_in_place("")
            self._shown = False


def progress_words(share: float | None, count: int, octets: int, elapsed_s: float, counted: str = "frames") -> str:
    """How far it is, how fast, and about how long it still takes; a share of nothing or of all says neither."""
    measurable = share is not None and _LEAST_SHARE <= share < 1
    parts = [f"{share:.0%}"] if share is not None and measurable else []
    parts += [f"{count:,} {counted}", f"{octets / 1e6:,.1f} MB of the line", f"{count / elapsed_s:,.0f} {counted}/s"]
    if share is not None and measurable and elapsed_s >= _LEAST_S:
        left = elapsed_s * (1 - share) / share
        minutes, seconds = divmod(round(left), 60)
        parts.append(f"{minutes}:{seconds:02d} left")
    return ", ".join(parts)


class Stop:
    """Whether Ctrl-C was pressed."""

    def __init__(self) -> None:
        self.asked = False

    def __call__(self) -> bool:
        return self.asked


@contextmanager
def interruptible() -> Iterator[Stop]:
    """The first Ctrl-C asks the work to end at its next step; a second one ends it where it is."""
    stop = Stop()

    def handler(_number: int, _frame: FrameType | None) -> None:
        if stop.asked:
            raise KeyboardInterrupt
        stop.asked = True

    try:
        before = signal.signal(signal.SIGINT, handler)
    except ValueError:  # not the main thread: Ctrl-C is another's business
        yield stop
        return
    try:
        yield stop
    finally:
        signal.signal(signal.SIGINT, before)


def tell(text: str) -> None:
    """A line on standard error, past a status line that may stand there."""
    erase = ERASE_LINE if places(sys.stderr) else ""
    print(terminal_text(erase, f"rtuscope: {harmless(text)}"), file=sys.stderr, flush=True)


def say_in_place(text: str) -> None:
    """A status on standard error, which must be a terminal, in place of the one before; empty takes it away."""
    sys.stderr.write(terminal_text(ERASE_LINE, harmless(text)))
    sys.stderr.flush()


def put_json(value: object, *, indent: int | None = None) -> None:
    """A value as JSON on standard output, in one line unless indented; ASCII only, so that the gate leaves it alone."""
    import json

    text = json.dumps(value, indent=indent, separators=None if indent else (",", ":"))
    print(text.replace("\x7f", "\\u007f"))  # the one control character that JSON does not escape


_PAGE_STYLES = (  # of a line of a report page, by how it begins: its graphic rendition
    (re.compile(r"\d+\. "), "1;31"),
    (re.compile(r"(new|worse|новое|хуже): "), "31"),
    (re.compile(r"(gone|better|ушло|лучше): "), "32"),
    (re.compile(r"(unit  |function  |poll  |hour  |finding  )"), "4"),
    (re.compile(r"   (seen|rests on|explained by|видно|основание|объясняет): "), "2"),
    (re.compile(r"\w[^\d.:]*$"), "1"),  # a heading
)


def put_page(text: str) -> None:
    """Write a report page to standard output: in colour on a terminal, plain on a pipe."""
    if not coloured(sys.stdout):
        sys.stdout.write(text)
        return
    for line in text.splitlines():
        style = next((graphics for pattern, graphics in _PAGE_STYLES if pattern.match(line)), "")
        print(painted(line, style))


def put(text: str) -> None:
    """Write all of a text to standard output, now: unbuffered, a stream may take part of it when a signal comes."""
    put_bytes(terminal_text(text).encode(sys.stdout.encoding, "backslashreplace"), sys.stdout.buffer)


def put_bytes(data: bytes, stream: BinaryIO) -> None:
    """Write all of it, now."""
    left = memoryview(data)
    while left:
        left = left[stream.write(left) :]
    stream.flush()


def hung_up(stream: BinaryIO) -> bool:
    """Whether nobody reads this pipe any more, as far as that shows without writing to it."""
    if os.name != "posix":
        return False
    import select

    poller = select.poll()
    poller.register(stream.fileno(), select.POLLERR)
    return bool(poller.poll(0))


def places(stream: IO[str]) -> bool:
    """Whether it is a terminal on which text can be put anywhere, and a line be taken away again."""
    return stream.isatty() and os.environ.get("TERM") != "dumb"


def full_screen() -> bool:
    """Whether the interface can be shown: keys come from a terminal, and it can place text."""
    return sys.stdin.isatty() and places(sys.stdout)


def coloured(stream: IO[str]) -> bool:
    """Whether escape sequences are welcome there."""
    if os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb":
        return False
    if os.name == "nt" and not (os.environ.get("WT_SESSION") or os.environ.get("TERM")):
        return False  # the old console shows them as text
    return stream.isatty()
