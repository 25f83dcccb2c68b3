"""Tables of a logic analyser, `.csv`: Saleae Logic's data table and its older export, a byte a row.

    name,type,start_time,duration,data,error          "Async Serial","data",0.0006025,2.375e-05,0xC8
    Time [s],Value,Parity Error,Framing Error         0.000602500000000,0xC8,,

The columns are found by their names in the first line. A byte's time is its start plus its duration; where the table
has no durations it is the start, which moves all times of the capture by the same character. Analyzers (the channels
of a data table) become ports in the order of their first byte.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from captures.chunks import TIME_LIMIT, Block, Chunk, Note
from captures.errors import CaptureError
from captures.files import line_batches, opened, read_head
from captures.formats import Format
from captures.line import LineSettings
from captures.text import stamps

_NAMES = {
    "time": ("start_time", "time [s]", "start"),
    "duration": ("duration",),
    "data": ("data", "value"),
    "type": ("type",),
    "name": ("name", "analyzer name"),
    "error": ("error", "parity error", "framing error"),
}
_MISSING = ("", "false", "no", "0")


@dataclass(frozen=True, slots=True)
class _Reader:
    path: Path
    line: LineSettings
    columns: Mapping[str, tuple[int, ...]]
    timed: bool = True

    def blocks(self, max_bytes: int, note: Note) -> Iterator[Block]:
        ports: dict[str, int] = {}
        with opened(self.path) as file:
            for number, lines in line_batches(file, note, 32 * min(max_bytes, 1 << 16)):
                chunks = []
                for i, line in enumerate(lines, number):
                    if i == 1 or not line.strip():
                        continue
                    try:
                        chunk = self._chunk(_cells(line), ports)
                    except ValueError as error:
                        note(f"line {i}", f"{error}: left out")
                    else:
                        chunks.extend([chunk] if chunk is not None else [])
                yield Block.from_chunks(chunks)

    def _chunk(self, cells: list[str], ports: dict[str, int]) -> Chunk | None:
        """The byte of a row; None for a row of another type; ValueError for one that can't be read."""
        values = {key: [cells[i] for i in where if i < len(cells)] for key, where in self.columns.items()}
        if values["type"] and values["type"][0] not in ("data", "address"):
            return None
        if not values["time"] or not values["data"]:
            raise ValueError("columns are missing")
        t_ns = _time(values["time"][0]) + (_time(values["duration"][0]) if values["duration"] else 0)
        if not -TIME_LIMIT < t_ns < TIME_LIMIT:
            raise ValueError("its time is out of range")
        name = values["name"][0] if values["name"] else ""
        port = ports.setdefault(name, min(len(ports), 255))
        wrong = any(cell.strip().lower() not in _MISSING for cell in values["error"])
        return Chunk(t_ns, bytes((_byte(values["data"][0]),)), port, errors=(0,) if wrong else ())


def _cells(line: bytes) -> list[str]:
    try:
        return next(csv.reader([line.decode("utf-8", "replace").strip("\r\n\ufeff")]), [])
    except csv.Error as error:
        raise ValueError(f"not a row of a table ({error})") from error


def _columns(head: bytes) -> dict[str, tuple[int, ...]] | None:
    try:
        names = [cell.strip().lower() for cell in _cells(head.split(b"\n", 1)[0])]
    except ValueError:
        return None
    columns = {key: tuple(i for i, name in enumerate(names) if name in known) for key, known in _NAMES.items()}
    return columns if columns["time"] and columns["data"] else None


def _time(text: str) -> int:
    try:
        return round(float(text) * 1e9)
    except (ValueError, OverflowError):
        stamp, _ = stamps.find(text)
        if stamp is None:
            raise ValueError(f"{text[:40]!r} is not a time") from None
        return stamp.t_ns


def _byte(text: str) -> int:
    try:
        value = int(text.strip("'\" "), 0)
    except ValueError:
        raise ValueError(f"{text[:40]!r} is not a byte: export the table with hexadecimal values") from None
    if not 0 <= value <= 255:
        raise ValueError(f"{text[:40]!r} is more than a byte")
    return value


def _sniff(head: bytes) -> float:
    return 0.95 if _columns(head) is not None else 0.0


def _read(path: Path) -> _Reader:
    columns = _columns(read_head(path))
    if columns is None:
        raise CaptureError(f"{path}: line 1: no columns for time and data: expected those of a Saleae export")
    return _Reader(path, LineSettings(), columns)


FORMAT = Format("saleae", (".csv",), _sniff, _read)
