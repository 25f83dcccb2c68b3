"""What commands put out, and what a terminal adds: a line in place, colour, how far work has come, and Ctrl-C that
keeps what was done.

Nothing that a terminal adds shows on a pipe. Colour follows the terminal and NO_COLOR. How far long work has come is
drawn by rich, which is imported when there is something to draw: most work is over before. No file is written over
unless somebody said so.
"""

from __future__ import annotations

import argparse
import io
import os
import re
import shutil
import signal
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import IO, TYPE_CHECKING, BinaryIO, Final

from dissectors.values import harmless

from ..languages import counted, tr
from ..terminal_text import ERASE_LINE, READABLE, TerminalText, painted, terminal_text, trusted
from .commands import UsageError
from .twins import TWINS

if TYPE_CHECKING:
    from pathlib import Path

_NARROWEST: Final = 40  # columns of a paragraph
_VIRTUAL_TERMINAL: Final = 1 | 4  # ENABLE_PROCESSED_OUTPUT, ENABLE_VIRTUAL_TERMINAL_PROCESSING


class Stop:
    """Whether Ctrl-C was pressed."""

    def __init__(self) -> None:
        self.asked = False

    def __call__(self) -> bool:
        return self.asked


@contextmanager
def interruptible() -> Iterator[Stop]:
    """The first Ctrl-C, or signal to end, asks the work to end at its next step; a second one ends it where it is."""
    stop = Stop()

    def handler(_number: int, _frame: FrameType | None) -> None:
        if stop.asked:
            raise KeyboardInterrupt
        stop.asked = True

    with _heeding((signal.SIGINT, *told_to_end()), handler):
        yield stop


def told_to_end() -> Iterator[int]:
    """SIGTERM and what a terminal or a console says when it is closed, as far as there are such here and heeded."""
    for name in ("SIGTERM", "SIGHUP", "SIGBREAK"):
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) is not signal.SIG_IGN:  # nohup
            yield number


@contextmanager
def endable() -> Iterator[None]:
    """A signal that ends a program does so as a KeyboardInterrupt: what it began is tidied away."""

    def handler(_number: int, _frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    with _heeding(told_to_end(), handler):
        yield


@contextmanager
def _heeding(numbers: Iterable[int], handler: Callable[[int, FrameType | None], None]) -> Iterator[None]:
    """Signals that go to a handler; outside the main thread they are another's business."""
    before = {}
    with suppress(ValueError):
        before = {number: signal.signal(number, handler) for number in numbers}
    try:
        yield
    finally:
        for number, old in before.items():
            signal.signal(number, old)


def tell_user(text: str) -> None:
    """A line on standard error, in the language in use, past a status line that may stand there."""
    from ..languages import retold

    erase = ERASE_LINE if places(sys.stderr) else ""
    print(terminal_text(erase, f"rtuscope: {harmless(retold(text))}"), file=sys.stderr, flush=True)


def tell_partial(aside: Path | None) -> None:
    """That not all was written; where that is, as a file that was there stays."""
    if aside is None:
        tell_user("interrupted; partial output is kept")
    else:
        tell_user(f"interrupted; partial output is kept in {aside}; the file that was there stays")


def say_in_place(text: str) -> None:
    """A status on standard error, which must be a terminal, in place of the one before; empty takes it away."""
    sys.stderr.write(terminal_text(ERASE_LINE, text if isinstance(text, TerminalText) else harmless(text)))
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
    (re.compile(r"(unit|function|poll|hour|finding|устр|функция|опрос|час|находка)  "), "4"),
    (re.compile(r"   (seen|source|explained by|видно|основание|объясняет): "), "2"),
    (re.compile(r"\w[^\d.:]*$"), "1"),  # a heading
)


def page_width(usual: int) -> int:
    """Columns of a page's paragraphs: the terminal's, as far as lines stay readable; `usual` on a pipe."""
    return min(max(shutil.get_terminal_size().columns, _NARROWEST), READABLE) if sys.stdout.isatty() else usual


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
    _put_encoded(text, sys.stdout.encoding)


def put_data(text: str) -> None:
    """The same of a text that programs read: UTF-8, whatever Windows' code page is; on a terminal as it takes text."""
    _put_encoded(text, sys.stdout.encoding if sys.stdout.isatty() else "utf-8")


def _put_encoded(text: str, encoding: str) -> None:
    put_bytes(terminal_text(text).encode(encoding, TWINS), sys.stdout.buffer)


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
    """Whether it is a terminal that obeys escape sequences: text can be put anywhere, a line be taken away again."""
    return stream.isatty() and os.environ.get("TERM") != "dumb" and _obeys(stream)


def _obeys(stream: IO[str]) -> bool:
    """Whether a terminal obeys escape sequences. A Windows console is told to; before Windows 10 none can."""
    if sys.platform != "win32":
        return True
    import ctypes
    import msvcrt
    from ctypes import wintypes

    try:
        descriptor = stream.fileno()
    except OSError:  # a program's own terminal (IDLE, a notebook): no console
        return True
    console, mode = wintypes.HANDLE(msvcrt.get_osfhandle(descriptor)), wintypes.DWORD()
    kernel = ctypes.windll.kernel32
    if not kernel.GetConsoleMode(console, ctypes.byref(mode)):
        return False  # NUL, which calls itself a terminal
    return bool(kernel.SetConsoleMode(console, mode.value | _VIRTUAL_TERMINAL))


def full_screen() -> bool:
    """Whether the interface can be shown: keys come from a terminal, and text can be placed, also on standard error,
    where it is drawn."""
    return sys.stdin.isatty() and all(map(places, (sys.stdout, sys.stderr)))


