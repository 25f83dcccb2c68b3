"""What lines say of other lines: words of the rows below them, a column's name of its times, the order of times.

    NO.,TIME,DATA,ERR        0,-20.000ms,0xF7,
    No.  Time  Port  Data    1  12.345  1  01 03 00 6B
    Дата;Время [мс];Данные   46346.42744213;12,5;01

The unit of a column stands in the cell, else in the name; a number with a fraction and no unit is in seconds. A date
that is a number counts days as spreadsheets do.

Fractions of seconds without their leading zeros, `12:00:01.5` five milliseconds after `12:00:01`: loggers that print
seconds and milliseconds as two numbers write so. Read as decimals they run back within a second, read as counts they
never do. Steps, `[+0.031]`: as times since some start they would run back. Numbers before a mark, `1023: TX 01 03`:
milliseconds where they rise, and not from line to line by one. Days, `46351.423611842`, as spreadsheets count them from
1900 on, or from midnight: as seconds they would follow one another sooner than a line's bytes do.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final, NamedTuple

from .stamps import DAY_NS
from .timeforms import SECOND_NS, UNIT_NS, Stamp
from .tools import NONE, LineMark

FULL_ROW: Final = 8  # bytes of a row after which a read may go on in the next
_PARTED: Final = ("\t", ";", ",", "|")  # signs between the cells of a table


class Heading(NamedTuple):
    """What a line says of the rows of bytes below it."""

    mark: int
    t_ns: int | None
    fine: bool
    label: str
    port: str = ""
    left: int | None = None  # bytes still to come, where it says how many there are
    joins: bool = False  # all rows below it are one read
    exact: bool = False  # nothing else stands below it before all bytes are there
    rows: int = 0  # that it has had
    width: int = 0  # bytes of the row before
    parted: str = ""  # the sign between the cells of a table
    cells: tuple[int, ...] = ()  # the mark that each cell of its first line has

    def takes(self, size: int) -> bool:
        """Whether a row of so many bytes may go on with the read of the one before."""
        return self.joins or FULL_ROW <= self.width >= size

    def above(self, size: int) -> Heading:
        """It above one row more, of so many bytes."""
        left = None if self.left is None else self.left - size
        return self._replace(rows=self.rows + 1, width=size, left=left)

    def mark_at(self, text: str, start: int) -> int:
        """The mark of what stands at a place of a row."""
        if not self.parted:
            return self.mark
        cell = text.count(self.parted, 0, start)
        return self.cells[cell] if cell < len(self.cells) else NONE


def marks_of_cells(text: str, line_marks: list[LineMark]) -> tuple[str, tuple[int, ...]]:
    """What parts the cells of a table's first line, and the mark of each; none where both stand in one."""
    parted = next((sign for sign in _PARTED if sign in text), "")
    if not parted or len(line_marks) < 2:
        return "", ()
    cells: list[set[int]] = [set() for _ in range(text.count(parted) + 1)]
    for mark in line_marks:
        cells[text.count(parted, 0, mark.start)].add(mark.mark)
    return parted, tuple(cell.pop() if len(cell) == 1 else NONE for cell in cells)


