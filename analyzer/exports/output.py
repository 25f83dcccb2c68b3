"""Where an export goes: a file that appears whole or not at all (`captures.replacing`), or standard output."""

from __future__ import annotations

import codecs
import io
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO, Final, cast

import captures

from ..terminal_text import terminal_text


class ExportError(Exception):
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
def output(path: str | Path, *, source: Path | None = None) -> Iterator[OutputStream]:
    """Somewhere to write to; `-` is standard output.

    Leaving the block by an exception leaves no file. `source` is the file that is being read: writing onto it is
    refused. Raises ExportError or captures.CaptureError with what the operating system says; BrokenPipeError passes.
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
        raise ExportError(f"{path}: is the capture that is being read; give another name")
    with captures.replacing(path) as stream:
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
