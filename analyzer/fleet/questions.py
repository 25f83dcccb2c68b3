"""What a lake is asked: ready questions (a name, what it says, SQL to be copied), and the tables behind its pages.

Times are told from the newest byte that the lake has, not from today: a lake may be old. A unit's response time lies
between the two figures that are given of it; they are one where its tap tells times exactly.

What changed for good about a unit, and when, is no SQL: one change point a series, in its hours. A series is cut where
that explains it best (the least sum of squares about two means rather than one), and told where the difference is many
times what the hours' own scatter makes likely. Where a tap only tells between what a response time lies, the two means
must not overlap.

Pages ask one query a table, of all sites at once; each row is a dictionary.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, pairwise
from typing import Any, Final

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from ..causes.registry import told_again
from ..languages import in_use
from ..meant import meant
from ..words import CLOCK_FROM_NS
from . import FleetError
from .lake import Lake

_NEWEST: Final = "(SELECT max(t_last_ns)::TIMESTAMPTZ FROM captures)"  # an interval is not taken from nanoseconds
_CLOCKED: Final = f"({{}}::TIMESTAMPTZ > to_timestamp({CLOCK_FROM_NS // 10**9}))"
DATES: Final = ("since", "last_heard")  # columns that mean a date; without a clock there is none
_BAD: Final = "exception + unanswered + damaged"
UNIT_COLUMNS: Final = """sum(requests) - sum(broadcast) - sum(unheard) AS asked,
  sum(exception) AS exceptions, sum(unanswered) AS unanswered, sum(damaged) AS damaged, sum(retries) AS retries,
  round(100.0 * sum(exception + unanswered + damaged)
    / nullif(sum(requests) - sum(broadcast) - sum(unheard), 0), 3) AS bad_percent,
  round(sum(response_time_low_sum_ns) / nullif(sum(timed), 0) / 1e6, 3) AS mean_ms_low,
  round(sum(response_time_high_sum_ns) / nullif(sum(timed), 0) / 1e6, 3) AS mean_ms_high"""


@dataclass(frozen=True, slots=True)
class Asked:
    """A question as somebody asks it. `since_s`: seconds before the newest byte; `site` where one is meant."""

    words: Sequence[str] = ()
    since_s: float | None = None
    site: str | None = None
    limit: int | None = None  # rows; as many as the question has by itself if not given

    @property
    def sql_limit(self) -> str:
        """What ends a query."""
        return "" if self.limit is None else f"LIMIT {self.limit}"


@dataclass(frozen=True, slots=True)
class Question:
    """A ready question: what is said after its name, what it tells, and the table that answers it."""

    usage: str
    help: str
    answer: Callable[[Lake, Asked], Any]  # an Arrow table
    most: int | None = 20  # rows, where nobody says how many; None: all


def _sql_span(asked: Asked, column: str = "t_ns") -> str:
    since = "" if asked.since_s is None else f" AND {column}::TIMESTAMPTZ >= {_NEWEST} - to_seconds($since)"
    return ("WHERE true" if asked.site is None else "WHERE site = $site") + since


def _parameters(asked: Asked, **more: Any) -> dict[str, Any]:
    given = {"site": asked.site, "since": asked.since_s}
    return {name: value for name, value in {**given, **more}.items() if value is not None}


def _worst_units(lake: Lake, asked: Asked) -> Any:
    """By the least share of bad answers that the count makes likely (Wilson, 95 %): one of one is not the worst."""
    return lake.arrow(
        f"""WITH units AS (SELECT site, line, unit, {UNIT_COLUMNS}
    FROM hours {_sql_span(asked)} AND unit > 0 GROUP BY ALL),
  judged AS (SELECT *, (exceptions + unanswered + damaged) / asked AS p FROM units WHERE asked > 0)
