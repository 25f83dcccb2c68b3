"""Times that count: seconds since some start or since 1970, numbers with a unit, ticks, numbers that may be times.

A few stand anywhere in a line, most where it begins. Of some only their order tells that they are times (`counter`).
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import Final

SECOND_NS: Final = 1_000_000_000
LEAD: Final = r"^[\s\[(|\"']*+"  # what may stand before the time that a line begins with
_TITLE: Final = re.compile(
    LEAD
    + r"(?:- )?(?:t|ts|time|time_?stamp|elapsed|uptime)[ =:+]{1,3}(?=\d+(?:[.,]\d+)?(?:ms|us|µs|μs|ns|s)?[\s\]):,;|])",
    re.I,
)
_UNIT_FIRST: Final = re.compile(  # `Timestamp (us): 4701393`
    LEAD
    + r"(?:t|ts|time|time_?stamp)[ _]?\(?(ms|us|µs|μs|ns|s|sec)\)? {0,9}[:=] ?(\d{1,18})(?:\.(\d{1,9}))?(?![\w.:])",
    re.I,
)
_FIRST: Final = re.compile(  # what a line begins with: no clock, as most logs have it
    LEAD + r"(?!(?:\d{4}-\d\d-\d\d[ T])?\d\d:\d\d:\d)(?:(?P<number>[-+#]?\d)|[^\W\d_])"
)
_BRACKETED: Final = re.compile(r"^[\w./: -]{1,40}?[:\s]\[\s*()(\d{1,7})\.(\d{6})\](?=\s)")  # of a kernel, behind a name
_MINUTES = re.compile(  # since some start
    LEAD + r"(\d{1,3}):([0-5]\d)(?:\.(\d{1,6})(?=[\s\]):,;>|\"'])|,(\d{1,6})(?=[;\t]))"
)
_COMMA_UNITS: Final = ("мс", "мкс", "с")  # of countries that write `12,5`
_FINE: Final = 3  # digits of a fraction that make a number seconds
_SECONDS_MOST: Final = 10  # digits
_UNITS: Final = "ms|us|µs|μs|ns|s|мс|мкс|нс"
_VALUE: Final = (
    r"(?P<sign>[-+]?)(?:[\w-]+\]\s*)?(?P<whole>\d{1,18})(?:(?P<point>[.,])(?P<part>\d{1,18}))? ?"
    rf"(?P<unit>{_UNITS}|с)?(?=[\s\]):,;>|\"']|-\D|$)"
)
_NUMBER: Final = re.compile(LEAD + _VALUE)  # `12.345678`, `15.2ms`, `12,5 мс`
_NUMBERED: Final = re.compile(r"^\s*\d{1,9}(?:\s*(?P<by>[|,;\t])\s*|[ ]+)" + _VALUE)  # behind the number of a row
_PARTS: Final = re.compile(  # `0d 0h 12m 3.456s`
    LEAD + r"(?:(\d{1,5})d ?)?(?:(\d{1,5})h ?)?(\d{1,5})m ?(\d{1,5})(?:\.(\d{1,9}))?s(?=[\s\]):,;>|]|$)"
)
_DAYS: Final = re.compile(r"(?<![\w:.])(\d{1,3}):([0-2]\d):([0-5]\d):([0-5]\d)\.(\d{1,6})(?![\w.])")  # since some start
_ANYWHERE: Final = re.compile(  # never of an even number of digits, as bytes in hex have
    r"(?<![\w.])(1[2-9]\d{8})(?:\.(\d{1,9})|(\d{3}|\d{9}))(?![\w.])"
)
_TICKS = re.compile(  # milliseconds since a microcontroller began, or a program, as their logs write them
    r"^\s*(?:(\d{1,10}) \[[\w .#:-]{1,60}\] (?:TRACE|DEBUG|INFO|WARN|ERROR)\b|\[[A-Z]\] ?(\d+)\||[EWIDV] \((\d+)\)(?= )"
    r"|\[ *(\d+)\](?:\[[EWIDV]\]| \[(?:INFO|DEBUG|WARN|ERR|ERROR|TRACE|VERB) *\]))"
)
_ARROW: Final = r"[-=]?[-=<>][->=]|[→←]"
_AHEAD: Final = (  # of a mark
    r"(?=\W{0,2}(?:\w{0,8}_)?(?:[TR]x|req|resp?|sen[dt]|recv|read|wr|write|in|out|запрос|ответ|отпр\w*|прин\w*)\b"
    rf"|{_ARROW})"
)
_COUNTER = re.compile(  # `1023: TX 01 03`
    r"^\s*(?:(?:\[?#?(\d{1,10})\]?[:>]|\[ *(\d{1,10})\]|\((\d{1,10})\)|#(\d{4,10})|(?<= {2})(\d{1,10})(?= )) ?"
    rf"{_AHEAD}|"
    r"\[ *(\d{1,10})\] (?=\w{1,12}(?:Send|Receive|Write|Read)\b)|"
    r"(?:\[(\d{4,10})\]|(\d{4,10}) ?:) (?=(?:[\w.-]{1,16}:? ){1,3}(?:[TR]x|sen[dt]|recv|reply)\b)|"
    rf"(\d{{4,10}})(?: ?[|;,\t] ?{_AHEAD}|(?: ?[|;,\t]| (?=\S)) ?(?=\W{{0,2}}(?:[TR]x\b|{_ARROW}))))",
    re.I,
)
_FEW_PLACES: Final = re.compile(rf"{LEAD}()(\d{{1,10}})\.(\d\d?)[\])]?[ \t:;|]+{_AHEAD}", re.I)
_DOTTED: Final = re.compile(LEAD + r"([01]?\d|2[0-3])\.([0-5]\d)\.([0-5]\d)\.(\d{3})(?=[\s\]),;|])")  # no address
_TIME: Final = r"(?:ts|t|time|time_?stamp|elapsed|uptime)"
_NAMED: Final = re.compile(  # `t=0.015`, `elapsed=15ms`
    rf"(?<![\w.\"']){_TIME}=\+?(?:(\d{{1,10}})\.(\d{{1,9}})()|(\d{{1,18}})(?:\.(\d{{1,9}}))? ?({_UNITS}))(?![\w.])",
    re.I,
)
_KEYED = re.compile(  # epochs in JSON, YAML and logfmt
    r"(?:[\"'](?:ts|t|time|at|date|when|t_?ms|[\w.]*(?:time_?stamp|epoch))[\"'] ?: ?(?:\[\s*)?|"
    r"(?<![\w.])(?:ts|time_?stamp)(?:=|: ))[\"']?(1[2-9]\d{8})(?:\.(\d{1,9})|(\d{3}|\d{6}|\d{9})(?!\d))?",
    re.IGNORECASE,
)
_KEYED_COUNT: Final = re.compile(  # `"time_ms": 1012`, `"t": 1.012`, `"t": 1012`
    rf"[\"']{_TIME}(?:[ _]?\(?(ms|us|µs|ns|s|sec)\)?[\"'] ?: ?[\"']?(\d{{1,18}}+)(?:\.(\d{{1,9}}+))?+"
    r"(?=\s*(?:[\"',}\]]|$))"  # no date
    r"|[\"'] ?: ?[\"']?(?:(\d{1,9})\.(\d{1,9})|0(?![\d.:])|([1-9]\d{0,10})(?=[\"',}\]])))",
    re.IGNORECASE,
)
UNIT_NS: Final = {"s": 10**9, "ms": 10**6, "us": 10**3, "µs": 10**3, "μs": 10**3, "ns": 1}
TITLE_UNIT_NS: Final = {  # as titles of columns write them
    **UNIT_NS, "sec": 10**9, "second": 10**9, "seconds": 10**9, "с": 10**9, "сек": 10**9,
    "milliseconds": 10**6, "msec": 10**6, "мс": 10**6, "мсек": 10**6,
    "microseconds": 10**3, "usec": 10**3, "мкс": 10**3, "nanoseconds": 1, "nsec": 1, "нс": 1,
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Stamp:
    """A time in ns: of the day if `of_day`, else since 1970 (UTC) or since some start.

    `zoned` is whether the text itself named a zone; `fine` whether it goes beyond whole seconds. `places` are the
    digits behind a point, where it has one. `signed` is one with a plus: since some start, or since the time above.
    `counter` is a number that may be a time, or count lines. `unnamed` is one without a unit: seconds with a fraction,
    milliseconds without one.
    """

    t_ns: int
    of_day: bool
    zoned: bool = True
    fine: bool = True
    places: int = 0
    signed: bool = False
    counter: bool = False
    unnamed: bool = False


def fraction(digits: str | None, unit_ns: int = 10**9) -> int:
    """The ns of the digits behind a point."""
    if not digits:
        return 0
    return int(int(digits) * unit_ns // 10 ** len(digits))


def _of_number(match: re.Match[str]) -> Stamp | None:
    """A number with a unit, or seconds to the millisecond at least; None of others."""
    groups = match.groupdict()
    whole, part, unit, comma = groups["whole"], groups["part"], groups["unit"], groups["point"] == ","
    if unit is not None:
        if unit not in _COMMA_UNITS if comma else unit == "с":
            return None
        size = TITLE_UNIT_NS[unit]
    elif comma or part is None or len(part) < _FINE or len(whole) > _SECONDS_MOST:
        return None
    else:
        size = SECOND_NS
    t_ns = int(whole) * size + fraction(part, size)
    return Stamp(
        -t_ns if groups["sign"] == "-" else t_ns, of_day=False, places=0 if unit else len(part or ""), unnamed=not unit
    )


def _of_numbered(match: re.Match[str]) -> Stamp | None:
    exact = match["unit"] is None and len(match["part"] or "") in (6, 9)
    return _of_number(match) if exact or (match["unit"] is not None and match["by"] is not None) else None


def _of_worded(match: re.Match[str]) -> Stamp | None:
    return _of_number(match) if match["unit"] is not None else None


def _of_seconds(match: re.Match[str]) -> Stamp:
    sign, whole, part = match.groups()
    t_ns = int(whole) * 10**9 + fraction(part)
    return Stamp(-t_ns if sign == "-" else t_ns, of_day=False, places=len(part), unnamed=True)


def _of_minutes(match: re.Match[str]) -> Stamp:
    return Stamp((int(match[1]) * 60 + int(match[2])) * 10**9 + fraction(match[3] or match[4]), of_day=False)


def _of_seconds_and_more(seconds: str, part: str | None) -> Stamp:
    return Stamp(int(seconds) * 10**9 + fraction(part), of_day=False, fine=part is not None)


def _of_keyed_count(match: re.Match[str]) -> Stamp:
    if match[6] is not None:
        return Stamp(int(match[6]) * 10**6, of_day=False, counter=True, unnamed=True)
    if match[1] is None:
        return Stamp(int(match[4] or 0) * 10**9 + fraction(match[5]), of_day=False)
    return _of_unit_first(match)


def _of_unit_first(match: re.Match[str]) -> Stamp:
    unit = TITLE_UNIT_NS[match[1].lower()]
    return Stamp(int(match[2]) * unit + fraction(match[3], unit), of_day=False)


def _of_ticks(match: re.Match[str]) -> Stamp:
    return Stamp(int(next(filter(None, match.groups()))[:19]) * 10**6, of_day=False)


def _of_counter(match: re.Match[str]) -> Stamp:
    return Stamp(int(next(filter(None, match.groups()))) * 10**6, of_day=False, counter=True, unnamed=True)


def _of_few_places(match: re.Match[str]) -> Stamp:
    return replace(_of_seconds(match), counter=True)


def _of_dotted(match: re.Match[str]) -> Stamp:
    return replace(_of_parts(match), of_day=True, counter=True)


def _of_named(match: re.Match[str]) -> Stamp:
    whole, part, unit = match.groups()[:3] if match[1] else match.groups()[3:]
    size = TITLE_UNIT_NS[unit.lower() or "s"]
    return Stamp(int(whole) * size + fraction(part, size), of_day=False, counter=True)


def _of_parts(match: re.Match[str]) -> Stamp:
    *parts, part = match.groups()
    days, hours, minutes, seconds = [0, *(int(part or 0) for part in parts)][-4:]
    whole = ((days * 24 + hours) * 60 + minutes) * 60 + seconds
    return Stamp(whole * 10**9 + fraction(part), of_day=False)


_COUNTS: Final = (
    (_NUMBER, _of_number),
    (_NUMBERED, _of_numbered),
    (_MINUTES, _of_minutes),
    (_PARTS, _of_parts),
    (_TICKS, _of_ticks),
    (_COUNTER, _of_counter),
    (_FEW_PLACES, _of_few_places),
    (_DOTTED, _of_dotted),
)
_WORDED: Final = ((_NUMBER, _of_worded), (_TICKS, _of_ticks))  # behind a word


def count_at_begin(text: str) -> tuple[Stamp | None, str]:
    """The count that a line begins with, or that has a key of its own, and the line with blanks in its place."""
    if (match := _TITLE.match(text)) is not None:
        text = blanked(text, match)
    if (match := _UNIT_FIRST.match(text)) is not None:
        return _of_unit_first(match), blanked(text, match)
    first = _FIRST.match(text)
    for pattern, value in () if first is None else _COUNTS if first["number"] else _WORDED:
        if (match := pattern.match(text)) is not None and (stamp := value(match)) is not None:
            return replace(stamp, signed=True) if "+" in match[0] else stamp, blanked(text, match)
    if (":" in text or "=" in text) and (match := _KEYED.search(text)) is not None:
        return _of_seconds_and_more(match[1], match[2] or match[3]), blanked(text, match)
    if (match := _KEYED_COUNT.search(text)) is not None:
        return _of_keyed_count(match), blanked(text, match)
    return None, text


def count_with_days(text: str) -> tuple[Stamp | None, str]:
    """`1:10:01:48.958`: days, hours, minutes and seconds since some start."""
    match = _DAYS.search(text)
    return (None, text) if match is None else (_of_parts(match), blanked(text, match))


def count_anywhere(text: str) -> tuple[Stamp | None, str]:
    """The count that stands somewhere in a line, and the line with blanks in its place."""
    if (match := _BRACKETED.match(text)) is not None:
        return _of_seconds(match), blanked(text, match, 2)
    if (match := _ANYWHERE.search(text)) is not None:
        return _of_seconds_and_more(match[1], match[2] or match[3]), blanked(text, match)
    if "=" in text and (match := _NAMED.search(text)) is not None:
        return _of_named(match), blanked(text, match)
    return None, text


def blanked(text: str, match: re.Match[str], group: int = 0) -> str:
    """A text with blanks in place of what was found."""
    return text[: match.start(group)] + " " * (match.end() - match.start(group)) + text[match.end() :]
