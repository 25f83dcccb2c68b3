"""Polls: the list that stands still. What it says is what the capture holds, however it came."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from polled import moving
from seats import Seat, opened, sample_in, using

from analyzer.model.bus import Bus
from analyzer.model.pollwatch import PollKey
from analyzer.model.source import CaptureSource
from analyzer.tui.filterbar import FilterBar
from analyzer.tui.places import PollPlace
from analyzer.tui.polllist import PollList
from captures import samples
from captures.chunks import Capture
from captures.line import LineSettings


@pytest.fixture
def capture(tmp_path: Path) -> Path:
    return sample_in(tmp_path)


def _bus(source: CaptureSource) -> Bus:
    bus = Bus.of(source)
    for analysed in source.steps(bool):
        bus.feed(analysed)
    bus.close()
    return bus


def test_polls_count_what_the_transactions_say(capture: Path) -> None:
    bus = _bus(opened(capture))
    report = bus.report(opened(capture))
    asked = Counter[int]()
    for poll in bus.watched:
        asked[poll.key.unit] += poll.facts.asked
        assert poll.ended.sum() <= poll.facts.asked
        assert len(poll.moved) in (0, len(poll.values))
    told = {row.unit: row.counts.requests for row in report.units}
    assert {unit: count for unit, count in asked.items() if unit in told} == pytest.approx(told, abs=3)


def test_what_was_written_and_never_acknowledged_is_no_newest_value(capture: Path) -> None:
    """As `--plain` tells it."""

    async def work(sitting: Seat) -> None:
        listing = sitting.screen.query_one(PollList)
        await sitting.until(lambda: sitting.bus.whole and listing.count() > 0)
        for line, poll in enumerate(sorted(sitting.bus.watched, key=lambda poll: poll.key)):
            told = "".join(part.text for part in listing.pieces(line, 120))
            assert ("no good answer yet" in told) == (poll.facts.answered < 0), told

    using(opened(capture), work, view="polls", size=(120, 40))


def test_a_poll_knows_its_period_its_newest_values_and_what_moves() -> None:
    bus = _bus(moving([10, 10, 11, 11, 12]))
    first, second = sorted(bus.watched, key=lambda poll: poll.key)
    assert first.key == PollKey(1, 3, 3, 0, 2) and second.key.register == "40010"
    assert first.every_ns == 100_000_000 and first.jitter_ns == 0 and first.facts.asked == 5
    assert first.values.tolist() == [7, 12] and first.moved.tolist() == [False, True]
    assert second.moved.tolist() == [False] and first.bad == 0


def test_polls_are_the_same_however_small_the_batches() -> None:
    whole = _bus(moving(list(range(40))))
    parts = Bus.of(moving(list(range(40))))
    for analysed in moving(list(range(40))).steps(bool):
        parts.feed(analysed)
    for one, other in zip(whole.watched, parts.watched, strict=True):
        assert one.key == other.key and one.facts == other.facts
        assert np.array_equal(one.intervals, other.intervals) and np.array_equal(one.moved, other.moved)


def test_the_list_sorts_notches_pins_and_opens() -> None:
    async def work(sitting: Seat) -> None:
        listing = sitting.screen.query_one(PollList)
        assert listing.count() == 2 and "▲1" in sitting.shown() and "100ms" in sitting.shown()
        assert isinstance(sitting.screen.place, PollPlace)
        await sitting.press("n")
        assert "▲1" not in sitting.shown(), "what moved so far is left out"
        await sitting.press("d")
        assert listing.count() == 0
        await sitting.press("d", "N")
        assert "▲1" in sitting.shown()
        await sitting.press("end", "space", "home")
        assert listing.poll is not None and listing.poll.key.unit == 2, "pinned to the top"
        await sitting.press("=")
        await sitting.press("p")
        wanted = "unit == 2 and register == 40010 and function == 3 and quantity == 1"
        assert sitting.screen.query_one(FilterBar).text == wanted
        await sitting.until(lambda: listing.count() == 1)
        await sitting.press("escape")
        await sitting.until(lambda: listing.count() == 2)
        await sitting.press("home", "enter")
        assert sitting.screen.view == "transactions" and sitting.screen.query_one(FilterBar).text == wanted

    using(moving([10, 11, 12, 13]), work, view="polls", size=(140, 30))


def test_a_click_on_a_head_sorts_by_it() -> None:
    async def work(sitting: Seat) -> None:
        listing = sitting.screen.query_one(PollList)
        head = "".join(part.text for part in listing.head(listing.scrollable_content_region.width))
        await sitting.pilot.click(PollList, offset=(head.index("max") + 1, 0))
        await sitting.settle()
        assert listing.sort == "max" and "max▾" in sitting.shown()

    using(moving([10, 11]), work, view="polls", size=(140, 30))


def test_polls_fit_forty_columns_and_say_so_where_nothing_was_asked() -> None:
    async def work(sitting: Seat) -> None:
        assert max(len(line.rstrip()) for line in sitting.shown().splitlines()) <= 40

    using(CaptureSource(samples_healthy(), "healthy"), work, view="polls", size=(40, 24))

    async def nothing(sitting: Seat) -> None:
        assert "nothing was asked yet" in sitting.shown() or "no Modbus frame" in sitting.shown()

    using(CaptureSource(Capture.of(LineSettings(), [], timed=True), "empty"), nothing, view="polls")


def samples_healthy() -> Capture:
    import captures

    return captures.open(samples.path("healthy.jsonl"))


def test_a_poll_without_a_quantity_names_its_register_alone() -> None:
    assert PollKey(1, 22, 3, 4, -1).registers == "40005"
    assert PollKey(1, 3, 3, 107, 3).registers == "40108 ×3"
    assert PollKey(17, 43, -1, -1, -1).registers == ""
