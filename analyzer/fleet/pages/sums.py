"""What the pages of a lake show, asked of it: of the fleet as a whole, and of some sites at a time.

A fleet has thousands of sites; only what its own page shows of each of them is in memory at once.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import groupby
from typing import Any, Final

from ...words import CLOCK_FROM_NS, DAY_NS
from ..lake import Lake
from ..questions import UNIT_COLUMNS, sites_at_once

DAYS: Final = 60  # shown, the newest
UNITS: Final = 60  # of a site, those with the largest share of bad answers
CAUSES: Final = 24
CAPTURES: Final = 60  # the newest, and as many of which something could not be read
NO_CLOCK: Final = -(-CLOCK_FROM_NS // DAY_NS)  # days since the epoch: what is before is no date

_DAY: Final = f"epoch_ns(t_ns) // {DAY_NS}"
_SUMS: Final = f"sum(answered) AS answered, {UNIT_COLUMNS}"
_HOURS: Final = "hours WHERE site BETWEEN $first AND $last"
_CAUSES: Final = "causes WHERE site BETWEEN $first AND $last"
_CAPTURES: Final = "captures WHERE site BETWEEN $first AND $last"
_RECENT: Final = f"({_DAY} > $before OR {_DAY} < {NO_CLOCK})"
_FLEET_DAYS: Final = f"SELECT DISTINCT {_DAY} AS day FROM hours"
_FLEET_SPAN: Final = f"""SELECT (SELECT min({_DAY}) FROM causes) AS caused,
  (SELECT max(epoch_ns(t_last_ns)) // {DAY_NS} FROM captures) AS newest"""
_SITE_DAYS: Final = f"SELECT site, {_DAY} AS day, {_SUMS} FROM {_HOURS} AND {_RECENT} GROUP BY ALL ORDER BY ALL"
_SITE_SUMS: Final = f"SELECT site, {_SUMS} FROM {_HOURS} GROUP BY ALL ORDER BY site"
_UNITS: Final = f"""SELECT *, count(*) OVER (PARTITION BY site) AS units FROM (
    SELECT site, line, unit, {_SUMS} FROM {_HOURS} AND unit > 0 GROUP BY ALL)
  QUALIFY row_number() OVER (PARTITION BY site ORDER BY bad_percent DESC NULLS LAST, line, unit) <= {UNITS}
  ORDER BY site, bad_percent DESC NULLS LAST, line, unit"""
_UNIT_DAYS: Final = f"""SELECT site, line, unit, {_DAY} AS day, {_SUMS} FROM {_HOURS} AND unit > 0 AND {_RECENT}
  GROUP BY ALL ORDER BY site, line, unit, day"""
_TOLD: Final = "severity blame text share deciding_test remedy period_s confidence runner_up numbers"
_NEWEST_CAUSE: Final = f"struct_pack({', '.join(f'{name} := {name}' for name in _TOLD.split())})"
_SITE_CAUSES: Final = f"""WITH spells AS (SELECT site, line, cause, units, arg_max({_NEWEST_CAUSE}, t_ns) AS newest,
    min({_DAY}) AS first, max(epoch_ns(coalesce(until_ns, t_ns))) // {DAY_NS} AS last, count(DISTINCT {_DAY}) AS days,
    epoch_ns(min(since_ns)) AS since, epoch_ns(max(until_ns)) AS until,
    sum(lost_answers) AS lost_answers, sum(lost_ms) AS lost_ms, sum(bits) AS bits
    FROM {_CAUSES} GROUP BY site, line, cause, units),
  ends AS (SELECT site, line, max(epoch_ns(t_last_ns)) // {DAY_NS} AS ended FROM {_CAPTURES} GROUP BY ALL)
  SELECT *, last >= ended - 1 AS lately, count(*) OVER (PARTITION BY site) AS causes
  FROM spells JOIN ends USING (site, line)
  QUALIFY row_number() OVER (PARTITION BY site ORDER BY last >= ended - 1 DESC, bits DESC, line, cause) <= {CAUSES}
  ORDER BY site, lately DESC, bits DESC, line, cause, units"""
_SITE_CAPTURES: Final = f"""SELECT site, count(*) AS captures, count(DISTINCT line) AS lines,
  count(*) FILTER (WHERE state IN ('damaged', 'unreadable')) AS harmed, sum(bytes)::BIGINT AS bytes,
  epoch_ns(min(t_ns) FILTER (WHERE bytes > 0)) AS oldest, epoch_ns(max(t_last_ns)) AS newest
  FROM {_CAPTURES} GROUP BY site ORDER BY site"""
_CAPTURE: Final = """site, line, source, epoch_ns(t_ns) AS t_ns, epoch_ns(t_last_ns) AS t_last_ns, bytes, state,
  damage_count, damage"""
_ORDER: Final = "t_ns DESC, line, source"
_LATEST: Final = f"""SELECT {_CAPTURE} FROM {_CAPTURES}
  QUALIFY row_number() OVER (PARTITION BY site ORDER BY {_ORDER}) <= {CAPTURES} ORDER BY site, {_ORDER}"""
_HARMED: Final = f"""SELECT {_CAPTURE} FROM {_CAPTURES} AND state IN ('damaged', 'unreadable')
  QUALIFY row_number() OVER (PARTITION BY site ORDER BY {_ORDER}) <= {CAPTURES} ORDER BY site, {_ORDER}"""

LakeRow = dict[str, Any]
BySite = dict[str, list[LakeRow]]


class FleetSpan:
    """The days of a fleet. Raises FleetError where the lake cannot be asked."""

    def __init__(self, lake: Lake) -> None:
        known = [row["day"] for row in lake.arrow(_FLEET_DAYS).to_pylist()]
        self.before = max(known, default=0) - DAYS  # a day that is shown no more, and those before it
        shown = [day for day in known if day > self.before or day < NO_CLOCK]
        dated = [day for day in shown if day >= NO_CLOCK]
        clocked = list(range(max(min(dated), max(dated) - DAYS + 1), max(dated) + 1)) if dated else []
        self.calendar = ([0] if len(dated) < len(shown) else []) + clocked
        """The days to show, since the epoch: without a gap up to the newest; first 0 where some have no clock."""
        [span] = lake.arrow(_FLEET_SPAN).to_pylist()
        self.newest: int = span["newest"] or 0
        """The day of the newest byte."""
        self.oldest_cause: int = self.newest if span["caused"] is None else span["caused"]


class SiteSums:
    """The answers of the sites from one to another, by site. Raises FleetError where the lake cannot be asked."""

    def __init__(self, lake: Lake, span: FleetSpan, first: str, last: str) -> None:
        given = {"first": first, "last": last, "before": span.before}

        def rows(text: str) -> list[LakeRow]:
            told: list[LakeRow] = lake.arrow(text, {k: v for k, v in given.items() if f"${k}" in text}).to_pylist()
            return told

        self.days = _by_site(rows(_SITE_DAYS))
        self.sites = {row["site"]: row for row in rows(_SITE_SUMS)}
        self.units = _by_site(rows(_UNITS))
        self.unit_days: dict[tuple[str, str, int], list[LakeRow]] = {}
        for row in rows(_UNIT_DAYS):
            self.unit_days.setdefault((row["site"], row["line"], row["unit"]), []).append(row)
        self.causes = _by_site(rows(_SITE_CAUSES))
        self.captures = {row["site"]: row for row in rows(_SITE_CAPTURES)}
        self.latest, self.harmed = (_by_site(rows(text)) for text in (_LATEST, _HARMED))


def sums_of(lake: Lake, span: FleetSpan) -> Iterator[tuple[list[str], SiteSums]]:
    """All sites, some at a time, with what they sum up to."""
    for some in sites_at_once(lake):
        yield some, SiteSums(lake, span, some[0], some[-1])


def _by_site(rows: Iterable[LakeRow]) -> BySite:
    return {site: list(own) for site, own in groupby(rows, lambda row: str(row["site"]))}
