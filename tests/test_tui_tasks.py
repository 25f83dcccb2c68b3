"""What an engineer comes for, as a new user would do it: each in under 20 keys from opening the file, counted."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from datetime import UTC, datetime
from pathlib import Path

import pytest
from buses import write_meter
from seats import Seat, opened, seat

import captures
from analyzer.simulation import Scenario, simulate
from analyzer.tui.home import HomeList
from analyzer.tui.plot import Plot
from analyzer.tui.registerlist import RegisterList
from captures import samples
from captures.chunks import Capture, Chunk

_KEYS = 20
_DAY_NS = 86_400 * 10**9


class Counting(Seat):
    """Counts what is typed."""

    keys = 0

    async def press(self, *keys: str) -> None:
        type(self).keys += len(keys)
        await super().press(*keys)

    async def type(self, text: str) -> None:
        type(self).keys += len(text)
        await super().type(text)


@pytest.fixture(scope="module")
def week(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A week of a troubled bus, heard for a while every six hours, at two among them."""
    sample = captures.open(samples.path("troubled.jsonl"))
    noon = datetime.now(UTC).replace(hour=12, minute=0, second=0, microsecond=0)
    begin = int(noon.timestamp()) * 10**9 - 7 * _DAY_NS
    heard = list(sample.chunks())
    chunks = [
        Chunk(begin + hour * 3600 * 10**9 + chunk.t_ns - heard[0].t_ns, chunk.data, chunk.port)
        for hour in range(2, 7 * 24 + 2, 6)
        for chunk in heard
    ]
    path = tmp_path_factory.mktemp("week") / "week.jsonl"
    captures.write(path, Capture.of(sample.line, chunks))
    return path


def doing(
    path: Path, work: Callable[[Counting], Awaitable[None]], size: tuple[int, int] = (100, 30), *, home: bool = True
) -> int:
    """Work done by somebody who has just opened a file; how many keys it took."""
    Counting.keys = 0

    async def main() -> None:
        async with seat(opened(path), size=size, view=None) as sitting:
            causes = sitting.screen.query_one(HomeList)
            if home:
                await sitting.until(lambda: sitting.screen.view == "home" and causes.count() > 0)
            await sitting.settle()
            await work(Counting(sitting.app, sitting.pilot))

    asyncio.run(main())
    assert Counting.keys < _KEYS
    return Counting.keys


def test_the_sickest_unit_and_why(week: Path) -> None:
    async def work(sitting: Counting) -> None:
        shown = sitting.shown()
        units = [line for line in shown.splitlines() if line.strip(" │").startswith("unit")]
        report = sitting.bus.report(sitting.app.desk.source)
        bad = {
            u.unit: (c := u.counts).unanswered / c.requests + (c.exceptions + c.damaged) / c.requests
            for u in report.units
        }
        worst = max(report.units, key=lambda u: bad[u.unit])
        assert f"unit {worst.unit:>3}" in units[0] and "bad" in units[0], "the sickest first"
        home = sitting.screen.query_one(HomeList)
        assert home.state is not None
        await sitting.press(*["down"] * len(home.state.causes))
        assert home.unit is not None and home.unit.unit == worst.unit
        assert "silent" in sitting.shown() and "no answer" not in units[0].split("asked")[0]

    assert doing(week, work) <= 8


def test_all_slow_answers_of_a_unit(week: Path) -> None:
    async def work(sitting: Counting) -> None:
        home = sitting.screen.query_one(HomeList)
        assert home.state is not None
        await sitting.press(*["down"] * len(home.state.causes))
        assert home.unit is not None
        unit, limit = home.unit.unit, home.unit.times.p95_ns
        await sitting.press("equals_sign", "s", "1")
        asked = sitting.screen.transactions
        await sitting.until(lambda: asked.count() > 0)
        rows = [row for row in range(sitting.bus.count) if sitting.bus.table.value("unit", row) == unit]
        slow = [row for row in rows if sitting.bus.table.value("response_ns", row) >= limit]
        assert asked.count() == len(slow) > 0

    doing(week, work)


