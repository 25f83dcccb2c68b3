"""Tables of a Saleae analyzer, `.csv` and `.txt`: Logic 2's data table and Logic 1's export, a byte a row.

    name,type,start_time,duration,data,error          "Async Serial","data",0.0006025,2.375e-05,0xC8
    Time [s],Value,Parity Error,Framing Error         0.000602500000000,0xC8,,

The columns are found by their names in the first line. Values may be hexadecimal, binary, decimal or characters, as the
table's radix was set: characters where any of the first rows is one. Other tools write hexadecimal and binary without
`0x` and `0b`, which the first rows together tell. Times are seconds or ISO 8601. Analyzers (the
channels of a data table) become ports in the order of their first byte.

A byte's time is its start plus one character: by the settings given, else by the durations (which the analyzer counts
to the middle of the stop bit) or the spacing of the first bytes, which tell the baud rate.
"""

from __future__ import annotations

import csv
import re
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from captures.text import stamps

from ..chunks import Block, Chunk, Note
from ..errors import CaptureError
from ..files import HEAD_BYTES, line_batches, opened, read_head
from ..limits import TIME_LIMIT
from ..line import LineSettings
from ..spacing import INFERRED, RATES, character_ns, fitting
from . import Format

_NAMES: Final = {
    "time": ("start_time", "time [s]", "time[s]", "start"),
    "duration": ("duration",),
    "data": ("data", "value", "decoded protocol result"),
    "type": ("type",),
    "name": ("name", "analyzer name"),
    "error": ("error", "parity error", "framing error"),
}
_MISSING: Final = ("", "false", "no", "0", "null", "none")
_ANOTHER: Final = re.compile(r"_ns\b|channel \d+", re.I)  # in the first line of other tables
_HEX: Final = re.compile(r"0x([0-9A-Fa-f]{1,8})\b")
_SEVERAL: Final = re.compile(  # bytes, not one word of some bits
    r"\s*(?!0b|[01]{8}\s*$|0x[0-9A-Fa-f]{1,8}\s*$)(?:0[xX])?[0-9A-Fa-f]{2}(?:[ :-]?[0-9A-Fa-f]{2}){2,}\s*"
)
_LOOK: Final = 8  # lines
_BINARY: Final = re.compile(r"0b([01 ]{1,40})")
_OCTET: Final = re.compile(r"[0-9A-F]{1,2}")
_PLAINLY_HEX: Final = re.compile(r"0[0-9A-F]|[1-9][A-F]|[A-F][0-9A-F]")  # neither a number nor one character
_BITS: Final = re.compile(r"[01]{8}")
_ESCAPES: Final = {
    "\\0": 0, "\\a": 7, "\\b": 8, "\\t": 9, "\\n": 10, "\\v": 11, "\\f": 12, "\\r": 13, "\\\\": 92, "comma": 44,
    "space": 32, "tab": 9, "cr": 13, "lf": 10, "\\'": 39, '\\"': 34,
}  # fmt: skip
_ESCAPED: Final = re.compile(r"\\x([0-9A-Fa-f]{1,2})")
_DURATIONS: Final = ((9.5, 10), (10.5, 11), (10, 10), (11, 11))  # bits that a duration covers, of so many
_OFF: Final = 0.012  # of a duration


@dataclass(frozen=True, slots=True)
class _SaleaeReader:
    path: Path
    line: LineSettings
    columns: Mapping[str, tuple[int, ...]]
    read_value: Callable[[str], int]
    delimiter: str
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
                        chunk = self._chunk(_split_row(line, self.delimiter), ports)
                    except ValueError as error:
                        note(f"line {i}", f"{error}: skipped")
                    else:
                        chunks.extend([chunk] if chunk is not None else [])
                yield Block.from_chunks(chunks)

    def _chunk(self, cells: Sequence[str], ports: dict[str, int]) -> Chunk | None:
        """The byte of a row; None for a row of another type; ValueError for one that can't be read."""
        values = _values(cells, self.columns)
        if not _holds_byte(values):
            return None
        if not values["time"] or not values["data"]:
            raise ValueError("columns are missing")
        start, duration = _time(values["time"][0]), _duration(values["duration"])
        character = 0 if self.line.baud is None else round((self.line.char_bits or 10) * 1e9 / self.line.baud)
        t_ns = start + (character or duration)
        if not -TIME_LIMIT < t_ns < TIME_LIMIT:
            raise ValueError("its time is out of range")
        name = values["name"][0] if values["name"] else ""
        octet = self.read_value(values["data"][0])
        if not 0 <= octet <= 255:
            raise ValueError(f"{values['data'][0][:40]!r} is more than a byte")
        port = ports.setdefault(name, min(len(ports), 255))
        wrong = any(cell.strip().lower() not in _MISSING for cell in values["error"])
        return Chunk(t_ns, bytes((octet,)), port, errors=(0,) if wrong else ())