_APART: Final = {sign: re.compile(re.escape(sign) or r"\s{2,}") for sign in (*_PARTED, "")}
_IN_UNIT: Final = (  # `[ms]`, `, мс`, `/us`, ` in seconds`
    rf"(?:[ _,/]*(?:in |в )?[\[(]?\s*(?P<unit>{'|'.join(sorted(UNIT_NS, key=len, reverse=True))})[\])]?)?"
)
_NAME: Final = re.compile(  # in a cell of its own
    r"(?:^|(?P<before>[\t;,|])|\s\s)[ \"'\ufeff]*(?:(?:start|begin|rel\w*|abs\w*|packet|о?т?метка|t)[ _-]?)?"
    r"(?P<name>time ?stamp|start|begin|time|(?:start|uhr)?zeit(?:stempel)?|врем(?:я|ени)|начало|temps|tiempo|tempo|"
    rf"czas|čas|час|时间|時間)(?: (?:since|from|от|с|seit) \w+)?{_IN_UNIT}[ \"']*"
    r"(?:$|(?(before)(?P=before)|(?:(?P<behind>[\t;,|])|\s\s)))",
    re.IGNORECASE,
)
_CELL: Final = re.compile(
    r"^[\"']?\s*(?P<sign>[-+−])?(?P<whole>\d{1,3}(?: \d{3})+|\d{1,18})(?:[.,](?P<fraction>\d{1,30}))?"
    r"(?:[eE](?P<power>[-+]?\d{1,2}))?"
    r"\s*(?P<unit>ms|us|µs|μs|ns|s|мс|мкс|с)?\s*[\"']?$"
)
_DATA: Final = re.compile(
    r"dat[aei]|daten|datos|byte|octet|hex|value|wert|valeur|данны|байт|знач|数据|數據|(?<!\w)[tr]x", re.IGNORECASE
)
_DAYS: Final = range(20_000, 80_000)  # of spreadsheets: 1954 to 2119
_1970: Final = 25_569  # in them
_LEAST: Final = 2  # columns of a table
_CELLS_MOST: Final = 64
_LONGEST: Final = 1024  # characters of a row


@dataclass(frozen=True, slots=True)
class TimeColumn:
    """Which of a table's columns is the time: `unit` in ns by its name (None: not named).

    `numbered`: no column before it is named as bytes are.
    """

    parted: str  # by this sign; by two blanks where empty
    number: int
    columns: int
    unit: int | None
    numbered: bool

    def find(self, text: str) -> tuple[Stamp, str] | None:
        """The time of a row, and the row with the cells up to it blanked by as many spaces; None of other lines."""
        cells = _cells(text, self.parted)
        if not self.number < len(cells) <= self.columns + 1:
            return None
        start, end = cells[self.number]
        if (cell := _CELL.match(text[start:end])) is None or (t_ns := self._time(cell)) is None:
            return None
        numbers = self.numbered and all(text[a:b].strip(" \"'").isdigit() for a, b in cells[: self.number])
        begin = cells[0][0] if numbers else start
        unnamed = self.unit is None and not cell["unit"]
        return Stamp(t_ns, of_day=False, unnamed=unnamed), text[:begin] + " " * (end - begin) + text[end:]

    def _time(self, match: re.Match[str]) -> int | None:
        whole, fraction = int(match["whole"].replace(" ", "")), match["fraction"] or ""
        unit = UNIT_NS[match["unit"]] if match["unit"] else self.unit
        if unit is None:
            if not fraction and not match["power"]:
                return None  # of what unit, nobody says
            unit = 10**9
        scaled = int(f"{whole}{fraction}") * unit
        power = int(match["power"] or 0) - len(fraction)
        t_ns = scaled * int(10 ** max(power, 0)) // int(10 ** max(-power, 0))
        return -t_ns if match["sign"] in ("-", "−") else t_ns


def time_column(text: str) -> TimeColumn | None:
    """The column that a line names as the time, where it is the first line of a table."""
    name = _NAME.search(text) if len(text) <= _LONGEST else None
    parted = "" if name is None else name["before"] or name["behind"] or ""
    cells = _cells(text, parted)
    if name is None or not _LEAST <= len(cells) <= _CELLS_MOST:
        return None
    before = [cell for cell in cells if cell[1] <= name.start("name")]
    numbered = not any(_DATA.search(text, *cell) for cell in before)
    return TimeColumn(parted, len(before), len(cells), UNIT_NS.get((name["unit"] or "").lower()), numbered)


def _cells(text: str, parted: str) -> list[tuple[int, int]]:
    """Where the cells of a row begin and end."""
    if parted not in text:
        return []
    begin, end = (0, len(text)) if parted else (len(text) - len(text.lstrip()), len(text.rstrip()))
    gaps = [match.span() for match in _APART[parted].finditer(text, begin, end)]
    return [*zip((begin, *(last for _, last in gaps)), (*(first for first, _ in gaps), end), strict=True)]


