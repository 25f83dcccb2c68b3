"""Opening and writing captures: the two calls that choose a format."""

from __future__ import annotations

from collections.abc import Iterable
from os import PathLike
from pathlib import Path
from typing import BinaryIO

from captures.chunks import Capture, Chunk
from captures.errors import CaptureError
from captures.files import replacing
from captures.formats import Format, by_name, for_writing, recognise
from captures.line import LineSettings


def open(path: str | PathLike[str], *, format: str | None = None) -> Capture:
    """The capture in a file, its format found by content and suffix, or given by name.

    Nothing but the head is read yet. Raises CaptureError, one line for a person, where there is no usable capture.
    """
    path = Path(path)
    chosen = by_name(format) if format is not None else recognise(path)
    return Capture(chosen.read(path), path=path, format=chosen.name)


def write(
    target: str | PathLike[str] | BinaryIO,
    capture: Capture | Iterable[Chunk],
    *,
    line: LineSettings | None = None,
    format: str | None = None,
) -> None:
    """Writes a capture, or chunks with the settings `line`, to a file or to an open binary file.

    The format follows from `format`, else from the suffix, else it is serial-chunks. A named file gets its name only
    when it is whole. Raises CaptureError where it can't be written, ValueError for chunks with impossible values.
    """
    if not isinstance(capture, Capture):
        capture = Capture.of(line or LineSettings(), capture)
    settings = line if line is not None else capture.line
    if isinstance(target, (str, PathLike)):
        path = Path(target)
        chosen = by_name(format) if format is not None else for_writing(path)
        with replacing(path) as file:
            _put(chosen, file, settings, capture)
    else:
        _put(by_name(format or "serial-chunks"), target, settings, capture)


def _put(chosen: Format, file: BinaryIO, line: LineSettings, capture: Capture) -> None:
    if chosen.write is None:
        raise CaptureError(f"captures in the format {chosen.name!r} can be read, but not written")
    chosen.write(file, line, capture.blocks(), capture.timed)
