"""A user at the interface, for tests: what is pressed, what is seen."""

from __future__ import annotations

import asyncio
import shutil
from collections.abc import AsyncIterator, Awaitable, Callable, Sequence
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

from textual.pilot import Pilot

import captures
from analyzer.model.source import CaptureSource, ViewSource
from analyzer.tui.app import Rtuscope
from analyzer.tui.keys import Help
from analyzer.tui.prompts import Ask, Choose
from analyzer.tui.screen import BusScreen
from captures import samples

_PATIENCE_S = 60.0  # a key that the application gave up waiting for, on a busy machine, would count as done


class Seat:
    """A user at the interface."""

    def __init__(self, app: Rtuscope, pilot: Pilot[None], notices: Sequence[str] = ()) -> None:
        self.app, self.pilot = app, pilot
        self._notices = notices

    @property
    def screen(self) -> BusScreen:
        screen = self.app.screen_stack[0]
        assert isinstance(screen, BusScreen)
        return screen

    @property
    def row(self) -> int:
        row = self.screen.studied if self.screen.row is None else self.screen.row
        assert row is not None
        return row

    @property
    def bus(self) -> Any:
        return self.app.desk.bus

    async def press(self, *keys: str) -> None:
        await self._pressed(keys)
        await self.settle()

    async def type(self, text: str) -> None:
        await self._pressed(["space" if c == " " else c for c in text])
        await self.settle()

    async def _pressed(self, keys: Sequence[str]) -> None:
        """Press keys, and wait until the application has taken up the last of them.

        On a busy machine the pilot comes back while keys are still on their way to the application, whose queue of
        keys knows nothing of those.
        """
        queue = self.app.keys
        wanted = queue.taken + len(keys)
        await self.pilot.press(*keys)
        await self.until(lambda: queue.taken >= wanted or queue.closed)

    async def settle(self) -> None:
        """Workers are done and their messages handled."""
        await self.pilot.pause()
        await self.until(lambda: not self.app.keys.busy)
        for _ in range(4000):
            if all(worker.is_finished or (self.app.desk.source.live and worker.group in ("load", "select"))
                   for worker in self.app.workers):  # fmt: skip
                break
            if any(isinstance(screen, Ask | Choose | Help) for screen in self.app.screen_stack):
                break
            await asyncio.sleep(0.01)
        await self.pilot.pause()

    async def until(self, wanted: Callable[[], bool]) -> None:
        for _ in range(60_000):
            if wanted():
                return
            await asyncio.sleep(0.01)
        raise AssertionError("it did not come")

    def shown(self) -> str:
        """What the terminal shows, as text."""
        return "\n".join(
            "".join(segment.text for segment in strip) for strip in self.app.screen._compositor.render_strips()
        )

    def notices(self) -> list[str]:
        """All that was notified, also what has gone from the screen again."""
        return list(self._notices)


@asynccontextmanager
async def seat(
    source: ViewSource, *, size: tuple[int, int] = (100, 30), view: str | None = "frames"
) -> AsyncIterator[Seat]:
    app = Rtuscope(source, view=view)
    app.keys.patience_s = _PATIENCE_S
    notices: list[str] = []
    notify = app.notify

    def heard(message: str, **options: Any) -> None:
        notices.append(message)
        notify(message, **options)

    setattr(app, "notify", heard)  # noqa: B010 - a method, for this one only
    async with app.run_test(size=size) as pilot:
        sitting = Seat(app, pilot, notices)
        if not source.live:
            await sitting.until(
                lambda: sitting.bus.whole and (not sitting.bus.count or sitting.screen.studied is not None)
            )
            await sitting.settle()
        yield sitting


def using(source: ViewSource, work: Callable[[Seat], Awaitable[None]], **options: Any) -> None:
    async def main() -> None:
        async with seat(source, **options) as sitting:
            await work(sitting)

    asyncio.run(main())


def sample_in(folder: Path) -> Path:
    """The troubled sample, where notes may be kept beside it."""
    path = folder / "troubled.jsonl"
    shutil.copy(samples.path("troubled.jsonl"), path)
    return path


def opened(path: Path) -> CaptureSource:
    return CaptureSource(captures.open(path), path.name)
