"""Times, sizes and moments as people give them: `90s`, `15min`, `7d`; `500kB`, `2GB`; a time since a capture's
beginning, of the day, with a date.
"""

from __future__ import annotations

import re
from argparse import ArgumentTypeError
from datetime import UTC, datetime, timedelta, tzinfo
from typing import Final

from ..words import UNITS_NS, is_clock, moment_of
from .commands import UsageError

_TIMES: Final = {"ms": 1e-3, "s": 1, "sec": 1, "m": 60, "min": 60, "h": 3600, "d": 86_400, "w": 604_800}
_SIZES: Final = {
    "b": 1, "k": 10**3, "kb": 10**3, "m": 10**6, "mb": 10**6, "g": 10**9, "gb": 10**9, "t": 10**12, "tb": 10**12,
    "kib": 2**10, "mib": 2**20, "gib": 2**30, "tib": 2**40,
}  # fmt: skip
_SHAPE: Final = re.compile(r"\s*(\d{1,15}(?:\.\d{1,15})?)\s*([a-zA-Z]*)\s*")


def seconds(text: str) -> float:
    """A time in seconds, which a bare number is; for argparse."""
    return _value(text, _TIMES, "s", "a time such as 90s, 15min, 12h or 7d")


def size_in_bytes(text: str) -> int:
    """A size in bytes, which a bare number is; for argparse."""
    return int(_value(text, _SIZES, "b", "a size such as 500kB, 64MB or 2GB"))


def time_or_size(text: str) -> tuple[float | None, int | None]:
    """(seconds, bytes), one of them None: `7d` or `2GB`; for argparse."""
    match = _SHAPE.fullmatch(text)
    unit = match[2].lower() if match else ""
    if unit in _SIZES and unit != "m":
        return None, size_in_bytes(text)
    if unit in _TIMES:
        return seconds(text), None
    raise ArgumentTypeError(f"{text!r} is neither a time such as 7d nor a size such as 2GB")


def _value(text: str, units: dict[str, float] | dict[str, int], bare: str, expected: str) -> float:
    match = _SHAPE.fullmatch(text)
    factor = units.get(match[2].lower() or bare) if match else None
    if match is None or factor is None or float(match[1]) <= 0:
        raise ArgumentTypeError(f"{text!r} is not {expected}")
    return float(match[1]) * factor


_SPAN: Final = re.compile(r"([+-]?)(\d{1,12})(?:\.(\d{1,9}))?\s*(ns|us|ms|s|min|h|)")
_CLOCK: Final = re.compile(
    r"(?:(\d{4}-\d\d-\d\d)[T ])?(\d{1,2}):(\d\d)(?::(\d\d)(?:[.,](\d{1,9}))?)?\s*(Z|[+-]\d\d:?\d\d)?"
)
_SECOND: Final = 1_000_000_000


def time_span(text: str, flag: str) -> int:
    """A span of time in ns: `1.5` and `1.5s`, `-250ms`, `2min`, `1h`. UsageError names the flag."""
    match = _SPAN.fullmatch(text.strip())
    if match is None:
        raise UsageError(f"{flag} {text}: give a time such as 1.5s, -250ms, 2min")
    unit = UNITS_NS[match[4] or "s"]
    ns = int(match[2]) * unit + int((match[3] or "0").ljust(9, "0")) * unit // _SECOND
    return -ns if match[1] == "-" else ns


def moment(text: str, flag: str, first_ns: int, zone: tzinfo | None) -> int:
    """A moment in ns since 1970 of a capture whose first bytes came at `first_ns`.

    `12.5s` is so long after them; `08:30:00` the first such time of day from then on, in `zone` (None: this machine's);
    `2026-01-31T08:30:00.5` and `2026-01-31T08:30Z` are what they say.
    """
    match = _CLOCK.fullmatch(text.strip())
    if match is None:
        if _SPAN.fullmatch(text.strip()) is None:
            raise UsageError(f"{flag} {text}: use 12.5s (from the first byte), 08:30:00 or 2026-01-31T08:30Z")
        return first_ns + time_span(text, flag)
    date, hour, minute, second, rest, offset = match.groups()
    if date is None and not is_clock(first_ns):
        raise UsageError(f"{flag} {text}: this capture has no time of day: give a time such as 12.5s")
    try:
        if offset is not None:
            zone = UTC if offset == "Z" else datetime.fromisoformat(f"2000-01-01T00:00{offset}").tzinfo
        first = moment_of(first_ns // _SECOND, zone)
        day = first if date is None else datetime.fromisoformat(date).replace(tzinfo=zone)
        clock = day.replace(hour=int(hour), minute=int(minute), second=int(second or 0), microsecond=0)
        ns = int(clock.timestamp()) * _SECOND + int((rest or "0").ljust(9, "0"))
        if date is None and ns < first_ns - first_ns % _SECOND:
            ns = int((clock + timedelta(days=1)).timestamp()) * _SECOND + ns % _SECOND
    except (ValueError, OverflowError) as error:
        raise UsageError(f"{flag} {text}: is not a time of day") from error
    return ns
