"""Tables of times and values as panels and loggers write them: which column is which, and in what form times are.

Read by columns: a form of time counts where it reads nearly all of one, so that 03/04 is told by the rows that have
25/04. A row without a number (`---`, an empty cell) is a gap.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from functools import partial
from typing import Final

import numpy as np

from dissectors.maps import MapError
from dissectors.maps.table import csv_rows
from dissectors.maps.tableaddresses import together

from .overlay import DATED_S, DAY_S, Beginning, PanelTable

_POINTS: Final = 2000  # more tell no more
_ROWS: Final = 200_000
_COLUMNS: Final = 40
_SHARE: Final = 0.9  # of the rows below the headings that a column reads
_DATES: Final = (
    "%Y-%m-%d", "%d.%m.%Y", "%d.%m.%y", "%d/%m/%Y", "%m/%d/%Y", "%Y/%m/%d", "%Y.%m.%d", "%d-%m-%Y", "%d/%m/%y",
    "%m/%d/%y",
)  # fmt: skip
_CLOCK: Final = re.compile(r"(\d{1,2}):(\d{2})(?::(\d{2}(?:[.,]\d{1,9})?))?\s*([AaPp])?\.?(?:[Mm]\.?)?")
_VALUE: Final = re.compile(r"([-+]?[\d\s'\u00a0\u202f.,]*\d(?:[eE][-+]?\d+)?)\s*[^\d\s]{0,8}")


class PanelError(ValueError):
    """A table of times and values that cannot be used; one line."""


def read_panel(text: str, file: str) -> PanelTable:
    """The first column, or two, that read as times, and the next that reads as numbers."""
    lines = text.removeprefix("\ufeff").splitlines()[:_ROWS]
    best: list[tuple[float, float]] = []
    beginning: Beginning = "unknown"
    for delimiter in ";\t,|":
        try:
            rows = [
                [cell.strip() for cell in row[:_COLUMNS]] for _, row in csv_rows(lines, delimiter, file) if any(row)
            ]
        except MapError as error:
            raise PanelError(str(error)) from error
        found, since = _points([row for row in rows if len(row) > 1])
        if len(found) > len(best):
            best, beginning = found, since
    if len(best) < 3:
        raise PanelError(
            f"{file}: {len(best)} rows of a time and a value, such as 12:30:05,23.4: at least 3 are needed"
        )
    times, values = (np.array(column) for column in zip(*best, strict=True))
    order = np.argsort(times, kind="stable")[:: max(1, len(times) // _POINTS)]
    return PanelTable(times[order], values[order], beginning)


def _points(rows: Sequence[Sequence[str]]) -> tuple[list[tuple[float, float]], Beginning]:
    """The rows that have a time and a value, as one delimiter cuts them, and what the times count from."""
    body = [row for row in rows if any(re.match(r"[-+]?\d", cell) for cell in row[:3])]
    if not body:
        return [], "unknown"
    columns = [[row[at] if at < len(row) else "" for row in body] for at in range(max(map(len, body)))]
    times, behind, beginning = _times(columns)
    for column in columns[behind:]:
        values = [_number(cell) for cell in column]
        points = [(at, value) for at, value in zip(times, values, strict=True) if at is not None and value is not None]
        if 2 * len(points) > len(body):
            return points, beginning
    return [], beginning


def _times(columns: Sequence[Sequence[str]]) -> tuple[list[float | None], int, Beginning]:
    """The times of the rows, the column behind them, and what they count from; a date and a time of day may be two
    columns."""
    for at, column in enumerate(columns):
        day = _read(column, [partial(_dated, form=form, bare=True) for form in _DATES])
        clock = _read(columns[at + 1], [_clock]) if day and at + 1 < len(columns) else None
        if day and clock:
            both = zip(day, clock, strict=True)
            return (
                [one + other if one is not None and other is not None else None for one, other in both],
                at + 2,
                "1970",
            )
        if hours := _read(column, [_clock]):
            return _over_midnight(hours), at + 1, "midnight" if hours[0] else "unknown"
        if moments := _read(column, [_iso, *(partial(_dated, form=form) for form in _DATES)]):
            return moments, at + 1, "1970"
    for at, column in enumerate(columns):
        if numbers := _read(column, [_epoch]):
            return numbers, at + 1, "1970" if min(n for n in numbers if n is not None) >= DATED_S else "unknown"
    return [None] * len(columns[0]), len(columns), "unknown"


def _over_midnight(hours: Sequence[float | None]) -> list[float | None]:
    """Times of day in the order of the rows, those behind a midnight a day later."""
    found: list[float | None] = []
    before, days = 0.0, 0
    for seconds in hours:
        if seconds is not None:
            days += seconds < before - DAY_S / 2
            before = seconds
        found.append(None if seconds is None else seconds + days * DAY_S)
    return found


def _read(column: Sequence[str], ways: Sequence[Callable[[str], float | None]]) -> list[float | None] | None:
    """A column by the first way that reads nearly all of it."""
    for way in ways:
        if way(column[-1]) is None and way(column[len(column) // 2]) is None:
            continue
        read = [way(cell) for cell in column]
        if sum(one is not None for one in read) >= _SHARE * len(read):
            return read
    return None


def _dated(cell: str, form: str, *, bare: bool = False) -> float | None:
    """Seconds of a date in a form and, unless it stands `bare`, a time of day behind it."""
    day, _, clock = cell.replace("T", " ").partition(" ")
    seconds = 0.0 if bare and not clock else _clock(clock.strip())
    if seconds is None or (bare and clock):
        return None
    try:
        return datetime.strptime(day.rstrip(","), form).replace(tzinfo=UTC).timestamp() + seconds
    except ValueError:
        return None


def _clock(cell: str) -> float | None:
    """Seconds of a time of day."""
    match = _CLOCK.fullmatch(cell)
    if match is None or int(match[1]) > 23 or int(match[2]) > 59:
        return None
    hour = int(match[1]) % 12 + (12 if match[4] in "Pp" else 0) if match[4] else int(match[1])
    return hour * 3600.0 + int(match[2]) * 60.0 + float((match[3] or "0").replace(",", "."))


def _iso(cell: str) -> float | None:
    if not re.match(r"\d{4}-\d\d-\d\d[T ]\d", cell):
        return None
    try:
        moment = datetime.fromisoformat(cell.replace(",", "."))
    except ValueError:
        return None
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()


def _epoch(cell: str) -> float | None:
    """Seconds as they stand; large ones are ms or ns since 1970."""
    number = _number(cell)
    if number is None:
        return None
    return number / 1e9 if number > 1e17 else number / 1e3 if number > 1e11 else number


def _number(cell: str) -> float | None:
    """A number with a decimal comma or point, gaps at its thousands, and a unit of measure behind it."""
    match = _VALUE.fullmatch(cell[:60])
    if match is None:
        return None
    text = together(match[1]).replace(" ", "")
    if "," in text and "." in text:  # the last of the two is the decimal one
        other = "." if text.rindex(",") > text.rindex(".") else ","
        text = text.replace(other, "")
    try:
        number = float(text.replace(",", "."))
    except ValueError:
        return None
    return number if math.isfinite(number) else None
