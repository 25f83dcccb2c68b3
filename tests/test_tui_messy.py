"""The interface on captures of a bus in trouble: nothing that damage made up stands among what is there."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest
from seats import opened, seat

import captures
from analyzer.simulation import Scenario, simulate
from analyzer.tui.findings import FindingList
from analyzer.tui.home import HomeList
from analyzer.tui.timeline import Timeline
from captures.chunks import Capture


@pytest.fixture(scope="module")
def messy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A line on which everything goes wrong, behind a tap whose times are no good."""
    made = simulate(Scenario("brutal", "irq", transactions=500, seed=41))
    path = tmp_path_factory.mktemp("messy") / "bus.jsonl"
    captures.write(path, Capture.of(made.line, made.chunks))
    return path


def test_findings_stand_at_their_first_line_until_somebody_moves(messy: Path) -> None:
    """What explains them comes later; the finding about the bus as a whole is in the last group."""

    async def main() -> None:
        async with seat(opened(messy), size=(120, 40), view="findings") as sitting:
            listing = sitting.screen.query_one(FindingList)
            await sitting.until(lambda: sitting.bus.whole and bool(listing.causes))
            assert any(sitting.bus.found.row(i) < 0 for i in range(sitting.bus.found.count))
            await sitting.press("home")
            listing.use_causes(())
            listing.use_causes(sitting.bus.causes())
            await sitting.settle()
            assert listing.cursor == 0

    asyncio.run(main())


def test_the_timeline_has_a_row_for_each_unit_that_a_good_frame_speaks_of(messy: Path) -> None:
    async def main() -> None:
        async with seat(opened(messy), size=(120, 60), view="timeline") as sitting:
            timeline = sitting.screen.query_one(Timeline)
            await sitting.until(lambda: sitting.bus.whole and bool(timeline.bands))
            await sitting.settle()
            table = sitting.bus.table
            rows = [row for row in range(sitting.bus.count) if not sitting.bus.is_noise(row)]
            good = {table.value("unit", row) for row in rows if table.value("check", row)}
            assert good < {table.value("unit", row) for row in rows}, "damage made units up"
            shown = {int(band.name.split()[1]) for band in timeline.bands if band.name.startswith("unit")}
            assert shown == good

    asyncio.run(main())


def test_a_unit_that_only_broadcasts_name_is_not_called_sound(messy: Path) -> None:
    async def main() -> None:
        async with seat(opened(messy), size=(100, 60), view="home") as sitting:
            home = sitting.screen.query_one(HomeList)
            await sitting.until(lambda: sitting.bus.whole and home.count() > 0)
            await sitting.settle()
            lines = [line for line in sitting.shown().splitlines() if line.strip(" │").startswith("unit")]
            (everybody,) = (line for line in lines if "unit   0" in line)
            assert "sound" not in everybody and "no answer is due" in everybody
            assert len(lines) > 1 and all("answers" in line for line in lines if line is not everybody)

    asyncio.run(main())
