"""Saleae's digital export as a table, `.csv`: a row a change, a column a channel.

    Time [s],Channel 0,Channel 1         0.000602500,1,0

Logic 1 and 2 write them; times may be ISO 8601. `X` stands where a channel was not captured.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from captures.text import stamps

from ..chunks import Note
from ..edges.source import EdgePiece, edge_reader
from ..edges.uart import Times
from ..errors import CaptureError
from ..files import lines_of, opened, read_head, text_batches
from ..limits import TIME_LIMIT
from ..ragged import copy_pieces
from . import Format

_TIME: Final = re.compile(r"time ?\[s\]", re.I)
_STATES: Final = re.compile(rb"[^,]+(?:, ?[01X])+\r?")
_BATCH: Final = 1 << 20
_CHANNELS: Final = 64
_TIME_WIDTH: Final = 40  # characters of a time
_LEVELS: Final = np.frombuffer(b"01X", np.uint8)


@dataclass(frozen=True, slots=True)
class _Table:
    path: Path
    names: list[str]
    levels: list[int]
    begin_ns: int

    def pieces(self, note: Note) -> Iterator[EdgePiece]:
        settled = np.array(self.levels, np.bool_)
        newest = -TIME_LIMIT + 1
        with opened(self.path) as file:
            for number, text in text_batches(file, note, _BATCH):
                if number == 1:
                    number, text = 2, text.partition(b"\n")[2]
                times, states = self._rows(text, number, note)
                if not len(times):
                    continue
                times = np.maximum.accumulate(np.maximum(times, newest))
                newest = int(times[-1])
                before = np.concatenate((settled[None, :], states[:-1]))
                flipped = states != before
                settled = states[-1]
                yield EdgePiece([times[flipped[:, channel]] for channel in range(len(self.names))], newest)

    def _rows(self, text: bytes, number: int, note: Note) -> tuple[Times, NDArray[np.bool_]]:
        """Times and levels of the rows of a text that can be read."""
        width = len(self.names) + 1
        text = text.replace(b" ", b"").replace(b"\r", b"")
        cells = _cells(text if text.endswith(b"\n") else text + b"\n", width)
        if cells is None:
            lines = lines_of(text)
            good = [line for line in lines if re.fullmatch(rb"[^,]+(?:,[01X]){%d}" % (width - 1), line)]
            if wrong := sum(bool(line.strip()) for line in lines) - len(good):
                note(f"lines {number} to {number + len(lines)}", f"{wrong:,} rows that are none: left out")
            cells = _cells(b"".join(line + b"\n" for line in good), width)
        if cells is None:
            return np.zeros(0, np.int64), np.zeros((0, width - 1), np.bool_)
        times = _nanoseconds(cells[0])
        usable = times > -TIME_LIMIT
        if not usable.all():
            note(f"line {number}", f"{int((~usable).sum()):,} rows without a time from here on: left out")
        states = cells[1][usable]
        levels = states == ord("1")
        missing = states == ord("X")
        for channel in np.flatnonzero(missing.any(axis=0)).tolist():  # as it was before
            rows = np.maximum.accumulate(np.where(missing[:, channel], 0, np.arange(len(levels))))
            levels[:, channel] = levels[rows, channel]
        return times[usable], levels


def _cells(text: bytes, width: int) -> tuple[NDArray[np.bytes_], NDArray[np.uint8]] | None:
    """The first cell of each row as text, the others as one character each; None where any row is not like that."""
    data = np.frombuffer(text, np.uint8)
    ends = np.flatnonzero((data == ord(",")) | (data == ord("\n")))
    if not len(ends) or len(ends) % width:
        return None
    return _in_rows(data, ends.reshape(-1, width))


def _in_rows(data: NDArray[np.uint8], ends: NDArray[np.intp]) -> tuple[NDArray[np.bytes_], NDArray[np.uint8]] | None:
    """The same, with the ends of all cells, a row each."""
    begins = np.concatenate(([0], ends[:-1, -1] + 1))
    sizes = ends[:, 0] - begins
    rows = (data[ends[:, -1]] == ord("\n")).all() and (data[ends[:, :-1]] == ord(",")).all()
    if not rows or (np.diff(ends, axis=1) != 2).any() or not 0 < sizes.min() <= sizes.max() <= _TIME_WIDTH:
        return None
    states = data[ends[:, 1:] - 1]
    if not np.isin(states, _LEVELS).all():
        return None
    longest = int(sizes.max())
    first = np.zeros(len(ends) * longest, np.uint8)
    copy_pieces(first, np.arange(len(ends)) * longest, data, begins, sizes)
    return first.view(f"S{longest}"), states


def _nanoseconds(cells: NDArray[np.bytes_]) -> Times:
    """Times in ns; -TIME_LIMIT where there is none."""
    try:
        seconds = cells.astype(np.float64)
    except ValueError:
        return np.array([_stamp(cell) for cell in cells.tolist()], np.int64)
    out = np.full(len(cells), -TIME_LIMIT, np.int64)
    usable = np.isfinite(seconds) & (np.abs(seconds) < (TIME_LIMIT - 1) / 1e9)
    out[usable] = np.rint(seconds[usable] * 1e9).astype(np.int64)
    return out


def _stamp(cell: bytes) -> int:
    text = cell.decode("utf-8", "replace")
    try:
        seconds = float(text)
        return round(seconds * 1e9) if abs(seconds) < (TIME_LIMIT - 1) / 1e9 else -TIME_LIMIT
    except (ValueError, OverflowError):
        stamp, _ = stamps.find(text)
        return -TIME_LIMIT if stamp is None else stamp.t_ns


def _names(head: bytes) -> list[str] | None:
    """The channels that the head of a table names; None where it is another table."""
    first, _, rest = head.partition(b"\n")
    names = [
        " ".join(cell.strip().strip('"').split())
        for cell in first.decode("utf-8", "replace").lstrip("\ufeff").split(",")
    ]
    row = rest.partition(b"\n")[0]
    if len(names) < 2 or not _TIME.fullmatch(names[0]) or (row.strip() and not _STATES.fullmatch(row)):
        return None
    return names[1:]


def _sniff(head: bytes) -> float:
    return 0.97 if _names(head) is not None else 0.0


def _load(path: Path) -> _Table:
    head = read_head(path)
    names = _names(head)
    if names is None or len(names) > _CHANNELS:
        raise CaptureError(f"{path}: line 1: no columns of channels with levels 0 and 1 behind a time in seconds")
    cells = head.partition(b"\n")[2].partition(b"\n")[0].strip().split(b",")[1:]
    levels = [int(cell.strip() == b"1") for cell in cells] + [0] * len(names)
    begin = int(_nanoseconds(np.array([head.partition(b"\n")[2].partition(b",")[0].strip()], np.bytes_))[0])
    return _Table(path, names, levels[: len(names)], begin)


FORMAT = Format("saleae-edges", (".csv",), _sniff, edge_reader(_load))