def coloured(stream: IO[str]) -> bool:
    """Whether escape sequences are welcome there."""
    return not os.environ.get("NO_COLOR") and places(stream)


def shell_word(name: str, *, windows: bool = os.name == "nt") -> str:
    """A file's name as it is typed at the system's shell: between quotes where it holds what a shell may take apart."""
    if re.fullmatch(r"[\w./-]+" if not windows else r"[\w./:\\-]+", name):
        return name
    if windows:
        return f'"{name}"'  # no file is named with a quote there
    import shlex

    return shlex.quote(name)


_PERIOD_S: Final = 0.2
_BAR: Final = 24  # columns
_SHARE_AND_TIME: Final = 23  # columns, with what is between them
_LEAST_LABEL: Final = 12


class Progress:
    """Called as work goes on; `clear` takes the line away."""

    def __init__(self, label: str, counted: str = "frames", octets_of: str = "the line") -> None:
        self._label, self._counted, self._octets_of = label, counted, octets_of
        self._line: ProgressLine | None = None
        self._begun = time.monotonic()
        self._next = self._begun + 2 * _PERIOD_S if places(sys.stderr) else float("inf")

    def __call__(self, count: int, octets: int, share: float | None = None) -> None:
        """Say it, if the last time is long enough ago. `share` of all; else that of the files being read, if known."""
        now = time.monotonic()
        if now < self._next:
            return
        if share is None:
            from captures.files import share_read

            share = share_read()
        self._next = now + _PERIOD_S
        if self._line is None:
            self._line = ProgressLine(self._label, colour=coloured(sys.stderr), encoding=sys.stderr.encoding)
        rate = count / max(now - self._begun, 1e-3)
        words = f"{count:,} {self._counted}, {rate:,.0f}/s, {octets / 1e6:,.1f} MB of {self._octets_of}"
        say_in_place(self._line.at(share, words, now, shutil.get_terminal_size().columns - 1))

    def clear(self) -> None:
        """Take the line away."""
        if self._line is not None:
            say_in_place("")


class ProgressLine:
    """The line itself: label, bar, share, words, and the time left as the newest pace tells it."""

    def __init__(self, label: str, *, colour: bool, encoding: str | None = None) -> None:
        """`encoding` of where it is shown: the bar is of ASCII where nothing else can be."""
        from rich import progress
        from rich.console import Console
        from rich.table import Column

        def whole() -> Column:
            return Column(no_wrap=True)

        columns: list[progress.ProgressColumn] = [
            progress.TextColumn("{task.description}", markup=False, table_column=whole()),
            progress.BarColumn(_BAR),
            progress.TaskProgressColumn(table_column=whole()),
            progress.TextColumn("{task.fields[words]}", markup=False, table_column=whole()),
            progress.TimeRemainingColumn(compact=True, table_column=whole()),
            progress.TextColumn("{task.fields[left]}", style="progress.remaining", table_column=whole()),
        ]
        self._label, self._now = harmless(label), 0.0
        shown = io.TextIOWrapper(io.BytesIO(), encoding or "utf-8", errors="replace")
        self._console = Console(file=shown, force_terminal=True, no_color=not colour, highlight=False)
        self._progress = progress.Progress(
            *columns, console=self._console, auto_refresh=False, get_time=lambda: self._now
        )
        self._task = self._progress.add_task("", total=None, words="", left="")

    def at(self, share: float | None, words: str, now_s: float, columns: int) -> TerminalText:
        """How it stands at a time (s), so many columns wide at most. `share` of all, where that is known."""
        from ..words import shortened

        self._now = now_s
        room = max(columns - _BAR - _SHARE_AND_TIME - len(words), _LEAST_LABEL)
        label = shortened(self._label, room)
        total, left = (None, "") if share is None else (1.0, "left")
        self._progress.update(self._task, description=label, total=total, completed=share, words=words, left=left)
        self._console.width = columns
        with self._console.capture() as drawn:
            self._console.print(self._progress.get_renderable(), end="")
        return trusted(drawn.get().splitlines()[0])


_YES: Final = ("y", "yes", "д", "да")


def add_overwrite_argument(parser: argparse.ArgumentParser | argparse._ArgumentGroup, what: str) -> None:
    """--overwrite, for the file that is called `what` in the help."""
    parser.add_argument(
        "--overwrite", action="store_true", help=f"overwrite {what} if it exists (a terminal asks first)"
    )


def to_be_overwritten(path: str | Path, *, overwrite: bool, source: Path | None = None) -> bool:
    """Whether a file stands there that is to be written over: by `overwrite`, or because the user says so now.

    UsageError where it stands there and is not to be touched; `source`, the capture that is read, never is.
    """
    from pathlib import Path

    if str(path) == "-" or not Path(path).is_file():  # nothing there, or a pipe, a device, a folder
        return False
    if source is not None and Path(path).samefile(source):
        raise UsageError(f"{path}: is the capture being read: give another name")
    if overwrite:
        return True
    if not (sys.stdin.isatty() and sys.stderr.isatty()):
        raise UsageError(f"{path}: already exists: give another name, or --overwrite")
    sys.stderr.write(terminal_text(harmless(f"{path} is there already: overwrite it? [y/N] ")))
    sys.stderr.flush()
    if sys.stdin.readline().strip().lower() not in _YES:
        raise UsageError(f"{path}: left unchanged")
    return True


def captured_words(reads: int, octets: int) -> str:
    """How much of a line a capture that was written holds."""
    return tr(
        "{reads}, {bytes} of the line", reads=counted(reads, "read", "reads"), bytes=counted(octets, "byte", "bytes")
    )
