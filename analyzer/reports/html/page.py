"""A report with what was seen on the way, as HTML; and what the pages of reports and of fleets share.

That is how templates are filled, cards of causes, bars of outcomes. `page.html.j2` only lays out. Every string is made
harmless and escaped, for names and strings come from files and devices that anybody may have written; words come from
the catalogue.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined

from dissectors.values import harmless

from ...causes.registry import Cause
from ...languages import counted, grouped, in_use, page_words, tr
from ...registers.telling import place_cell
from ...version import __version__
from ...words import decimal, duration, is_clock, moment
from .. import findings, pagetables
from ..model import FindingRow, Report, UnitCard
from ..page import facts, file_name, nothing
from .charts import range_chart, time_chart
from .examples import example_view

if TYPE_CHECKING:
    from .examples import Sights


def page_environment(package: str | None = None) -> Environment:
    """Templates of this package, after those of another one if there is one; `w` and `grade` tell words."""
    environment = Environment(
        loader=ChoiceLoader([PackageLoader(each, "") for each in (package, __package__) if each]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=lambda value: harmless(value) if type(value) is str else value,
    )
    environment.filters.update(grouped=grouped, decimal=decimal)
    environment.globals.update(w=page_words, grade=tr, counted=counted, language=in_use(), version=__version__)
    return environment


_BLAMED: Final[Mapping[str, str]] = {
    "unit": "fault of the unit",
    "master": "fault of the client",
    "line": "fault of the line",
    "tap": "fault of the tap",
}


def about(cause: Cause) -> Iterator[str]:
    """Whose fault it is, since when, what it cost, and what else it could be."""
    if cause.blame in _BLAMED:  # else it is nobody's
        yield page_words(_BLAMED[cause.blame])
    if cause.since_ns is not None and is_clock(cause.since_ns):
        first, last = (moment(t)[:-4] for t in (cause.since_ns, cause.until_ns or cause.since_ns))
        end = last[11:] if last[:11] == first[:11] else last
        yield f"{first}{page_words(' to ')}{end}" if last != first else first
    if cause.lost_answers:
        yield page_words("{what} lost", what=findings.lost(cause.lost_answers, cause.lost_ms))
    if cause.runner_up:
        yield page_words("else {cause}", cause=cause.runner_up)


_UNITS_OF_CAUSE: Final = 4  # of a cause, drawn one by one
_OUTCOMES: Final = (  # kind of a part, which of the card's counts, words
    ("ok", "answered", "{number:,} answered"),
    ("exception", "exceptions", "{number:,} by exception"),
    ("silent", "silent", "{number:,} silent"),
    ("garbage", "garbage", "{number:,} garbage"),
)


@dataclass(frozen=True, slots=True)
class OutcomePart:
    """A part of a bar: so many requests that ended so."""

    kind: str
    count: int
    title: str


@dataclass(frozen=True, slots=True)
class OutcomeBar:
    """All requests to a unit, or to several together."""

    name: str
    parts: tuple[OutcomePart, ...]
    share: str  # that went well


def unit_bar(card: UnitCard) -> OutcomeBar:
    """Of one unit."""
    return _bar(page_words("unit {unit}", unit=card.unit), (card,))


def cause_bars(cause: Cause, cards: Sequence[UnitCard]) -> tuple[OutcomeBar, ...]:
    """The units of a cause, and all others together; nothing where there are none to compare."""
    asked = [card for card in cards if card.asked]
    mine = [card for unit in cause.units for card in asked if card.unit == unit]
    others = [card for card in asked if card.unit not in cause.units]
    if not mine or not others:
        return ()
    bars = [unit_bar(card) for card in mine[:_UNITS_OF_CAUSE]]
    if len(mine) > _UNITS_OF_CAUSE:
        bars.append(_bar(page_words("its other units"), mine[_UNITS_OF_CAUSE:]))
    return (*bars, _bar(page_words("all others"), others))


def _bar(name: str, cards: Iterable[UnitCard]) -> OutcomeBar:
    counts = [(kind, sum(getattr(card, which) for card in cards), words) for kind, which, words in _OUTCOMES]
    parts = tuple(OutcomePart(kind, n, page_words(words, number=n)) for kind, n, words in counts if n)
    every, well = sum(part.count for part in parts), counts[0][1] + counts[1][1]
    return OutcomeBar(name, parts, page_words("{some:,} of {all:,} answered", some=well, all=every))


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
    environment.filters["place"] = lambda value: place_cell(value.area, value.address)
    environment.globals["bytes"] = lambda count: counted(count, "byte", "bytes")
    char_ns = report.line.character_ns
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
        left=[findings.left_words(left) for left in report.not_explained],
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
        return page_words("No errors or warnings found.")
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
