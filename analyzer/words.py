"""Times in words: absolute, since the start, since the row before, since a reference; and the units they are in.

What people read has its units and its decimal mark as the language in use writes them (`analyzer.languages.use` says
which); clocks, and `seconds`, which may be typed in again, are the same in all.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from contextvars import ContextVar
from datetime import UTC, datetime, timedelta, tzinfo
from enum import Enum
from typing import TYPE_CHECKING, Final, overload

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

CLOCK_FROM_NS: Final = 10**17  # times after 1973 are taken for a clock's, others count from the start of the capture
UNITS_NS: Final = {"ns": 1, "us": 10**3, "ms": 10**6, "s": 10**9, "min": 60 * 10**9, "h": 3600 * 10**9}
HOUR_NS: Final = UNITS_NS["h"]
DAY_NS: Final = 24 * HOUR_NS
_ENGLISH_UNITS: Final[Mapping[str, str]] = {}
_units: ContextVar[Mapping[str, str]] = ContextVar("units", default=_ENGLISH_UNITS)
_EPOCH: Final = datetime(1970, 1, 1, tzinfo=UTC)


class TimeBase(Enum):
    """What times count from."""

    START = "since start"
    ABSOLUTE = "UTC"
    PREVIOUS = "since previous"
    REFERENCE = "since reference"


def write_units(units: Mapping[str, str]) -> None:
    """Units by their English from now on (in this thread, or whatever context it is), decimals with a comma; none of
    them: as in English."""
    _units.set(units or _ENGLISH_UNITS)


def unit_word(unit: str) -> str:
    """A unit as the language in use writes it: `ms`, `bit/s`, `kB`."""
    return _units.get().get(unit, unit)


def decimal(text: str) -> str:
    """A number, or two, or a percentage, as the language in use writes it: `4.5%`, in Russian `4,5 %`."""
    if not _units.get():
        return text
    return "..".join(number.replace(".", ",") for number in text.split("..")).replace("%", " %")


@overload
def is_clock(t_ns: int) -> bool: ...
@overload
def is_clock(t_ns: NDArray[np.int64]) -> NDArray[np.bool_]: ...
def is_clock(t_ns: int | NDArray[np.int64]) -> bool | NDArray[np.bool_]:
    """Whether a time, or each of some, is a clock's, and so has a date."""
    return t_ns > CLOCK_FROM_NS


def shortened(text: str, most: int) -> str:
    """A text in so many characters at most; `…` at its end where there is more."""
    return text if len(text) <= most else f"{text[: most - 1]}…"


def seconds(ns: int) -> str:
    """`12.345678`, in seconds to the microsecond; negative ones with a sign."""
    sign, ns = ("-", -ns) if ns < 0 else ("", ns)
    micros = (ns + 500) // 1000
    return f"{sign}{micros // 1_000_000}.{micros % 1_000_000:06d}"


def moment_of(since_s: float, zone: tzinfo | None = UTC) -> datetime:
    """The moment so many seconds after 1970 began, or before (Windows knows none); `zone` None: the system's."""
    return (_EPOCH + timedelta(seconds=since_s)).astimezone(zone)