SELECT site, line, unit, asked, exceptions, unanswered, damaged, retries, bad_percent, mean_ms_low, mean_ms_high
FROM judged WHERE p > 0
ORDER BY (p + 1.92 / asked - 1.96 * sqrt(p * (1 - p) / asked + 0.96 / asked / asked)) / (1 + 3.84 / asked) DESC,
  site, line, unit
{asked.sql_limit}""",
        _parameters(asked),
    )


def _new_causes(lake: Lake, asked: Asked) -> Any:
    """Causes whose line and units did not have them before; of captures without a clock all, as nobody can tell."""
    asked = asked if asked.since_s is not None else replace(asked, since_s=7 * 86_400.0)
    site = "" if asked.site is None else "WHERE site = $site"
    answer = lake.arrow(
        f"""WITH first AS (SELECT site, line, cause, units,
    coalesce(min(t_ns) FILTER ({_CLOCKED.format("t_ns")}), min(t_ns)) AS since, max(until_ns) AS until,
    count(*) AS days, arg_max(severity, t_ns) AS severity, arg_max(text, t_ns) AS text,
    arg_max(remedy, t_ns) AS remedy, arg_max(numbers, t_ns) AS numbers,
    sum(lost_answers) AS lost_answers, sum(bits) AS bits
  FROM causes {site} GROUP BY site, line, cause, units)
SELECT since, site, line, cause, units, severity, days, lost_answers, text, remedy, numbers
FROM first WHERE since::TIMESTAMPTZ >= {_NEWEST} - to_seconds($since) OR NOT {_CLOCKED.format("since")}
ORDER BY bits DESC, site, line, cause {asked.sql_limit}""",
        _parameters(asked),
    )
    return _in_use(answer).drop_columns("numbers")


def _in_use(answer: Any) -> Any:
    """Causes in the language in use; as they were kept where that is English, or this version knows no such cause."""
    if in_use() == "en":
        return answer
    rows = answer.select(["cause", "numbers", "text", "remedy"]).to_pylist()
    words = [told_again(row["cause"], row["numbers"]) for row in rows]
    for name in ("text", "remedy"):
        told = [row[name] if new is None else getattr(new, name) for row, new in zip(rows, words, strict=True)]
        answer = answer.set_column(answer.column_names.index(name), name, pa.array(told, pa.string()))
    return answer


def _silent(lake: Lake, asked: Asked) -> Any:
    """Units that answered once and then nothing more that was asked, and lines of which nothing came any more; how
    long a line without a clock is silent nobody can tell."""
    quiet = asked.since_s if asked.since_s is not None else 86_400.0
    where = "" if asked.site is None else "WHERE site = $site"
    return lake.arrow(
        f"""WITH units AS (SELECT site, line, unit,
    max(t_ns) FILTER (WHERE answered + exception + damaged > 0) AS heard, max(t_ns) AS asked
  FROM hours {where} GROUP BY ALL),
  asked_since AS (SELECT site, line, unit, sum(requests)::BIGINT AS requests_since
    FROM hours JOIN units USING (site, line, unit) WHERE heard IS NULL OR t_ns > heard GROUP BY ALL),
  lines AS (SELECT site, line, max(t_last_ns) AS heard FROM captures {where} GROUP BY ALL)
SELECT site, line, unit, heard AS last_heard, requests_since,
  if(heard IS NULL, 'never answered', 'answers no more') AS what
FROM units JOIN asked_since USING (site, line, unit) WHERE unit > 0 AND requests_since > 0
UNION ALL BY NAME
SELECT site, line, NULL AS unit, heard AS last_heard, NULL AS requests_since, 'nothing recorded any more' AS what
FROM lines WHERE heard::TIMESTAMPTZ < {_NEWEST} - to_seconds($since) AND {_CLOCKED.format("heard")}
ORDER BY what, requests_since DESC NULLS LAST, site, line, unit {asked.sql_limit}""",
        {**_parameters(asked), "since": quiet},
    )


def _compare(lake: Lake, asked: Asked) -> Any:
    one, two = asked.words
    for site in (one, two):
        _known_site(lake, site)
    return lake.arrow(
        f"""SELECT site, count(DISTINCT line) AS lines, count(DISTINCT (line, unit)) FILTER (WHERE unit > 0) AS units,
  {UNIT_COLUMNS},
  (SELECT count(DISTINCT (line, cause)) FROM causes WHERE causes.site = hours.site) AS causes,
  (SELECT sum(bytes)::BIGINT FROM captures WHERE captures.site = hours.site) AS bytes
