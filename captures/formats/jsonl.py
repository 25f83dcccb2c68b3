"""serial-chunks version 1, `.jsonl`: a header line, then one read a line.

    {"format": "serial-chunks", "version": 1, "baud": 19200, "char_bits": 11}
    {"t_ns": 1234567890, "hex": "1103006b"}

Other keys of the header are line settings or notes; `"timed": false` (or the tap "untimed") says that the times mean
nothing. Optional keys of a read: `port` (0 to 255), `errors` (offsets in it), `mark` ("tx" or "rx", a log's word for
its direction). A line that can't be used is noted with its number and left out.

Lines are taken a batch at a time: those of the plain layout above as arrays, without parsing any as JSON, others by
one JSON parse and one hex conversion for the whole batch. Only a batch that is not perfect is read line by line, to
find out which line is at fault. A line of the plain layout has six double quotes and no more, so that their places
tell where the number and the digits are; all that stands between is compared. What does not fit in any way (other
keys, an escape, an odd digit, a line cut short, a time that is not a plain number) is for the real parser: then
nothing is given, and never anything that JSON would not say.
"""

from __future__ import annotations

import codecs
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, Final

import numpy as np
import orjson

from ..chunks import Block, Chunk, Mark, Note, columns
from ..errors import CaptureError
from ..files import first_line, lines_of, opened, read_head, text_batches
from ..limits import TIME_LIMIT
from ..line import LineSettings
from ..ragged import Bytes, Ints, copy_pieces, sums, windows
from . import Format

_QUOTES: Final = 6  # in a line
_TIME_DIGITS: Final = 18  # of a time that needs no look at its range
_POWERS: Final = 10 ** np.arange(_TIME_DIGITS - 1, -1, -1, dtype=np.int64)


@dataclass(frozen=True, slots=True)
class _Layout:
    """What stands before the time, between time and digits, and after them."""

    before: bytes
    between: bytes
    after: bytes = b'"}\n'


_LAYOUTS: Final = (_Layout(b'{"t_ns": ', b', "hex": "'), _Layout(b'{"t_ns":', b',"hex":"'))


def reads_in(text: bytes) -> tuple[Ints, Ints, bytes] | None:
    """Times, sizes and bytes of the reads in whole lines; None where any line is not of the one layout.

    At least one byte a read; times are 0 to 10^18 - 1.
    """
    layout = next((layout for layout in _LAYOUTS if text.startswith(layout.before)), None)
    if layout is None or not text.endswith(layout.after):
        return None
    data = np.frombuffer(text, np.uint8)
    quotes = np.flatnonzero(data == ord('"'))
    if len(quotes) % _QUOTES:
        return None
    first, last = quotes[4::_QUOTES] + 1, quotes[5::_QUOTES]  # the digits
    ends = last + len(layout.after)
    starts = np.concatenate(([0], ends[:-1]))
    times, between = starts + len(layout.before), first - len(layout.between)
    widths, lengths = between - times, last - first
    if ends[-1] != len(data) or widths.min() < 1 or widths.max() > _TIME_DIGITS or lengths.min() < 2:
        return None
    if (lengths & 1).any():
        return None
    for at, words in ((starts, layout.before), (between, layout.between), (last, layout.after)):
        if not _all_are(data, at, words):
            return None
    t_ns, content = _numbers(data, times, widths), _from_hex(data, first, lengths)
    return None if t_ns is None or content is None else (t_ns, lengths >> 1, content)


def _all_are(data: Bytes, at: Ints, words: bytes) -> bool:
    heads = windows(data, len(words))[at]
    return bool((heads == np.frombuffer(words, f"V{len(words)}")).all())


def _numbers(data: Bytes, at: Ints, widths: Ints) -> Ints | None:
    """Plain numbers as JSON writes them: digits, the first not 0 unless it is alone."""
    numbers = np.zeros(len(at), np.int64)
    for width in np.flatnonzero(np.bincount(widths)).tolist():
        which = np.flatnonzero(widths == width)
        digits = windows(data, width)[at[which]].view(np.uint8).reshape(-1, width) - np.uint8(ord("0"))
        if digits.max() > 9 or (width > 1 and not digits[:, 0].all()):
            return None
        numbers[which] = digits @ _POWERS[-width:]
    return numbers


def _from_hex(data: Bytes, at: Ints, lengths: Ints) -> bytes | None:
    """The bytes that hex digits stand for, end to end; None where there is anything but digits."""
    begins = sums(lengths)
    digits = np.empty(int(begins[-1]), np.uint8)
    copy_pieces(digits, begins[:-1], data, at, lengths)
    try:
        octets = bytes.fromhex(digits.tobytes().decode("ascii"))
    except ValueError:
        return None
    return octets if 2 * len(octets) == len(digits) else None  # spaces would be skipped


