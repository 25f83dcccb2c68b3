"""The one gate of text: whatever leaves for a terminal goes through `terminal_text`.

Names of files, a log's header, a device's strings, notes, rules and names of plug-ins are foreign, and any of them can
end up in any line. So not each of them is looked after, but the way out: standard output and standard error are each a
`TerminalGate` while a command runs. What does not print as itself comes out as its escape, line ends apart
(`dissectors.values.harmless`). The program's own escape sequences pass as `TerminalText`, which this module alone
makes; where that is forgotten, the escape is seen on the screen, and nothing else happens.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any, Final, TextIO, cast

from dissectors.values import harmless


class TerminalText(str):
    """Text that is ready for a terminal. Put together with other text it is a plain `str` again."""

    __slots__ = ()

    def __str__(self) -> TerminalText:  # else `print` would write a plain `str`
        return self


READABLE: Final = 120  # columns of a line that one still reads
ERASE_LINE: Final = TerminalText("\r\x1b[K")


def terminal_text(*parts: str) -> TerminalText:
    """Parts end to end, each harmless line by line unless it is ready already."""
    return TerminalText("".join([_ready(part) for part in parts]))


def painted(text: str, graphics: str, *, ended: bool = False) -> TerminalText:
    """A line in a graphic rendition (`31` is red), as it is where that is empty; `ended`: with its end behind it."""
    ready, end = _ready(text), "\n" if ended else ""
    return TerminalText(f"\x1b[{graphics}m{ready}\x1b[0m{end}" if graphics else f"{ready}{end}")


def trusted(text: str) -> TerminalText:
    """A text of ours that holds control characters for a reason, such as a shell's script."""
    return TerminalText(text)


class TerminalGate:
    """A text stream through which only harmless text goes; what it does not do itself the stream behind it does."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        """Write a text made harmless; gives the characters taken of it, which are all."""
        self._stream.write(terminal_text(text))
        return len(text)

    def writelines(self, lines: Iterable[str]) -> None:
        """Write texts one after another."""
        for line in lines:
            self.write(line)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


@contextmanager
def gated_streams() -> Iterator[None]:
    """Standard output and standard error through the gate.

    The one place that knows of streams which are None, as the shell's `<&-` and `pythonw` leave them: inside, all three
    are there, what was closed reads and writes as /dev/null. That takes the lowest descriptors, so no file gets them.
    """
    before = sys.stdin, sys.stdout, sys.stderr
    with open(os.devnull, encoding="utf-8") as nothing, _nowhere() as nowhere:  # noqa: PTH123 - pathlib takes 4 ms
        sys.stdin = before[0] or nothing
        sys.stdout, sys.stderr = (cast(TextIO, TerminalGate(stream or nowhere)) for stream in before[1:])
        try:
            yield
        finally:
            sys.stdin, sys.stdout, sys.stderr = before


def _nowhere() -> TextIO:
    return open(os.devnull, "w", encoding="utf-8", errors="replace")  # noqa: PTH123


def _ready(text: str) -> str:
    """A text harmless line by line, unless it is so already."""
    if isinstance(text, TerminalText) or text.isprintable():
        return text
    return "\n".join(map(harmless, text.split("\n")))
