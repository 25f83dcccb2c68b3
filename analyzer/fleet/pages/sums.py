"""What pages ask the lake for: a query a table, of all sites at once, each row a dictionary."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import groupby
from typing import Any, Final

from ...words import CLOCK_FROM_NS, DAY_NS
from ..lake import Lake
from ..questions import UNIT_COLUMNS

DAYS: Final = 60  # shown, the newest
UNITS: Final = 60  # of a site, those with the largest share of bad answers
CAUSES: Final = 24
CAPTURES: Final = 60  # the newest, and as many of which something could not be read
NO_CLOCK: Final = -(-CLOCK_FROM_NS // DAY_NS)  # days since the epoch: what is before is no date

_DAY: Final = f"epoch_ns(t_ns) // {DAY_NS}"
_SUMS: Final = f"sum(answered) AS answered, {UNIT_COLUMNS}"
_LAST: Final = f"(SELECT max(epoch_ns(t_ns)) // {DAY_NS} - {DAYS} FROM hours)"
_RECENT: Final = f"({_DAY} > {_LAST} OR {_DAY} < {NO_CLOCK})"
_SITE_DAYS: Final = f"SELECT site, {_DAY} AS day, {_SUMS} FROM hours WHERE {_RECENT} GROUP BY ALL ORDER BY ALL"
_SITES: Final = f"SELECT site, {_SUMS} FROM hours GROUP BY ALL ORDER BY site"
_UNITS: Final = f"""SELECT *, count(*) OVER (PARTITION BY site) AS units FROM (
    SELECT site, line, unit, {_SUMS} FROM hours WHERE unit > 0 GROUP BY ALL)
  QUALIFY row_number() OVER (PARTITION BY site ORDER BY bad_percent DESC NULLS LAST, line, unit) <= {UNITS}
  ORDER BY site, bad_percent DESC NULLS LAST, line, unit"""
_UNIT_DAYS: Final = f"""SELECT site, line, unit, {_DAY} AS day, {_SUMS} FROM hours WHERE unit > 0 AND {_RECENT}
  GROUP BY ALL ORDER BY site, line, unit, day"""
_TOLD: Final = "severity blame text share deciding_test remedy period_s confidence runner_up numbers"
_NEWEST: Final = f"struct_pack({', '.join(f'{name} := {name}' for name in _TOLD.split())})"
_SITE_CAUSES: Final = f"""WITH spells AS (SELECT site, line, cause, units, arg_max({_NEWEST}, t_ns) AS newest,
    min({_DAY}) AS first, max(epoch_ns(coalesce(until_ns, t_ns))) // {DAY_NS} AS last, count(DISTINCT {_DAY}) AS days,
    epoch_ns(min(since_ns)) AS since, epoch_ns(max(until_ns)) AS until,
    sum(lost_answers) AS lost_answers, sum(lost_ms) AS lost_ms, sum(bits) AS bits
    FROM causes GROUP BY site, line, cause, units),
  ends AS (SELECT site, line, max(epoch_ns(t_last_ns)) // {DAY_NS} AS ended FROM captures GROUP BY ALL)
  SELECT *, last >= ended - 1 AS lately, count(*) OVER (PARTITION BY site) AS causes
  FROM spells JOIN ends USING (site, line)
  QUALIFY row_number() OVER (PARTITION BY site ORDER BY last >= ended - 1 DESC, bits DESC, line, cause) <= {CAUSES}
  ORDER BY site, lately DESC, bits DESC, line, cause, units"""
_SITE_CAPTURES: Final = """SELECT site, count(*) AS captures, count(DISTINCT line) AS lines,
  count(*) FILTER (WHERE state IN ('damaged', 'unreadable')) AS harmed, sum(bytes)::BIGINT AS bytes,
  epoch_ns(min(t_ns) FILTER (WHERE bytes > 0)) AS oldest, epoch_ns(max(t_last_ns)) AS newest
  FROM captures GROUP BY site ORDER BY site"""
_CAPTURE: Final = """site, line, source, epoch_ns(t_ns) AS t_ns, epoch_ns(t_last_ns) AS t_last_ns, bytes, state,
  damage_count, damage"""
_ORDER: Final = "t_ns DESC, line, source"
_LATEST: Final = f"""SELECT {_CAPTURE} FROM captures
  QUALIFY row_number() OVER (PARTITION BY site ORDER BY {_ORDER}) <= {CAPTURES} ORDER BY site, {_ORDER}"""
_HARMED: Final = f"""SELECT {_CAPTURE} FROM captures WHERE state IN ('damaged', 'unreadable')
  QUALIFY row_number() OVER (PARTITION BY site ORDER BY {_ORDER}) <= {CAPTURES} ORDER BY site, {_ORDER}"""

LakeRow = dict[str, Any]
BySite = dict[str, list[LakeRow]]


class FleetSums:
    """The answers, by site."""

    def __init__(self, lake: Lake) -> None:
        """Raises FleetError where the lake cannot be asked."""
        self.days = _by_site(_lake_rows(lake, _SITE_DAYS))
        self.sites = {row["site"]: row for row in _lake_rows(lake, _SITES)}
        self.units = _by_site(_lake_rows(lake, _UNITS))
        shown = {(row["site"], row["line"], row["unit"]) for rows in self.units.values() for row in rows}
        self.unit_days: dict[tuple[str, str, int], list[LakeRow]] = {}
        for row in _lake_rows(lake, _UNIT_DAYS):
            if (key := (row["site"], row["line"], row["unit"])) in shown:
                self.unit_days.setdefault(key, []).append(row)
        self.causes = _by_site(_lake_rows(lake, _SITE_CAUSES))
        self.captures = {row["site"]: row for row in _lake_rows(lake, _SITE_CAPTURES)}
        self.latest, self.harmed = (_by_site(_lake_rows(lake, text)) for text in (_LATEST, _HARMED))

    def calendar(self) -> list[int]:
        """The days to show, since the epoch: without a gap up to the newest; first 0 where some have no clock."""
        known = {row["day"] for rows in self.days.values() for row in rows}
        dated = [day for day in known if day >= NO_CLOCK]
        clocked = list(range(max(min(dated), max(dated) - DAYS + 1), max(dated) + 1)) if dated else []
        return ([0] if len(dated) < len(known) else []) + clocked

    @property
    def newest(self) -> int:
        """The day of the newest byte."""
        return max((row["newest"] for row in self.captures.values() if row["newest"] is not None), default=0) // DAY_NS


def _by_site(rows: Iterable[LakeRow]) -> BySite:
    return {site: list(own) for site, own in groupby(rows, lambda row: str(row["site"]))}


def _lake_rows(lake: Lake, text: str) -> list[LakeRow]:
    rows: list[LakeRow] = lake.arrow(text).to_pylist()
    return rows