NAME = "serial-chunks"
VERSION = 1
_MARKS = {"tx": Mark.TX, "rx": Mark.RX}
_MARK_NAMES = {mark: name for name, mark in _MARKS.items()}
_HEADER_LOOK = 4096  # bytes of a first line that is no header that are worth parsing


@dataclass(frozen=True, slots=True)
class _JsonlReader:
    path: Path
    line: LineSettings
    timed: bool
    has_header: bool
    complaints: tuple[str, ...]

    def blocks(self, max_bytes: int, note: Note) -> Iterator[Block]:
        for complaint in self.complaints:
            note("line 1", complaint)
        with opened(self.path) as file:
            skip = self.has_header
            for number, text in text_batches(file, note, 2 * max_bytes):
                if skip:
                    number, text, skip = number + 1, text.partition(b"\n")[2], False
                if not text:
                    continue
                if (reads := reads_in(text)) is not None:
                    times, sizes, data = reads
                    yield columns(data, sizes, times, timed=self.timed)
                    continue
                lines = lines_of(text)
                block = _fast(lines, self.timed)
                yield block if block is not None else _slow(lines, number, self.timed, note)


def _read(path: Path) -> _JsonlReader:
    head = read_head(path)
    if head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        raise CaptureError(f"{path}: UTF-16, as PowerShell's > writes it: save it as UTF-8, or write it with -o FILE")
    first = first_line(path, head)
    try:
        header = orjson.loads(_without_bom(first))
    except orjson.JSONDecodeError as error:
        # A first line cut or damaged: go on without settings where reads follow.
        if any(_usable(line) for line in head.split(b"\n")[1:20]):
            complaint = "the header is damaged: baud rate and character length are not known"
            return _JsonlReader(path, LineSettings(), True, True, (complaint,))
        raise CaptureError(f"{path}: line 1: not JSON ({error}): a {NAME} capture starts with its header") from error
    if not isinstance(header, dict):
        raise CaptureError(f"{path}: line 1: not a JSON object: a {NAME} capture starts with its header")
    if header.get("format") != NAME:
        if _usable(first):
            complaint = "no header: baud rate and character length are not known"
            return _JsonlReader(path, LineSettings(), True, False, (complaint,))
        raise CaptureError(f"{path}: line 1: {_what_else(header)}")
    if header.get("version") != VERSION:
        raise CaptureError(
            f"{path}: line 1: {NAME} version {str(header.get('version'))[:20]!r} is not supported, only version "
            f"{VERSION} (a newer rtuscope may read it)"
        )
    timed = header.get("timed") is not False and header.get("tap") != "untimed"
    settings = {key: value for key, value in header.items() if key not in ("format", "version", "timed")}
    line, complaints = LineSettings.from_header(settings)
    return _JsonlReader(path, line, timed, True, tuple(complaints))


def _sniff(head: bytes) -> float:
    first, _, others = head.partition(b"\n")
    if not _without_bom(first).startswith(b"{"):
        return 0.0
    if NAME.encode() in first or _exported(first):
        return 1.0
    return 0.95 if any(_usable(line) for line in [first, *others.split(b"\n", 20)]) else 0.0


def _usable(line: bytes) -> bool:
    """Whether this line is a read, or was one before the head of the file ended inside it."""
    line = line[:_HEADER_LOOK]
    return line.startswith(b"{") and b'"t_ns"' in line and b'"hex"' in line


def _exported(line: bytes) -> bool:
    """Whether this line is one of this tool's own exports, which `read` refuses with what to do instead."""
    line = line[:_HEADER_LOOK]
    return b'"unit"' in line and (b'"crc_ok"' in line or (b'"area"' in line and b'"confidence"' in line))


def _without_bom(line: bytes) -> bytes:
    return line.removeprefix(b"\xef\xbb\xbf")


def _what_else(header: dict[str, Any]) -> str:
    if _exported(orjson.dumps(header)):
        return "these are frames or registers, exported from a capture, not a capture: open the capture itself"
    if "format" in header:
        return f"format {str(header['format'])[:40]!r} is not {NAME!r}"
    return f'no capture: it lacks the header {{"format": "{NAME}", "version": {VERSION}, ...}}'


def _fast(lines: list[bytes], timed: bool) -> Block | None:
    """All of a batch at once; None where anything in it is out of the ordinary."""
    try:
        rows = orjson.loads(b"[" + b",".join(lines) + b"]")
        if len(rows) != len(lines):
            return None
        times = [row["t_ns"] for row in rows]
        texts = [row["hex"] for row in rows]
        joined = "".join(texts)
        data = bytes.fromhex(joined)
        if set(map(type, times)) != {int} or 2 * len(data) != len(joined):
            return None
        digits = np.fromiter(map(len, texts), dtype=np.int64, count=len(texts))
        t_ns = np.array(times, dtype=np.int64)
    except (ValueError, TypeError, KeyError, IndexError, OverflowError):
        return None
    if (digits & 1).any() or not digits.all() or t_ns.min() <= -TIME_LIMIT or t_ns.max() >= TIME_LIMIT:
        return None
    extras = {}
    if any(len(row) > 2 for row in rows):
        try:
            extras = _extras(rows, digits >> 1)
        except ValueError:
            return None
    return columns(data, digits >> 1, t_ns, timed=timed, extras=extras)


