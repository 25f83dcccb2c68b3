"""What threads of the interface read: once each, whoever asks; an error there is told."""

from __future__ import annotations

import threading
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

from seats import Seat, opened, sample_in, using

import captures
from analyzer.model.bus import Bus
from analyzer.model.registers import RegisterSeries
from analyzer.model.source import CaptureSource
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
    for own, shared in zip(alone, series.readings(), strict=True):
        assert own.tolist() == shared.tolist()


def test_an_error_in_a_thread_is_told(tmp_path: Path) -> None:
    def fails(stop: object) -> None:  # noqa: ARG001
        raise ValueError("no such thing")

    async def work(sitting: Seat) -> None:
        sitting.screen.jobs.run("history", fails, lambda _: None)
        await sitting.until(lambda: any("no such thing" in notice for notice in sitting.notices()))

    using(opened(sample_in(tmp_path)), work)
