"""Opening and writing captures: the two calls that choose a format."""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from datetime import UTC, timedelta, timezone, tzinfo
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, Final

from .chunks import Block, Capture, Chunk, Note, Source, spans_of
from .editing import of_port
from .errors import CaptureError
from .files import read_head, replacing
from .formats import Format, RecognisedFormat, by_name, claimed, for_writing, likely, recognise
from .line import POLARITIES, LineSettings
from .packed import STANDARD_INPUT, LocalFile, local_file, unpacked
from .recording.notes import Note as LineNote
from .spacing import INFERRED, inferred
from .text.judging import ByteJudge, no_judge

if TYPE_CHECKING:
    from .edges.source import BitSpans

_OFFSET_LENGTH: Final = len("+hh:mm")


def open(
    path: str | PathLike[str],
    *,
    format: str | None = None,
    baud: int | None = None,
    parity: str | None = None,
    bits: int | None = None,
    stop: float | None = None,
    polarity: str | None = None,
    tz: str | tzinfo | None = None,
    sample_rate: float | None = None,
    only_port: int | None = None,
    judge: ByteJudge = no_judge,
) -> Capture:
    """The capture in a file, its format seen from content and suffix, or given by name; `-` is standard input.

    Packed files (gzip, bzip2, xz, zstd, a zip with one capture) and pipes are read as well. `baud` in bit/s, `parity`
    N, E, O, M or S, `bits` data bits, `stop` stop bits: the line's settings, whatever the file says; what nobody says
    is inferred where the bytes tell it, and said in `notices`. `polarity` of edges: `normal`, or `inverted` for a line
    that is low when idle. `tz` is the zone of times without one: a name such as Europe/Berlin, an offset such as
    +03:00, or a tzinfo; `sample_rate`, in Hz, that of a log that counts samples; `only_port` leaves out all ports but
    this one. `judge` says which bytes have right check values, by which a log's bytes are told from its other numbers
    (`analyzer.open` gives one that knows Modbus). Little but the head is read yet. Raises CaptureError, one line for a
    person, where there is no usable capture.
    """
    path = Path(path)
    zone = time_zone(tz) if isinstance(tz, str) else tz
    chosen = None if format is None else by_name(format)
    settings = {"baud": baud, "parity": parity, "bits": bits, "stop": stop, "polarity": polarity, "tz": zone}
    if polarity not in (None, *POLARITIES):
        raise CaptureError(f"unknown polarity {polarity!r}: use {' or '.join(POLARITIES)}")
    try:
        LineSettings().with_settings(baud, parity, bits, stop)
    except ValueError as error:
        raise CaptureError(str(error)) from error
    file = local_file(path)
    try:
        file, recognised = _recognised(file, chosen)
        source = _read(recognised.format, file, {**settings, "sample_rate": sample_rate, "judge": judge})
        opened = _Opened(source, source.line.with_settings(baud, parity, bits, stop), source.timed, file)
        notices = [f"{file.name}: {recognised.doubt}"] if recognised.doubt else []
        capture = _capture(opened, path, recognised.format, notices)
        return capture if only_port is None else of_port(capture, only_port)
    except BaseException:
        file.remove()
        raise


def time_zone(text: str) -> tzinfo:
    """The zone of a name (`Europe/Moscow`, `UTC`, `local`) or an offset (`+03:00`, `-0530`, `Z`); else CaptureError."""
    if text in ("UTC", "utc", "Z"):
        return UTC
    if text == "local":
        from datetime import datetime

        zone = datetime.now().astimezone().tzinfo
        assert zone is not None
        return zone
    digits = text[1:].replace(":", "")
    if text[:1] in ("+", "-") and digits.isdecimal() and len(digits) in (2, 4) and len(text) <= _OFFSET_LENGTH:
        offset = timedelta(hours=int(digits[:2]), minutes=int(digits[2:] or 0))
        if offset < timedelta(hours=24):
            return timezone(-offset if text[0] == "-" else offset)
    from zoneinfo import ZoneInfo

    try:
        return ZoneInfo(text)
    except Exception as error:  # ValueError, KeyError, OSError: hostile names reach the file system
        raise CaptureError(
            f"unknown time zone {text[:40]!r}: give a name such as Europe/Berlin, an offset such as +03:00, UTC or "
            "local"
        ) from error