_LINES_NS: Final = 2_000_000  # of numbers of lines, or of two together, read as milliseconds
_FEWEST_STEPS: Final = 3  # that tell days from seconds
_SOONEST_NS: Final = 80_000  # of rows in seconds: a byte at 115200 bit/s takes longer
_SOONEST_BARE_NS: Final = 1_000  # where nothing else says that they are days
_NOTICES: Final = (  # of habits, one by one
    "fractions of a second are read as {} without leading zeros: as decimals they would run backwards",
    "times with a plus are read as steps from the one above: as absolute times they would run backwards",
    "times are read as days, as spreadsheets count them: as seconds they would be too close together",
    "",
    "numbers before line marks are read as milliseconds",
)
_UNITS_OF: Final = {3: "milliseconds", 6: "microseconds", 9: "nanoseconds"}  # by digits


class ClockHabits(NamedTuple):
    """How a text writes its times, where only their order tells."""

    width: int = 0  # digits that fractions of seconds stand for, where leading zeros are missing
    steps: bool = False  # times with a plus are steps from the one above
    days: bool = False  # times without a unit are days
    counters: bool = False  # numbers before a mark, and the like, are times: in milliseconds, where
    guessed: bool = False  # nothing says their unit

    @property
    def notices(self) -> Iterator[str]:
        """What was made of it, for people."""
        unit = _UNITS_OF.get(self.width)
        return (notice.format(unit) for notice, holds in zip(_NOTICES, self, strict=True) if holds and notice)


def habits_of(stamps: Iterable[Stamp]) -> ClockHabits:
    """What the times of a text's beginning, in their order, tell."""
    stamps = list(stamps)
    counters = _are_milliseconds(_steps(stamp.t_ns for stamp in stamps if stamp.counter))
    return ClockHabits(
        _width([stamp for stamp in stamps if stamp.places]),
        any(step < 0 for step in _steps(stamp.t_ns for stamp in stamps if stamp.signed)),
        _are_days([stamp.t_ns for stamp in stamps if stamp.unnamed and not stamp.counter]),
        counters,
        counters and any(stamp.counter and stamp.unnamed for stamp in stamps),
    )


def _steps(times: Iterable[int]) -> list[int]:
    return [later - earlier for earlier, later in pairwise(times)]


def _are_milliseconds(steps: Sequence[int]) -> bool:
    """Whether numbers before a mark, so far from one another, are no numbers of lines."""
    return bool(steps) and min(steps) >= 0 and sorted(steps)[len(steps) // 2] > _LINES_NS


def _are_days(times: Sequence[int]) -> bool:
    """Whether seconds are days."""
    steps = sorted(filter(None, _steps(times)))
    if len(steps) < _FEWEST_STEPS or steps[0] < 0:
        return False
    if all(t_ns // SECOND_NS in _DAYS for t_ns in times):
        return steps[len(steps) // 2] < _SOONEST_NS
    return steps[len(steps) // 2] < _SOONEST_BARE_NS and times[-1] < SECOND_NS


def _width(stamps: Sequence[Stamp]) -> int:
    """How many digits the fractions stand for, where leading zeros are missing; 0 where nothing says so."""
    places = {stamp.places for stamp in stamps}
    if len(places) < 2 or max(places) > max(_UNITS_OF):
        return 0
    width = next(width for width in _UNITS_OF if width >= max(places))
    runs_back = [
        any(-SECOND_NS < step < 0 for step in _steps(counted(stamp, digits) for stamp in stamps))
        for digits in (0, width)
    ]
    return width if runs_back == [True, False] else 0


def of_days(t_ns: int) -> int:
    """The time that so many days are, written as seconds in ns: since 1970, or of a day."""
    days = t_ns - _1970 * SECOND_NS if t_ns // SECOND_NS in _DAYS else t_ns
    return days * (DAY_NS // SECOND_NS)


def counted(stamp: Stamp, width: int) -> int:
    """The time of a stamp, in ns, whose fraction counts units of 10^-width seconds."""
    if not 0 < stamp.places <= width:
        return stamp.t_ns
    seconds, fraction = divmod(stamp.t_ns, SECOND_NS)
    count = fraction * int(10**stamp.places) // SECOND_NS
    return seconds * SECOND_NS + count * int(10 ** (9 - width))
