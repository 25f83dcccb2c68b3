"""Then and now: two captures, or two spans of one, and what is otherwise."""

from __future__ import annotations

from pathlib import Path

import pytest
from polled import moving
from seats import Seat, opened, sample_in, using

from analyzer.model.bus import Bus
from analyzer.model.meanings import Meanings
from analyzer.model.source import CaptureSource
from analyzer.model.spoken import spoken
from analyzer.model.thenandnow import changes, read_side
from analyzer.tui.against import ChangeList
from analyzer.tui.registerlist import RegisterList
from captures import samples


def _plain(bus: Bus) -> Meanings:
    return Meanings(bus, dict, lambda: lambda _: {})


def _changes(now: CaptureSource, then: CaptureSource) -> list[tuple[str, str, str]]:
    side = read_side(now, bool)
    told = changes(side, read_side(then, bool), _plain(Bus.of(now)))
    return [(each.kind, each.about, each.text) for each in told]


def test_the_same_capture_is_in_nothing_otherwise() -> None:
    assert _changes(moving([5, 6, 5, 6]), moving([6, 5, 6, 5])) == []


def test_a_value_has_moved_where_all_of_it_lies_elsewhere() -> None:
    told = _changes(moving([100, 101, 102]), moving([5, 6, 7]))
    assert told == [("moved", "value", "unit 1, 40002: was 7, now 102")]
    assert _changes(moving([6, 7, 101]), moving([5, 6, 7])) == [], "what varies is no news"


def test_polls_that_come_and_go_are_told() -> None:
    import captures

    healthy = CaptureSource(captures.open(samples.path("healthy.jsonl")), "healthy")
    kinds = {kind for kind, about, _ in _changes(healthy, moving([1, 2, 3, 4])) if about in ("poll", "unit")}
    assert {"new", "gone"} <= kinds


@pytest.fixture
def capture(tmp_path: Path) -> Path:
    return sample_in(tmp_path)


def test_two_spans_and_two_captures_are_compared_at_a_prompt(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        listing = sitting.screen.query_one(ChangeList)
        await sitting.press("A")
        await sitting.type("0s-1s | 200s-300s")
        await sitting.press("enter")
        await sitting.until(lambda: "200s-300s is outside the capture: it ends at" in sitting.shown())
        assert not listing.count()
        await sitting.press("ctrl+u")
        await sitting.type("0s-1s | 1s-3s")
        await sitting.press("enter")
        await sitting.until(lambda: listing.changes is not None)
        assert "beside" in sitting.shown()
        healthy = str(samples.path("healthy.jsonl"))
        await sitting.press("o")
        await sitting.type(healthy)
        await sitting.press("enter")
        await sitting.until(lambda: "healthy.jsonl" in listing.sides)
        assert listing.count() > 3 and "new" in sitting.shown()
        first = [each.kind for each in listing.changes or ()]
        assert first == sorted(first, key=["new", "worse", "moved", "better", "gone"].index)
        at = next((i for i, each in enumerate(listing.changes or ()) if each.spot is not None), None)
        if at is not None:
            spot = (listing.changes or ())[at].spot
            listing.move_to(at)
            await sitting.press("enter")
            assert sitting.screen.view == "registers" and sitting.screen.query_one(RegisterList).spot == spot
            await sitting.press("minus")
            assert sitting.screen.view == "against"

    using(opened(capture), work)


def test_polls_and_what_is_otherwise_are_read_out(capture: Path) -> None:
    import captures

    healthy = CaptureSource(captures.open(samples.path("healthy.jsonl")), "healthy.jsonl")
    lines = list(spoken(opened(capture), "exception", then=healthy))
    assert any(line.endswith("troubled.jsonl beside healthy.jsonl.") for line in lines)
    assert any(line.startswith("new: ") for line in lines)
    polls = [line for line in lines if line.startswith("Poll, unit ")]
    assert len(polls) > 3 and any("40108" in line and "asked" in line for line in polls)
