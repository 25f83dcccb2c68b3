"""A report with what was seen on the way, as HTML: values for the template `page.html.j2`, which only lays out."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Final

from analyzer.reports import findings, pagetables
from captures.line import LineSettings

from ...languages import counted, page_words
from ...words import duration
from ..model import FindingRow, Report, UnitCard
from ..page import facts, file_name, nothing
from .charts import range_chart, time_chart
from .examples import example_view
from .pageparts import OutcomeBar, about, cause_bars, page_environment, unit_bar

if TYPE_CHECKING:
    from ...causes.model import Cause
    from .examples import Sights

_CARDS: Final = 8  # findings told at length; the table has all
_UNITS: Final = 12  # that did not answer well
_REGIONS: Final = 5  # of a unit
_POLLS: Final = 60
_HOURS: Final = 24 * 14


def page(report: Report, sights: Sights) -> str:
    """The whole document."""
    environment = page_environment()
    environment.filters.update(duration=lambda ns: "?" if ns is None else duration(ns), seconds=findings.seconds)
    environment.filters["short"] = pagetables.short_number
    environment.filters["poll"] = pagetables.poll_words
    environment.globals["bytes"] = lambda count: counted(count, "byte", "bytes")
    char_ns = LineSettings(baud=report.baud, char_bits=report.char_bits).character_ns
    worst = [row for row in report.findings if row.severity != "note"]
    origin = sights.timeline.origin_ns if report.timed else None
    span = report.span_ns
    return environment.get_template("page.html.j2").render(
        report=report,
        named=file_name,
        facts=_facts_by_label(report),
        nothing=nothing(report),
        verdict=_verdict(worst),
        causes=[
            (cause, cause_bars(cause, report.cards), list(about(cause)), _follows(cause, report, worst))
            for cause in report.causes
        ],
        units=list(_units(report.cards)),
        polls=report.polls[:_POLLS],
        polled=counted(len(report.polls), "poll", "polls"),
        hours=[(row, row.counts) for row in report.hours[:_HOURS]],
        cards=[
            (
                row,
                findings.cost(row),
                [example_view(example, origin) for example in sights.examples.of(row.code)],
            )
            for row in worst[:_CARDS]
        ],
        time=time_chart(sights.timeline, span, char_ns, report.deaf) if span and report.frames else None,
        load_known=char_ns is not None,
        response=range_chart(report.units),
    )


def _follows(cause: Cause, report: Report, worst: list[FindingRow]) -> list[tuple[str, bool]]:
    """Codes of the findings that follow from a cause, and whether each is told at length on this page."""
    told = {row.code for row in worst[:_CARDS]}
    return [(row.code, row.code in told) for row in report.findings if cause.cause in row.explained_by]


def _units(cards: Sequence[UnitCard]) -> Iterator[tuple[OutcomeBar, list[str], list[tuple[str, int, int]], list[str]]]:
    """Of units in trouble, the worst of them, by number: bar, outcomes, where answers are damaged (how often, and as a
    share of the commonest in %), changes."""
    for card in pagetables.troubled(cards, _UNITS):
        most = max(card.damage.values(), default=1)
        regions = [(page_words(name), count, round(100 * count / most)) for name, count in card.damage.items() if count]
        words = list(pagetables.outcome_words(card, damage=False))
        yield unit_bar(card), words, regions[:_REGIONS], [pagetables.change_words(change) for change in card.changes]


def _facts_by_label(report: Report) -> list[tuple[str, list[str]]]:
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
