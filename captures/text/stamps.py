"""Times in a line of text.

A stamp is a time of day, a date with one, a count of seconds since some start or since 1970, or a number with a unit.
Where digits could be either a time or hex bytes (`11:03:00:64`), what follows decides: a clock has three parts and a
fraction, and its parts are in range. A date without a zone is local time of the zone that the caller names.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta, timezone, tzinfo
from functools import lru_cache
from typing import Final

from ..limits import TIME_LIMIT

DAY_NS = 86_400_000_000_000
SECOND_NS: Final = 1_000_000_000
_MINUTE_NS: Final = 60_000_000_000

_MONTHS: Final = ["jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec"]
_NAME = r"(?:jan|feb|mar|apr|may|jun|jul|aug|sep|oct|nov|dec)[a-z]{0,6}\.?"
_DATE = (
    r"(?:(?P<y>\d{4})[-/.](?P<mo>\d{1,2})[-/.](?P<d>\d{1,2})|"
    r"(?P<d2>\d{1,2})(?P<sign>[-./])(?P<mo2>\d{1,2})(?P=sign)(?P<y2>\d{4}|\d\d)|"
    rf"(?P<d3>\d{{1,2}})[ /-](?P<mo3>{_NAME})[ /-](?P<y3>\d{{4}})|"
    rf"(?P<mo4>{_NAME}) {{1,2}}(?P<d4>\d{{1,2}}),? (?:(?P<y4>\d{{4}}),?(?= ))?|"
    r"(?P<y5>20\d\d)(?P<mo5>[01]\d)(?P<d5>[0-3]\d)|"
    r"[01]?\d[-/][0-3]?\d)"
)
_CLOCK = re.compile(
    rf"(?<![0-9A-Za-z_.])(?<!\d:)(?<!\b[0-9a-f]:)(?<!\b[0-9a-f][0-9a-f]:)(?:{_DATE}(?:,? ?T?| |_|-|,|:){{0,1}} ?(?<=[T _,:-])|(?P<y6>\d{{4}})年(?P<mo6>\d{{1,2}})月(?P<d6>\d{{1,2}})日 ?)?"
    r"(?P<h>\d{1,2}):(?P<mi>\d\d):(?P<s>\d\d)"
    r"(?:[.:](?P<fz>\d{3}[,.]\d{3})(?!\d)|\.(?P<f>\d{1,9})|,(?P<fc>\d{3}(?:\d{3}){0,2})(?!\d)|:(?P<fm>\d{3})(?!\d)|"
    r"\ (?P<fs>\d{3})(?=\ ?(?:ms|мс)\b)|\ \((?P<fp>\d{3})\))?"
    r"(?:\ ?(?P<half>[AaPp])\.?[Mm]\.?)?(?:\ ?(?P<zone>Z\b|[+-]\d\d:?\d\d|UTC\b|GMT\b))?"
    r"(?:(?=[i-wyz][a-z]{2}|[tr]x(?![0-9a-z]))|(?![0-9a-z_]|\.\d)(?(f)|(?!:[0-9a-f]{1,2}(?!\w))))"
    r"(?:\ (?P<y7>20\d\d)(?=[\]) ]))?",
    re.IGNORECASE,
)
_FRACTIONS: Final = ("fz", "f", "fc", "fm", "fs", "fp")
_BARE_DATE = re.compile(
    r"(?<![\w.:-])(?:\d{4}[-/]\d\d[-/]\d\d|\d\d[./]\d\d[./]\d{4}|\d{4}\.\d\d\.\d\d)(?![\w:]|[-/.]\w)|"
    r"(?<![\w.:-])\d\d?-(?:jan|feb|mar|apr|may|jun|jul|aug|sep|oct|nov|dec)-\d{2,4}\b",
    re.IGNORECASE,
)
_MINUTE: Final = re.compile(  # of chats and mails: too coarse for a time, but no bytes
    rf"(?<![\w.:-])(?:{_DATE}(?:, | at | в | - | )(?:at |в )?(?P<h>\d{{1,2}}):(?P<mi>\d\d)(?: ?[AaPp]\.?[Mm]\b\.?)?|\d{{1,2}}:\d\d ?[AaPp]\.?[Mm]\b|(?<=\bat )\d{{1,2}}:\d\d)(?![\w:]|[.,]\d)"
    r"|^\s*\[\d\d:\d\d\](?=\s*[^\W\d_])",
    re.IGNORECASE,
)
_LIKELY_MINUTE: Final = re.compile(r"\d:\d\d(?![\d:])")
_LIKELY_CLOCK = re.compile(r"\d:\d\d:\d\d")
_LIKELY_DATE = re.compile(r"\d[-/.](?:\d\d|[A-Za-z])")
_LONG: Final = 4096  # characters: in a longer line times are looked for
_HEAD: Final = 256  # in the first of them alone
_DATE_LENGTH: Final = 40  # characters that a date and a zone take at most
_CLOCK_TAIL: Final = 20  # that a fraction, am or pm and a zone take
_DIGIT = re.compile(r"\d")
_LEAD = r"^[\s\[(|\"']*"
_TITLE: Final = re.compile(
    _LEAD + r"(?:- )?(?:t|ts|time|elapsed|uptime)[ =:]{1,3}(?=\d+(?:[.,]\d+)?(?:ms|us|µs|μs|ns|s)?[\s\]):,;|])", re.I
)
_SECONDS = re.compile(_LEAD + r"\+?(\d{1,10})\.(\d{3,18})(?: ?s)?(?=[\s\]):,;>|\"']|-\D|$)")
_COMMA_SECONDS = re.compile(_LEAD + r"(\d{1,10}),(\d{1,9})(?: ?s)?(?=[;\t])")  # of a table in a comma's country
_NUMBERED_SECONDS = re.compile(r"^\s*\d{1,9}[ \t]+(\d{1,10})\.(\d{6}|\d{9})(?=[ \t])")  # Wireshark's list of packets
_BRACKETED: Final = re.compile(r"^[\w./: -]{1,40}?[:\s]\[\s*(\d{1,7})\.(\d{6})\](?=\s)")  # of a kernel, behind a name
_MINUTES = re.compile(_LEAD + r"(\d{1,3}):([0-5]\d)\.(\d{1,6})(?=[\s\]):,;>|\"'])")  # since some start
_EPOCH = re.compile(_LEAD + r"(1[2-9]\d{11}(?:\d{3}){0,2})(?=[\])]|[\s,:;]+(?![0-9A-Fa-f]{6})\S)")
_EPOCH_SECONDS = re.compile(_LEAD + r"(1[2-9]\d{8})(?=[\])]|[\s,:;]+(?![0-9A-Fa-f]{6})\S)")
_UNIT = re.compile(rf"{_LEAD}\+?(?:[\w-]+\]\s*)?(\d+)(?:\.(\d{{1,9}}))? ?(ms|us|µs|μs|ns|s)(?=[\s\]):,;>|]|$)")
_NUMBERED_UNIT = re.compile(r"^\s*\d{1,9}\s*[|,;\t]\s*(-?)(\d{1,18})(?:\.(\d{1,9}))? ?(ms|us|µs|μs|ns|s)(?=[\s,;|])")
# `10-01-48.958`, `10.01.48,958`, `2026-11-21_10-01-48`, `20261121T100148`, behind a process `2311:20261121:100148.958`
_ODD_CLOCK: Final = re.compile(
    r"^[\s\[(|\"']*(?:(?:\d{1,7}:(?=20\d{6}:))?(?P<date>20\d\d-\d\d-\d\d|20\d\d[01]\d[0-3]\d)[ T_:-](?P<h>\d\d)(?P<sign>[-.]?)(?P<mi>\d\d)(?P=sign)"
    r"(?P<s>\d\d)(?:[.,](?P<f>\d{1,9}))?|(?P<hh>\d\d)(?:(?P<dash>-)|(?P<dot>\.))(?P<mm>\d\d)(?(dash)-|\.)(?P<ss>\d\d)"
    r"(?(dash)[.,]|,)(?P<ff>\d{3}|\d{6}))(?![\w.])"
)
_PARTS: Final = re.compile(  # `0d 0h 12m 3.456s`
    _LEAD + r"(?:(\d{1,5})d ?)?(?:(\d{1,5})h ?)?(\d{1,5})m ?(\d{1,5})(?:\.(\d{1,9}))?s(?=[\s\]):,;>|]|$)"
)
_DAYS: Final = re.compile(r"(?<![\w:.])(\d{1,3}):([0-2]\d):([0-5]\d):([0-5]\d)\.(\d{1,6})(?![\w.])")  # since some start
_CALLED: Final = re.compile(r"\bdatetime(?:\.datetime)?\((\d{4}(?:, ?\d{1,6}){4,6})\)")  # as Python shows one
_ANYWHERE: Final = re.compile(r"(?<![\w.])(1[2-9]\d{8})\.(\d{1,9})(?![\w.])")
_TICKS = re.compile(  # milliseconds since a microcontroller began, or a program, as their logs write them
    r"^\s*(?:(\d{1,10}) \[[\w .#:-]{1,60}\] (?:TRACE|DEBUG|INFO|WARN|ERROR)\b|\[[A-Z]\] ?(\d+)\||[EWIDV] \((\d+)\)(?= )|\[ *(\d+)\](?:\[[EWIDV]\]| \[(?:INFO|DEBUG|WARN|ERR|ERROR|TRACE|VERB) *\]))"
)
_COUNTER = re.compile(  # `1023: TX 01 03`
    r"^\s*(?:\[?(\d{1,10})\]?:|\[ *(\d{1,10})\]|\((\d{1,10})\)|(?<= {2})(\d{1,10})(?= )) ?(?=\W{0,2}(?:\w{0,8}_)?(?:[TR]x|req|resp?|sen[dt]|recv|read|wr|write|in|out)\b|[-=]?[-=<>][->=]|[→←])|^\s*\[ *(\d{1,10})\] (?=\w{1,12}(?:Send|Receive|Write|Read)\b)|^\s*(?:\[(\d{4,10})\]|(\d{4,10}) ?:) (?=(?:[\w.-]{1,16}:? ){1,3}(?:[TR]x|sen[dt]|recv|reply)\b)|^\s*(\d{4,10})(?: ?[|;,\t]| (?=\S)) ?(?=\W{0,2}(?:[TR]x\b|[-=]?[-=<>][->=]|[→←]))",
    re.I,
)
_LAST = re.compile(r"[\w\"')\]}][ \t](1[2-9]\d{8})(\d{3}|\d{9})\s*$")  # as InfluxDB's lines end
_KEYED = re.compile(  # epochs in JSON, YAML and logfmt
    r"(?:[\"'](?:ts|t|time|at|date|when|t_?ms|[\w.]*(?:time_?stamp|epoch))[\"'] ?: ?(?:\[\s*)?|(?<![\w.])(?:ts|time_?stamp)(?:=|: ))"
    r"[\"']?(1[2-9]\d{8})(?:\.(\d{1,9})|(\d{3}|\d{6}|\d{9})(?!\d))?",
    re.IGNORECASE,
)
_KEYED_COUNT: Final = re.compile(  # `"time_ms": 1012`, `"t": 1.012`
    r"[\"'](?:ts|t|time|time_?stamp|elapsed|uptime)(?:[ _]?\(?(ms|us|µs|ns|s|sec)\)?[\"'] ?: ?[\"']?(\d{1,18})(?:\.(\d{1,9}))?"
    r"|[\"'] ?: ?[\"']?(?:(\d{1,9})\.(\d{1,9})|0(?![\d.:])))",
    re.IGNORECASE,
)
UNIT_NS: Final = {"s": 10**9, "ms": 10**6, "us": 10**3, "µs": 10**3, "μs": 10**3, "ns": 1}
TITLE_UNIT_NS: Final = {  # as titles of columns write them
    **UNIT_NS, "sec": 10**9, "second": 10**9, "seconds": 10**9, "с": 10**9, "сек": 10**9,
    "milliseconds": 10**6, "мс": 10**6, "microseconds": 10**3, "мкс": 10**3, "nanoseconds": 1, "нс": 1,
}  # fmt: skip
_EPOCH_DAY: Final = datetime(1970, 1, 1, tzinfo=UTC)


@dataclass(frozen=True, slots=True)
class Stamp:
    """A time in ns: of the day if `of_day`, else since 1970 (UTC) or since some start.

    `zoned` is whether the text itself named a zone; `fine` whether it goes beyond whole seconds. `places` are the
    digits behind a point, where it has one. `signed` is one with a plus: since some start, or since the time above.
    `counter` is a number that may count milliseconds, or lines.
    """

    t_ns: int
    of_day: bool
    zoned: bool = True
    fine: bool = True
    places: int = 0
    signed: bool = False
    counter: bool = False


def find(text: str, zone: tzinfo | None = UTC) -> tuple[Stamp | None, str]:
    """The first stamp of a line, and the line with every time and date in it blanked by as many spaces.

    `zone` is that of dates without one; None for this machine's.
    """
    if len(text) > _LONG:
        stamp, head = find(text[:_HEAD], zone)
        return stamp, head + text[_HEAD:]
    if _DIGIT.search(text) is None:
        return None, text
    stamp = None
    if (match := _TITLE.match(text)) is not None:
        text = _blanked(text, match)
    for pattern, value in _COUNTS:
        if match := pattern.match(text):
            stamp = value(match)
            stamp = replace(stamp, signed=True) if "+" in match[0] else stamp
            text = _blanked(text, match)
            break
    if stamp is None and (":" in text or "=" in text) and (match := _KEYED.search(text)) is not None:
        stamp = _of_seconds_and_more(match[1], match[2] or match[3])
        text = _blanked(text, match)
    elif stamp is None and (match := _KEYED_COUNT.search(text)) is not None:
        stamp = _of_keyed_count(match)
        text = _blanked(text, match)
    if stamp is None and (match := _LAST.search(text)) is not None:
        stamp = _of_seconds_and_more(match[1], match[2])
        text = text[: match.start(1)].ljust(len(text))
    likely = _LIKELY_CLOCK.search(text)
    for sign, found, written in _CLOCKS if stamp is None and likely is None else ():
        match = found(text) if sign in text else None
        clock = None if match is None else _of_clock_written(written(match), zone)
        if match is not None and clock is not None:
            stamp = clock
            text = _blanked(text, match)
    timed = likely is not None
    while likely is not None:
        end = likely.end()
        limit = end + _DATE_LENGTH
        for match in _CLOCK.finditer(text, max(likely.start() - _DATE_LENGTH, 0), limit):
            if match.end() + _CLOCK_TAIL > limit and match.start() > likely.start():
                break  # another, which is looked at whole below
            end = max(end, match.end())
            if (clock := _of_clock(match, zone)) is not None:
                stamp = clock if stamp is None else _finer(stamp, clock)
                text = _blanked(text, match)
        likely = _LIKELY_CLOCK.search(text, end)
    if stamp is None and timed and (match := _DAYS.search(text)) is not None:
        stamp = _of_parts(match)
        text = _blanked(text, match)
    if stamp is None and ":" in text and _LIKELY_MINUTE.search(text):
        text = _MINUTE.sub(lambda match: " " * len(match[0]), text)
    if _LIKELY_DATE.search(text):
        for match in _BARE_DATE.finditer(text):
            text = _blanked(text, match)
    if stamp is None and (match := _BRACKETED.match(text)) is not None:
        stamp = _of_seconds(match)
        text = _blanked(text, match, 1)
    if stamp is None and "." in text and (match := _ANYWHERE.search(text)) is not None:
        stamp = _of_seconds_and_more(match[1], match[2])
        text = _blanked(text, match)
    if stamp is not None and abs(stamp.t_ns) >= TIME_LIMIT:
        stamp = None
    return stamp, text


def _finer(stamp: Stamp, clock: Stamp) -> Stamp:
    """A time to the second with the fraction of the same second that stands elsewhere in its line."""
    fraction = (clock.t_ns - stamp.t_ns) % _MINUTE_NS
    if stamp.fine or not clock.fine or fraction >= 10**9:
        return stamp
    return replace(stamp, t_ns=stamp.t_ns + fraction, fine=True)


def _blanked(text: str, match: re.Match[str], group: int = 0) -> str:
    return text[: match.start(group)] + " " * (match.end() - match.start(group)) + text[match.end() :]


def _fraction(digits: str | None, unit_ns: int = 10**9) -> int:
    if not digits:
        return 0
    return int(int(digits) * unit_ns // 10 ** len(digits))


def _of_seconds(match: re.Match[str]) -> Stamp:
    return Stamp(int(match[1]) * 10**9 + _fraction(match[2]), of_day=False, places=len(match[2]))


def _of_minutes(match: re.Match[str]) -> Stamp:
    return Stamp((int(match[1]) * 60 + int(match[2])) * 10**9 + _fraction(match[3]), of_day=False)


def _of_epoch(match: re.Match[str]) -> Stamp:
    return Stamp(int(int(match[1]) * 10 ** (19 - len(match[1]))), of_day=False, fine=len(match[1]) > len("1700000000"))


def _of_seconds_and_more(seconds: str, fraction: str | None) -> Stamp:
    return Stamp(int(seconds) * 10**9 + _fraction(fraction), of_day=False, fine=fraction is not None)


def _of_keyed_count(match: re.Match[str]) -> Stamp:
    if match[1] is None:
        return Stamp(int(match[4] or 0) * 10**9 + _fraction(match[5]), of_day=False)
    unit = TITLE_UNIT_NS[match[1].lower()]
    return Stamp(int(match[2]) * unit + _fraction(match[3], unit), of_day=False)


def _of_unit(match: re.Match[str]) -> Stamp:
    unit = UNIT_NS[match[3]]
    return Stamp(int(match[1][:19]) * unit + _fraction(match[2], unit), of_day=False)


def _of_numbered_unit(match: re.Match[str]) -> Stamp:
    unit = UNIT_NS[match[4]]
    t_ns = int(match[2]) * unit + _fraction(match[3], unit)
    return Stamp(-t_ns if match[1] else t_ns, of_day=False)


def _of_ticks(match: re.Match[str]) -> Stamp:
    return Stamp(int(next(filter(None, match.groups()))[:19]) * 10**6, of_day=False)


def _of_counter(match: re.Match[str]) -> Stamp:
    return Stamp(int(next(filter(None, match.groups()))) * 10**6, of_day=False, counter=True)


def _of_parts(match: re.Match[str]) -> Stamp:
    days, hours, minutes, seconds = (int(part or 0) for part in match.groups()[:4])
    whole = ((days * 24 + hours) * 60 + minutes) * 60 + seconds
    return Stamp(whole * 10**9 + _fraction(match[5]), of_day=False)


_COUNTS: Final = (
    (_SECONDS, _of_seconds),
    (_COMMA_SECONDS, _of_seconds),
    (_NUMBERED_SECONDS, _of_seconds),
    (_MINUTES, _of_minutes),
    (_PARTS, _of_parts),
    (_EPOCH, _of_epoch),
    (_EPOCH_SECONDS, _of_epoch),
    (_UNIT, _of_unit),
    (_NUMBERED_UNIT, _of_numbered_unit),
    (_TICKS, _of_ticks),
    (_COUNTER, _of_counter),
)


def _of_clock(match: re.Match[str], zone: tzinfo | None) -> Stamp | None:
    hour, minute, second = int(match["h"]), int(match["mi"]), int(match["s"])
    if hour > 23 or minute > 59 or second > 60:
        return None
    half = match["half"]
    if half:
        hour = hour % 12 + (12 if half in "Pp" else 0)
    fraction = next((match[name] for name in _FRACTIONS if match[name]), "").replace(",", "").replace(".", "")
    t_ns = (hour * 3600 + minute * 60 + second) * 10**9 + _fraction(fraction)
    date = _date(match, american=bool(half))
    if date is None:
        return Stamp(t_ns, of_day=True, fine=bool(fraction), places=len(match["f"] or ""))
    try:
        seconds = _midnight(*date, match["zone"], zone, hour)
    except (ValueError, OverflowError):
        return None
    t_ns += seconds * 10**9
    zoned = bool(match["zone"])
    return Stamp(t_ns, of_day=False, zoned=zoned, fine=bool(fraction), places=len(match["f"] or ""))


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


_CLOCKS: Final = (("", _ODD_CLOCK.match, _with_colons), ("datetime(", _CALLED.search, _of_call))


def _date(match: re.Match[str], *, american: bool) -> tuple[int, int, int] | None:
    """Year, month and day; None where the text has no date, or one without a year."""
    for i in ("", "2", "3", "4", "5", "6"):
        if (month := match[f"mo{i}"]) is None:
            continue
        year, day = match[f"y{i}"] or match["y7"], int(match[f"d{i}"])
        if year is None:
            return None
        number = _MONTHS.index(month[:3].lower()) + 1 if month[:1].isalpha() else int(month)
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
