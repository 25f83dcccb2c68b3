"""The column of times in a table whose first line names its columns, as decoders and gateways export it.

    NO.,TIME,DATA,ERR        0,-20.000ms,0xF7,
    No.  Time  Port  Data    1  12.345  1  01 03 00 6B
    Дата;Время [мс];Данные   46346.42744213;12,5;01

The unit stands in the cell, else in the name; a number with a fraction and no unit is in seconds. A date that is a
number counts days as spreadsheets do.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Final

from .stamps import TITLE_UNIT_NS, Stamp

_PARTED: Final = ("\t", ";", ",", "|")
_APART: Final = re.compile(r"\s{2,}")
_NAME: Final = re.compile(
    r"^(?:(?:start|begin|rel\w*|abs\w*|packet)[ _-]?)?"
    r"(?:time ?stamp|start|begin|time|zeit(?:stempel)?|время|temps|tiempo|tempo|czas|时间|時間)"
    r"(?:[ _,]*[\[(]?\s*(?P<unit>sec(?:onds)?|с|сек|мс|мкс|ms|us|µs|μs|ns|s)[\])]?)?$",
    re.IGNORECASE,
)
_UNIT_NAME: Final = re.compile(  # of a table's first column: `ms`, `t`, `elapsed [s]`
    r"^(?:t|elapsed|uptime|millis|micros)?"
    r"(?:[ _,]*[\[(]?\s*(?P<unit>sec(?:onds)?|с|сек|мс|мкс|ms|us|µs|μs|ns|s)[\])]?)?$",
    re.IGNORECASE,
)
_NO_NAMES: Final = ("", "s", "с")
_UNITS: Final = {"millis": 10**6, "micros": 10**3}
_DATE: Final = re.compile(r"^(?:date|datum|дата|date[ /_]?time|datetime|дата[ /,]?время)$", re.IGNORECASE)
_CELL: Final = re.compile(
    r"^[\"']?\s*(?P<sign>[-+−])?(?P<whole>\d{1,18})(?:[.,](?P<fraction>\d{1,18}))?(?:[eE](?P<power>[-+]?\d{1,2}))?"
    r"\s*(?P<unit>ms|us|µs|μs|ns|s|мс|мкс|с)?\s*[\"']?$"
)
_DAY_NS: Final = 86_400 * 10**9
_EPOCH: Final = 25_569  # 1970 in the days of spreadsheets
_DAYS: Final = range(20_000, 80_000)  # 1954 to 2119
_LEAST: Final = 2  # columns of a table
_MOST: Final = 64
_LONGEST: Final = 1024  # characters of a row


@dataclass(frozen=True, slots=True)
class TimeColumn:
    """Which of a table's columns is the time: `unit` in ns by its name (None: not named), `days` since 1900."""

    parted: str  # by this sign; by two blanks where empty
    number: int
    columns: int
    unit: int | None
    days: bool

    def find(self, text: str) -> tuple[Stamp, str] | None:
        """The time of a row, and the row with the cells up to it blanked by as many spaces; None of other lines."""
        cells = _cells(text, self.parted)
        if not self.number < len(cells) <= self.columns + 1:
            return None
        start, end = cells[self.number]
        t_ns = self._time(text[start:end])
        if t_ns is None:
            return None
        begin = cells[0][0] if all(text[a:b].strip(" \"'").isdigit() for a, b in cells[: self.number]) else start
        return Stamp(t_ns, of_day=False), text[:begin] + " " * (end - begin) + text[end:]

    def _time(self, cell: str) -> int | None:
        match = _CELL.match(cell)
        if match is None:
            return None
        whole, fraction = int(match["whole"]), match["fraction"] or ""
        unit = TITLE_UNIT_NS[match["unit"]] if match["unit"] else self.unit
        if self.days and not match["unit"]:
            if whole not in _DAYS or not fraction:
                return None
            whole, unit = whole - _EPOCH, _DAY_NS
        if unit is None:
            if not fraction and not match["power"]:
                return None  # of what unit, nobody says
            unit = 10**9
        scaled = int(f"{whole}{fraction}") * unit
        power = int(match["power"] or 0) - len(fraction)
        t_ns = scaled * int(10**power) if power >= 0 else scaled // int(10**-power)
        return -t_ns if match["sign"] in ("-", "−") else t_ns


def time_column(text: str) -> TimeColumn | None:
    """The column that a line names as the time, where it is the first line of a table."""
    if len(text) > _LONGEST or not any(char.isalpha() for char in text):
        return None
    for parted in (*_PARTED, ""):
        cells = _cells(text, parted)
        if not _LEAST <= len(cells) <= _MOST:
            continue
        names = [text[start:end].strip(" \"'\ufeff") for start, end in cells]
        for number, name in enumerate(names):
            if _DATE.match(name) is not None:
                return TimeColumn(parted, number, len(cells), None, days=True)
            match = _NAME.match(name) or (None if number or name in _NO_NAMES else _UNIT_NAME.match(name))
            if match is not None:
                unit = _UNITS.get(name.lower()) or TITLE_UNIT_NS.get((match["unit"] or "").lower())
                return TimeColumn(parted, number, len(cells), unit, days=False)
    return None


def _cells(text: str, parted: str) -> list[tuple[int, int]]:
    """Where the cells of a row begin and end."""
    if parted and parted not in text:
        return []
    cells, at = [], len(text) - len(text.lstrip()) if not parted else 0
    if parted:
        for cell in text.split(parted):
            cells.append((at, at + len(cell)))
            at += len(cell) + 1
        return cells
    for gap in _APART.finditer(text, at):
        cells.append((at, gap.start()))
        at = gap.end()
    return [*cells, (at, len(text))] if at < len(text) else cells
