"""What threads of the interface read: once each, whoever asks; an error there is told."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Callable, Hashable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from seats import Seat, opened, sample_in, using
from textual.events import Key

import captures
from analyzer.causes.ledger import Ledger
from analyzer.causes.registry import Cause
from analyzer.core import Analysed
from analyzer.model.activity import Activity
from analyzer.model.bus import Bus
from analyzer.model.registers import RegisterSeries
from analyzer.model.scope import ScopedFigures
from analyzer.model.selection import CompiledTest
from analyzer.model.source import CaptureSource
from analyzer.tui import jobs
from analyzer.tui.app import Rtuscope
from analyzer.tui.filterbar import FilterBar
from analyzer.tui.lines import Lines
from captures import samples


def test_readings_asked_for_by_several_threads_are_there_once() -> None:
    source = CaptureSource(captures.open(samples.path("healthy.jsonl")), "bus")
    bus = Bus.of(source)
    for analysed in source.steps(lambda: False):
        bus.feed(analysed)
    bus.close()
    register = bus.registers.all()[0]
    alone = RegisterSeries(register.unit, register.area, register.address).extend(bus).readings()
    series, together = RegisterSeries(register.unit, register.area, register.address), threading.Barrier(2)

    def slow_stop() -> bool:
        """Asked between two slices: the other thread comes in here."""
        with suppress(threading.BrokenBarrierError):
            together.wait(0.2)
        return False

    with ThreadPoolExecutor(2) as threads:
        for task in [threads.submit(series.extend, bus, slow_stop) for _ in range(2)]:
            task.result()
    assert [each.tolist() for each in series.readings()] == [each.tolist() for each in alone]


def test_an_error_in_a_thread_is_told(tmp_path: Path) -> None:
    def fails(stop: object) -> None:  # noqa: ARG001
        raise ValueError("no such thing")

    async def work(sitting: Seat) -> None:
        sitting.screen.jobs.run("history", fails, lambda _: None)
        await sitting.until(lambda: any("no such thing" in notice for notice in sitting.notices()))

    using(opened(sample_in(tmp_path)), work)


def test_an_outcome_on_its_way_is_not_heard_once_another_one_is_wanted(tmp_path: Path) -> None:
    heard, began, ends = list[str](), threading.Event(), threading.Event()

    def first(stop: object) -> str:  # noqa: ARG001
        began.set()
        ends.wait()
        return "old"

    async def work(sitting: Seat) -> None:
        jobs = sitting.screen.jobs
        jobs.run("history", first, heard.append)
        await sitting.until(began.is_set)
        ends.set()
        time.sleep(0.2)  # nobody draws meanwhile: the outcome waits to be heard
        jobs.run("history", lambda _: "new", heard.append)
        await sitting.until(lambda: "new" in heard)
        assert heard == ["new"]

    using(opened(sample_in(tmp_path)), work)


def test_figures_of_a_filter_that_was_taken_back_are_not_shown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    began, ends, ended = threading.Event(), threading.Event(), threading.Event()

    def slowly(bus: Bus, rows: NDArray[np.int64], stop: Callable[[], bool]) -> ScopedFigures:  # noqa: ARG001
        began.set()
        ends.wait()
        try:
            return ScopedFigures(bus, rows)
        finally:
            ended.set()

    monkeypatch.setattr("analyzer.tui.jobs.ScopedFigures", slowly)

    async def work(sitting: Seat) -> None:
        bar = sitting.screen.query_one(FilterBar)
        bar.use_filter("unit == 2")
        await sitting.until(began.is_set)
        bar.use_filter("")
        await sitting.until(lambda: not sitting.screen.jobs.scope.narrows)
        ends.set()
        await sitting.until(ended.is_set)
        await sitting.settle()
        assert sitting.screen.desk.narrowed is None

    using(opened(sample_in(tmp_path)), work, view="home")


@pytest.mark.parametrize(("key", "target"), [("9", "#unit-list"), ("0", "#home")])
def test_keys_typed_ahead_wait_for_the_first_lines_of_a_view(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, key: str, target: str
) -> None:
    whole = Bus.report

    def slowly(bus: Bus, source: Any, *, story: bool = False) -> Any:
        time.sleep(0.3)  # a busy machine
        return whole(bus, source, story=story)

    monkeypatch.setattr(Bus, "report", slowly)

    async def work(sitting: Seat) -> None:
        for typed in (key, "down", "down"):
            sitting.app.post_message(Key(typed, typed if len(typed) == 1 else None))
        await sitting.until(lambda: sitting.app.keys.taken == 3)
        await sitting.settle()
        assert sitting.screen.query_one(target, Lines).cursor == 2

    using(opened(sample_in(tmp_path)), work)


def test_keys_wait_once_for_lines_that_do_not_come(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    comes, whole = threading.Event(), Bus.report

    def late(bus: Bus, source: Any, *, story: bool = False) -> Any:
        comes.wait()
        return whole(bus, source, story=story)

    monkeypatch.setattr(Bus, "report", late)

    async def work(sitting: Seat) -> None:
        sitting.app.keys.patience_s = 0.2
        for typed in ("9", "down", "2"):
            sitting.app.post_message(Key(typed, typed if len(typed) == 1 else None))
        await sitting.until(lambda: sitting.screen.view == "frames" and not sitting.app.keys.busy)
        assert not sitting.screen.jobs.is_filling
        comes.set()

    using(opened(sample_in(tmp_path)), work)


def test_a_search_that_fails_is_told_and_the_next_hit_is_looked_for(tmp_path: Path) -> None:
    failing = [True]

    def hits(bus: object, first: int, last: int) -> NDArray[np.int64]:  # noqa: ARG001
        if failing.pop() if failing else False:
            raise ValueError("no such bytes")
        return np.array([row for row in (5,) if first <= row < last], np.int64)

    async def work(sitting: Seat) -> None:
        sitting.screen.jumps.find_by("row five", hits)
        await sitting.until(lambda: any("no such bytes" in notice for notice in sitting.notices()))
        await sitting.until(lambda: sitting.screen.jobs.doing == "")
        await sitting.press("n")
        await sitting.until(lambda: sitting.row == 5)

    using(opened(sample_in(tmp_path)), work)


def test_escape_stops_a_search_and_the_filter_stays(tmp_path: Path) -> None:
    stopped = threading.Event()

    def hits(bus: object, first: int, last: int) -> NDArray[np.int64]:  # noqa: ARG001
        stopped.wait(60)
        return np.array([first], np.int64)

    async def work(sitting: Seat) -> None:
        sitting.screen.query_one(FilterBar).use_filter("unit == 2")
        await sitting.settle()
        at = sitting.row
        sitting.screen.jumps.find_by("what never comes", hits)
        sitting.screen.jumps.find_on(back=False)
        assert "what never comes, Esc stops" in sitting.screen.jobs.doing
        sitting.app.keys.patience_s = 0.1
        sitting.app.post_message(Key("escape", None))
        await sitting.until(lambda: sitting.screen.jobs.doing == "")
        stopped.set()
        await sitting.settle()
        assert sitting.row == at and sitting.screen.query_one(FilterBar).text == "unit == 2"

    using(opened(sample_in(tmp_path)), work)


def test_a_filter_that_fails_is_told_and_the_next_one_filters(tmp_path: Path) -> None:
    def fails(bus: Bus, number: int, low: int, high: int) -> NDArray[np.bool_]:  # noqa: ARG001
        raise ValueError("no such column")

    async def work(sitting: Seat) -> None:
        jobs = sitting.screen.jobs
        jobs.scope.filter = CompiledTest("broken", fails, False)
        jobs.reselect()
        await sitting.until(lambda: any("no such column" in notice for notice in sitting.notices()))
        sitting.screen.query_one(FilterBar).use_filter("unit == 2")
        await sitting.until(lambda: 0 < sitting.screen.frames.count() < sitting.bus.count)

    using(opened(sample_in(tmp_path)), work)


def test_reading_ends_though_its_last_step_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(ledger: Ledger) -> None:  # noqa: ARG001
        raise ValueError("no such ledger")

    monkeypatch.setattr(Ledger, "close", fails)

    async def work(sitting: Seat) -> None:
        await sitting.until(lambda: any("no such ledger" in notice for notice in sitting.notices()))
        assert sitting.bus.whole and sitting.screen.jobs.doing == ""

    using(opened(sample_in(tmp_path)), work)


def test_activity_asked_for_while_its_bins_merge_is_all_there(monkeypatch: pytest.MonkeyPatch) -> None:
    source = CaptureSource(captures.open(samples.path("healthy.jsonl")), "bus")
    bus = Bus.of(source)
    for analysed in source.steps(lambda: False):
        bus.feed(analysed)
    monkeypatch.setattr("analyzer.model.activity._FEW", -1)
    whole, merging, asked = bus.batch(np.arange(bus.count)).rows, threading.Event(), threading.Event()
    activity = Activity()
    activity.feed(whole)

    class Slowly(dict[Hashable, NDArray[np.int64]]):
        def __setitem__(self, name: Hashable, table: NDArray[np.int64]) -> None:
            merging.set()
            asked.wait(0.3)
            super().__setitem__(name, table)

    before = activity.over(bus, bus.t_first, bus.t_last + 10**9, 50).frames.sum()
    activity._bins.tables = Slowly(activity._bins.tables)
    later = whole[-1:].copy()
    later.t_start_ns[:] += 400_000_000_000
    later.t_end_ns[:] += 400_000_000_000
    with ThreadPoolExecutor(1) as thread:
        fed = thread.submit(activity.feed, later)
        assert merging.wait(5)
        frames = activity.over(bus, bus.t_first, bus.t_last + 10**9, 50).frames.sum()
        asked.set()
        fed.result()
    assert frames == before


def test_a_row_is_under_study_though_home_comes_up_before_any_list(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    held, tested = threading.Event(), jobs._extended

    def late(*arguments: Any) -> bool:
        held.wait(20)
        return tested(*arguments)

    monkeypatch.setattr(jobs, "_extended", late)

    async def work(sitting: Seat) -> None:
        try:
            await sitting.until(lambda: sitting.bus.whole and sitting.screen.view == "home")
            await sitting.until(lambda: sitting.screen.studied is not None)
        finally:
            held.set()

    app = Rtuscope(opened(sample_in(tmp_path)))

    async def main() -> None:
        async with app.run_test() as pilot:
            await work(Seat(app, pilot))

    asyncio.run(main())


def test_causes_that_nobody_looks_at_are_not_worked_out_once_a_key_was_pressed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source, pressed, asked = opened(sample_in(tmp_path)), threading.Event(), list[bool]()
    steps, causes = source.steps, Bus.causes

    def held_back(stop: Callable[[], bool]) -> Iterator[Analysed]:
        pressed.wait(20)  # a first part in which a cause shows would bring Home up before the key
        yield from steps(stop)

    def noted(bus: Bus) -> list[Cause]:
        asked.append(pressed.is_set())
        return causes(bus)

    monkeypatch.setattr(source, "steps", held_back)
    monkeypatch.setattr(Bus, "causes", noted)

    async def main() -> None:
        app = Rtuscope(source)
        async with app.run_test() as pilot:
            sitting = Seat(app, pilot)
            await pilot.press("down")
            await sitting.until(lambda: sitting.screen.touched)
            pressed.set()
            await sitting.until(lambda: sitting.bus.whole)
            await sitting.settle()
            sitting.screen.query_one(FilterBar).use_filter("value >= 0")
            await sitting.settle()
            assert sitting.screen.view == "transactions"

    asyncio.run(main())
    assert True not in asked


def test_nothing_is_called_right_before_it_is_read(monkeypatch: pytest.MonkeyPatch) -> None:
    source, begun, go_on = opened(samples.path("healthy.jsonl")), threading.Event(), threading.Event()
    steps = source.steps

    def held_back(stop: Callable[[], bool]) -> Iterator[Analysed]:
        begun.wait(20)
        for analysed in steps(stop):
            yield analysed
            go_on.wait(20)

    monkeypatch.setattr(source, "steps", held_back)
    monkeypatch.setattr(jobs, "_PERIOD_S", 0.0)  # each step is painted

    async def main() -> None:
        app = Rtuscope(source, view="home")
        async with app.run_test(size=(80, 24)) as pilot:
            sitting = Seat(app, pilot)
            await sitting.until(lambda: "reading …" in sitting.shown())
            assert "wrong" not in sitting.shown()
            begun.set()
            await sitting.until(lambda: "No problems so far" in sitting.shown())
            go_on.set()
            await sitting.until(lambda: "No problems found" in sitting.shown())

    asyncio.run(main())
