"""A report with what was seen on the way, as HTML: values for the template `page.html.j2`, which only lays out.

Every string that reaches the page is made harmless and escaped, whatever it says: names and strings come from files
and devices that anybody may have written.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from jinja2 import Environment, PackageLoader, StrictUndefined

from analyzer.reports import findings, values
from captures.line import LineSettings
from dissectors.values import harmless

from ...languages import counted, in_use, page_words
from ...version import __version__
from ...words import duration
from ..model import FindingRow, Report
from ..page import facts, nothing
from .charts import range_chart, time_chart
from .pieces import shown

if TYPE_CHECKING:
    from .examples import Sights

_CARDS: Final = 8  # findings told at length; the table has all


def page(report: Report, sights: Sights) -> str:
    """The whole document."""
    environment = Environment(
        loader=PackageLoader("analyzer.reports.html", ""),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=lambda value: harmless(value) if type(value) is str else value,
    )
    environment.filters.update(duration=lambda ns: "?" if ns is None else duration(ns), seconds=findings.seconds)
    environment.filters["short"] = values.short
    environment.globals["w"] = page_words
    char_ns = LineSettings(baud=report.baud, char_bits=report.char_bits).character_ns
    worst = [row for row in report.findings if row.severity != "note"]
    origin = sights.timeline.origin_ns if report.timed else None
    span = report.span_ns
    return environment.get_template("page.html.j2").render(
        report=report,
        language=in_use(),
        facts=_joined(report),
        nothing=nothing(report),
        verdict=_verdict(worst),
        cards=[
            (row, findings.cost(row), [shown(example, origin) for example in sights.examples.of(row.code)])
            for row in worst[:_CARDS]
        ],
        time=time_chart(sights.timeline, span, char_ns, report.deaf) if span and report.frames else None,
        load_known=char_ns is not None,
        response=range_chart(report.units),
        version=__version__,
    )


def _joined(report: Report) -> list[tuple[str, list[str]]]:
    """The facts, each label with all of its lines."""
    joined: list[tuple[str, list[str]]] = []
    for label, words in facts(report):
        if label:
            joined.append((label, [words]))
        else:
            joined[-1][1].append(words)
    return joined


def _verdict(worst: list[FindingRow]) -> str:
    """The page in one sentence."""
    errors = [row for row in worst if row.severity == "error"]
    if not worst:
        return page_words("No error and no warning was found.")
    parts = []
    if errors:
        parts.append(counted(sum(row.count for row in errors), "error", "errors"))
    if len(worst) > len(errors):
        parts.append(counted(sum(row.count for row in worst if row.severity == "warning"), "warning", "warnings"))
    answers, ms = sum(row.lost_answers for row in worst), sum(row.lost_ms or 0.0 for row in worst)
    words = page_words(
        "{found} of {kinds}", found=page_words(" and ").join(parts), kinds=counted(len(worst), "kind", "kinds")
    )
    if answers:
        words += page_words("; {what} lost", what=findings.lost(answers, ms))
    return f"{words}."
