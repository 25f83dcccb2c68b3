"""Rows that the user picks, to copy their bytes or to export them.

Copied, bytes are text to paste elsewhere: a way is an entry here. Exports are the same targets as `rtuscope export`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryFile
from typing import TYPE_CHECKING, BinaryIO, Final, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from ..core import Analysed
from ..exports.sink import ExportOptions, OutputStream
from ..languages import counted, error_words, retold, tr
from ..model.bus import Bus
from ..model.selection import Selection
from ..model.table import PIECE
from ..tables.findings import NOTHING
from ..tables.schema import Kind
from .pagefiles import write_story
from .places import CausePlace
from .prompts import Ask, Choose, may_write, names_folder, typed_path
from .threads import Stop
from .views import BY_NAME

if TYPE_CHECKING:
    from ..model.source import ViewSource
    from .screen import BusScreen


class Way(NamedTuple):
    """A way to write bytes: its key in the menu, what it is, and how."""

    key: str
    name: str
    write: Callable[[bytes], str]


def _c_array(data: bytes) -> str:
    return f"const uint8_t frame[{len(data)}] = {{ {', '.join(f'0x{octet:02X}' for octet in data)} }};"


WAYS: Final = (
    Way("h", "hex: 11 03 00 6B", lambda data: data.hex(" ").upper()),
    Way("c", "C array: { 0x11, 0x03 }", _c_array),
    Way("p", 'Python: bytes.fromhex("1103006b")', lambda data: f'bytes.fromhex("{data.hex()}")'),
    Way("r", "command: rtuscope parse 11 03", lambda data: f"rtuscope parse {data.hex(' ').upper()}"),
)


_AT_ONCE: Final = 1 << 12  # rows
_FRAMES: Final = ExportOptions(noise=True)
_OF_THE_BUS: Final = np.array([-1])  # where findings stand that are on no row


def save(
    bus: Bus,
    source: ViewSource,
    rows: NDArray[np.int64],
    path: Path,
    stop: Stop = bool,
    options: ExportOptions = _FRAMES,
) -> int:
    """Write these rows (ascending), noise among them if it is chosen, to a file; how many were written.

    By suffix: jsonl, csv, mcap. A transaction is written with its request or with its answer, whole, so that a request
    is never called unanswered because its answer was not chosen. `options` may name another table: the values that the
    rows carry, by the names that its charts give them, or their findings. The file appears whole or not at all, holding
    what came before `stop` said True.
    Raises ExportError and CaptureError.
    """
    from ..exports.sink import output

    with output(path, source=source.path) as stream:
        return write(bus, source, rows, path, stream, stop, options)


def write(
    bus: Bus, source: ViewSource, rows: NDArray[np.int64], name: Path, stream: OutputStream, stop: Stop = bool,
    options: ExportOptions = _FRAMES,
) -> int:  # fmt: skip
    """What `save` puts into a file called `name`, to an open stream."""
    from captures.chunks import Capture

    from ..exports.running import open_sink
    from ..exports.sink import format_name

    capture = Capture.of(source.line, (), timed=source.timed)
    sink = open_sink(stream, capture, options, format_name(name))
    sink.begins(bus.t_first)
    first = 0
    while first < len(rows) and not stop():
        last = int(np.searchsorted(rows, (rows[first] // PIECE + 1) * PIECE))
        part = rows[first : min(last, first + _AT_ONCE)]
        batch = bus.batch(part)
        sink.rows(batch, 0, len(batch))
        findings = NOTHING if batch.findings is None else batch.findings
        sink.batch(Analysed(batch, bus.transactions(_requests(bus, part, rows)), findings))
        first += len(part)
    if first == bus.count:  # who has all rows has what is found of the bus as a whole
        sink.batch(replace(Analysed.nothing(), findings=bus.found.on(_OF_THE_BUS)))
    sink.close()
    return first


def _requests(bus: Bus, part: NDArray[np.int64], chosen: NDArray[np.int64]) -> NDArray[np.int64]:
    """The requests in a part of the chosen rows, and those that its answers answer and that were not chosen."""
    partners = bus.table.take_column("partner", part).astype(np.int64)
    kinds = bus.table.take_column("kind", part)
    away = partners[(kinds == Kind.RESPONSE) & (partners >= 0)]
    return np.union1d(part[kinds == Kind.REQUEST], away[~np.isin(away, chosen)])


_PLAIN: Final = re.compile(r"[A-Za-z0-9_][A-Za-z0-9._-]{0,99}")
_TABLES: Final = {"registers": "values", "polls": "values", "findings": "findings"}  # of a view's export; else frames
_SUBJECTS: Final = {"values": "the values of {rows}", "findings": "the findings of {rows}"}
_COPIED: Final = 1 << 20  # bytes, at most


class _Saved(NamedTuple):
    """What became of an export: `trouble` says why it failed, if it did; `file` holds it, if it is for a browser."""

    rows: int
    trouble: str = ""
    file: BinaryIO | None = None


class PickedRows:
    """The rows from the anchor to the cursor, or to where the selection was ended, if an anchor is set."""

    def __init__(self, screen: BusScreen) -> None:
        self._screen = screen
        self.anchor: int | None = None
        self.ended: int | None = None

    def rows(self) -> NDArray[np.int64]:
        """Those of them that the list shows."""
        shown = self._screen.frames.rows
        last = self._screen.frames.row if self.ended is None else self.ended
        if self.anchor is None or last is None:
            return np.zeros(0, np.int64)
        low, high = sorted((self.anchor, last))
        if isinstance(shown, Selection):
            rows = shown.rows()
            return rows[(rows >= low) & (rows <= high)]
        return np.arange(low, high + 1)

    def toggle(self) -> None:
        """Begin at the cursor; then end it there, and keep it; then begin anew."""
        if self.anchor is not None and self.ended is None:
            self._choose(self.anchor, self._screen.frames.row)
        else:
            self._choose(self._screen.frames.row, None)

    def drop(self) -> None:
        """Select nothing."""
        self._choose(None, None)

    def _choose(self, anchor: int | None, ended: int | None) -> None:
        self.anchor, self.ended = anchor, ended
        frames = self._screen.frames
        frames.pinned, frames.pinned_to = anchor, ended
        frames.unpaint()
        self._screen.write_status()

    async def copy(self) -> None:
        """Ask how, and put the bytes on the terminal's clipboard (OSC 52); in views without bytes what they say."""
        screen = self._screen
        copied = BY_NAME[screen.view].copied
        if copied is not None:
            if text := copied(screen):
                screen.app.copy_to_clipboard(text)
                screen.notify_of(tr("copied, if the terminal allows it (OSC 52)"))
            return
        data = self._octets()
        if not data:
            screen.notify_of(tr("no bytes to copy"))
            return
        if len(data) > _COPIED:
            octets = counted(len(data), "byte", "bytes")
            screen.notify_of(tr("{bytes} is too much for the clipboard: e writes them to a file", bytes=octets))
            return
        ways = [(each.key, tr(each.name)) for each in WAYS]
        question = tr("Copy {bytes} as", bytes=counted(len(data), "byte", "bytes"))
        which = await screen.app.push_screen_wait(Choose(question, ways))
        if which is not None:
            screen.app.copy_to_clipboard(WAYS[which].write(data))
            screen.notify_of(tr("copied, if the terminal allows it (OSC 52)"))

    def _octets(self) -> bytes:
        """The picked rows' bytes, those of the field that has the keys, or the frame's."""
        if self.anchor is None:
            return self._screen.detail.chosen_bytes
        return b"".join(self._screen.desk.bus.captured(int(row)) for row in self.rows())

    async def export(self) -> None:
        """Ask for a file, and write the picked rows to it, or the shown ones; a browser downloads it."""
        screen, app = self._screen, self._screen.app
        other = BY_NAME[screen.view].export
        if other is not None:
            await other(screen)
            return
        place = screen.place
        if isinstance(place, CausePlace) and screen.jobs.narrowed is None:  # else the rows that are left are meant
            await write_story(screen, place.cause)
            return
        picked = None if self.anchor is None else self.rows()
        count = screen.jobs.shown_count if picked is None else len(picked)
        if count == 0:
            screen.notify_of(tr("no rows to export"))
            return
        some = tr("the rows") if count is None else counted(count, "row", "rows")
        subject = some + (tr(" shown") if picked is None else tr(" selected"))
        table = _TABLES.get(screen.view, "frames")
        options = _FRAMES if table == "frames" else ExportOptions(table=table, charts=screen.desk.meanings.charts)
        if table in _SUBJECTS:
            subject = tr(_SUBJECTS[table], rows=subject)
        question = tr("Download {rows} as", rows=subject) if app.is_web else tr("Export {rows} to", rows=subject)
        wrong = partial(_no_download if app.is_web else _no_file, table=table)
        text = await app.push_screen_wait(Ask(question, _formats(table), wrong=wrong, value=f"{table}.csv"))
        if not text:
            return
        path = typed_path(text)
        if not await may_write(screen, path):
            return
        screen.jobs.doing = tr("exporting")
        screen.write_status()
        shown = screen.jobs.shown()

        def work(stop: Stop) -> _Saved:
            return self._save(shown(stop) if picked is None else picked, path, stop, options)

        screen.jobs.run("export", work, lambda saved: self._saved(path, saved), exclusive=False)

    def _save(self, rows: NDArray[np.int64], path: Path, stop: Stop, options: ExportOptions) -> _Saved:
        """Write them: for a browser to a file without a name, since nobody there is to name files of this machine."""
        bus, source = self._screen.desk.bus, self._screen.desk.source
        try:
            if not self._screen.app.is_web:
                return _Saved(save(bus, source, rows, path, stop, options))
            nameless = cast(BinaryIO, TemporaryFile())  # noqa: SIM115 - the browser takes it
            count = write(bus, source, rows, path, OutputStream(nameless), stop, options)
            nameless.seek(0)
            return _Saved(count, file=nameless)
        except Exception as error:  # told in one line
            return _Saved(0, error_words(error))

    def _saved(self, path: Path, saved: _Saved) -> None:
        screen, rows = self._screen, counted(saved.rows, "row", "rows")
        screen.jobs.doing = ""
        screen.write_status()
        if saved.trouble:
            screen.notify_of(saved.trouble, wrong=True)
        elif saved.file is not None:
            screen.app.deliver_binary(saved.file, save_filename=path.name)
            screen.notify_of(tr("{rows} sent to the browser as {file}", rows=rows, file=path.name))
        else:
            screen.notify_of(tr("{rows} written to {file}", rows=rows, file=path.absolute()))