def _values(cells: Sequence[str], columns: Mapping[str, tuple[int, ...]]) -> dict[str, list[str]]:
    return {key: [cells[i] for i in where if i < len(cells)] for key, where in columns.items()}


def _split_row(line: bytes, delimiter: str) -> list[str]:
    try:
        text = line.decode("utf-8", "replace").strip("\r\n\ufeff")
        return next(csv.reader([text], delimiter=delimiter), [])
    except csv.Error as error:
        raise ValueError(f"not a row of a table ({error})") from error


def _header(head: bytes) -> tuple[dict[str, tuple[int, ...]], str] | None:
    """Where the columns stand in a table that begins like this, and what parts them."""
    first = head.split(b"\n", 1)[0]
    for delimiter in (",", ";", "\t"):
        try:
            names = [cell.strip().lower() for cell in _split_row(first, delimiter)]
        except ValueError:
            continue
        columns = {key: tuple(i for i, name in enumerate(names) if name in titles) for key, titles in _NAMES.items()}
        if columns["time"] and columns["data"] and not _ANOTHER.search(first.decode("utf-8", "replace")):
            return columns, delimiter
    return None


def _decimal(text: str) -> float:
    """A number, with a decimal comma where spreadsheets write one."""
    return float(text.replace(",", "."))


def _time(text: str) -> int:
    try:
        return round(_decimal(text) * 1e9)
    except (ValueError, OverflowError):
        stamp, _ = stamps.find(text)
        if stamp is None:
            raise ValueError(f"{text[:40]!r} is not a time") from None
        return stamp.t_ns


def _duration(cells: Sequence[str]) -> int:
    try:
        return max(0, min(round(_decimal(cells[0]) * 1e9), TIME_LIMIT)) if cells else 0
    except (ValueError, OverflowError):
        return 0


def _holds_byte(values: Mapping[str, Sequence[str]]) -> bool:
    """Whether a row has a byte: none is one of another type, none the titles once more."""
    titles = [cell.strip().lower() in names for key, names in _NAMES.items() for cell in values[key]]
    return values["type"][:1] in ([], ["data"], ["Data"], ["address"]) and not all(titles)


def _bare(text: str) -> str:
    """A value without its quotes."""
    bare = text.strip()
    return bare[1:-1] if len(bare) > 2 and bare[0] == bare[-1] == "'" else bare


def _number(text: str) -> int:
    bare = _bare(text)
    if match := _HEX.search(bare):
        return int(match[1], 16)
    if match := _BINARY.fullmatch(bare):
        return int(match[1].replace(" ", "") or "0", 2)
    try:
        return int(bare)
    except ValueError:
        raise ValueError(f"{text[:40]!r} is not a byte: export the table with hexadecimal values") from None


def _number_or_character(text: str) -> int:
    bare = _bare(text)
    return _character(bare if bare else " ") if _is_character(text) or bare.isdecimal() else _number(text)


def _digits(base: int) -> Callable[[str], int]:
    def value(text: str) -> int:
        try:
            return int(_bare(text), base)
        except ValueError:
            raise ValueError(f"{text[:40]!r} is not a byte as those above") from None

    return value


def _reader_of(values: Sequence[str]) -> Callable[[str], int]:
    """How values like these are read."""
    bare = [_bare(value).upper() for value in values if value.strip()]
    if bare and all(map(_OCTET.fullmatch, bare)) and any(map(_PLAINLY_HEX.fullmatch, bare)):
        return _digits(16)
    if bare and all(map(_BITS.fullmatch, bare)):
        return _digits(2)
    return _number_or_character if any(map(_is_character, filter(None, values))) else _number


