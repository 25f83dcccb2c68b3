"""Times in a line of text.

A stamp is a time of day, a date with one, a count of seconds since some start or since 1970, or a number with a unit.
Where digits could be either a time or hex bytes (`11:03:00:64`), what follows decides: a clock has three parts and a
fraction, and its parts are in range. A date without a zone is local time of the zone that the caller names.
"""

from __future__ import annotations

import re
from dataclasses import replace
from datetime import UTC, datetime, timedelta, timezone, tzinfo
from functools import lru_cache
from typing import Final

from ..limits import TIME_LIMIT
from .counts import LEAD, Stamp, blanked, count_anywhere, count_at_begin, count_with_days, fraction

DAY_NS = 86_400_000_000_000
_MINUTE_NS: Final = 60_000_000_000

_MONTHS: Final = {  # by the first three letters of their names in English, German and Russian
    name: number
    for names in (
        "jan feb mar apr may jun jul aug sep oct nov dec",
        "jan feb mär apr mai jun jul aug sep okt nov dez",
        "янв фев мар апр мая июн июл авг сен окт ноя дек",
    )
    for number, name in enumerate(names.split(), 1)
}
_NAME = rf"(?:{'|'.join(_MONTHS)})[^\W\d_]{{0,6}}\.?"
_DATE = (
    r"(?:(?P<y>\d{4})[-/.](?P<mo>\d{1,2})[-/.](?P<d>\d{1,2})|"
    r"(?P<d2>\d{1,2})(?P<sign>[-./])(?P<mo2>\d{1,2})(?P=sign)(?P<y2>\d{4}|\d\d)|"
    rf"(?P<d3>\d{{1,2}})\.?[ /-](?P<mo3>{_NAME})[ /-](?P<y3>\d{{4}})(?: г\.)?|"
    rf"(?P<mo4>{_NAME}) {{1,2}}(?P<d4>\d{{1,2}}),? (?:(?P<y4>\d{{4}}),?(?= ))?|"
    r"(?P<y5>20\d\d)(?P<mo5>[01]\d)(?P<d5>[0-3]\d)|"
    r"[01]?\d[-/][0-3]?\d)"
)
_CLOCK = re.compile(
    rf"(?<![0-9A-Za-z_.])(?<!\d:)(?<!\b[0-9a-f]:)(?<!\b[0-9a-f][0-9a-f]:)(?:{_DATE}(?:,? ?T?| |_|-|,|:|,? (?:at|um|в)){{0,1}} ?(?<=[T _,:-])|(?P<y6>\d{{4}})年(?P<mo6>\d{{1,2}})月(?P<d6>\d{{1,2}})日 ?)?"
    r"(?P<h>\d{1,2}):(?P<mi>\d\d):(?P<s>\d\d)"
    r"(?:[.:](?P<fz>\d{3}[,.]\d{3})(?!\d)|\.(?P<f>\d{1,9})|,(?P<fc>\d{3}(?:\d{3}){0,2})(?!\d)|:(?P<fm>\d{3})(?!\d)|"
    r"\ (?P<fs>\d{3})(?=\ ?(?:ms|мс)\b)|\ \((?P<fp>\d{3})\)|[-/'](?P<fd>\d{3})(?=[\s\]),;:|]|$))?"
    r"(?:\ ?(?P<half>[AaPp])\.?[Mm]\.?)?(?:\ ?(?P<zone>Z\b|[+-]\d\d:?\d\d|UTC\b|GMT\b))?"
    r"(?:(?=[i-wyz][a-z]{2}|[tr]x(?![0-9a-z]))|(?![0-9a-z_]|\.\d)(?(f)|(?!:[0-9a-f]{1,2}(?!\w))))"
    r"(?:\ (?P<y7>20\d\d)(?=[\]) ]))?",
    re.IGNORECASE,
)
_FRACTIONS: Final = ("fz", "f", "fc", "fm", "fs", "fp", "fd")
_BARE_DATE = re.compile(
    r"(?<![\w.:-])(?:\d{4}[-/]\d\d[-/]\d\d|\d\d[./]\d\d[./]\d{4}|\d{4}\.\d\d\.\d\d)(?![\w:]|[-/.]\w)|"
    rf"(?<![\w.:-])\d\d?-{_NAME}-\d{{2,4}}\b",
    re.IGNORECASE,
)
_LIKELY_CLOCK = re.compile(r"\d:\d\d:\d\d")
_LIKELY_DATE = re.compile(r"\d[-/.](?:\d\d|[A-Za-z])")
_LONG: Final = 4096  # characters: in a longer line times are looked for
_HEAD: Final = 256  # in the first of them alone
_DATE_LENGTH: Final = 40  # characters that a date and a zone take at most
_CLOCK_TAIL: Final = 20  # that a fraction, am or pm and a zone take
_DIGIT = re.compile(r"\d")
# `10-01-48.958`, `10.01.48,958`, `2026-11-21_10-01-48`, `20261121T100148`, behind a process `2311:20261121:100148.958`
_ODD_CLOCK: Final = re.compile(
    r"^[\s\[(|\"']*(?:(?:\d{1,7}:(?=20\d{6}:))?(?P<date>20\d\d-\d\d-\d\d|20\d\d[01]\d[0-3]\d)[ T_:-](?P<h>\d\d)(?P<sign>[-.]?)(?P<mi>\d\d)(?P=sign)"
    r"(?P<s>\d\d)(?:[.,](?P<f>\d{1,9}))?Z?|(?P<hh>\d\d)(?:(?P<dash>-)|(?P<dot>\.))(?P<mm>\d\d)(?(dash)-|\.)(?P<ss>\d\d)"
    r"(?(dash)[.,]|,)(?P<ff>\d{3}|\d{6}))(?![\w.])"
)
_CALLED: Final = re.compile(r"\bdatetime(?:\.datetime)?\((\d{4}(?:, ?\d{1,6}){4,6})\)")  # as Python shows one
_PACKED: Final = re.compile(  # `20261121100148958`: no even number of digits, as bytes in hex have
    LEAD + r"(20\d\d)([01]\d)([0-3]\d)([0-2]\d)([0-5]\d)([0-5]\d)[.,]?(\d{3})(?![\w.])"
)
_SPELLED: Final = re.compile(  # `10时01分48秒958毫秒`, `10 ч 01 мин 48 с`, `10h01m48s`
    r"(?<![\w.])(\d{1,2}) ?(?:时|時|ч|h|Uhr) ?(\d\d) ?(?:分|мин|м|min|m) ?(\d\d)(?:[.,](\d{1,6}))? ?(?:秒|сек|с|sec|s)"
    r"(?:(\d{3})(?:毫秒|ms)?)?(?![0-9A-Za-z])"
)
_EPOCH_DAY: Final = datetime(1970, 1, 1, tzinfo=UTC)


