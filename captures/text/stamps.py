"""Times in a line of text.

A stamp is a time of day, a date with one, a count of seconds since some start or since 1970, or a number with a unit.
Where digits could be either a time or hex bytes (`11:03:00:64`), what follows decides: a clock has three parts and a
fraction, and its parts are in range.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta, timezone

DAY_NS = 86_400_000_000_000
LIMIT_NS = 1 << 62  # the year 2116: nothing later is a time

_DATE = r"(?:(?P<y>\d{4})[-/.](?P<mo>\d{1,2})[-/.](?P<d>\d{1,2})|(?P<d2>\d{1,2})[./](?P<mo2>\d{1,2})[./](?P<y2>\d{4}))"
_CLOCK = re.compile(
    rf"(?<![\w:.])(?:{_DATE}[T _,]{{1,2}})?(?P<h>\d{{1,2}}):(?P<mi>\d\d):(?P<s>\d\d)"
    r"(?:\.(?P<f>\d{1,9})|,(?P<fc>\d{3}(?:\d{3}){0,2})(?!\d)|:(?P<fm>\d{3})(?!\d))?"
    r"(?:\ ?(?P<half>[AaPp])[Mm])?(?P<zone>Z|[+-]\d\d:?\d\d)?(?!\w|:\w|\.\d)"
)
_BARE_DATE = re.compile(r"(?<![\w.:-])(?:\d{4}[-/]\d\d[-/]\d\d|\d\d[./]\d\d[./]\d{4})(?![\w:]|[-/.]\w)")
_DATE_SIGN = re.compile(r"[-/.]")
_SECONDS = re.compile(r"^[\s\[(]*(\d{1,10})\.(\d{3,9})(?: ?s)?(?=[\s\]):,;>|]|-\D)")
_EPOCH = re.compile(r"^[\s\[(]*(1[2-9]\d{11}(?:\d{3}){0,2})(?=[\])]|[\s,:;]+(?![0-9A-Fa-f]{6})\S)")
_UNIT = re.compile(r"^[\s\[(]*(\d+)(?:\.(\d{1,9}))? ?(ms|us|µs|ns|s)(?=[\s\]):,;>|])")
_UNIT_NS = {"s": 10**9, "ms": 10**6, "us": 10**3, "µs": 10**3, "ns": 1}


@dataclass(frozen=True, slots=True)
class Stamp:
    """A time in ns: of the day if `of_day`, else since 1970 (UTC where no zone is given) or since some start."""

    t_ns: int
    of_day: bool


def find(text: str) -> tuple[Stamp | None, str]:
    """The first stamp of a line, and the line with every time and date in it blanked by as many spaces."""
    stamp = None
    for pattern, value in ((_SECONDS, _of_seconds), (_EPOCH, _of_epoch), (_UNIT, _of_unit)):
        if match := pattern.match(text):
            stamp = Stamp(value(match), of_day=False)
            text = _blanked(text, match)
            break
    for match in _CLOCK.finditer(text) if ":" in text else ():
        if (clock := _of_clock(match)) is not None:
            stamp = stamp or clock
            text = _blanked(text, match)
    for match in _BARE_DATE.finditer(text) if _DATE_SIGN.search(text) else ():
        text = _blanked(text, match)
    if stamp is not None and abs(stamp.t_ns) >= LIMIT_NS:
        stamp = None
    return stamp, text


def _blanked(text: str, match: re.Match[str]) -> str:
    return text[: match.start()] + " " * (match.end() - match.start()) + text[match.end() :]


def _fraction(digits: str | None, unit_ns: int = 10**9) -> int:
    if not digits:
        return 0
    return int(int(digits) * unit_ns // 10 ** len(digits))


def _of_seconds(match: re.Match[str]) -> int:
    return int(match[1]) * 10**9 + _fraction(match[2])


def _of_epoch(match: re.Match[str]) -> int:
    return int(int(match[1]) * 10 ** (19 - len(match[1])))


def _of_unit(match: re.Match[str]) -> int:
    unit = _UNIT_NS[match[3]]
    return int(match[1][:19]) * unit + _fraction(match[2], unit)


def _of_clock(match: re.Match[str]) -> Stamp | None:
    hour, minute, second = int(match["h"]), int(match["mi"]), int(match["s"])
    if hour > 23 or minute > 59 or second > 60:
        return None
    if half := match["half"]:
        hour = hour % 12 + (12 if half in "Pp" else 0)
    t_ns = (hour * 3600 + minute * 60 + second) * 10**9 + _fraction(match["f"] or match["fc"] or match["fm"])
    year = match["y"] or match["y2"]
    if year is None:
        return Stamp(t_ns, of_day=True)
    try:
        midnight = datetime(int(year), int(match["mo"] or match["mo2"]), int(match["d"] or match["d2"]), tzinfo=UTC)
        midnight = midnight.replace(tzinfo=_zone(match["zone"]))
    except ValueError:
        return None
    days = (midnight - datetime(1970, 1, 1, tzinfo=UTC)) // timedelta(seconds=1)
    return Stamp(days * 10**9 + t_ns, of_day=False)


def _zone(text: str | None) -> timezone:
    if text in (None, "Z"):
        return UTC
    assert text is not None
    hours, minutes = int(text[1:3]), int(text[-2:])
    offset = timedelta(hours=hours, minutes=minutes)
    return timezone(-offset if text[0] == "-" else offset)
