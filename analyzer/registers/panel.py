"""Tables of times and values as panels and loggers write them: read, and laid over a capture.

Which column is which, and in what form times are, is read by columns: a form of time counts where it reads nearly all
of one, so that 03/04 is told by the rows that have 25/04. A row without a number (`---`, an empty cell) is a gap.

Where such a table lies in a capture: with clocks that agree, or by how much they differ. A table whose clock is another
one (an hour of summer time, minutes that it runs ahead) is laid over a reading at every place: a correlation of what
both have at that place, for all places at once.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from dissectors.maps import MapError
from dissectors.maps.table import csv_rows
from dissectors.maps.written import together

from ..errors import RtuscopeError

Floats = NDArray[np.float64]
Beginning = Literal["1970", "midnight", "unknown"]
DAY_S: Final = 86_400.0
DATED_S: Final = 1e9  # seconds since 1970 that a clock with a date says
_PLACES: Final = 1 << 16
_OVERLAP: Final = 0.6  # of the table or of the capture, whichever is shorter
_LEAST: Final = 5
HALF_HOUR_S: Final = 1800.0
_AS_GOOD: Final = 1.3  # times the least misfit
_EVEN: Final = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class PanelTable:
    """Times (s) and values that somebody wrote down; `beginning` is what its times count from."""

    times_s: Floats
    values: Floats
    beginning: Beginning = "unknown"

    def dated_as(self, begin_s: float) -> PanelTable:
        """Times of day on the day on which a capture begins, where that is known."""
        if self.beginning != "midnight" or begin_s < DATED_S:
            return self
        day = DAY_S * np.round((begin_s - self.times_s[0]) / DAY_S)
        return PanelTable(self.times_s + day, self.values, "1970")

    def is_of_clock(self, begin_s: float) -> bool:
        """Whether its times and those of a capture are both of a clock: only then can those differ."""
        return self.beginning == "1970" and begin_s >= DATED_S


def clock_difference(lag_s: float, near_s: float) -> float:
    """What a lag says of the clocks: half hours of a zone where it is so within `near_s`, or all of it."""
    zone = HALF_HOUR_S * round(lag_s / HALF_HOUR_S)
    return zone if zone and abs(lag_s - zone) <= near_s else lag_s


def best_place(times_s: Floats, shown: Floats, series: Sequence[tuple[Floats, Floats]]) -> tuple[float, float] | None:
    """The lag at which the table goes best with one of these series (times in s, readings), and the share of its
    variance that is left there; of places that are about as good the nearest one. None where it has no place."""
    matched: list[tuple[float, float]] = []
    for at_s, values in series:
        lags, left = _places(times_s, shown, at_s, values)
        if len(lags):
            good = left <= _AS_GOOD * left.min() + _EVEN
            which = np.flatnonzero(good)[np.argmin(np.abs(lags[good]))]
            matched.append((float(left[which]), float(lags[which])))
    if not matched:
        return None
    left_least, lag = min(matched)
    return lag, left_least


def _places(times_s: Floats, shown: Floats, at_s: Floats, values: Floats) -> tuple[Floats, Floats]:
    """All lags on a grid, and the share of the table's variance that a line through the readings leaves there."""
    spans = times_s[-1] - times_s[0], at_s[-1] - at_s[0]
    paces = [span / max(len(times) - 1, 1) for span, times in zip(spans, (times_s, at_s), strict=True)]
    pace = max(min(paces), sum(spans) / _PLACES, 1e-3)
    if min(spans) < _LEAST * max(paces):
        return np.empty(0), np.empty(0)
    table, capture = _on_grid(times_s, shown, pace), _on_grid(at_s, values, pace)
    size = 1 << int(len(table) + len(capture)).bit_length()
    ones = np.ones(len(table)), np.ones(len(capture))

    def together(one: Floats, other: Floats) -> Floats:
        """The sums of products at every place of the table `one` in the capture `other`."""
        product = np.fft.irfft(np.fft.rfft(other, size) * np.conj(np.fft.rfft(one, size)), size)
        return np.concatenate((product[size - len(table) + 1 :], product[: len(capture)]))

    count = np.maximum(together(*ones), 1.0)
    sums, own = together(ones[0], capture), together(table, ones[1])
    power = together(ones[0], capture**2) - sums**2 / count
    own_power = together(table**2, ones[1]) - own**2 / count
    shared = together(table, capture) - sums * own / count
    enough = count > max(_OVERLAP * min(len(table), len(capture)), _LEAST)
    enough &= (power > 1e-9 * power.max()) & (own_power > 0.2 * own_power.max())
    lags = at_s[0] - times_s[0] + pace * np.arange(1 - len(table), len(capture))
    left = 1 - shared[enough] ** 2 / (power[enough] * own_power[enough])
    return lags[enough], np.clip(left, 0.0, 1.0)


def _on_grid(times_s: Floats, values: Floats, pace: float) -> Floats:
    """The values that stand at even times, in units of their spread about their mean."""
    grid = np.arange(times_s[0], times_s[-1] + pace / 2, pace)
    held = values[np.searchsorted(times_s, grid + pace * 1e-6, side="right") - 1]
    even: Floats = (held - held.mean()) / max(float(held.std()), 1e-300)
    return even


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


class PanelError(RtuscopeError, ValueError):
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
        matched, since = _points([row for row in rows if len(row) > 1])
        if len(matched) > len(best):
            best, beginning = matched, since
    if len(best) < 3:
        raise PanelError(
            f"{file}: {len(best)} rows with a time and a value, such as 12:30:05,23.4: at least 3 are needed"
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
        values = [_decimal(cell) for cell in column]
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
    matched: list[float | None] = []
    before, days = 0.0, 0
    for seconds in hours:
        if seconds is not None:
            days += seconds < before - DAY_S / 2
            before = seconds
        matched.append(None if seconds is None else seconds + days * DAY_S)
    return matched


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
    number = _decimal(cell)
    if number is None:
        return None
    return number / 1e9 if number > 1e17 else number / 1e3 if number > 1e11 else number


def _decimal(cell: str) -> float | None:
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
