"""What became of requests, drawn: a bar a unit, and of a cause its units beside all others."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

from ...causes.model import Cause
from ...languages import page_words
from ..model import UnitCard

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
