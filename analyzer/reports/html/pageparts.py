"""What the pages of reports and of fleets share: how templates are filled, cards of causes, bars of outcomes.

Every string is made harmless and escaped, for names and strings come from files and devices that anybody may have
written; words come from the catalogue.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined

from dissectors.values import harmless

from ...causes.model import Cause
from ...languages import counted, grouped, in_use, page_words, tr
from ...version import __version__
from ...words import is_clock, moment
from .. import findings
from ..model import UnitCard


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
    environment.filters["grouped"] = grouped
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


_UNITS: Final = 4  # of a cause, drawn one by one
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
    bars = [unit_bar(card) for card in mine[:_UNITS]]
    if len(mine) > _UNITS:
        bars.append(_bar(page_words("further units of it"), mine[_UNITS:]))
    return (*bars, _bar(page_words("all others"), others))


def _bar(name: str, cards: Iterable[UnitCard]) -> OutcomeBar:
    counts = [(kind, sum(getattr(card, which) for card in cards), words) for kind, which, words in _OUTCOMES]
    parts = tuple(OutcomePart(kind, n, page_words(words, number=n)) for kind, n, words in counts if n)
    every, well = sum(part.count for part in parts), counts[0][1] + counts[1][1]
    return OutcomeBar(name, parts, page_words("{some:,} of {all:,} answered", some=well, all=every))
