"""What the page of each site shows (days as cells, units, causes, captures), and how that comes of a lake's rows."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Final

from ...causes.registry import Cause, CauseWords, told_again
from ...languages import counted, in_use, page_words
from ...languages import retold as in_language
from ...reports.html.page import OutcomeBar, OutcomePart
from ...reports.page import file_name
from ...words import DAY_NS, between, duration, is_clock, moment
from ..datasets import day_name
from ..lake import Lake
from .sums import NO_CLOCK, FleetSpan, LakeRow, SiteSums, sums_of


@dataclass(frozen=True, slots=True)
class DayCell:
    """How well requests were answered on a day: a level (`none`, `good`, `fair`, `poor`, `bad`), and words."""

    level: str
    title: str


@dataclass(frozen=True, slots=True)
class HealthStrip:
    """Cells of days, oldest first, and the whole in words, for those who do not see it."""

    cells: tuple[DayCell, ...]
    words: str


@dataclass(frozen=True, slots=True)
class DelayCurve:
    """Mean response times by day: the points of runs of days in a drawing, what its top means, what it says in all."""

    runs: tuple[str, ...]
    top: str
    words: str


@dataclass(frozen=True, slots=True)
class HealthSums:
    """What became of requests in all; `response` in words."""

    asked: int
    answered: int
    exceptions: int
    unanswered: int
    damaged: int
    bad_percent: float | None
    response: str


@dataclass(frozen=True, slots=True)
class UnitHealth:
    """A unit of a line over its days."""

    line: str
    unit: int
    strip: HealthStrip
    curve: DelayCurve | None
    bar: OutcomeBar
    sums: HealthSums


@dataclass(frozen=True, slots=True)
class CauseSpell:
    """A cause of a line over all days on which it was found: its words are those of the newest.

    `first` and `last` are days since the epoch, `days` how many there were; `lately` whether it was found on the last
    two days of its line; `fresh` whether it first came in the fleet's last week.
    """

    cause: Cause
    line: str
    first: int
    last: int
    days: int
    lately: bool
    fresh: bool


@dataclass(frozen=True, slots=True)
class CaptureEntry:
    """A capture: its name without folders, times and sizes in words, what could not be read of it."""

    name: str
    line: str
    begun: str
    span: str
    octets: int
    state: str
    damage: tuple[str, ...]
    damage_count: int


@dataclass(frozen=True, slots=True)
class SiteHealth:
    """All that a page of a site shows. `file`: the name of the page in its folder."""

    name: str
    file: str
    strip: HealthStrip
    sums: HealthSums
    lines: int
    captures: int
    harmed: int  # captures of which something could not be read
    octets: int
    span: str
    newest: str
    behind: bool  # nothing was recorded on the last two days of the fleet
    units: tuple[UnitHealth, ...]
    unit_count: int
    causes: tuple[CauseSpell, ...]
    cause_count: int
    damaged: tuple[CaptureEntry, ...]
    latest: tuple[CaptureEntry, ...]

    @property
    def names_lines(self) -> bool:
        """Whether captures have lines of other names than their own."""
        return any(each.line != each.name for each in (*self.latest, *self.damaged))

    @property
    def now(self) -> list[CauseSpell]:
        """Causes that were found lately."""
        return [each for each in self.causes if each.lately]

    @property
    def before(self) -> list[CauseSpell]:
        """Those that were not."""
        return [each for each in self.causes if not each.lately]


_LEVELS: Final = ((0.1, "good"), (1.0, "fair"), (5.0, "poor"))  # percent of bad answers up to which
_WORST: Final = "bad"
_NONE: Final = "none"
_FRESH: Final = 7  # days
_DAMAGE: Final = 3  # of a capture, told
CURVE: Final = (120, 24)  # width and height of a drawing of response times, in its own units
_OUTCOMES: Final = (  # kind of a part, which of the sums, words
    ("ok", "answered", "{number:,} answered"),
    ("exception", "exceptions", "{number:,} by exception"),
    ("silent", "unanswered", "{number:,} unanswered"),
    ("garbage", "damaged", "{number:,} answered by a damaged frame"),
)


def sites_of(lake: Lake, named: Mapping[str, str], span: FleetSpan) -> Iterator[SiteHealth]:
    """All sites by their names, with few of them in memory. `named`: the file of each site's page."""
    young = span.newest - _FRESH <= span.oldest_cause
    fresh = span.newest + 1 if young else span.newest - _FRESH  # of a young lake all is new: nothing is said
    for some, sums in sums_of(lake, span):
        yield from (_site(site, named[site], sums, span, fresh) for site in some)


