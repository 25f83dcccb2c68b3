"""What a view prints can be typed: every time on the screen, in each view and each way to show times."""

from __future__ import annotations

import asyncio
import re
from pathlib import Path

import pytest
from seats import opened, sample_in, seat

from analyzer.languages import use_language
from analyzer.model.search import row_named
from analyzer.model.times import span
from analyzer.tui.views import VIEWS

_CLOCK = r"(?:(?:\d{4}-)?\d{2}-\d{2} )?\d{2}:\d{2}(?::\d{2}(?:\.\d+)?)?"
_SINCE = r"(?<![\d.,±≤])\d+(?:[.,]\d+)? ?(?:s|с|ms|мс|us|мкс)\b|(?<![\d.,-])-?\d+\.\d{6}(?![\d.])"
_SPAN = re.compile(rf"{_CLOCK}–{_CLOCK}(?: UTC)?|\d+(?:[.,]\d+)?–\d+(?:[.,]\d+)? [sс]\b")
_TIME = re.compile(f"{_CLOCK}|{_SINCE}")


@pytest.mark.parametrize("lang", ["en", "ru"])
def test_every_time_on_the_screen_can_be_typed(tmp_path: Path, lang: str) -> None:
    async def main() -> None:
        seen, spans = set[str](), set[str]()
        async with seat(opened(sample_in(tmp_path)), size=(160, 50)) as sitting:
            desk, bus = sitting.app.desk, sitting.bus
            await sitting.press("T")
            await sitting.type("2s-17s")
            await sitting.press("enter", "1", "r")
            for _ in desk.bases():
                for view in VIEWS:
                    if view.name in ("against", "paste"):
                        continue
                    await sitting.press(view.key.split(",")[0])
                    shown = sitting.shown()
                    spans.update(match[0] for match in _SPAN.finditer(shown))
                    seen.update(match[0] for match in _TIME.finditer(_SPAN.sub("", shown)))
                await sitting.press("1", "t")
            for text in spans:
                assert span(text.lower(), bus, desk.zone)
            for text in seen:
                assert row_named(text, bus, 0, desk.zone) >= 0
            assert spans and len(seen) > 50

    use_language(lang)
    try:
        asyncio.run(main())
    finally:
        use_language("en")