FROM hours WHERE site IN ($one, $two) GROUP BY site ORDER BY site = $two {asked.sql_limit}""",
        {"one": one, "two": two},
    )


_SITES: Final = 20  # named where none is meant
_REGISTER_AREAS: Final = ("coil", "discrete", "input", "holding")


def _known_site(lake: Lake, site: str) -> None:
    if site in lake.sites:
        return
    if near := meant(site, lake.sites):
        raise FleetError(f"no site {site!r} in the lake: did you mean {near}?")
    more = f" and {len(lake.sites) - _SITES:,} more" if len(lake.sites) > _SITES else ""
    raise FleetError(f"no site {site!r} in the lake: choose from {', '.join(lake.sites[:_SITES])}{more}")


def _register(lake: Lake, asked: Asked) -> Any:
    """Every value that the bus said, in order; the area where the address has one of several."""
    unit, address, *area = asked.words
    if not (_to(unit, 255) and _to(address, 0xFFFF)) or (area and area[0] not in _REGISTER_AREAS):
        raise FleetError(
            f"register takes UNIT (0 to 255) ADDRESS (0 to 65535, as on the wire) [{'|'.join(_REGISTER_AREAS)}]"
        )
    day = "" if asked.since_s is None else f" AND day >= ({_NEWEST} - to_seconds($since))::DATE"
    return lake.arrow(
        f"""SELECT t_ns, site, line, area, raw FROM values {_sql_span(asked)}{day}
  AND unit = $unit AND address = $address {"AND area = $area" if area else ""}
ORDER BY site, line, t_ns, "index", area {asked.sql_limit}""",
        _parameters(asked, unit=int(unit), address=int(address), area=area[0] if area else None),
    )


def _to(text: str, most: int) -> bool:
    """Whether it is a whole number from 0 to this one."""
    return text.isascii() and text.isdecimal() and len(text) <= len(str(most)) and int(text) <= most


def _damaged(lake: Lake, asked: Asked) -> Any:
    where = _sql_span(asked)
    return lake.arrow(
        f"""SELECT site, line, source, state, damage_count, damage[1] AS first FROM captures {where}
  AND state IN ('damaged', 'unreadable') ORDER BY site, line, source {asked.sql_limit}""",
        _parameters(asked),
    )


def _drift(lake: Lake, asked: Asked) -> Any:
    some = sites_at_once(lake) if asked.site is None else [[asked.site]]
    return drifts(_hours(lake, asked, each[0], each[-1]) for each in some).slice(0, asked.limit)


def sites_at_once(lake: Lake) -> list[list[str]]:
    """All sites, in order, in lots whose hours are as many as may be in memory."""
    sites, rows = lake.sites, sum(lake.manifest.rows("hours").values())
    count = max(1, min(len(sites), len(sites) * HOURS_AT_ONCE // max(rows, 1)))
    return [sites[first : first + count] for first in range(0, len(sites), count)]


def _hours(lake: Lake, asked: Asked, first: str, last: str) -> Any:
    """Those of the sites from one to another."""
    return lake.arrow(
        f"""SELECT site, line, unit, t_ns, requests - broadcast - unheard AS asked, {_BAD} AS bad, timed,
  response_time_low_sum_ns AS low, response_time_high_sum_ns AS high