def time_of_day(t_ns: int, zone: tzinfo = UTC) -> str:
    """`08:29:51.123456` in a zone."""
    micros = t_ns // 1000
    moment = moment_of(micros // 1_000_000, zone)
    return f"{moment:%H:%M:%S}.{micros % 1_000_000:06d}"


def clock_text(t_ns: int) -> str:
    """ISO 8601 in UTC to the microsecond; nothing for a time that no clock of ours gave."""
    moment = (_EPOCH + timedelta(microseconds=t_ns // 1000)).replace(tzinfo=None)
    return f"{moment.isoformat(timespec='microseconds')}Z" if is_clock(t_ns) else ""


def date_and_time(t_ns: int, zone: tzinfo = UTC) -> str:
    """`2026-11-21 08:29:51.123456 UTC`, or seconds on the capture's own clock."""
    if not is_clock(t_ns):
        return " ".join((seconds(t_ns), unit_word("s on the capture's clock")))
    moment = moment_of(t_ns // 1_000_000_000, zone)
    return f"{moment:%Y-%m-%d} {time_of_day(t_ns, zone)} {zone_name(t_ns, zone)}"


def zone_name(t_ns: int, zone: tzinfo = UTC) -> str:
    """How a zone is called at a time: `UTC`, `MSK`, `UTC+03:00`."""
    return moment_of(t_ns // 1_000_000_000, zone).tzname() or "UTC"


def short(ns: int | None) -> str:
    """A duration in at most six characters and a sign: `870us`, `12.3ms`, `4.21s`, `3h12m`; a dash for none."""
    if ns is None:
        return "-"
    if ns < 0:
        return "-" + short(-ns)
    if ns < 999_500:
        return f"{ns / 1e3:.0f}{unit_word('us')}"
    if ns < 999_500_000:
        return decimal(f"{ns / 1e6:.3g}") + unit_word("ms")
    if ns < 99_950_000_000:
        return decimal(f"{ns / 1e9:.3g}") + unit_word("s")
    minutes, rest = divmod(ns // 1_000_000_000, 60)
    if minutes < 100:
        return f"{minutes}{unit_word('m')}{rest:02d}{unit_word('s')}"
    hours, minutes = divmod(minutes, 60)
    if hours < 100:
        return f"{hours}{unit_word('h')}{minutes:02d}{unit_word('m')}"
    return f"{hours // 24 if hours < 24_000 else '>999'}{unit_word('d')}"


def pointed_ms(low_ns: int, high_ns: int) -> str:
    """Milliseconds in nine columns, the point always in the same: `    4.21 `, `   12.3  `; in ten between two:
    `     9..17`, rounded outwards."""
    if low_ns != high_ns:
        digits = 2 if low_ns < 950_000 and high_ns < 9_950_000 else 1 if high_ns < 99_500_000 else 0
        scale = 10**digits / 1e6
        low, high = math.floor(low_ns * scale) / 10**digits, math.ceil(high_ns * scale) / 10**digits
        return decimal(f"{low:.{digits}f}..{high:.{digits}f}").rjust(10)
    ns = low_ns
    ms = ns / 1e6
    whole, _, rest = f"{ms:.{3 if ms < 1 else 2 if ms < 10 else 1 if ms < 100 else 0}f}".partition(".")
    return f"{whole:>5}{decimal(f'0.{rest}')[1] if rest else ' '}{rest:<3}"


def short_bound(bounds: tuple[int, int] | None) -> str:
    """`short` of a time that lies between two: `12.3ms`, or what it is at most, `≤17ms`, rounded up; a dash where it is
    unknown."""
    if bounds is None:
        return "-"
    low, high = bounds
    if low == high:
        return short(low)
    step = max(10 ** (len(str(high)) - 3), 1000) if high < 99_950_000_000 else UNITS_NS["s"]  # of what `short` shows
    return f"≤{short(-(-high // step) * step)}"


def moment(t_ns: int) -> str:
    """A time of a clock."""
    return f"{moment_of(t_ns / 1e9):%Y-%m-%d %H:%M:%S} UTC"


def duration(ns: int) -> str:
    """A time in its natural unit, three or four digits: `870 us`, `12.3 ms`, `4.2 s`, `3 h 12 min`."""
    if ns < 999_500:
        return f"{ns / 1e3:.0f} {unit_word('us')}"
    if ns < 999_500_000:
        return f"{decimal(f'{ns / 1e6:.3g}')} {unit_word('ms')}"
    seconds = ns / 1e9
    if seconds < 99.95:
        return f"{decimal(f'{seconds:.3g}')} {unit_word('s')}"
    minutes, seconds = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    days, hours = divmod(hours, 24)
    if days:
        return f"{days} {unit_word('d')} {hours} {unit_word('h')}"
    if hours:
        return f"{hours} {unit_word('h')} {minutes} {unit_word('min')}"
    return f"{minutes} {unit_word('min')} {seconds} {unit_word('s')}"


def between(low_ns: int, high_ns: int) -> str:
    """A duration that lies between two: `9..17 ms`, `0..1.2 s`, rounded outwards; `870 us` where they are one."""
    if low_ns == high_ns:
        return duration(low_ns)
    for scale, unit in ((1e3, "us"), (1e6, "ms"), (1e9, "s")):
        if high_ns < 999.5 * scale or unit == "s":
            span = f"{_rounded(low_ns / scale, math.floor)}..{_rounded(high_ns / scale, math.ceil)}"
            return f"{decimal(span)} {unit_word(unit)}"
    return duration(high_ns)


def _rounded(number: float, towards: Callable[[float], int]) -> str:
    """Two digits of a number, all of one from ten on; `towards`: `math.floor` or `math.ceil`."""
    if number <= 0:
        return "0"
    step = 10.0 ** min(math.floor(math.log10(number)) - 1, 0)
    rounded = towards(round(number / step, 9)) * step
    return f"{rounded:.0f}" if rounded > 9.95 else f"{rounded:.2g}"


def compact(number: int) -> str:
    """A count in at most five characters: `9999`, `12.3k`, `1.2M`."""
    if number < 10_000:
        return str(number)
    for scale, letter in ((1e3, "k"), (1e6, "M"), (1e9, "G"), (1e12, "T")):
        if number < 999.5 * scale:
            digits = 2 if number < 9.995 * scale else 1 if number < 99.95 * scale else 0
            return decimal(f"{number / scale:.{digits}f}") + unit_word(letter)
    return ">999" + unit_word("T")


def percent(share: float) -> str:
    """A share in at most five characters; one that is not nothing is never called `0%`: `12%`, `0.4%`, `<0.1%`."""
    whole = share >= 0.0995 or share <= 0
    return decimal(f"{share:.0%}" if whole else f"{share:.1%}" if share >= 0.0005 else "<0.1%")


def rough_percent(share: float) -> str:
    """A share as a whole number: `12%`, and `<1%` for one that is next to nothing."""
    return decimal(f"{share:.0%}" if share >= 0.005 or share <= 0 else "<1%")


def plural(number: int, one: str, many: str) -> str:
    """`1 retry`, `2 retries`."""
    return f"{number:,} {one if number == 1 else many}"


def data_size(octets: int) -> str:
    """A number of bytes as people read it: `812 B`, `5.2 kB`, `1.2 MB`, `3.4 GB`."""
    if octets < 1000:
        return f"{octets} {unit_word('B')}"
    for unit in ("kB", "MB"):
        octets_of = octets / (1e3 if unit == "kB" else 1e6)
        if octets_of < 999.95:
            return f"{decimal(f'{octets_of:.1f}')} {unit_word(unit)}"
    return f"{decimal(f'{octets / 1e9:.1f}')} {unit_word('GB')}"
