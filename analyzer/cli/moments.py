"""Times as people give them to commands: since a capture's beginning, of the day, with a date; and spans of time."""

from __future__ import annotations

import re
from datetime import UTC, datetime, timedelta, tzinfo
from typing import Final

from ..words import is_clock, moment_of
from .exits import UsageError

_UNITS: Final = {
    "ns": 1, "us": 1_000, "ms": 1_000_000, "": 1_000_000_000, "s": 1_000_000_000, "min": 60_000_000_000,
    "h": 3_600_000_000_000,
}  # fmt: skip
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
    unit = _UNITS[match[4]]
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
            raise UsageError(f"{flag} {text}: give 12.5s after the first byte, 08:30:00, or 2026-01-31T08:30Z")
        return first_ns + time_span(text, flag)
    date, hour, minute, second, rest, offset = match.groups()
    if date is None and not is_clock(first_ns):
        raise UsageError(f"{flag} {text}: this capture's clock has no time of day: give a time such as 12.5s")
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
        raise UsageError(f"{flag} {text}: is no time of a day") from error
    return ns