def _suffixes(table: str) -> Sequence[str]:
    """Formats that hold rows of a table, or frames, of a part of a capture."""
    from ..exports.recordfiles import TABULAR
    from ..exports.sink import formats, target

    return TABULAR if table != "frames" else [name for name in formats() if not hasattr(target("-", name), "WHOLE")]


def _formats(table: str) -> str:
    names = " ".join(f".{name}" for name in _suffixes(table))
    words = tr("a file; its suffix sets the format: {formats}", formats=names)
    return words if table != "frames" else f"{words}. {tr('A .pcapng opens in Wireshark and here')}"


def _no_file(text: str, table: str = "frames") -> str:
    """Why an export cannot go to a file of that name; empty where it can."""
    path = typed_path(text)
    folder = "" if names_folder(path.parent) else tr("no folder {folder}", folder=Path(text).parent)
    return _no_format(path, table) or folder


def _no_download(text: str, table: str = "frames") -> str:
    """Why a browser cannot be given a file of that name; empty where it can."""
    if not _PLAIN.fullmatch(text):
        return tr("a plain name, such as frames.csv: the browser decides where it goes")
    return _no_format(Path(text), table)


def _no_format(path: Path, table: str) -> str:
    """Why no export has that suffix, told by what can be done here."""
    from ..exports.sink import formats, target

    suffix = path.suffix.removeprefix(".").lower()
    if suffix in _suffixes(table):
        return ""
    whole = getattr(target("-", suffix), "WHOLE", "") if suffix in formats() else ""
    names = " ".join(f".{name}" for name in _suffixes(table))
    return retold(whole) or tr("nothing is exported as {name}; formats: {formats}", name=path.name, formats=names)