FROM hours {_sql_span(asked)} AND site BETWEEN $first AND $last AND unit > 0 ORDER BY site, line, unit, t_ns""",
        _parameters(asked, first=first, last=last),
    )


QUESTIONS: Final[Mapping[str, Question]] = {
    "worst-units": Question("", "units whose requests most often had no good answer", _worst_units),
    "new-causes": Question("", "causes that began since then (--since, a week if not given)", _new_causes),
    "drift": Question("", "units whose response time or bad answers changed for good, and when", _drift),
    "register": Question("UNIT ADDRESS [AREA]", "all values of a register or bit, in order", _register, None),
    "silent": Question("", "units that answer no more, lines of which nothing comes (--since, a day)", _silent),
    "compare": Question("SITE SITE", "two sites side by side", _compare, None),
    "damaged": Question("", "captures of which something could not be read", _damaged),
}
_WORDS: Final = re.compile(r"\S+")


def ready(lake: Lake, name: str, asked: Asked) -> Any:
    """The answer to a ready question as an Arrow table. Raises FleetError for words that it does not take."""
    question = QUESTIONS[name]
    takes = _WORDS.findall(question.usage)
    least = sum(not word.startswith("[") for word in takes)
    if not least <= len(asked.words) <= len(takes):
        raise FleetError(f"{name} takes {question.usage or 'no further words'}")
    if asked.site is not None:
        _known_site(lake, asked.site)
    return question.answer(lake, asked if asked.limit is not None else replace(asked, limit=question.most))


HOURS_AT_ONCE: Final = 1_000_000  # of which some numbers each are in memory
_LEAST: Final = 6  # hours on either side of a change
_SIGMAS: Final = 6.0  # a change that hours' scatter alone makes once in far more series than a fleet has
_MS: Final = 0.5  # a change of less is nothing to anybody
_PERCENT: Final = 0.5
_Numbers = NDArray[np.float64]


def drifts(hours: Iterable[Any]) -> Any:
    """Changes, the surest first, of tables of hours, each sorted by site, line, unit and time."""
    rows = sorted(
        chain.from_iterable(map(_changes, hours)),
        key=lambda row: (-row["sigmas"], row["site"], row["line"], row["unit"]),
    )
    schema = pa.schema(
        [
            ("site", pa.string()),
            ("line", pa.string()),
            ("unit", pa.uint8()),
            ("what", pa.string()),
            ("since", pa.timestamp("ns", "UTC")),
            ("before", pa.float64()),
            ("after", pa.float64()),
            ("sigmas", pa.float64()),
            ("hours", pa.int64()),
        ]
    )
    return pa.Table.from_pylist(rows, schema)


def _changes(hours: Any) -> Iterator[dict[str, Any]]:
    times = hours.column("t_ns").cast(pa.timestamp("ns", "UTC")).cast(pa.int64()).to_numpy()
    numbers = [hours.column(name).to_numpy() for name in ("asked", "bad", "timed", "low", "high")]
    for begin, end in pairwise(_series_cuts(hours)):
        about = hours.select(["site", "line", "unit"]).slice(begin, 1).to_pylist()[0]
        asked, bad, timed, low, high = (column[begin:end].astype(np.float64) for column in numbers)
        mine, known = times[begin:end], timed > 0
        lows, highs = (each[known] / timed[known] / 1e6 for each in (low, high))
        yield from _change(about, "mean response time, ms", mine[known], lows, highs, _MS)
        known = asked > 0
        rates = 100 * bad[known] / asked[known]
        yield from _change(about, "bad answers, %", mine[known], rates, rates, _PERCENT)


def _series_cuts(hours: Any) -> list[int]:
    """Where the rows of each unit begin, and where the last one's end; no name of millions becomes an object."""
    changes = np.zeros(len(hours) + 1, np.bool_)
    changes[[0, -1]] = True
    for name in ("site", "line", "unit"):
        codes = hours.column(name).combine_chunks().dictionary_encode().indices.to_numpy()
        changes[1:-1] |= codes[1:] != codes[:-1]
    cuts: list[int] = np.flatnonzero(changes).tolist()
    return cuts


def _change(
    about: dict[str, Any], what: str, times: NDArray[np.int64], low: _Numbers, high: _Numbers, least: float
) -> Iterator[dict[str, Any]]:
    values = (low + high) / 2
    count = len(values)
    if count < 2 * _LEAST:
        return
    sums = np.cumsum(values)
    n = np.arange(1, count)
    left, right = sums[:-1] / n, (sums[-1] - sums[:-1]) / (count - n)
    gain = n * (count - n) / count * (left - right) ** 2
    gain[: _LEAST - 1] = gain[count - _LEAST :] = -1
    at = int(gain.argmax()) + 1
    before, after = float(values[:at].mean()), float(values[at:].mean())
    rest = np.concatenate((values[:at] - before, values[at:] - after))
    scatter = float(np.sqrt((rest**2).sum() / (count - 2)))
    unsure = float((high - low).mean()) / 2
    change = abs(after - before)
    sigmas = change / max(scatter * np.sqrt(1 / at + 1 / (count - at)), 1e-9)
    if sigmas >= _SIGMAS and change >= least and change > 2 * unsure:
        yield {
            **about,
            "what": what,
            "since": int(times[at]),
            "before": round(before, 3),
            "after": round(after, 3),
            "sigmas": round(min(sigmas, 1e6), 1),
            "hours": count,
        }
