"""What a target is, the registry of them, and where an export goes: a file that appears whole or not at all, or
standard output.

A target is a module of `targets`, named by the suffix that it writes. A new one is one new file there with
`open_sink(out, capture, options) -> Sink`; nothing else has to know it. Files are written by `captures.replacing`.
"""

from __future__ import annotations

import codecs
import io
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import TYPE_CHECKING, Any, BinaryIO, Final, Protocol, cast

import captures

from ..errors import RtuscopeError
from ..meant import did_you_mean
from ..registry import module_names
from ..terminal_text import terminal_text
from . import targets

if TYPE_CHECKING:
    from collections.abc import Mapping

    from captures import Block, Capture
    from captures.files import Unfinished
    from dissectors.maps import RegisterMap

    from ..core import Analysed
    from ..filters import Filter
    from ..tables.batch import Batch


class ExportError(RtuscopeError):
    """An export that cannot be made: what, where, what to do."""


class OutputStream:
    """A binary stream that only goes forward and knows how far it is, which a pipe could not say."""

    closed: Final = False  # as long as it is there to be written to; libraries ask

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream
        self._at = 0

    def write(self, data: bytes | memoryview) -> int:
        """Write all of it: a stream without a buffer (PYTHONUNBUFFERED) may take less at a time."""
        left = memoryview(data)
        while len(left):
            left = left[self._stream.write(left) or 0 :]
        self._at += len(data)
        return len(data)

    def tell(self) -> int:
        """Bytes written so far."""
        return self._at

    def flush(self) -> None:
        """Hand what is buffered to the operating system."""
        self._stream.flush()


@contextmanager
def output(
    path: str | Path, *, source: Path | None = None, unfinished: Unfinished | None = None
) -> Iterator[OutputStream]:
    """Somewhere to write to; `-` is standard output.

    Leaving the block by an exception leaves no file. `source` is the file that is being read: writing onto it is
    refused. What `unfinished` calls a part replaces no file. Raises ExportError or captures.CaptureError with what the
    operating system says; BrokenPipeError passes.
    """
    if str(path) == "-":
        try:
            target = OutputStream(cast(BinaryIO, _Screen()) if sys.stdout.isatty() else sys.stdout.buffer)
            yield target
            target.flush()
        except BrokenPipeError:
            raise
        except OSError as error:
            raise ExportError(
                f"standard output: cannot be written: {(error.strerror or str(error)).lower()}"
            ) from error
        return
    if source is not None and _same(Path(path), source):
        raise ExportError(f"{path}: is the capture being read: give another name")
    with captures.replacing(path, unfinished=unfinished) as stream:
        target = OutputStream(stream)
        yield target
        target.flush()


class _Screen(io.RawIOBase):
    """A terminal as a binary stream: UTF-8 goes to it through the gate of text; other bytes come as escapes."""

    def __init__(self) -> None:
        self._decoded = codecs.getincrementaldecoder("utf-8")("backslashreplace").decode

    def write(self, data: Any) -> int:
        """Write all of it."""
        sys.stdout.write(terminal_text(self._decoded(bytes(data))))
        return len(data)

    def flush(self) -> None:
        """Hand what is buffered to the operating system."""
        sys.stdout.flush()


def _same(one: Path, second: Path) -> bool:
    try:
        return one.samefile(second)
    except (OSError, ValueError):
        return False


@dataclass(frozen=True, slots=True)
class ExportOptions:
    """What is written beside the frames."""

    explain: bool = False  # why each boundary stands where it does
    noise: bool = False  # the bytes between frames, so that lines tile the stream
    filter: Filter | None = None  # only rows that pass; one that names noise brings noise without being asked to
    table: str = "frames"  # or one of `records.TABLES`
    delimiter: str = ","  # of CSV
    bom: bool = False  # a byte order mark before a CSV, by which spreadsheets know UTF-8
    charts: Mapping[int, RegisterMap] | None = None  # register maps by unit, which name the values
    fields: tuple[str, ...] = ()  # columns to write, in this order; all if none is named
    count: int = sys.maxsize  # write so many frames, or records of another table, and end

    @property
    def whole(self) -> bool:
        """Whether all of a capture is written."""
        return (self.filter, self.count) == (None, sys.maxsize)


class Sink:
    """A target being written. Blocks and batches come as the capture is read; a block before the batches it gave.

    One says what it heeds.
    """

    full = False  # as much is written as was asked for

    def begins(self, t_ns: int) -> None:
        """Rows begin at that time; told before those of them that are written come, of the first row of all first."""

    def block(self, block: Block) -> None:
        """Raw chunks."""

    def rows(self, batch: Batch, first: int, last: int) -> None:
        """Rows `first` to `last` (excluded) of a batch, in wire order."""

    def batch(self, analysed: Analysed) -> None:
        """A batch all of whose rows have come, with what is said of them; the last one may have been cut short."""

    def close(self) -> None:
        """Write what is left."""


class Target(Protocol):
    """A module of `targets`.

    One whose files cannot hold a part of a capture has WHOLE, which says why not; one whose files are no text has
    BINARY, which is True. TAKES names the options (of `running.REFUSED`) that it heeds.
    """

    TAKES: frozenset[str]

    def open_sink(self, out: OutputStream, capture: Capture, options: ExportOptions) -> Sink: ...


def formats() -> tuple[str, ...]:
    """The names of all targets, which are the suffixes too."""
    return module_names(targets.__name__)


def target(path: str | PurePath, name: str | None = None) -> Target:
    """The target for a path, by name or else by suffix; standard output is jsonl.

    Raises ExportError where there is none.
    """
    from importlib import import_module

    return cast(Target, import_module(f"{targets.__name__}.{format_name(path, name)}"))


def format_name(path: str | PurePath, name: str | None = None) -> str:
    """The format of that name, or else of the path's suffix; standard output is jsonl. Raises ExportError."""
    if name is None:
        name = "jsonl" if str(path) == "-" else PurePath(path).suffix.removeprefix(".").lower()
    if name not in formats():
        which = (
            f"no format {name!r}{did_you_mean(name, formats())}"
            if name
            else f"{path}: no suffix to tell the format from"
        )
        raise ExportError(f"{which}; formats: {', '.join(formats())} (by suffix or --format)")
    return name
