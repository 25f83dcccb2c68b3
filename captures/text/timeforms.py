"""How people and programs write times, a row each.

A row's pattern names what it finds: `y mo d h mi s f zone half` of a date and a clock, `days` since some start, `n f
unit` of a count, `sign` before one, `us` microseconds. `form` is what such a time is, but for the time itself.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Final, NamedTuple


@dataclass(frozen=True, slots=True)
class Stamp:
    """A time in ns: of the day if `of_day`, else since 1970 (UTC) or since some start.

    `zoned` is whether the text itself named a zone; `fine` whether it goes beyond whole seconds. `places` are the
    digits behind a point, where it has one. `signed` is one with a plus: since some start, or since the time above.
    `counter` is a number that may be a time, or count lines. `unnamed` is one without a unit: seconds with a fraction,
    milliseconds without one.
    """

    t_ns: int = 0
    of_day: bool = False
    zoned: bool = True
    fine: bool = True
    places: int = 0
    signed: bool = False
    counter: bool = False
    unnamed: bool = False


class TimeForm(NamedTuple):
    """A row: `sign` is in every line that has such a time, `unit` is that in ns of a count that names none."""

    sign: str
    pattern: re.Pattern[str]
    unit: int
    form: Stamp


SECOND_NS: Final = 1_000_000_000
_MS: Final = 1_000_000
UNIT_NS: Final = {  # as titles of columns write them, too
    "s": 10**9, "ms": 10**6, "us": 10**3, "µs": 10**3, "μs": 10**3, "ns": 1,
    "sec": 10**9, "second": 10**9, "seconds": 10**9, "с": 10**9, "сек": 10**9,
    "milliseconds": 10**6, "msec": 10**6, "мс": 10**6, "мсек": 10**6,
    "microseconds": 10**3, "usec": 10**3, "мкс": 10**3, "nanoseconds": 1, "nsec": 1, "нс": 1,
}  # fmt: skip
MONTHS: Final = {  # by the first three letters of their names in English, German and Russian
    name: number
    for names in (
        "jan feb mar apr may jun jul aug sep oct nov dec",
        "jan feb mär apr mai jun jul aug sep okt nov dez",
        "янв фев мар апр мая июн июл авг сен окт ноя дек",
    )
    for number, name in enumerate(names.split(), 1)
}
_LEAD: Final = r"^[\s\[(|\"']*+"  # what may stand before the time that a line begins with
_END: Final = r"(?=[\s\]):,;>|\"']|-\D|$)"
_UNIT: Final = "(?P<unit>ms|[uµμ]s|ns|s|мк?с|нс)"
_SIGN: Final = r"(?P<sign>[-+]?)"
_ROW: Final = r"^\s*\d{1,9}(?:\s*[|,;\t]\s*|[ ]+)"  # the number of a row
_CELLED: Final = r"^\s*\d{1,9}\s*[|,;\t]\s*"
_NUMBER: Final = rf"{_SIGN}(?:[\w-]+\]\s*)?(?P<n>\d{{1,18}})"
_POINT: Final = rf"{_NUMBER}(?:\.(?P<f>\d{{1,18}}))? ?{_UNIT}{_END}"
_COMMA: Final = rf"{_NUMBER},(?P<f>\d{{1,18}}) ?(?P<unit>мк?с|с){_END}"
_ARROW: Final = r"[-=]?[-=<>][->=]|[→←]"
_AHEAD: Final = (  # of a mark
    r"(?=\W{0,2}(?:\w{0,8}_)?(?:[TR]x|req|resp?|sen[dt]|recv|read|wr|write|in|out|запрос|ответ|отпр\w*|прин\w*)\b"
    rf"|{_ARROW})"
)
_TIME: Final = r"(?:ts|t|time|time_?stamp|elapsed|uptime)"
_SAYS: Final = r"(?P<unit>ms|[uµμ]s|ns|s|sec)"
_EPOCH: Final = r"(?P<n>1[2-9]\d{8})"
_COUNT: Final = Stamp()
_BARE: Final = Stamp(unnamed=True)
_MAYBE: Final = Stamp(counter=True)
_BARE_MAYBE: Final = Stamp(counter=True, unnamed=True)
_WHOLE: Final = Stamp(fine=False)  # fine where it has a fraction
_OF_DAY: Final = Stamp(of_day=True, fine=False)


def _forms(*rows: tuple[str, str, int, Stamp]) -> tuple[TimeForm, ...]:
    return tuple(TimeForm(sign, re.compile(pattern, re.IGNORECASE), unit, form) for sign, pattern, unit, form in rows)


FIRST, TITLE = (
    re.compile(_LEAD + pattern, re.IGNORECASE)
    for pattern in (
        # what a count begins with: no clock, as most logs have it
        r"(?!(?:\d{4}-\d\d-\d\d[ T])?\d\d:\d\d:\d)(?:[-+#]?\d|[^\W\d_])",
        rf"(?:- )?{_TIME}[ =:+]{{1,3}}(?=\d+(?:[.,]\d+)?(?:ms|[uµμ]s|ns|s)?[\s\]):,;|])",
    )
)
AT_BEGIN: Final = _forms(
    (",", f"(?:{_LEAD}|{_CELLED}){_COMMA}", 0, _COUNT),
    ("", f"(?:{_LEAD}|{_CELLED}){_POINT}", 0, _COUNT),
    (".", rf"{_LEAD}{_SIGN}(?:\d[\w-]*\]\s*)?(?P<n>\d{{1,10}})\.(?P<f>\d{{3,18}}) ?{_END}", SECOND_NS, _BARE),
    (".", rf"{_ROW}{_SIGN}(?P<n>\d{{1,10}})\.(?P<f>\d{{6}}(?:\d{{3}})?) ?{_END}", SECOND_NS, _BARE),
    # since some start: `12:48.958`, `0d 0h 12m 3.456s`
    (":", _LEAD + r"(?P<mi>\d{1,3}):(?P<s>[0-5]\d)(?:\.|,(?=\d+[;\t]))(?P<f>\d{1,6})(?=[\s\]):,;>|\"'])", SECOND_NS,
     _COUNT),
    ("", _LEAD + r"(?:(?P<days>\d{1,5})d ?)?(?:(?P<h>\d{1,5})h ?)?(?P<mi>\d{1,5})m ?(?P<s>\d{1,5})(?:\.(?P<f>\d{1,9}))?"
     r"s(?=[\s\]):,;>|]|$)", SECOND_NS, _COUNT),
    # milliseconds since a microcontroller began, or a program, as their logs write them
    ("[", r"^\s*(?P<n>\d{1,10}) \[[\w .#:-]{1,60}\] (?:TRACE|DEBUG|INFO|WARN|ERROR)\b", _MS, _COUNT),
    ("[", r"^\s*\[ *(?P<n>\d{1,19})\](?:\[[EWIDV]\]| \[(?:INFO|DEBUG|WARN|ERR|ERROR|TRACE|VERB) *\])", _MS, _COUNT),
    # `1023: TX 01 03`, `[1023] -> 01 03`, `1023;TX;01 03`, `[12] PortSend`
    ("", rf"^\s*[\[(]?[ #]*(?P<n>\d{{1,10}})(?:[\])]?[:>]|[\])]) ?"
     rf"(?:{_AHEAD}|(?=\w{{1,12}}(?:Send|Receive|Write|Read)\b))", _MS, _BARE_MAYBE),
    ("", rf"^\s*(?:#|(?<= {{2}})(?=\d+ )|(?=\d{{4}}))(?P<n>\d{{1,10}})[ |;,\t]{{1,3}}{_AHEAD}", _MS, _BARE_MAYBE),
    ("", r"^\s*\[?(?P<n>\d{4,10})(?:\]| ?:) (?=(?:[\w.-]{1,16}:? ){1,3}(?:[TR]x|sen[dt]|recv|reply)\b)", _MS,
     _BARE_MAYBE),
    (".", rf"{_LEAD}(?P<n>\d{{1,10}})\.(?P<f>\d\d?)[\])]?[ \t:;|]+{_AHEAD}", SECOND_NS, _BARE_MAYBE),
    (".", _LEAD + r"(?P<h>[01]?\d|2[0-3])\.(?P<mi>[0-5]\d)\.(?P<s>[0-5]\d)\.(?P<f>\d{3})(?=[\s\]),;|])", 0,
     Stamp(of_day=True, counter=True)),
)  # fmt: skip
BEHIND_WORD: Final = _forms(  # of a line that begins with a letter
    ("", rf"{_LEAD}{_TIME}[ _]?\(?{_SAYS}\)? {{0,9}}[:=] ?(?P<n>\d{{1,18}})(?:\.(?P<f>\d{{1,9}}))?(?![\w.:])",
     0, _COUNT),
    ("", _LEAD + _POINT, 0, _COUNT),
    (",", _LEAD + _COMMA, 0, _COUNT),
    ("", r"^\s*(?:\[[A-Z]\] ?|[EWIDV] \()(?P<n>\d{1,19})(?:\||\)(?= ))", _MS, _COUNT),
)  # fmt: skip
KEYED: Final = _forms(  # in JSON, YAML and logfmt
    ("", r"(?:[\"'](?:ts|t|time|at|date|when|t_?ms|[\w.]*(?:time_?stamp|epoch))[\"'] ?: ?(?:\[\s*)?|"
     rf"(?<![\w.])(?:ts|time_?stamp)(?:=|: ))[\"']?{_EPOCH}"
     r"(?:\.(?P<f>\d{1,9})|(?P<more>\d{3}|\d{6}|\d{9})(?!\d))?",
     SECOND_NS, _WHOLE),
    (":", rf"[\"']{_TIME}[ _]?\(?{_SAYS}\)?[\"'] ?: ?[\"']?(?P<n>\d{{1,18}}+)(?:\.(?P<f>\d{{1,9}}+))?+"
     r"(?=\s*(?:[\"',}\]]|$))", 0, _COUNT),  # no date
    (":", rf"[\"']{_TIME}[\"'] ?: ?[\"']?(?P<n>\d{{1,9}}(?=\.)|0(?![\d.:]))(?:\.(?P<f>\d{{1,9}}))?", SECOND_NS, _COUNT),
    (":", rf"[\"']{_TIME}[\"'] ?: ?[\"']?(?P<n>[1-9]\d{{0,10}})(?=[\"',}}\]])", _MS, _BARE_MAYBE),
)  # fmt: skip
ANYWHERE: Final = _forms(  # never of an even number of digits, as bytes in hex have
    # `1:10:01:48.958`: days, hours, minutes and seconds since some start
    (":", r"(?<![\w:.])(?P<days>\d{1,3}):(?P<h>[0-2]\d):(?P<mi>[0-5]\d):(?P<s>[0-5]\d)\.(?P<f>\d{1,6})(?![\w.])",
     SECOND_NS, _COUNT),
    ("[", r"(?<=[:\s]\[)\s*(?P<n>\d{1,7})\.(?P<f>\d{6})\](?=\s)", SECOND_NS, _BARE),  # of a kernel
    # behind the text, as the loggers of JavaScript write it
    ("+", rf"(?<=\s)(?P<sign>\+)(?P<n>\d{{1,9}})(?:\.(?P<f>\d{{1,9}}))? ?{_UNIT}\s*$", 0, _COUNT),
    ("1", rf"(?<![\w.]){_EPOCH}(?:\.(?P<f>\d{{1,9}})|(?P<more>\d{{3}}|\d{{9}}))(?![\w.])", SECOND_NS, _WHOLE),
    ("=", rf"(?<![\w.\"']){_TIME}=\+?(?P<n>\d{{1,18}})(?:\.(?P<f>\d{{1,9}}))? ?{_UNIT}(?![\w.])", 0, _MAYBE),
    ("=", rf"(?<![\w.\"']){_TIME}=\+?(?P<n>\d{{1,10}})\.(?P<f>\d{{1,9}})(?![\w.])", SECOND_NS, _MAYBE),
)  # fmt: skip
ODD_CLOCKS: Final = _forms(
    # `2026-11-21_10-01-48`, `20261121T100148`, behind a process `2311:20261121:100148.958`
    ("", _LEAD + r"(?:\d{1,7}:(?=20\d{6}:))?(?P<y>20\d\d)(?P<dash>-?)(?P<mo>[01]\d)(?P=dash)(?P<d>[0-3]\d)[ T_:-]"
     r"(?P<h>\d\d)(?P<by>[-.]?)(?P<mi>\d\d)(?P=by)(?P<s>\d\d)(?:[.,](?P<f>\d{1,9}))?(?P<zone>Z?)(?![\w.])", 0, _OF_DAY),
    # `10-01-48.958`, `10.01.48,958`
    ("", _LEAD + r"(?P<h>\d\d)(?:(?P<dash>-)|\.)(?P<mi>\d\d)(?(dash)-|\.)(?P<s>\d\d)(?(dash)[.,]|,)(?P<f>\d{3}|\d{6})"
     r"(?![\w.])", 0, _OF_DAY),
    # `20261121100148958`: no even number of digits, as bytes in hex have
    ("", _LEAD + r"(?P<y>20\d\d)(?P<mo>[01]\d)(?P<d>[0-3]\d)(?P<h>[0-2]\d)(?P<mi>[0-5]\d)(?P<s>[0-5]\d)"
     r"[.,]?(?P<f>\d{3})(?![\w.])", 0, _OF_DAY),
    # `10时01分48秒958毫秒`, `10 ч 01 мин 48 с`, `10h01m48s`
    ("", r"(?<![\w.])(?P<h>\d{1,2}) ?(?:时|時|ч|h|Uhr) ?(?P<mi>\d\d) ?(?:分|мин|м|min|m) ?(?P<s>\d\d)"
     r"(?:[.,](?P<f>\d{1,6}))? ?(?:秒|сек|с|sec|s)(?:(?P<more>\d{3})(?:毫秒|ms)?)?(?![0-9A-Za-z])", 0,
     Stamp(of_day=True)),
    ("datetime(", r"\b(?:datetime\.)?datetime\((?P<y>\d{4}), ?(?P<mo>\d{1,2}), ?(?P<d>\d{1,2}), ?(?P<h>\d{1,2})"
     r", ?(?P<mi>\d{1,2})(?:, ?(?P<s>\d{1,2})(?:, ?(?P<us>\d{1,6}))?)?\)", 0, Stamp(of_day=True)),
)  # fmt: skip
_NAME: Final = rf"(?:{'|'.join(MONTHS)})[^\W\d_]{{0,6}}\.?"
_DATE: Final = (
    r"(?:(?P<y>\d{4})[-/.](?P<mo>\d{1,2})[-/.](?P<d>\d{1,2})|"
    r"(?P<d2>\d{1,2})(?P<by>[-./])(?P<mo2>\d{1,2})(?P=by)(?P<y2>\d{4}|\d\d)|"
    rf"(?P<d3>\d{{1,2}})\.?[ /-](?P<mo3>{_NAME})[ /-](?P<y3>\d{{4}})(?: г\.)?|"
    rf"(?P<mo4>{_NAME}) {{1,2}}(?P<d4>\d{{1,2}}),? (?:(?P<y4>\d{{4}}),?(?= ))?|"
    r"(?P<y5>20\d\d)(?P<mo5>[01]\d)(?P<d5>[0-3]\d)|"
    r"[01]?\d[-/][0-3]?\d)"
)
CLOCK, BARE_DATE, LIKELY_CLOCK, LIKELY_DATE, DIGIT = (
    re.compile(pattern, re.IGNORECASE)
    for pattern in (
        rf"(?<![0-9A-Za-z_.])(?<!\d:)(?<!\b[0-9a-f]:)(?<!\b[0-9a-f][0-9a-f]:)"
        rf"(?:{_DATE}(?:,? ?T?| |_|-|,|:|,? (?:at|um|в)){{0,1}} ?(?<=[T _,:-])|"
        r"(?P<y6>\d{4})年(?P<mo6>\d{1,2})月(?P<d6>\d{1,2})日 ?)?"
        r"(?P<h>\d{1,2}):(?P<mi>\d\d):(?P<s>\d\d)"
        r"(?:[.:](?P<fz>\d{3}[,.]\d{3})(?!\d)|\.(?P<f>\d{1,9})|,(?P<fc>\d{3}(?:\d{3}){0,2})(?!\d)|:(?P<fm>\d{3})(?!\d)|"
        r" (?P<fs>\d{3})(?= ?(?:ms|мс)\b)| \((?P<fp>\d{3})\)|[-/'](?P<fd>\d{3})(?=[\s\]),;:|]|$))?"
        r"(?: ?(?P<half>[AaPp])\.?[Mm]\.?)?(?: ?(?P<zone>Z\b|[+-]\d\d:?\d\d|UTC\b|GMT\b))?"
        r"(?:(?=[i-wyz][a-z]{2}|[tr]x(?![0-9a-z]))|(?![0-9a-z_]|\.\d)(?(f)|(?!:[0-9a-f]{1,2}(?!\w))))"
        r"(?: (?P<y7>20\d\d)(?=[\]) ]))?",
        r"(?<![\w.:-])(?:\d{4}[-/]\d\d[-/]\d\d|\d\d[./]\d\d[./]\d{4}|\d{4}\.\d\d\.\d\d)(?![\w:]|[-/.]\w)|"
        rf"(?<![\w.:-])\d\d?-{_NAME}-\d{{2,4}}\b",
        r"\d:\d\d:\d\d",
        r"\d[-/.](?:\d\d|[A-Za-z])",
        r"\d",
    )
)
FRACTIONS: Final = ("fz", "fc", "fm", "fs", "fp", "fd", "more", "us")  # besides `f`
DATES: Final = ("", "2", "3", "4", "5", "6")  # ends of names of groups
