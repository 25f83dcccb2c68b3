"""Times in a line of text.

A stamp is a time of day, a date with one, a count of seconds since some start or since 1970, or a number with a unit:
rows of `captures.text.timeforms`. Where digits could be either a time or hex bytes (`11:03:00:64`), what follows
decides: a clock has three parts and a fraction, and its parts are in range. A date without a zone is local time of the
zone that the caller names.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import replace
from datetime import UTC, datetime, timedelta, timezone, tzinfo
from functools import lru_cache
from typing import Final

from ..limits import TIME_LIMIT
from .timeforms import (
    ANYWHERE,
    AT_BEGIN,
    BARE_DATE,
    BEHIND_WORD,
    CLOCK,
    DATES,
    DIGIT,
    FIRST,
    FRACTIONS,
    KEYED,
    LIKELY_CLOCK,
    LIKELY_DATE,
    MONTHS,
    ODD_CLOCKS,
    SECOND_NS,
    TITLE,
    UNIT_NS,
    Stamp,
    TimeForm,
)

DAY_NS = 86_400_000_000_000
_MINUTE_NS: Final = 60_000_000_000
_LONG: Final = 4096  # characters: in a longer line times are looked for
_HEAD: Final = 256  # in the first of them alone
_AROUND: Final = 72  # characters that a clock takes at most, with its date and its zone
_EPOCH_DAY: Final = datetime(1970, 1, 1, tzinfo=UTC)
_OF_DAY: Final = Stamp(of_day=True, fine=False)
Found = tuple[Stamp | None, str]  # a time, and its line without it


def find(text: str, zone: tzinfo | None = UTC) -> Found:
    """The first stamp of a line, and the line with every time and date in it blanked by as many spaces.

    `zone` is that of dates without one; None for this machine's.
    """
    if len(text) > _LONG:
        stamp, head = find(text[:_HEAD], zone)
        return stamp, head + text[_HEAD:]
    return _find(text, zone)


@lru_cache(maxsize=2048)  # a text's beginning is read again, once it is known what it is like
def _find(text: str, zone: tzinfo | None) -> Found:
    if DIGIT.search(text) is None:
        return None, text
    stamp, text = _count(text)
    if LIKELY_CLOCK.search(text) is not None:
        stamp, text = _clocks(text, stamp, zone)
    elif stamp is None:
        stamp, text = _first(ODD_CLOCKS, text, zone)
    if LIKELY_DATE.search(text):
        for match in BARE_DATE.finditer(text):
            text = _blanked(text, match)
    if stamp is None:
        stamp, text = _first(ANYWHERE, text)
    return (None if stamp is None or in_range(stamp.t_ns) is None else stamp), text


def in_range(t_ns: int) -> int | None:
    """A time that a capture can hold; None where it is none."""
    return t_ns if abs(t_ns) < TIME_LIMIT else None


def _count(text: str) -> Found:
    """The count that a line begins with, or that has a key of its own."""
    if (match := TITLE.match(text)) is not None:
        text = _blanked(text, match)
    if (begins := FIRST.match(text)) is not None:
        stamp, text = _first(AT_BEGIN if begins[0][-1].isdigit() else BEHIND_WORD, text)
        if stamp is not None:
            return stamp, text
    return _first(KEYED, text) if ":" in text or "=" in text else (None, text)


def _first(forms: Iterable[TimeForm], text: str, zone: tzinfo | None = None) -> Found:
    """The time of the first of these forms that a line has."""
    for form in forms:
        if form.sign in text and (match := form.pattern.search(text)) is not None:
            stamp = _stamp(match, form, zone)
            if stamp is not None:
                return stamp, _blanked(text, match)
    return None, text


def _clocks(text: str, stamp: Stamp | None, zone: tzinfo | None) -> Found:
    """The first clock of a line, or what it has of a count's second."""
    likely = [match.start() for match in LIKELY_CLOCK.finditer(text)]
    for match in CLOCK.finditer(text, max(likely[0] - _AROUND, 0), likely[-1] + _AROUND):
        if (clock := _of_clock(match.groupdict(""), _OF_DAY, zone)) is not None:
            stamp = clock if stamp is None or stamp.counter else _finer(stamp, clock)
            text = _blanked(text, match)
    return stamp, text


def _finer(stamp: Stamp, clock: Stamp) -> Stamp:
    """A time to the second with the fraction of the same second that stands elsewhere in its line."""
    fraction = (clock.t_ns - stamp.t_ns) % _MINUTE_NS
    if stamp.fine or fraction >= SECOND_NS:
        return stamp
    return replace(stamp, t_ns=stamp.t_ns + fraction, fine=True)


Parts = dict[str, str]  # of a time, by the names of groups; empty where it has none