def test_a_register_over_the_whole_week(week: Path) -> None:
    async def work(sitting: Counting) -> None:
        await sitting.press("5", "g")
        await sitting.type("40108")
        await sitting.press("enter")
        plot = sitting.screen.query_one(Plot)
        await sitting.until(lambda: "40108" in plot.title and "readings" in plot.title)
        assert plot.span is not None and plot.span[1] - plot.span[0] > 6.7 * _DAY_NS
        register = sitting.screen.query_one(RegisterList).register
        assert register is not None and register.address == 107

    doing(week, work)


def test_what_changed_between_two_polls(tmp_path: Path) -> None:
    meter = tmp_path / "meter.jsonl"
    write_meter(meter, [230.0, 230.0, 230.0, 231.5, 231.5, 231.5])

    async def work(sitting: Counting) -> None:
        await sitting.press("1", "d")
        await sitting.until(lambda: sitting.screen.transactions.count() == 2)
        await sitting.press("end")
        assert "40001 230→231.5" in sitting.shown(), "the register, what it was, what it is"
        assert "differ" in sitting.shown(), "and below, from which frame"

    doing(meter, work, home=False)


def test_why_a_boundary_stands_here(week: Path) -> None:
    async def work(sitting: Counting) -> None:
        await sitting.press("1", "down", "w")
        shown = sitting.shown()
        for words in ("likelier than", "t1.5", "t3.5", "before", "length", "crc", "silence"):
            assert words in shown, words

    doing(week, work, size=(100, 40))


def test_yesterdays_exceptions_from_two_to_four_as_a_file(
    week: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)

    async def work(sitting: Counting) -> None:
        await sitting.press("T")
        await sitting.type("y 14-16")
        await sitting.press("enter", "slash")
        await sitting.type("exc")
        await sitting.press("enter", "e", "enter")
        await sitting.until(lambda: (tmp_path / "frames.csv").exists())

    doing(week, work)
    lines = (tmp_path / "frames.csv").read_text().splitlines()
    assert len(lines) > 1
    noon = datetime.now(UTC).replace(hour=12, minute=0, second=0, microsecond=0)
    yesterday = int(noon.timestamp()) * 10**9 - _DAY_NS
    column = lines[0].split(",").index("t_start_ns")
    for line in lines[1:]:
        t = int(line.split(",")[column])
        assert yesterday + 2 * 3600 * 10**9 <= t < yesterday + 4 * 3600 * 10**9


def test_a_unit_whose_answers_come_too_late_is_not_called_sound_and_stands_before_others(tmp_path: Path) -> None:
    made = simulate(Scenario("clean", "irq", transactions=400, seed=4, defect="late-response"))
    path = tmp_path / "late.jsonl"
    captures.write(path, Capture.of(made.line, made.chunks))

    async def work(sitting: Counting) -> None:
        shares = {
            unit.unit: unit.counts.late / unit.counts.requests
            for unit in sitting.bus.report(sitting.app.desk.source).units
        }
        units = [
            line for line in sitting.shown().splitlines() if line.strip(" │").startswith("unit") and "asked" in line
        ]
        assert len(units) == len(shares) and any(shares.values()) and not all(shares.values())
        for line, (unit, share) in zip(units, sorted(shares.items(), key=lambda of: (-of[1], of[0])), strict=True):
            assert f"unit {unit:>3}" in line
            assert (f"{share:.0%} late" if share else "sound") in line
        home = sitting.screen.query_one(HomeList)
        assert home.state is not None
        await sitting.press("end")
        assert home.unit is not None
        least, most = home.unit.times.bounds("p95") or (0, 0)
        assert least < most, "as far as the tap carries"
        assert f"its slow answers: {home.unit.times.worded('p95')} and more" in sitting.shown()

    doing(path, work)
