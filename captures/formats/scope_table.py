"""An oscilloscope's table, `.csv`: a row a sample, its time and the voltages of its channels.

    Time(s),CH1(V),CH2(V)          X,CH1,Start,Increment            Time,Channel A
    -6.0e-03,2.5,0.1               Sequence,VOLT,-6.0e-03,5.0e-06   (ms),(V)
                                   0,2.5,,                          0.0005,2.5

Which columns hold numbers is seen from the rows; what stands above them, or beside the first ones, are the settings of
the instrument. The first of these columns, which rises evenly, is the time, or the number of a sample whose interval
the settings (or `--sample-rate`) tell. A channel is high and low by its own extremes, with a quarter of their distance
as hysteresis, so that a line that nobody drives stays as it was left: of RS-485, one wire, both, or their difference.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ..chunks import Note
from ..edges.source import EdgePiece, edge_reader
from ..edges.uart import Times, unit_of
from ..errors import CaptureError
from ..files import lines_of, opened, read_head, text_batches
from ..limits import TIME_LIMIT
from . import Format

_HEAD: Final = 64  # lines before the rows are all alike, at most
_ROWS: Final = 40  # in the head of a file, by which it is known
_SIGNS: Final = (b",", b";", b"\t")  # between columns
_CHANNELS: Final = 16
_NUMBER: Final = re.compile(rb" ?[-+]?\d{1,15}(?:\.\d{0,20})?(?:[eE][-+]?\d{1,3})? ?")
_INTERVAL: Final = re.compile(rb"(?:sample interval|increment|\bdt\b|xincr?(?:ement)?)[^,;\t\n]*$", re.I)
_NUMBERS: Final = (b"x", b"n", b"no", b"no.", b"index", b"point", b"points", b"sample", b"samples", b"sequence")
_LONGEST: Final = 1e-3  # seconds between samples in which a serial line can be seen
_EVEN: Final = 0.1  # of a step, by which the steps of time may differ
_EXTREMES: Final = (0.002, 0.998)  # of the samples: what is beyond is ringing
_HYSTERESIS: Final = 0.125  # of the distance between low and high, to both sides of the middle
_BATCH: Final = 1 << 20


@dataclass(frozen=True, slots=True)
class _ScopeHead:
    """Where the rows begin and which columns hold numbers: the time, then the channels."""

    names: list[str]
    columns: tuple[int, ...]
    lines: int
    size: int  # bytes before the rows
    sign: bytes
    step: float  # seconds that one in the first column stands for; 0 where nothing tells

    def values(self, text: bytes) -> tuple[NDArray[np.float64], int]:
        """The rows of a text, a column each, and how many lines are none."""
        if self.sign != b",":
            text = text.replace(b",", b".").replace(self.sign, b",")
        try:
            return self._loaded(text), 0
        except ValueError:
            lines = [line.split(b",") for line in lines_of(text) if line.strip()]
            rows = [
                [float(cells[column]) for column in self.columns] for cells in lines if _numbers(cells, self.columns)
            ]
            return np.array(rows).reshape(-1, len(self.columns)), len(lines) - len(rows)

    def _loaded(self, text: bytes) -> NDArray[np.float64]:
        if not text.strip():
            return np.zeros((0, len(self.columns)))
        return np.loadtxt(io.BytesIO(text), delimiter=",", usecols=self.columns, comments=None, ndmin=2)


@dataclass(frozen=True, slots=True)
class _ScopeTable:
    path: Path
    names: list[str]
    levels: list[int]
    head: _ScopeHead
    low: NDArray[np.float64]  # of each channel: at or below it is low,
    high: NDArray[np.float64]  # at or above it is high
    begin_ns: int

    def pieces(self, note: Note) -> Iterator[EdgePiece]:
        before, newest = np.array(self.levels, np.int8), -TIME_LIMIT + 1
        for times, volts in _samples(self.path, self.head, note):
            times = np.maximum.accumulate(np.maximum(times, newest))
            newest = int(times[-1])
            level = np.where(volts >= self.high, 1, np.where(volts <= self.low, 0, -1)).astype(np.int8)
            level = np.concatenate((before[None, :], level))
            known = np.maximum.accumulate(np.where(level < 0, 0, np.arange(len(level))[:, None]), axis=0)
            level = np.take_along_axis(level, known, axis=0)
            flipped = level[1:] != level[:-1]
            before = level[-1]
            yield EdgePiece([times[flipped[:, channel]] for channel in range(len(self.names))], newest)


def _samples(path: Path, head: _ScopeHead, note: Note) -> Iterator[tuple[Times, NDArray[np.float64]]]:
    """Times and voltages of the rows, a batch at once; none without a row."""
    with opened(path) as file:
        for number, text in text_batches(file, note, _BATCH):
            first = number == 1
            values, wrong = head.values(text[head.size :] if first else text)
            if wrong:
                note(f"line {number}", f"{wrong:,} invalid rows: skipped")
            seconds = values[:, 0] * head.step
            usable = np.isfinite(values).all(axis=1) & (np.abs(seconds) < TIME_LIMIT / 1e9 - 1)
            if usable.any():
                yield np.rint(seconds[usable] * 1e9).astype(np.int64), values[usable, 1:]


def _numbers(cells: Sequence[bytes], columns: Sequence[int]) -> bool:
    return len(cells) > columns[-1] and all(_NUMBER.fullmatch(cells[column].strip()) for column in columns)


def _head(head: bytes) -> _ScopeHead | None:
    """The head of an oscilloscope's table; None of another table, such as one of values polled now and then."""
    for sign in _SIGNS:
        lines = head.split(b"\n", _HEAD + _ROWS)[: _HEAD + _ROWS]
        plain = [line if sign == b"," else line.replace(b",", b".").replace(sign, b",") for line in lines]
        rows = [line.strip(b"\r").split(b",") for line in plain[:-1]]  # the last line may be cut
        columns = _columns(rows[-_ROWS:])
        if len(columns) < 2 or len(rows) < _ROWS:
            continue
        first = len(rows) - _ROWS
        while first and _numbers(rows[first - 1], columns):
            first -= 1
        above = rows[:first]
        if _rises(rows[first:], columns[1]):
            columns = columns[1:]  # the first one numbers the rows
            if len(columns) < 2:
                continue
        step = _step([row[columns[0]] for row in rows[first:]], above, columns[0])
        if step is not None and any(b"." in row[column] for row in rows[first:] for column in columns[1:]):
            size = sum(len(line) + 1 for line in lines[:first])
            return _ScopeHead(_names(above, columns), columns, first, size, sign, step)
    return None