def _site(site: str, file: str, sums: SiteSums, span: FleetSpan, fresh: int) -> SiteHealth:
    captured, units = sums.captures.get(site, {}), sums.units.get(site, [])
    causes = sums.causes.get(site, [])
    days = span.calendar
    oldest, newest = captured.get("oldest"), captured.get("newest")
    return SiteHealth(
        name=site,
        file=file,
        strip=_strip(days, sums.days.get(site, ())),
        sums=_sums(sums.sites.get(site, {})),
        lines=captured.get("lines", 0),
        captures=captured.get("captures", 0),
        harmed=captured.get("harmed", 0),
        octets=captured.get("bytes") or 0,
        span="–" if oldest is None or newest is None else _span(_when(oldest), _when(newest)),
        newest="–" if newest is None else _date(newest // DAY_NS),
        behind=newest is None or NO_CLOCK <= newest // DAY_NS < span.newest - 1,
        units=tuple(_unit(row, sums.unit_days.get((site, row["line"], row["unit"]), ()), days) for row in units),
        unit_count=units[0]["units"] if units else 0,
        causes=tuple(_spell(row, fresh) for row in causes),
        cause_count=causes[0]["causes"] if causes else 0,
        damaged=tuple(map(_capture, sums.harmed.get(site, ()))),
        latest=tuple(map(_capture, sums.latest.get(site, ()))),
    )  # fmt: skip


def _unit(row: LakeRow, by_day: Sequence[LakeRow], days: Sequence[int]) -> UnitHealth:
    sums = _sums(row)
    parts = [(kind, getattr(sums, which), words) for kind, which, words in _OUTCOMES]
    bar = OutcomeBar(
        page_words("unit {unit}", unit=row["unit"]),
        tuple(OutcomePart(kind, count, page_words(words, number=count)) for kind, count, words in parts if count),
        "",
    )
    return UnitHealth(row["line"], row["unit"], _strip(days, by_day), _curve(days, by_day), bar, sums)


def _sums(row: Mapping[str, Any]) -> HealthSums:
    def count(name: str) -> int:
        return int(row.get(name) or 0)

    return HealthSums(
        count("asked"),
        count("answered"),
        count("exceptions"),
        count("unanswered"),
        count("damaged"),
        row.get("bad_percent"),
        _response(row),
    )


def _response(row: Mapping[str, Any]) -> str:
    """The mean response time, as far as it is known."""
    if row.get("mean_ms_low") is None:
        return "–"
    return _between_ms(row["mean_ms_low"], row["mean_ms_high"])


def _strip(days: Sequence[int], rows: Iterable[LakeRow]) -> HealthStrip:
    by_day = {row["day"] if row["day"] >= NO_CLOCK else 0: row for row in rows}
    cells = tuple(_cell(day, by_day.get(day)) for day in days)
    counts = [(level, sum(cell.level == level for cell in cells)) for level in level_words()]
    told = [f"{level_words()[level]}: {counted(count, 'day', 'days')}" for level, count in counts if count]
    return HealthStrip(cells, "; ".join(told))


def level_words() -> dict[str, str]:
    """What each level means."""
    words = {level: page_words("up to {most:g}%", most=most) for most, level in _LEVELS}
    return {**words, _WORST: page_words("more"), _NONE: page_words("nothing asked")}


def _cell(day: int, row: LakeRow | None) -> DayCell:
    if row is None or row["bad_percent"] is None:
        return DayCell(_NONE, page_words("{day}: nothing asked", day=_date(day)))
    bad = row["bad_percent"]
    level = next((name for most, name in _LEVELS if bad <= most), _WORST)
    words = "{day}: {bad:.3g}% of {asked:,} requests without a good answer"
    return DayCell(level, page_words(words, day=_date(day), bad=bad, asked=int(row["asked"])))


def _curve(days: Sequence[int], rows: Iterable[LakeRow]) -> DelayCurve | None:
    """The middle of what a day's mean lies between; nothing where no two days have one."""
    means = {row["day"]: (row["mean_ms_low"], row["mean_ms_high"]) for row in rows if row["mean_ms_low"] is not None}
    dated = [day for day in days if day >= NO_CLOCK]
    known = [day for day in dated if day in means]
    if len(known) < 2:
        return None
    width, height = CURVE
    middles = {day: sum(means[day]) / 2 for day in known}
    top = max(middles.values())
    step = (width - 4) / max(len(dated) - 1, 1)

    def point(day: int) -> str:
        return f"{2 + (day - dated[0]) * step:.1f},{height - 3 - (height - 6) * middles[day] / (top or 1):.1f}"

    runs = [[known[0]]]
    for before, day in pairwise(known):
        if day > before + 1:
            runs.append([])
        runs[-1].append(day)
    drawn = tuple(" ".join(map(point, run if len(run) > 1 else run * 2)) for run in runs)
    first, last = (_between_ms(*means[day]) for day in (known[0], known[-1]))
    least, most = min(known, key=lambda day: middles[day]), max(known, key=lambda day: middles[day])
    words = page_words(
        "mean response time: {first} at first, {last} at last; least {least} on {day}, most {most} on {other}",
        first=first, last=last, least=_between_ms(*means[least]), day=_date(least), most=_between_ms(*means[most]),
        other=_date(most),
    )  # fmt: skip
    return DelayCurve(drawn, duration(round(top * 1e6)), words)


def _between_ms(low: float, high: float) -> str:
    return between(round(low * 1e6), round(high * 1e6))


def _spell(row: LakeRow, fresh: int) -> CauseSpell:
    newest = row["newest"]
    words = _cause_words(row["cause"], newest)
    cause = Cause(
        cause=row["cause"],
        severity=newest["severity"],
        units=tuple(row["units"] or ()),
        blame=newest["blame"],
        text=words.text,
        share=words.share,
        since_ns=row["since"] if row["days"] == 1 else None,  # of several days the dates are told
        until_ns=row["until"],
        period_s=newest["period_s"],
        confidence=newest["confidence"],
        runner_up=newest["runner_up"],
        deciding_test=words.deciding_test,
        remedy=words.remedy,
        lost_answers=None if row["lost_answers"] is None else int(row["lost_answers"]),
        lost_ms=row["lost_ms"],
        frames=(),
        bits=row["bits"],
    )
    first, last = row["first"], max(row["last"], row["first"])
    return CauseSpell(cause, row["line"], first, last, row["days"], bool(row["lately"]), first >= fresh)


def _cause_words(cause: str, kept: LakeRow) -> CauseWords:
    """A cause in the language in use; as it was kept where that is English, or this version knows no such cause."""
    plain = CauseWords(*(kept[name] or "" for name in ("text", "share", "deciding_test", "remedy")))
    return plain if in_use() == "en" else told_again(cause, kept["numbers"]) or plain


def _capture(row: LakeRow) -> CaptureEntry:
    begun, ended = row["t_ns"], row["t_last_ns"]
    heard = ended is not None and row["bytes"]
    name = file_name(row["source"])
    return CaptureEntry(
        name=name,
        line=row["line"],
        begun=_when(begun) if heard else "–",
        span=duration(ended - begun) if heard else "–",
        octets=row["bytes"],
        state=row["state"],
        damage=tuple(in_language(each.replace(row["source"], name)) for each in (row["damage"] or ())[:_DAMAGE]),
        damage_count=row["damage_count"],
    )


def _when(t_ns: int) -> str:
    return moment(t_ns)[:-4] if is_clock(t_ns) else page_words("no clock")


def _span(first: str, last: str) -> str:
    return first if first == last else page_words("{first} to {last}", first=first, last=last)


def _date(day: int) -> str:
    return day_name(day) if day >= NO_CLOCK else page_words("no clock")


def spelled(spell: CauseSpell) -> str:
    """Where and on which days a cause was found."""
    days = [_date(spell.first)]
    if spell.last != spell.first:
        days = [page_words("{first} to {last}", first=days[0], last=_date(spell.last))]
    if spell.days > 1:
        days.append(page_words("found on {days}", days=counted(spell.days, "day", "days")))
    return ", ".join([page_words("line {line}", line=spell.line), *days])


def calendar_ends(days: Sequence[int]) -> tuple[str, str]:
    """The first and the last date of a calendar in words; empty where there is none."""
    dated = [day for day in days if day >= NO_CLOCK] or days
    return (_date(dated[0]), _date(dated[-1])) if dated else ("", "")
