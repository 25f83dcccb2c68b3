"""A fleet as one HTML page: sites as rows with their health day by day, each down to its own section and its causes.

One self-contained file: no script, nothing fetched. All of it comes from the small tables (`hours`, `causes`,
`captures`), so it costs the same whatever the frames are.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final
from urllib.parse import quote

from ..version import __version__
from .datasets import DAY_NS, day_name
from .lake import Lake
from .questions import UNIT_COLUMNS

_DAYS: Final = 60  # shown, the newest
_MOST: Final = 12  # causes, and units, of a site
_LEVELS: Final = ((0.1, "good"), (1.0, "fair"), (5.0, "poor"))  # percent of bad answers up to which
_WORST: Final = "bad"


@dataclass(frozen=True, slots=True)
class DayCell:
    """A site's day: how it looks, and what to say of it."""

    level: str
    title: str


@dataclass(frozen=True, slots=True)
class SiteSection:
    """A site in the table and in its own section."""

    name: str
    anchor: str
    days: tuple[DayCell, ...]
    totals: dict[str, Any]
    causes: tuple[dict[str, Any], ...]
    units: tuple[dict[str, Any], ...]
    captures: dict[str, Any]


def fleet_page(lake: Lake) -> str:
    """The page."""
    from jinja2 import Environment, PackageLoader

    from ..words import date_and_time

    environment = Environment(
        loader=PackageLoader("analyzer.fleet", "templates"), autoescape=True, trim_blocks=True, lstrip_blocks=True
    )
    environment.globals["response"] = _response
    environment.filters["day"] = day_name
    days, sections = _sections(lake)
    newest = max((row["newest"] for row in _rows(lake, _CAPTURES) if row["newest"] is not None), default=None)
    style = (Path(__file__).parents[1] / "reports" / "html" / "page.css").read_text(encoding="utf-8")
    return environment.get_template("fleet.html.j2").render(
        title=Path(lake.store.root).name or lake.store.root,
        root=lake.store.root,
        newest="-" if newest is None else date_and_time(newest),
        days=days,
        sites=sections,
        style=style,
        version=__version__,
    )


_CAPTURES: Final = """SELECT site, count(*) AS captures, count(*) FILTER (WHERE state = 'damaged') AS damaged,
  count(*) FILTER (WHERE state = 'unreadable') AS unreadable, sum(bytes)::BIGINT AS bytes,
  epoch_ns(max(t_last_ns)) AS newest FROM captures GROUP BY site ORDER BY site"""
_DAY_SUMS: Final = f"""SELECT site, epoch_ns(t_ns) // {DAY_NS} AS day, {UNIT_COLUMNS}
  FROM hours GROUP BY ALL ORDER BY ALL"""
_SITE_SUMS: Final = f"SELECT site, {UNIT_COLUMNS} FROM hours GROUP BY ALL ORDER BY ALL"
_UNIT_SUMS: Final = f"""SELECT site, line, unit, {UNIT_COLUMNS} FROM hours WHERE unit > 0
  GROUP BY site, line, unit
  QUALIFY row_number() OVER (PARTITION BY site ORDER BY bad_percent DESC NULLS LAST, line, unit) <= {_MOST}
  ORDER BY site, bad_percent DESC NULLS LAST, line, unit"""
_SITE_CAUSES: Final = f"""SELECT site, line, cause, units, arg_max(severity, t_ns) AS severity,
  arg_max(text, t_ns) AS text, arg_max(remedy, t_ns) AS remedy, count(*) AS days,
  min(epoch_ns(t_ns)) // {DAY_NS} AS first,
  max(epoch_ns(coalesce(until_ns, t_ns))) // {DAY_NS} AS last, sum(bits) AS bits
  FROM causes GROUP BY site, line, cause, units
  QUALIFY row_number() OVER (PARTITION BY site ORDER BY sum(bits) DESC, line, cause) <= {_MOST}
  ORDER BY site, bits DESC, line, cause"""


def _sections(lake: Lake) -> tuple[list[str], list[SiteSection]]:
    by_day: dict[str, dict[str, dict[str, Any]]] = {}
    for row in _rows(lake, _DAY_SUMS):
        by_day.setdefault(row["site"], {})[day_name(row["day"])] = row
    days = sorted({day for rows in by_day.values() for day in rows})[-_DAYS:]
    totals = {row["site"]: row for row in _rows(lake, _SITE_SUMS)}
    captured = {row["site"]: row for row in _rows(lake, _CAPTURES)}
    causes, units = (_by_site(_rows(lake, text)) for text in (_SITE_CAUSES, _UNIT_SUMS))
    sections = [
        SiteSection(
            site,
            "site-" + quote(site, safe=""),
            tuple(_cell(day, by_day.get(site, {}).get(day)) for day in days),
            totals.get(site, {}),
            tuple(causes.get(site, ())),
            tuple(units.get(site, ())),
            captured.get(site, {}),
        )
        for site in lake.sites
    ]
    sections.sort(key=lambda one: (-(one.totals.get("bad_percent") or 0), one.name))
    return days, sections


def _cell(day: str, row: dict[str, Any] | None) -> DayCell:
    if row is None or row["bad_percent"] is None:
        return DayCell("none", f"{day}: nothing asked")
    bad = row["bad_percent"]
    level = next((name for most, name in _LEVELS if bad <= most), _WORST)
    return DayCell(level, f"{day}: {bad:g} % of {int(row['asked']):,} requests without a good answer")


def _response(row: dict[str, Any]) -> str:
    """The mean response time, as far as it is known."""
    from ..words import between

    if not row or row["mean_ms_low"] is None:
        return "-"
    return between(round(row["mean_ms_low"] * 1e6), round(row["mean_ms_high"] * 1e6))


def _by_site(rows: list[dict[str, Any]]) -> dict[str, list[dict[str, Any]]]:
    grouped: dict[str, list[dict[str, Any]]] = {}
    for row in rows:
        grouped.setdefault(row["site"], []).append(row)
    return grouped


def _rows(lake: Lake, text: str) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = lake.arrow(text).to_pylist()
    return rows
