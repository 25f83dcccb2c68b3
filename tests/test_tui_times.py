"""One grammar of times: whatever is shown as a time can be typed."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta, timezone, tzinfo
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from analyzer.model.times import GotoError, moment, span
from analyzer.tui.desk import ViewState

_START = int(datetime(2026, 11, 21, 8, 29, 30, tzinfo=UTC).timestamp()) * 10**9
_ZONES = st.sampled_from([UTC, timezone(timedelta(hours=3)), timezone(timedelta(hours=-5, minutes=-30), "XYZ")])


def _bus(first: int = _START, hours: float = 30.0) -> Any:
    return SimpleNamespace(t_first=first, t_last=first + round(hours * 3600e9), timed=True, count=1)


def _desk(bus: Any, zone: tzinfo) -> Any:
    desk = ViewState(SimpleNamespace(), bus)
    desk.zone = zone
    return desk


@given(begin=st.integers(0, 29 * 3600_000), size=st.integers(1, 3600_000 * 24), zone=_ZONES)
def test_a_span_that_is_shown_can_be_typed(begin: int, size: int, zone: tzinfo) -> None:
    bus = _bus()
    low = bus.t_first + begin * 10**6
    high = min(low + size * 10**6, bus.t_last)
    if high <= low:
        return
    shown = _desk(bus, zone).span_words((low, high))
    try:
        told = span(shown, bus, zone)
    except GotoError as error:
        assert "before" in str(error) and high - low < 60 * 10**9, (shown, error)  # both told as one and the same
        return
    step = 60 * 10**9 if high - low >= 3600 * 10**9 else 10**9 if high - low >= 60 * 10**9 else 10**6
    assert abs(told[0] - low) < step and abs(told[1] - high) < step, shown


@given(at=st.integers(0, 30 * 3600_000_000), zone=_ZONES)
def test_a_time_that_is_shown_can_be_typed(at: int, zone: tzinfo) -> None:
    bus = _bus()
    t_ns = bus.t_first + at * 1000
    told = moment(_desk(bus, zone).when(t_ns, True).lower(), bus, zone)
    assert abs(told - t_ns) < 10**6


@given(low=st.integers(0, 10**9), size=st.integers(1, 10**9))
def test_a_span_of_a_capture_s_own_clock_can_be_typed(low: int, size: int) -> None:
    bus = _bus(0)
    shown = _desk(bus, UTC).span_words((low * 1000, (low + size) * 1000))
    told = span(shown, bus)
    assert told == pytest.approx((low * 1000, (low + size) * 1000), rel=1e-8, abs=1000), shown


@pytest.mark.parametrize(
    ("text", "begins", "ends"),
    [
        ("08:29:51-08:30:00", "22 08:29:51", "22 08:30:00"),
        ("2026-11-21 08:29:51 – 08:30:00.5 UTC", "21 08:29:51", "21 08:30:00.5"),
        ("11-21 14-16", "21 14:00", "21 16:00"),
        ("14:00 to 16:00", "22 14:00", "22 16:00"),
        ("14:00..16:00", "22 14:00", "22 16:00"),
        ("23:00-24:00", "21 23:00", "22 00:00"),
        ("2026-11-21 23:00–11-22 01:00 UTC", "21 23:00", "22 01:00"),
    ],
)
def test_spans_as_people_write_them(text: str, begins: str, ends: str) -> None:
    told = [datetime.fromtimestamp(t / 1e9, UTC) for t in span(text, _bus())]
    forms = ("%d %H:%M", "%d %H:%M:%S", "%d %H:%M:%S.%f")
    wanted = [
        datetime.strptime(f"2026-11 {each} +0000", f"%Y-%m {forms[each.count(':') - 1 + ('.' in each)]} %z")
        for each in (begins, ends)
    ]
    assert told == wanted


@pytest.mark.parametrize(
    "text", ["", "-", "14", "14:00", "16:00-14:00", "25:00-26:00", "a-b", "14:00-16:00 xyz", "5-3s"]
)
def test_what_is_no_span_is_said(text: str) -> None:
    with pytest.raises(GotoError):
        span(text, _bus())


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("2000min-3000min", "2000min-3000min is outside the capture: it ends at 1 d 6 h"),
        ("2026-11-21 06:00-08:00", "is outside the capture: it begins at 2026-11-21 08:29:30.000000 UTC"),
        ("2026-11-23 06:00-08:00", "is outside the capture: it ends at 2026-11-22 14:29:30.000000 UTC"),
    ],
)
def test_a_span_of_which_the_capture_has_no_moment_is_said(text: str, says: str) -> None:
    with pytest.raises(GotoError, match=says):
        span(text, _bus())
