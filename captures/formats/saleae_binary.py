"""Saleae Logic 2's binary export of a digital channel, `.bin` that begins with `<SALEAE>`: the times of its edges.

Version 0 holds one stretch, version 1 several with gaps between. A file is one channel.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Final

import numpy as np

from ..chunks import Note
from ..edges.source import EdgePiece, edge_reader
from ..errors import CaptureError
from ..files import opened
from ..limits import TIME_LIMIT
from . import Format

_MAGIC: Final = b"<SALEAE>"
_HEADER: Final = struct.Struct("<8sii")
_STRETCH: Final = {0: struct.Struct("<IddQ"), 1: struct.Struct("<IdddQ")}  # state, [rate,] begin, end, edges
_COUNT: Final = struct.Struct("<Q")
_PIECE: Final = 1 << 18  # edges at once
_LIMIT_S: Final = TIME_LIMIT / 1e9


@dataclass(frozen=True, slots=True)
class _DigitalExport:
    path: Path
    names: list[str]
    levels: list[int]
    version: int
    begin_ns: int = 0

    def pieces(self, note: Note) -> Iterator[EdgePiece]:
        level, newest = self.levels[0], -TIME_LIMIT + 1
        with opened(self.path) as file:
            file.seek(_HEADER.size)
            for state, begin, end, count in self._stretches(file, note):
                edges = np.zeros(0, np.int64)
                if state != level:  # it changed while nothing was captured
                    edges, level = np.array([begin]), state
                while count or len(edges):
                    data = file.read(8 * min(count, _PIECE))
                    seconds = np.frombuffer(data, "<f8", len(data) // 8)
                    count = count - len(seconds) if len(data) == 8 * min(count, _PIECE) else 0
                    usable = np.isfinite(seconds) & (np.abs(seconds) < _LIMIT_S)
                    if not usable.all():
                        note(self.path.name, f"{int((~usable).sum()):,} edges without a time: skipped")
                    measured = np.concatenate((edges, np.rint(seconds[usable] * 1e9).astype(np.int64)))
                    level ^= int(usable.sum()) & 1
                    edges = np.maximum.accumulate(np.maximum(measured, newest))
                    newest = int(edges[-1]) if len(edges) else newest
                    yield EdgePiece([edges], newest)
                    edges = np.zeros(0, np.int64)
                newest = max(newest, end)
                yield EdgePiece([edges], newest)

    def _stretches(self, file: BinaryIO, note: Note) -> Iterator[tuple[int, int, int, int]]:
        """First level, begin and end in ns, and number of edges of each stretch; the file stands before its edges."""
        total = 1
        if self.version == 1:
            data = file.read(_COUNT.size)
            total = _COUNT.unpack(data)[0] if len(data) == _COUNT.size else 0
        shape = _STRETCH[self.version]
        for _ in range(total):
            data = file.read(shape.size)
            if len(data) < shape.size:
                note(self.path.name, "cut short: the complete part was read")
                return
            state, *_, begin, end, count = shape.unpack(data)
            yield state & 1, _nanoseconds(begin), _nanoseconds(end), count


def _nanoseconds(seconds: float) -> int:
    return round(seconds * 1e9) if abs(seconds) < _LIMIT_S else 0


def _sniff(head: bytes) -> float:
    return 1.0 if head.startswith(_MAGIC) else 0.0


def _load(path: Path, _rate: float | None = None) -> _DigitalExport:
    with opened(path) as file:
        head = file.read(_HEADER.size)
        if len(head) < _HEADER.size or not head.startswith(_MAGIC):
            raise CaptureError(f"{path}: not a binary export of Saleae Logic 2")
        _, version, kind = _HEADER.unpack(head)
        if version not in _STRETCH:
            raise CaptureError(f"{path}: version {version} of Saleae's binary export is not supported, only 0 and 1")
        if kind != 0:
            raise CaptureError(f"{path}: an analog channel: export the digital channels, or the analyzer's table")
        export = _DigitalExport(path, [path.stem], [0], version)
        first = next(export._stretches(file, lambda *_: None), None)
    if first is None:
        raise CaptureError(f"{path}: cut short in its header: nothing can be read")
    return _DigitalExport(path, export.names, [first[0]], version, first[1])


FORMAT = Format("saleae-binary", (".bin",), _sniff, edge_reader(_load))
