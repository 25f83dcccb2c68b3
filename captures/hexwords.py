"""Pasted text to bytes: what people copy out of logs, dumps, source code and terminals.

Pure Python, no arrays: `rtuscope parse` starts with it. How bytes can look is in `captures.text.hexshapes`, how lines
look in `captures.text.loglines`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from captures.text.hexshapes import HexError as HexError
from captures.text.loglines import LineReader, Piece, Reading, joined


@dataclass(frozen=True, slots=True)
class Words:
    """Bytes found in a text.

    `mark` is the direction that the text gives: 0 none, 1 sent, 2 received. `t_ns` is its time in ns, None without one.
    `line` (from 1) and `text` are the line where the bytes begin. `ascii` says that they are an ASCII-mode frame, kept
    as its characters from `:` to CR LF.
    """

    data: bytes
    mark: int
    t_ns: int | None
    line: int
    text: str
    ascii: bool = False


def read_line(text: str) -> Words | None:
    """The bytes of one line, the longest run where there are several; None where it holds none.

    Raises HexError for digits that are meant as bytes but do not come in pairs.
    """
    reading = LineReader().read(text, 1)
    if not reading.pieces:
        _check(reading, 0)
        return None
    return _words(max(reading.pieces, key=lambda piece: len(piece.data)))


def read_text(text: str) -> list[Words]:
    """All bytes of a text, in order, an item for each run of bytes; lines of one dump are put together.

    Lines without bytes are passed over, as long as any line has some. Where no line has hex bytes, decimal ones are
    looked for. Raises HexError where there are none either, or where digits that are meant as bytes do not come in
    pairs.
    """
    lines = text.splitlines()

    def pieces(reader: LineReader) -> Iterator[Piece]:
        for number, line in enumerate(lines, 1):
            reading = reader.read(line, number)
            if not reading.pieces:
                _check(reading, number if len(lines) > 1 else 0)
            yield from reading.pieces

    found = [_words(piece) for piece in joined(pieces(LineReader()))]
    found = found or [_words(piece) for piece in joined(pieces(LineReader(decimal=True)))]
    if not found:
        shown = " ".join(text.split())
        raise HexError(f"no hex bytes found in {shown[:60]!r}" if shown else "no hex bytes: the text is empty")
    return found


def _check(reading: Reading, line: int) -> None:
    if reading.halved:
        raise HexError(f"line {line}: {reading.problem}" if line else reading.problem)


def _words(piece: Piece) -> Words:
    return Words(piece.data, piece.mark, piece.t_ns, piece.line, piece.text, piece.ascii)
