"""Round times along a span: in order, inside it, not too many, and called what a clock there shows."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta, timezone

from hypothesis import given
from hypothesis import strategies as st

from analyzer.model.activity import time_marks

_YEARS = st.integers(1_600_000_000, 1_900_000_000)


@given(_YEARS, st.integers(600, 365 * 86_400), st.integers(2, 30), st.integers(-12, 14))
def test_marks_are_in_the_span_and_say_what_the_clock_shows(begin: int, size: int, most: int, hours: int) -> None:
    zone = timezone(timedelta(hours=hours))
    marks = list(time_marks(begin * 10**9, (begin + size) * 10**9, most, zone))
    times = [t for t, _ in marks]
    assert times == sorted(set(times)) and len(times) <= most + 1
    assert all(begin * 10**9 <= t <= (begin + size) * 10**9 for t in times)
    for t, words in marks:
        moment = datetime.fromtimestamp(t / 1e9, zone)
        assert words == (f"{moment:%m-%d}" if f"{moment:%H:%M}" == "00:00" else f"{moment:%H:%M}")


def test_a_week_is_marked_by_its_days() -> None:
    begin = int(datetime(2026, 11, 16, 13, tzinfo=UTC).timestamp()) * 10**9
    week = [words for _, words in time_marks(begin, begin + 7 * 86_400 * 10**9, 7, UTC)]
    assert week == ["11-17", "11-18", "11-19", "11-20", "11-21", "11-22", "11-23"]