def _character(text: str) -> int:
    if len(text) == 1 and ord(text) < 256:
        return ord(text)
    if (value := _ESCAPES.get(text.lower())) is not None:
        return value
    if (match := _ESCAPED.fullmatch(text)) is not None:
        return int(match[1], 16)
    if text.isdecimal() and len(text) <= 3:  # a character that cannot be shown, by its number
        return int(text)
    raise ValueError(f"{text[:40]!r} is not a character: export the table with hexadecimal values")


def _is_character(text: str) -> bool:
    """Whether a value can only be a character."""
    bare = _bare(text)
    return not bare.isdecimal() and not _HEX.search(bare) and not _BINARY.fullmatch(bare)


def _sniff(head: bytes) -> float:
    header = _header(head)
    if header is None:
        return 0.0
    columns, delimiter = header
    for line in head.split(b"\n")[1:_LOOK]:  # of another tool, a frame a row
        try:
            cells = _values(_split_row(line, delimiter), columns)["data"]
        except ValueError:
            continue
        if any(map(_SEVERAL.fullmatch, cells)):
            return 0.0
    return 0.95


def _read(
    path: Path,
    *,
    baud: int | None = None,
    parity: str | None = None,
    bits: int | None = None,
    stop: float | None = None,
) -> _SaleaeReader:
    head = read_head(path)
    header = _header(head)
    if header is None:
        raise CaptureError(f"{path}: line 1: no columns for time and data: expected those of a Saleae export")
    columns, delimiter = header
    rows = []
    for line in head.split(b"\n")[1 : -1 if len(head) >= HEAD_BYTES else None]:
        try:
            rows.append(_values(_split_row(line, delimiter), columns))
        except ValueError:
            continue
    rows = [row for row in rows if row["time"] and row["data"] and _holds_byte(row)]
    read_value = _reader_of([row["data"][0] for row in rows[:1000]])
    line_settings = LineSettings().with_settings(baud, parity, bits, stop)
    if baud is None:
        line_settings = _inferred(line_settings, rows)
    return _SaleaeReader(path, line_settings, columns, read_value, delimiter)


def _inferred(line: LineSettings, rows: Sequence[Mapping[str, Sequence[str]]]) -> LineSettings:
    """The settings that durations and spacing of the first bytes tell."""
    starts: dict[str, list[int]] = defaultdict(list)
    for row in rows:
        try:
            starts[row["name"][0] if row["name"] else ""].append(_time(row["time"][0]))
        except ValueError:
            continue
    durations = [duration for row in rows if (duration := _duration(row["duration"]))]
    fit, how = _by_duration(float(np.median(durations)) if durations else 0.0, line.char_bits), "durations"
    if fit is None:
        none = [np.zeros(0, np.int64)]
        times = [
            np.array([min(max(t, -TIME_LIMIT), TIME_LIMIT) for t in of_one], np.int64) for of_one in starts.values()
        ]
        steps = np.concatenate([*none, *map(np.diff, times)])
        fit, how = fitting(character_ns(steps), line.char_bits), "spacing"
    if fit is None:
        return line
    baud, bits = fit
    note = f"{baud} bit/s and {bits} bits a character are inferred from the {how} of bytes (--baud says otherwise)"
    return replace(line, baud=baud, char_bits=line.char_bits or bits, notes={INFERRED: note})


def _by_duration(duration: float, char_bits: int | None) -> tuple[int, int] | None:
    """Baud rate and bits of a character whose frame, as the analyzer draws it, is so long, ns."""
    near = [
        (abs(duration * rate / 1e9 / covered - 1), rate, bits)
        for rate in RATES
        for covered, bits in _DURATIONS
        if char_bits in (None, bits)
    ]
    best = min(near)[0]
    if best > _OFF:
        return None
    _, rate, bits = next(candidate for candidate in near if candidate[0] < best + _OFF / 4)
    return rate, bits


FORMAT = Format("saleae", (".csv",), _sniff, _read)
