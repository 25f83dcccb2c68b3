"""Times as people type them, and as they are shown: one grammar for where to go and for spans.

A time is a clock's (`08:29:51.5`, with a date before it and a zone behind it or not), or one since the capture's start
(`12.5 s`). A span is two of them with `-`, an en dash, `..` or `to` between; what the second leaves out it has from the
first. Whatever the interface shows as a time can be typed here.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta, tzinfo
from typing import TYPE_CHECKING, Final

from ..languages import tr
from ..words import UNITS_NS, date_and_time, duration, is_clock, moment_of, unit_word, zone_name

if TYPE_CHECKING:
    from .bus import Bus

FORMS: Final = "frame 120, time 12.5s, step +200ms or -5s, clock 08:29:51.5 or 2026-11-21 08:29, share 50%"
SPANS: Final = "14:00-16:00, 08:29:51-08:30:00.5, yesterday 14-16 (or y), 2026-11-21 14-16, 10s-25s"
DIGITS: Final = r"\d{1,12}(?:[.,]\d{1,12})?"
_BETWEEN: Final = re.compile(r"\s*(?:[-\u2013\u2014\u2212]|\.\.|\bto\b|\bдо\b)\s*")
UNIT: Final = r"[^\W\d_]{1,3}"
_SINCE: Final = re.compile(rf"({DIGITS})\s*({UNIT})?")
_CLOCK: Final = re.compile(
    r"(?:(?P<day>y|yesterday|вчера|t|today|сегодня|(?:\d{4}-)?\d{2}-\d{2})[ t]+)?"
    r"(?P<hour>\d{1,2})(?::(?P<minute>\d{2})(?::(?P<second>\d{2})(?:[.,](?P<part>\d{1,9}))?)?)?"
    r"(?:\s*(?P<zone>z|[a-z]{2,5}(?:[+-]\d{1,2}(?::?\d{2})?)?|[+-]\d{1,2}(?::?\d{2})?))?"
)
_SECOND_NS: Final = 1_000_000_000
_DAY: Final = timedelta(days=1)


class GotoError(ValueError):
    """No place is named like this; the message says what can be."""


def is_clock_text(text: str) -> bool:
    """Whether a text has the form of a time of day; an hour alone has not."""
    match = _CLOCK.fullmatch(text)
    return match is not None and match["minute"] is not None


def time_ns(number: str, unit: str) -> int | None:
    """So many of a unit in ns, in the words of the language in use or in English; None where it is no unit of time."""
    units = {name: ns for known, ns in UNITS_NS.items() for name in (known, unit_word(known))}
    return round(float(number.replace(",", ".")) * units[unit]) if unit in units else None


def moment(text: str, bus: Bus, zone: tzinfo = UTC) -> int:
    """The time (ns) that a text like `08:29:51.5` names: without a date on the first day of the capture that has it.
    Raises GotoError."""
    _with_clock(bus, tr("this capture has no time of day: give a time since its start, such as 12.5s"))
    match = _CLOCK.fullmatch(text)
    if match is None or match["minute"] is None:
        raise GotoError(tr("{text!r} is not a time of day", text=text[:40]))
    zone = _zone(match, bus, zone, text)
    t_ns = _of_clock(match, moment_of(bus.t_first / 1e9, zone), zone, None, text)
    return t_ns if match["day"] or t_ns + _SECOND_NS >= bus.t_first else t_ns + round(_DAY.total_seconds()) * _SECOND_NS


def span(text: str, bus: Bus, zone: tzinfo = UTC, now: datetime | None = None) -> tuple[int, int]:
    """The time from .. to, in ns, that `text` names (see SPANS); without a day the last one of the capture that has it.

    `now` tells what today is. Raises GotoError, also where the capture has no moment of that time.
    """
    text = text.strip().lower()
    if not bus.timed or not bus.count:
        raise GotoError(tr("no times in this capture"))
    for one, other in _halves(text):
        if since := _since_start(one, other):
            last = duration(bus.t_last - bus.t_first)
            return _within(_ordered(bus.t_first + since[0], bus.t_first + since[1]), bus, text, duration(0), last)
        begin, end = _CLOCK.fullmatch(one), _CLOCK.fullmatch(other)
        if begin and end:
            told = _of_clocks(begin, end, bus, zone, now, text)
            return _within(told, bus, text, date_and_time(bus.t_first, zone), date_and_time(bus.t_last, zone))
    raise GotoError(tr("{text!r} is not a span: {forms}", text=text[:40], forms=tr(SPANS)))


def _since_start(one: str, other: str) -> tuple[int, int] | None:
    """Two times since the start, in ns; a unit that one of them lacks it has from the other."""
    low, high = _SINCE.fullmatch(one), _SINCE.fullmatch(other)
    unit = (low and low[2]) or (high and high[2])
    if not (low and high and unit):
        return None
    begin, end = time_ns(low[1], low[2] or unit), time_ns(high[1], high[2] or unit)
    return None if begin is None or end is None else (begin, end)


def _halves(text: str) -> Iterator[tuple[str, str]]:
    """Every way to take a text for two with something between."""
    for match in _BETWEEN.finditer(text):
        yield text[: match.start()], text[match.end() :]


def _of_clocks(
    begin: re.Match[str], end: re.Match[str], bus: Bus, zone: tzinfo, now: datetime | None, text: str
) -> tuple[int, int]:
    _with_clock(bus, tr("this capture has no time of day: give seconds since its start, such as 10s-25s"))
    zone = _zone(end if end["zone"] else begin, bus, zone, text)
    day = moment_of(bus.t_last // _SECOND_NS, zone)
    low = _of_clock(begin, day, zone, now, text)
    if not begin["day"] and low > bus.t_last:
        day -= _DAY
        low = _of_clock(begin, day, zone, now, text)
    high = _of_clock(end, moment_of(low // _SECOND_NS, zone), zone, now, text)
    return _ordered(low, high)


def _with_clock(bus: Bus, otherwise: str) -> None:
    if not is_clock(bus.t_first):
        raise GotoError(otherwise)


def _zone(match: re.Match[str], bus: Bus, zone: tzinfo, text: str) -> tzinfo:
    """The zone that is written, which is the one that times are shown in, or UTC."""
    written = match["zone"]
    if written in (None, zone_name(bus.t_first, zone).lower(), zone_name(bus.t_last, zone).lower()):
        return zone
    if written in ("z", "utc", "gmt"):
        return UTC
    raise GotoError(tr("{text!r} is not a time of day", text=text[:40]))


def _of_clock(match: re.Match[str], day: datetime, zone: tzinfo, now: datetime | None, text: str) -> int:
    """A time of a day in ns; 24:00 is its end."""
    try:
        day = _named_day(match["day"], day, zone, now)
        hour, minute, second = (int(match[name] or 0) for name in ("hour", "minute", "second"))
        midnight = hour == 24 and not minute and not second
        at = day.replace(hour=0 if midnight else hour, minute=minute, second=second, microsecond=0)
        at += _DAY * midnight
        return int(at.timestamp()) * _SECOND_NS + int((match["part"] or "0").ljust(9, "0"))
    except (ValueError, OverflowError) as error:
        raise GotoError(tr("{text!r} is not a time of day", text=text[:40])) from error


def _named_day(name: str | None, day: datetime, zone: tzinfo, now: datetime | None) -> datetime:
    if not name:
        return day
    if name[0].isdigit():
        written = name if len(name) > len("11-21") else f"{day.year}-{name}"
        return datetime.fromisoformat(written).replace(tzinfo=zone)
    return (now or datetime.now(zone)).astimezone(zone) - _DAY * (name[0] in "yв")


def _ordered(low: int, high: int) -> tuple[int, int]:
    if high <= low:
        raise GotoError(tr("it ends before it begins"))
    return low, high


def _within(span: tuple[int, int], bus: Bus, text: str, first: str, last: str) -> tuple[int, int]:
    """The span, if the capture, which is told to go from `first` to `last`, has a moment of it."""
    if span[0] > bus.t_last:
        raise GotoError(tr("{text} is outside the capture: it ends at {last}", text=text[:40], last=last))
    if span[1] < bus.t_first:
        raise GotoError(tr("{text} is outside the capture: it begins at {first}", text=text[:40], first=first))
    return span