def _stamp(match: re.Match[str], form: TimeForm, zone: tzinfo | None) -> Stamp | None:
    parts: Parts = match.groupdict("")
    if form.form.of_day:
        return _of_clock(parts, form.form, zone)
    digits = parts.get("f") or parts.get("more", "")
    size = form.unit or UNIT_NS[parts["unit"].lower()]
    whole = int(parts["n"]) if "n" in parts else _seconds(parts)
    t_ns = whole * size + _fraction(digits, size)
    return replace(
        form.form,
        t_ns=-t_ns if parts.get("sign") == "-" else t_ns,
        fine=form.form.fine or bool(digits),
        places=len(digits) * form.form.unnamed,
        signed=parts.get("sign") == "+",
    )


def _seconds(parts: Parts) -> int:
    days, hours, minutes, seconds = (int(parts.get(name) or 0) for name in ("days", "h", "mi", "s"))
    return ((days * 24 + hours) * 60 + minutes) * 60 + seconds


def _fraction(digits: str, unit_ns: int = SECOND_NS) -> int:
    """The ns of the digits behind a point."""
    return int(int(digits or 0) * unit_ns // 10 ** len(digits))


def _of_clock(parts: Parts, form: Stamp, zone: tzinfo | None) -> Stamp | None:
    """A clock, with its date where it has one; None where a part is out of range."""
    half = parts.get("half", "")
    hour, minute, second = (int(parts[name] or 0) for name in ("h", "mi", "s"))
    if hour > 23 or minute > 59 or second > 60:
        return None
    if half:
        hour = hour % 12 + 12 * (half in "Pp")
    told = parts.get("f", "")
    digits = told or next(filter(None, map(parts.get, FRACTIONS)), "")
    digits = (digits.zfill(6) if parts.get("us") else digits).replace(",", "").replace(".", "")
    t_ns = ((hour * 60 + minute) * 60 + second) * SECOND_NS + _fraction(digits)
    date = _date(parts, american=half != "")
    try:
        midnight = 0 if date is None else _midnight(*date, parts.get("zone"), zone, hour)
    except (ValueError, OverflowError):
        return None
    return replace(
        form,
        t_ns=t_ns + midnight * SECOND_NS,
        of_day=date is None,
        zoned=date is None or bool(parts.get("zone")),
        fine=form.fine or bool(digits),
        places=len(told),
    )


def _date(parts: Parts, *, american: bool) -> tuple[int, int, int] | None:
    """Year, month and day; None where the text has no date, or one without a year."""
    end = next((end for end in DATES if parts.get(f"mo{end}")), None)
    if end is None or not (year := parts[f"y{end}"] or parts["y7"]):
        return None
    month, day = parts[f"mo{end}"], int(parts[f"d{end}"])
    number = MONTHS[month[:3].lower()] if month[:1].isalpha() else int(month)
    by = parts.get("by")
    if end == "2" and (number > 12 >= day or (american and by == "/" and day <= 12)):
        number, day = day, number  # month first
    if len(year) == 2:
        if by == "-":
            year, day = str(day), int(year)  # 26-11-21
        year = f"20{int(year):02d}"
    return int(year), number, day


@lru_cache(maxsize=64)
def _midnight(year: int, month: int, day: int, written: str | None, zone: tzinfo | None, hour: int) -> int:
    """Seconds from 1970 to the midnight of a day, on the clock that this hour of it is told by."""
    moment = datetime(year, month, day, hour)
    if written:
        moment = moment.replace(tzinfo=_zone(written))
    elif zone is not None:
        moment = moment.replace(tzinfo=zone)
    else:
        moment = _local(moment)
    return (moment - _EPOCH_DAY) // timedelta(seconds=1) - hour * 3600


def _local(moment: datetime) -> datetime:
    """A time of this machine's clock, aware. Windows has none before 1970: there the clock is as in 1972."""
    try:
        return moment.astimezone()
    except OSError:
        return moment.replace(tzinfo=moment.replace(year=1972).astimezone().tzinfo)


def _zone(text: str) -> timezone:
    if text[0] not in "+-":
        return UTC
    offset = timedelta(hours=int(text[1:3]), minutes=int(text[-2:]))
    return timezone(-offset if text[0] == "-" else offset)


def _blanked(text: str, match: re.Match[str]) -> str:
    """A text with blanks in place of what was found."""
    return text[: match.start()] + " " * (match.end() - match.start()) + text[match.end() :]


def short_fraction(time: str) -> str:
    """socat 1.7 writes microseconds as nine digits: `.000394797` is 394797 us."""
    return re.sub(r"(?<=\d{4}/\d\d/\d\d \d\d:\d\d:\d\d\.)000(?=\d{6}$)", "", time)
