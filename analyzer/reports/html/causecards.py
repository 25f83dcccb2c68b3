"""What the card of a cause says besides the cause's own words."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Final

from analyzer.reports import findings

from ...causes.model import Cause
from ...languages import page_words
from ...words import is_clock, moment

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
