"""Pasted text to bytes: what people copy out of logs, dumps, source code and terminals.

Pure Python, no arrays: `rtuscope parse` starts with it. The text is read by `captures.text.logs`, as logs in files are.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import tzinfo
from typing import Final

from .errors import HexError
from .text.candidates import halves
from .text.judging import ByteJudge, no_judge
from .text.logs import LOOKED_FOR, Piece, UnreadLine, joined, read_lines

_WHAT_IS_READ: Final = f"paste bytes {LOOKED_FOR}, or lines of a log that show them"


@dataclass(frozen=True, slots=True)
class Words:
    """Bytes found in a text.

    `mark` is the direction that the text gives: 0 none, 1 sent, 2 received. `t_ns` is its time in ns, None without one.
    `line` (from 1) and `text` are the line where the bytes begin. `ascii` says that they are an ASCII-mode frame, kept
    as its characters from `:` to CR LF.
    """

    data: bytes
    mark: int
    t_ns: int | None
    line: int
    text: str
    ascii: bool = False


@dataclass(frozen=True, slots=True)
class TextBytes:
    """What a text holds: its bytes, an item for each run of them, and the lines of which not all was read."""

    words: tuple[Words, ...]
    unread: tuple[UnreadLine, ...]


def read_text(text: str, judge: ByteJudge = no_judge) -> list[Words]:
    """All bytes of a text, in order. Raises HexError where there are none: see `read_paste`."""
    return list(read_paste(text, judge).words)


def read_paste(text: str, judge: ByteJudge = no_judge, zone: tzinfo | None = None) -> TextBytes:
    """The bytes of a text, and what of it was not read; lines of one dump are put together.

    `judge` says which bytes have right check values, by which bytes are told from other numbers; `zone` is that of
    dates without one (None: this machine's). Raises HexError, one line for a person, where no bytes are found.
    """
    paste = _read(text, judge, zone)
    if not paste.words:
        raise HexError(_nothing(text, paste.unread))
    return paste


def _read(text: str, judge: ByteJudge, zone: tzinfo | None) -> TextBytes:
    reads = list(joined(read_lines(text.splitlines(), judge, zone)))
    words = tuple(
        Words(read.data, read.mark, read.t_ns, read.line, read.text, read.ascii)
        for read in reads
        if isinstance(read, Piece)
    )
    return TextBytes(words, tuple(read for read in reads if isinstance(read, UnreadLine)))


def _nothing(text: str, unread: tuple[UnreadLine, ...]) -> str:
    """What to say where there are no bytes."""
    shown = " ".join(text.split())
    if not shown:
        return "nothing to read: it is empty"
    lines = text.splitlines()
    for number, line in enumerate(lines, 1):
        if (half := halves(line)) is not None:
            return f"line {number}: {half}" if len(lines) > 1 else half
    telling = next((one for one in unread if not one.empty), None)
    if telling is not None:
        return f"no hex bytes found: line {telling.line}: {telling.why}; {_WHAT_IS_READ}"
    return f"no hex bytes found in {shown[:60]!r}: {_WHAT_IS_READ}"