def _rises(rows: Sequence[Sequence[bytes]], column: int) -> bool:
    return bool((np.diff([float(row[column]) for row in rows]) > 0).all())


def _columns(rows: Sequence[Sequence[bytes]]) -> tuple[int, ...]:
    """The columns in which each of the rows has a number, the time and the channels behind it."""
    width = min(map(len, rows), default=0)
    numbers = [column for column in range(width) if all(_NUMBER.fullmatch(row[column]) for row in rows)]
    return tuple(numbers[: 1 + _CHANNELS])


def _step(cells: Sequence[bytes], above: Sequence[Sequence[bytes]], column: int) -> float | None:
    """Seconds that one in the column of times stands for, 0 where nothing tells; None where these are no samples."""
    times, numbered = [float(cell) for cell in cells], all(cell.strip().isdigit() for cell in cells)
    steps = np.diff(times)
    step = float(np.median(steps))
    digits = np.spacing(max(map(abs, times))) + 0.01 * step
    if step <= 0 or (np.abs(steps - step) > _EVEN * step + digits).any():
        return None
    if numbered and step == 1:
        said = [_interval(row, below) for row, below in zip(above, [*above[1:], ()], strict=True)]
        titled = any(row[column].strip().lower() in _NUMBERS for row in above if len(row) > column)
        return next((one for one in said if 0 < one <= _LONGEST), 0.0 if titled else None)
    titles = [unit_of(row[column].decode("utf-8", "replace")) for row in above if len(row) > column]
    unit = next((one for one in titles if one), 10**9)
    return unit / 1e9 if step * unit / 1e9 <= _LONGEST else None


def _interval(row: Sequence[bytes], below: Sequence[bytes]) -> float:
    """The time between samples that a row says behind, or below, its title; 0 for none."""
    for place, cell in enumerate(row):
        if _INTERVAL.search(cell.strip()):
            for beside in (row[place + 1 : place + 2], below[place : place + 1]):
                if beside and _NUMBER.fullmatch(beside[0].strip()):
                    return float(beside[0])
    return 0.0


def _names(above: Sequence[Sequence[bytes]], columns: Sequence[int]) -> list[str]:
    """The channels' names: the first words above their columns."""
    names = []
    for number, column in enumerate(columns[1:], 1):
        words = (
            " ".join(row[column].decode("utf-8", "replace").strip(' "').split()) for row in above if len(row) > column
        )
        names.append(next((word for word in words if re.search(r"[^\W\d_]", word)), f"channel {number}"))
    return names if len(set(names)) == len(names) else [f"{name} ({i})" for i, name in enumerate(names, 1)]


def _sniff(head: bytes) -> float:
    return 0.93 if _head(head) is not None else 0.0


def _load(path: Path, sample_rate: float | None) -> _ScopeTable:
    head = _head(read_head(path))
    if head is None:
        raise CaptureError(f"{path}: not an oscilloscope table: expected rows of an evenly rising time and voltages")
    if head.step == 0 and not sample_rate:
        raise CaptureError(f"{path}: numbered samples without a sample rate: give it with --sample-rate")
    if head.step == 0 and sample_rate:
        head = _ScopeHead(head.names, head.columns, head.lines, head.size, head.sign, 1 / sample_rate)
    bounds, begin, first = [], 0, None
    for times, volts in _samples(path, head, lambda *_: None):
        bounds.append(np.quantile(volts, _EXTREMES, axis=0))
        if first is None:
            begin, first = int(times[0]), volts[0]
    if first is None:
        raise CaptureError(f"{path}: no row of this table can be read")
    least, most = np.min([low for low, _ in bounds], axis=0), np.max([high for _, high in bounds], axis=0)
    middle, apart = (least + most) / 2, _HYSTERESIS * (most - least)
    levels = (first >= middle).astype(int).tolist()
    return _ScopeTable(path, head.names, levels, head, middle - apart, middle + apart, begin)


FORMAT = Format("scope-table", (".csv",), _sniff, edge_reader(_load))