def find(text: str, zone: tzinfo | None = UTC) -> tuple[Stamp | None, str]:
    """The first stamp of a line, and the line with every time and date in it blanked by as many spaces.

    `zone` is that of dates without one; None for this machine's.
    """
    if len(text) > _LONG:
        stamp, head = find(text[:_HEAD], zone)
        return stamp, head + text[_HEAD:]
    if _DIGIT.search(text) is None:
        return None, text
    stamp, text = count_at_begin(text)
    likely = _LIKELY_CLOCK.search(text)
    for sign, found, written in _CLOCKS if stamp is None and likely is None else ():
        match = found(text) if sign in text else None
        clock = None if match is None else _of_clock_written(written(match), zone)
        if match is not None and clock is not None:
            stamp = clock
            text = blanked(text, match)
    timed = likely is not None
    while likely is not None:
        end = likely.end()
        limit = end + _DATE_LENGTH
        for match in _CLOCK.finditer(text, max(likely.start() - _DATE_LENGTH, 0), limit):
            if match.end() + _CLOCK_TAIL > limit and match.start() > likely.start():
                break  # another, which is looked at whole below
            end = max(end, match.end())
            if (clock := _of_clock(match, zone)) is not None:
                stamp = clock if stamp is None or stamp.counter else _finer(stamp, clock)
                text = blanked(text, match)
        likely = _LIKELY_CLOCK.search(text, end)
    if stamp is None and timed:
        stamp, text = count_with_days(text)
    if _LIKELY_DATE.search(text):
        for match in _BARE_DATE.finditer(text):
            text = blanked(text, match)
    if stamp is None:
        stamp, text = count_anywhere(text)
    if stamp is not None and in_range(stamp.t_ns) is None:
        stamp = None
    return stamp, text