def _extras(rows: list[dict[str, Any]], sizes: np.ndarray[Any, np.dtype[np.int64]]) -> dict[str, Any]:
    starts = np.cumsum(sizes) - sizes
    port = np.zeros(len(rows), dtype=np.uint8)
    mark = np.zeros(len(rows), dtype=np.uint8)
    errors: list[int] = []
    for i, row in enumerate(rows):
        if len(row) > 2:
            port[i], mark[i], wrong = _options(row, int(sizes[i]))
            errors.extend(int(starts[i]) + offset for offset in wrong)
    return {"port": port, "mark": mark, "errors": np.array(errors, dtype=np.int64)}


def _options(row: dict[str, Any], size: int) -> tuple[int, Mark, list[int]]:
    """Port, mark and sorted error offsets of a read; ValueError says what is wrong with them."""
    port, mark, errors = row.get("port", 0), row.get("mark"), row.get("errors") or []
    if type(port) is not int or not 0 <= port <= 255:
        raise ValueError(f"port {_excerpt(port)} is not a number from 0 to 255")
    if mark is not None and (not isinstance(mark, str) or mark not in _MARKS):
        raise ValueError(f'mark {_excerpt(mark)} is neither "tx" nor "rx"')
    if not isinstance(errors, list) or any(type(error) is not int or not 0 <= error < size for error in errors):
        raise ValueError(f"errors {_excerpt(errors)} are not offsets in a read of {size} bytes")
    return port, _MARKS[mark] if mark else Mark.NONE, sorted(set(errors))


def _slow(lines: list[bytes], number: int, timed: bool, note: Note) -> Block:
    """A batch line by line, with a note for each line that can't be used."""
    chunks: list[Chunk] = []
    for i, line in enumerate(lines, number):
        if not line.strip():
            continue
        try:
            chunks.append(_chunk(line))
        except ValueError as error:
            note(f"line {i}", f"{error}: skipped")
    return Block.from_chunks(chunks, timed=timed)


def _chunk(line: bytes) -> Chunk:
    try:
        row = orjson.loads(line)
    except orjson.JSONDecodeError as error:
        cut = line.startswith(b"{") and not line.rstrip().endswith(b"}")
        raise ValueError("cut short" if cut else f"not JSON ({error})") from error
    if not isinstance(row, dict) or "t_ns" not in row or "hex" not in row:
        raise ValueError('not a read: "t_ns" and "hex" are needed')
    t_ns, text = row["t_ns"], row["hex"]
    if type(t_ns) is not int or not -TIME_LIMIT < t_ns < TIME_LIMIT:
        raise ValueError(f"t_ns {_excerpt(t_ns)} is not a time in whole nanoseconds")
    if not isinstance(text, str):
        raise ValueError(f"hex {_excerpt(text)} is not text")
    try:
        data = bytes.fromhex(text)
    except ValueError:
        odd = "an odd number of" if len(text) % 2 else "not all"
        raise ValueError(f"hex {_excerpt(text)} has {odd} hex digits") from None
    port, mark, errors = _options(row, len(data))
    return Chunk(t_ns, data, port, mark, tuple(errors))


def _excerpt(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 40 else text[:37] + "..."


def _write(file: BinaryIO, line: LineSettings, blocks: Iterable[Block], timed: bool) -> None:
    header: dict[str, object] = {"format": NAME, "version": VERSION}
    if not timed:
        header["timed"] = False
    header = {**header, **line.to_header(), **header}  # these keys first, and never a note's
    file.write(orjson.dumps(header) + b"\n")
    for block in blocks:
        file.write(_lines(block).encode())


def _lines(block: Block) -> str:
    if not (block.port.any() or block.mark.any() or len(block.errors)):
        digits = block.data.tobytes().hex()
        ends = (2 * block.offsets).tolist()
        reads = zip(block.t_ns.tolist(), ends, ends[1:], strict=False)
        return "".join(f'{{"t_ns": {t}, "hex": "{digits[a:b]}"}}\n' for t, a, b in reads)
    lines = []
    for i in range(len(block)):
        chunk = block.chunk(i)
        row: dict[str, object] = {"t_ns": chunk.t_ns, "hex": chunk.data.hex()}
        if chunk.port:
            row["port"] = chunk.port
        if chunk.mark:
            row["mark"] = _MARK_NAMES[chunk.mark]
        if chunk.errors:
            row["errors"] = list(chunk.errors)
        lines.append(orjson.dumps(row).decode() + "\n")
    return "".join(lines)


FORMAT = Format(NAME, (".jsonl", ".ndjson"), _sniff, _read, _write)
