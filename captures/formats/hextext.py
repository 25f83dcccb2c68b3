"""Hex text and serial logs: `.txt`, `.log`, `.hex` and whatever else people saved a terminal's output as.

Each read that a line shows becomes a chunk, with the time and the direction mark that the log gives it; what lines look
like is known in `captures.text`. A log whose first lines mostly lack times is taken as untimed. Speakers that a log
names (jpnevulator) become ports, in the order of their first word. A line that is neither bytes nor anything known is
noted with its number.
"""

from __future__ import annotations

import codecs
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import BinaryIO, cast

from captures.chunks import Block, Chunk, Mark, Note
from captures.errors import CaptureError
from captures.files import HEAD_BYTES, line_batches, opened, read_head
from captures.formats import Format
from captures.line import LineSettings
from captures.text import encodings
from captures.text.loglines import LineReader, Piece, joined

_LOOK_LINES = 400  # lines by which a log is judged
_JOIN_BYTES = 1 << 16  # a dump of any length comes in chunks of this size
_BLOCK_CHUNKS = 1 << 14


@dataclass(frozen=True, slots=True)
class _Reader:
    path: Path
    line: LineSettings
    timed: bool
    first_ns: int  # time for bytes before the first line with a time
    decimal: bool

    def blocks(self, max_bytes: int, note: Note) -> Iterator[Block]:
        with opened(self.path) as file:
            chunks = self._chunks(joined(_pieces(file, self.decimal, note), _JOIN_BYTES), note)
            while held := list(_up_to(chunks, max_bytes)):
                yield Block.from_chunks(held, timed=self.timed)

    def _chunks(self, pieces: Iterable[Piece], note: Note) -> Iterator[Chunk]:
        ports: dict[str, int] = {}
        t_ns = self.first_ns
        for piece in pieces:
            if piece.t_ns is not None:
                t_ns = piece.t_ns
            elif self.timed:
                note(f"line {piece.line}", "has no time: its bytes are given the time before")
            port = ports.setdefault(piece.label, min(len(ports), 255)) if piece.label else 0
            yield Chunk(t_ns, piece.data, port, Mark(piece.mark))


def _up_to(chunks: Iterator[Chunk], max_bytes: int) -> Iterator[Chunk]:
    size = 0
    for chunk in islice(chunks, _BLOCK_CHUNKS):
        yield chunk
        size += len(chunk.data)
        if size >= max_bytes:
            return


def _pieces(file: BinaryIO, decimal: bool, note: Note) -> Iterator[Piece]:
    reader = LineReader(decimal)
    codec = encodings.utf16(file.read(HEAD_BYTES))
    file.seek(0)
    if codec is not None:
        file = cast(BinaryIO, codecs.EncodedFile(file, "utf-8", codec, "replace"))
    for number, lines in line_batches(file, note, 1 << 16):
        for i, line in enumerate(lines, number):
            reading = reader.read(encodings.line_of(line).removeprefix("\ufeff"), i)
            if reading.problem is not None:
                note(f"line {i}", reading.problem)
            yield from reading.pieces


@dataclass(frozen=True, slots=True)
class _Look:
    """What the head of a file promises."""

    lines: int = 0  # that say anything; a tool's own lines without bytes do not count
    with_bytes: int = 0
    times: tuple[int, ...] = ()
    problem: tuple[str, int] | None = None
    decimal: bool = False


def _look(head: bytes) -> _Look:
    """What a file promises that begins like this; decimal numbers are bytes only where there is no hex."""
    if encodings.is_binary(head):
        return _Look()
    look = _looked(head, decimal=False)
    if look.with_bytes:
        return look
    decimal = _looked(head, decimal=True)
    return decimal if decimal.with_bytes else look


def _looked(head: bytes, *, decimal: bool) -> _Look:
    lines = encodings.decoded(head).split("\n")
    if len(head) >= HEAD_BYTES and len(lines) > 1:
        lines.pop()  # cut by the end of the head
    reader, seen, with_bytes, problem = LineReader(decimal), 0, 0, None
    times: list[int] = []
    for number, line in enumerate(lines[:_LOOK_LINES], 1):
        reading = reader.read(line, number)
        seen += bool(reading.pieces or reading.problem)
        if reading.pieces:
            with_bytes += 1
            times.extend(piece.t_ns for piece in reading.pieces[:1] if piece.t_ns is not None)
        elif reading.problem and problem is None:
            problem = (reading.problem, number)
    return _Look(seen, with_bytes, tuple(times), problem, decimal)


def _sniff(head: bytes) -> float:
    look = _look(head)
    share = look.with_bytes / look.lines if look.lines else 0.0
    return 0.4 + 0.4 * share if share >= 0.2 else 0.0


def _read(path: Path) -> _Reader:
    head = read_head(path)
    look = _look(head)
    if not look.with_bytes:
        if encodings.is_binary(head):
            raise CaptureError(f"{path}: not text: name it .bin if it is the raw bytes of a line")
        if look.problem is None:
            raise CaptureError(f"{path}: no hex bytes found: the file holds only empty lines and comments")
        what, number = look.problem
        raise CaptureError(f"{path}: no hex bytes found, first at line {number}: {what}")
    timed = 2 * len(look.times) > look.with_bytes
    return _Reader(path, LineSettings(), timed, look.times[0] if timed else 0, look.decimal)


FORMAT = Format("text", (".txt", ".log", ".hex", ".asc", ".out", ".csv"), _sniff, _read)