def _recognised(file: LocalFile, chosen: Format | None) -> tuple[LocalFile, RecognisedFormat]:
    """The file unpacked as far as that makes it a capture, and its format."""
    while True:
        try:
            head = read_head(file.path)
        except CaptureError as error:
            raise file.blamed(error) from error
        if not claimed(head, file.path.suffix, chosen):
            try:
                inside = unpacked(file, head, likely)
            except CaptureError:
                if chosen is None or not chosen.sniff(head):
                    raise
                inside = None  # raw bytes may begin as a packed file does
            if inside is not None:
                file = inside
                continue
        return file, RecognisedFormat(chosen) if chosen is not None else recognise(head, file.path.suffix, file.name)


def _read(format: Format, file: LocalFile, settings: dict[str, Any]) -> Source:
    """What the format's reader gives; it is told those settings that it takes."""
    takes = inspect.signature(format.read).parameters
    try:
        return format.read(file.path, **{name: value for name, value in settings.items() if name in takes})
    except CaptureError as error:
        raise file.blamed(error) from error


def _capture(opened: _Opened, path: Path, format: Format, notices: list[str]) -> Capture:
    shown = None if str(path) == STANDARD_INPUT else path
    notices += [f"{opened.file.name}: {notice}" for notice in getattr(opened.source, "notices", ())]
    if opened.line.baud is None and opened.timed:
        opened.line = inferred(Capture(opened))
    if (how := opened.line.notes.get(INFERRED)) is not None:
        notices.append(f"{opened.file.name}: {how}")
    return Capture(opened, path=shown, format=format.name, notices=notices)


@dataclass(slots=True, weakref_slot=True)
class _Opened:
    """A reader's source with the settings that were given, whose temporary file stays as long as it does."""

    source: Source
    line: LineSettings
    timed: bool
    file: LocalFile

    def __post_init__(self) -> None:
        self.file.keep(self)

    @property
    def spans(self) -> BitSpans | None:
        return spans_of(self.source)

    def notes(self) -> list[LineNote]:
        of_source = getattr(self.source, "notes", None)
        return list(of_source()) if of_source is not None else []

    def blocks(self, max_bytes: int, note: Note) -> Iterator[Block]:
        try:
            yield from self.source.blocks(max_bytes, note)
        except CaptureError as error:
            raise self.file.blamed(error) from error
        if self.file.cut is not None:
            note("end", self.file.cut)


def write(
    target: str | PathLike[str] | BinaryIO,
    capture: Capture | Iterable[Chunk],
    *,
    line: LineSettings | None = None,
    format: str | None = None,
) -> None:
    """Writes a capture with its notes, or chunks with the settings `line`, to a file or to an open binary file.

    Chunks are written as they are made. The format follows from `format`, else from the suffix, else it is
    serial-chunks; notes are left out where it has no room for them. A named file gets its name only when it is whole.
    Raises CaptureError where it can't be written, ValueError for chunks with impossible values.
    """
    if not isinstance(capture, Capture):
        capture = Capture.passing(line or LineSettings(), capture)
    settings = line if line is not None else capture.line
    if isinstance(target, (str, PathLike)):
        path = Path(target)
        chosen = by_name(format) if format is not None else for_writing(path)
        with replacing(path, private=True) as file:
            _put(chosen, file, settings, capture)
    else:
        _put(by_name(format or "serial-chunks"), target, settings, capture)


def _put(chosen: Format, file: BinaryIO, line: LineSettings, capture: Capture) -> None:
    if chosen.write is None:
        raise CaptureError(f"the format {chosen.name!r} can be read, but not written")
    notes = {"notes": capture.notes()} if keeps_notes(chosen) else {}
    chosen.write(file, line, capture.blocks(), capture.timed, **notes)


def keeps_notes(chosen: Format) -> bool:
    """Whether files of a format hold notes, too."""
    return chosen.write is not None and "notes" in inspect.signature(chosen.write).parameters
