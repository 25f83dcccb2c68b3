"""Painting costs what is in sight: registers and polls by the thousand are laid out only where one is new."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest
from seats import Seat, seat, using

from analyzer.model.meanings import Meanings
from analyzer.model.source import CaptureSource
from analyzer.tui.polllist import PollList
from analyzer.tui.registerlist import RegisterList
from captures.chunks import Capture, Chunk
from captures.line import LineSettings
from dissectors.crc import crc_bytes

_POLLS, _SIZE = 40, 120


def _big() -> CaptureSource:
    """A client that polls 4,800 registers, twice; the second time each is another one."""
    chunks, t_ns = [], 0
    for turn in range(2):
        for poll in range(_POLLS):
            ask = bytes([1, 3]) + (poll * _SIZE).to_bytes(2, "big") + _SIZE.to_bytes(2, "big")
            words = b"".join((poll + place + 7 * turn).to_bytes(2, "big") for place in range(_SIZE))
            for body, wait in ((ask, 3_000_000), (bytes([1, 3, 2 * _SIZE]) + words, 5_000_000)):
                chunks.append(Chunk(t_ns, body + crc_bytes(body)))
                t_ns += wait
    return CaptureSource(Capture.of(LineSettings(115_200), chunks, timed=True), "big")


@pytest.mark.parametrize("view", ["registers", "polls"])
def test_a_repaint_asks_for_the_lines_in_sight_alone(view: str, monkeypatch: pytest.MonkeyPatch) -> None:
    async def work(sitting: Seat) -> None:
        screen = sitting.screen
        assert screen.query_one(RegisterList)._log is sitting.bus.registers
        count = {"registers": _POLLS * _SIZE, "polls": _POLLS}[view]
        kind = {"registers": RegisterList, "polls": PollList}[view]
        assert screen.query_one(kind).count() == count
        asked: list[Any] = []
        real = Meanings.at

        def told(self: Meanings, spot: Any) -> Any:
            asked.append(spot)
            return real(self, spot)

        monkeypatch.setattr(Meanings, "at", told)
        for _ in range(5):
            screen.refresh_view()
        assert not asked, "what nobody looks at anew is not laid out anew"
        screen.repaint_lists()
        await sitting.pilot.pause()
        seen = screen.query_one(kind).room
        assert len(asked) <= 40 * seen, "a few meanings a line in sight"

    using(_big(), work, view=view, size=(120, 40))


def test_a_repaint_that_waits_is_one_however_many_rows_come() -> None:
    async def main() -> None:
        async with seat(_big(), view="registers") as sitting:
            jobs, painted = sitting.screen.jobs, []
            jobs._once("rows", lambda: painted.append(1))
            for _ in range(100):
                jobs._once("rows", lambda: painted.append(1))
            await sitting.pilot.pause()
            assert len(painted) == 1

    asyncio.run(main())
