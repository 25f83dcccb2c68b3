"""The main screens look as they did at three sizes, dark; at one light, at one in 16 colours. The documentation's too.

RTUSCOPE_PICTURES=1 makes them; RTUSCOPE_PICTURES=FOLDER puts an SVG of each there as well, to be looked at.
"""

from __future__ import annotations

import asyncio
import os
import time
from pathlib import Path

import pytest
from pictures import compare, looks_as_before

import captures
from analyzer.model.source import CaptureSource
from analyzer.tui.app import Rtuscope
from analyzer.tui.filterbar import FilterBar
from analyzer.tui.pastepane import PasteText
from analyzer.tui.plot import Plot
from analyzer.tui.screen import BusScreen
from captures import samples

_DOCS = Path(__file__).parents[1] / "docs" / "pictures"
_STEPS: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("home", ("0",)),
    ("transactions", ("1", "home", "down", "right")),
    ("frames", ("2", "g", "1", "5", "enter", "tab", "home", "down", "tab", "tab")),
    ("findings", ("3", "home")),
    ("polls", ("4",)),
    ("units", ("9",)),
    ("registers", ("5", "space", "down", "down")),
    ("timeline", ("6", "right", "right", "right", "space", "right", "right")),
    ("report", ("7",)),
    ("paste", ("8",)),
)
_SHOWN = {("light", "frames"), ("16", "transactions")}  # in the documentation beside the dark ones
_PASTED = "11 03 00 6B 00 03 76 87\n11 03 06 AE 41 56 52 43 40 49 AD"


@pytest.mark.parametrize(
    ("size", "colours"),
    [((80, 24), "dark"), ((80, 24), "16"), ((120, 40), "dark"), ((120, 40), "light"), ((200, 60), "dark")],
)
def test_screens_look_as_they_did(size: tuple[int, int], colours: str) -> None:
    asyncio.run(_look(size, colours))


async def _look(size: tuple[int, int], colours: str) -> None:
    source = CaptureSource(captures.open(samples.path("troubled.jsonl")), "troubled.jsonl")
    app = Rtuscope(source, light=colours == "light")
    if colours == "16":
        app.use_16_colours()
    async with app.run_test(size=size) as pilot:
        screen = app.screen
        assert isinstance(screen, BusScreen)
        async with asyncio.timeout(60):
            while not app.desk.bus.whole or screen.studied is None:
                await asyncio.sleep(0.01)
        for name, keys in _STEPS:
            await pilot.press(*keys)
            if name == "paste":
                screen.query_one(PasteText).load_text(_PASTED)
                screen.query_one("#pieces").focus()
            if name == "frames":
                screen.query_one(FilterBar).use_filter("unit in (1, 2, 17)")
            for _ in range(200):
                await pilot.pause(0.01)
                if all(worker.is_finished for worker in app.workers):
                    break
            await pilot.pause(0.05)
            async with asyncio.timeout(60):
                while name == "registers" and "readings" not in screen.query_one(Plot).title:
                    await pilot.pause(0.01)
            if name != "report":  # its text is compared elsewhere
                file = f"{name}-{size[0]}x{size[1]}-{colours}"
                until = time.monotonic() + 60  # a busy machine draws later
                while not looks_as_before(file, screen) and time.monotonic() < until:
                    await pilot.pause(0.05)
                compare(file, screen)
            _keep(app, name, size[0], colours)


def _keep(app: Rtuscope, name: str, width: int, colours: str) -> None:
    """A picture for the documentation, where that shows it; and for who looks at all of them."""
    wanted = os.environ.get("RTUSCOPE_PICTURES")
    if not wanted:
        return
    svg = app.export_screenshot(title="rtuscope", simplify=True)
    if wanted != "1":
        (Path(wanted) / f"{name}-{width}-{colours}.svg").write_text(svg, encoding="utf-8")
    if width == (120 if name == "frames" else 80) and (colours == "dark" or (colours, name) in _SHOWN):
        _DOCS.mkdir(exist_ok=True)
        (_DOCS / f"{name}{'' if colours == 'dark' else f'-{colours}'}.svg").write_text(svg, encoding="utf-8")