def in_range(t_ns: int) -> int | None:
    """A time that a capture can hold; None where it is none."""
    return t_ns if abs(t_ns) < TIME_LIMIT else None


def _finer(stamp: Stamp, clock: Stamp) -> Stamp:
    """A time to the second with the fraction of the same second that stands elsewhere in its line."""
    fraction = (clock.t_ns - stamp.t_ns) % _MINUTE_NS
    if stamp.fine or fraction >= 10**9:
        return stamp
    return replace(stamp, t_ns=stamp.t_ns + fraction, fine=True)


def _of_clock(match: re.Match[str], zone: tzinfo | None) -> Stamp | None:
    hour, minute, second = int(match["h"]), int(match["mi"]), int(match["s"])
    if hour > 23 or minute > 59 or second > 60:
        return None
    half = match["half"]
    if half:
        hour = hour % 12 + (12 if half in "Pp" else 0)
    digits = next((match[name] for name in _FRACTIONS if match[name]), "").replace(",", "").replace(".", "")
    t_ns = (hour * 3600 + minute * 60 + second) * 10**9 + fraction(digits)
    date = _date(match, american=bool(half))
    if date is None:
        return Stamp(t_ns, of_day=True, fine=bool(digits), places=len(match["f"] or ""))
    try:
        seconds = _midnight(*date, match["zone"], zone, hour)
    except (ValueError, OverflowError):
        return None
    t_ns += seconds * 10**9
    zoned = bool(match["zone"])
    return Stamp(t_ns, of_day=False, zoned=zoned, fine=bool(digits), places=len(match["f"] or ""))


def _of_clock_written(text: str, zone: tzinfo | None) -> Stamp | None:
    match = _CLOCK.fullmatch(text)
    return None if match is None else _of_clock(match, zone)


def _with_colons(match: re.Match[str]) -> str:
    """A clock whose parts others than colons hold together, or nothing."""
    date, fraction = match["date"] or "", match["f"] or match["ff"]
    if date and "-" not in date:
        date = f"{date[:4]}-{date[4:6]}-{date[6:]}"
    clock = f"{match['h'] or match['hh']}:{match['mi'] or match['mm']}:{match['s'] or match['ss']}"
    return f"{date} {clock}".strip() + (f".{fraction}" if fraction else "")


def _of_call(match: re.Match[str]) -> str:
    year, month, day, hour, minute, *rest = (int(part) for part in match[1].split(","))
    second, fraction = [*rest, 0, 0][:2]
    return f"{year}-{month:02}-{day:02} {hour}:{minute:02}:{second:02}.{fraction:06}"


def _of_packed(match: re.Match[str]) -> str:
    return "{}-{}-{} {}:{}:{}.{}".format(*match.groups())


def _of_spelled(match: re.Match[str]) -> str:
    hour, minute, second, fraction, milliseconds = match.groups()
    return f"{hour}:{minute}:{second}.{fraction or milliseconds or 0}"


_CLOCKS: Final = (
    ("", _ODD_CLOCK.match, _with_colons),
    ("", _PACKED.match, _of_packed),
    ("", _SPELLED.search, _of_spelled),
    ("datetime(", _CALLED.search, _of_call),
)


def _date(match: re.Match[str], *, american: bool) -> tuple[int, int, int] | None:
    """Year, month and day; None where the text has no date, or one without a year."""
    for i in ("", "2", "3", "4", "5", "6"):
        if (month := match[f"mo{i}"]) is None:
            continue
        year, day = match[f"y{i}"] or match["y7"], int(match[f"d{i}"])
        if year is None:
            return None
        number = _MONTHS[month[:3].lower()] if month[:1].isalpha() else int(month)
        if i == "2" and (number > 12 >= day or (american and match["sign"] == "/" and day <= 12)):
            number, day = day, number  # month first
        if len(year) == 2:
            if match["sign"] == "-":
                year, day = str(int(match["d2"])), int(year)  # 26-11-21
            year = f"20{int(year):02d}"
        return int(year), number, day
    return None


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


def short_fraction(time: str) -> str:
    """socat 1.7 writes microseconds as nine digits: `.000394797` is 394797 us."""
    return re.sub(r"(?<=\d{4}/\d\d/\d\d \d\d:\d\d:\d\d\.)000(?=\d{6}$)", "", time)
