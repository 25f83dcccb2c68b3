"""Where `go to` goes: a frame's number, a time, a step in time, a share of the capture."""

from __future__ import annotations

import re
from datetime import UTC, datetime, timedelta, tzinfo
from typing import Final

from ..languages import tr
from ..words import UNITS_NS, is_clock, moment_of
from .bus import Bus

_DIGITS: Final = r"\d{1,12}(?:\.\d{1,12})?"
_FRAME: Final = re.compile(r"#?\d{1,18}")
_SHARE: Final = re.compile(rf"({_DIGITS})\s*%")
_STEP: Final = re.compile(rf"([+-]?)({_DIGITS})\s*(us|ms|s|min|h)")
_DAY: Final = re.compile(r"(?:(\d{4}-\d{2}-\d{2})[ t])?(\d{1,2}):(\d{2})(?::(\d{2})(?:\.(\d{1,9}))?)?")
FORMS: Final = "frame 120, time 12.5s, step +200ms or -5s, clock 08:29:51.5 or 2026-11-21 08:29, share 50%"


SPANS: Final = "14:00-16:00, yesterday 14-16 (or y), today 8-9:30, 2026-11-21 14-16, 10s-25s"
_SPAN: Final = re.compile(
    r"(?:(y|yesterday|t|today|\d{4}-\d{2}-\d{2})\s+)?(\d{1,2})(?::(\d{2}))?\s*-\s*(\d{1,2})(?::(\d{2}))?"
)
_SECONDS: Final = re.compile(rf"({_DIGITS})\s*(us|ms|s|min|h)?\s*-\s*({_DIGITS})\s*(us|ms|s|min|h)")


class GotoError(ValueError):
    """No place is named like this; the message says what can be."""


def is_place(text: str) -> bool:
    """Whether a text has the form of a place, wherever that may be."""
    text = text.strip().lower()
    return any(form.fullmatch(text) for form in (_FRAME, _SHARE, _STEP, _DAY))


def place(text: str, bus: Bus, row: int, zone: tzinfo = UTC) -> int:
    """The row that `text` names, seen from `row`; times of day are those of `zone`. Raises GotoError."""
    text = text.strip().lower()
    if not bus.count:
        raise GotoError(tr("no frame is there yet"))
    if _FRAME.fullmatch(text):
        target = bus.table.row_of_frame(int(text.lstrip("#")))
        if target < 0:
            raise GotoError(tr("no frame {text}: they are 0 to {last:,}", text=text, last=bus.frames - 1))
        return target
    if match := _SHARE.fullmatch(text):
        return min(bus.count - 1, int(bus.count * float(match[1]) / 100))
    if not bus.timed:
        raise GotoError(tr("this capture has no times: go to a frame's number or a share such as 50%"))
    if match := _STEP.fullmatch(text):
        ns = round(float(match[2]) * UNITS_NS[match[3]])
        if not match[1]:
            return bus.table.row_at_time(bus.t_first + ns)
        return bus.table.row_at_time(bus.table.value("t_start_ns", row) + (ns if match[1] == "+" else -ns))
    if match := _DAY.fullmatch(text):
        return bus.table.row_at_time(_on_the_day(match, bus, text, zone))
    raise GotoError(tr("{text!r} is no place: {forms}", text=text[:40], forms=tr(FORMS)))


def span(text: str, bus: Bus, zone: tzinfo = UTC, now: datetime | None = None) -> tuple[int, int]:
    """The time from .. to, in ns, that `text` names (see SPANS); without a day the last one of the capture that has it.

    `now` tells what today is. Raises GotoError.
    """
    text = text.strip().lower()
    if not bus.timed or not bus.count:
        raise GotoError(tr("no times in this capture"))
    if match := _SECONDS.fullmatch(text):
        low, high = (round(float(match[i]) * UNITS_NS[match[j] or match[4]]) for i, j in ((1, 2), (3, 4)))
        return _some(bus.t_first + low, bus.t_first + high)
    match = _SPAN.fullmatch(text)
    if match is None:
        raise GotoError(tr("{text!r} is no span: {forms}", text=text[:40], forms=tr(SPANS)))
    if not is_clock(bus.t_first):
        raise GotoError(tr("this capture's clock has no time of day: give seconds since its start, such as 10s-25s"))
    now = now or datetime.now(zone)
    newest = moment_of(bus.t_last // 1_000_000_000, zone)
    try:
        day = newest
        if match[1]:
            back = timedelta(days=match[1][0] == "y")
            named = match[1][0].isdigit()
            day = datetime.fromisoformat(match[1]).replace(tzinfo=zone) if named else now.astimezone(zone) - back
        low, high = (_at(day, int(match[i]), int(match[i + 1] or 0)) for i in (2, 4))
        if not match[1] and low > bus.t_last:
            low, high = (_at(day - timedelta(days=1), int(match[i]), int(match[i + 1] or 0)) for i in (2, 4))
    except ValueError as error:
        raise GotoError(tr("{text!r} is no time of day", text=text[:40])) from error
    return _some(low, high)


def _at(day: datetime, hour: int, minute: int) -> int:
    """A time of a day in ns; 24:00 is its end."""
    midnight = hour == 24 and not minute
    moment = day.replace(hour=0 if midnight else hour, minute=minute, second=0, microsecond=0)
    return int((moment + timedelta(days=midnight)).timestamp()) * 1_000_000_000


def _some(low: int, high: int) -> tuple[int, int]:
    if high <= low:
        raise GotoError(tr("it ends before it begins"))
    return low, high


def _on_the_day(match: re.Match[str], bus: Bus, text: str, zone: tzinfo) -> int:
    """A time of day, on the first day of the capture that has it."""
    if not is_clock(bus.t_first):
        raise GotoError(tr("this capture's clock has no time of day: give a time since its start, such as 12.5s"))
    first = moment_of(bus.t_first / 1e9, zone)
    try:
        if match[1]:
            first = datetime.fromisoformat(match[1]).replace(tzinfo=zone)
        moment = first.replace(hour=int(match[2]), minute=int(match[3]), second=int(match[4] or 0), microsecond=0)
    except ValueError as error:
        raise GotoError(tr("{text!r} is no time of day", text=text)) from error
    ns = int(moment.timestamp()) * 1_000_000_000 + int((match[5] or "0").ljust(9, "0"))
    day = int(timedelta(days=1).total_seconds()) * 1_000_000_000
    return ns if match[1] or ns + 1_000_000_000 >= bus.t_first else ns + day
