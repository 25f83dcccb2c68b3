"""Lists: what is painted is what is known, and what is cut says so."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.cells import cell_len
from seats import Seat, opened, sample_in, using
from textual.app import App, ComposeResult
from textual.color import Color
from textual.theme import Theme

from analyzer.tui.home import HomeList
from analyzer.tui.lines import Lines
from analyzer.tui.paint import DARK, DARK_16, INKS, LIGHT, LIGHT_16, StyledText, fitted
from analyzer.tui.registerlist import RegisterList


class Growing(Lines):
    """Words that become others while lines come."""

    lines, word = 100, "open"

    def count(self) -> int:
        return self.lines

    def pieces(self, line: int, width: int) -> list[StyledText]:
        return fitted([StyledText(f"{line} {self.word}")], width)

    def head(self, width: int) -> list[StyledText]:
        return fitted([], width)


class OneList(App[None]):
    CSS = "Lines { overflow-y: scroll; }"

    def compose(self) -> ComposeResult:
        yield Growing(id="list")

    def on_mount(self) -> None:
        self.register_theme(DARK)
        self.theme = DARK.name


def test_a_line_in_sight_says_what_is_known_when_the_last_line_came_right_behind_others() -> None:
    async def main() -> None:
        async with OneList().run_test(size=(40, 10)) as pilot:
            listing = pilot.app.query_one(Growing)
            listing.grown()
            await pilot.pause()
            listing.lines, listing.word = 200, "answered"
            listing.grown()  # nothing follows
            for _ in range(100):
                await pilot.pause(0.05)
                if "answered" in listing.render_line(1).text:
                    return
            raise AssertionError(listing.render_line(1).text)

    asyncio.run(main())


def test_a_list_that_was_scrolled_away_from_its_cursor_stays_so_when_there_is_more_room() -> None:
    async def main() -> None:
        async with OneList().run_test(size=(40, 10)) as pilot:
            listing = pilot.app.query_one(Growing)
            listing.grown()
            await pilot.pause()
            listing.scroll_to(y=50, animate=False, immediate=True)
            await pilot.resize_terminal(41, 11)
            await pilot.pause()
            assert listing.scroll_offset.y == 50
            listing.move_to(59)
            await pilot.resize_terminal(41, 8)
            await pilot.pause()
            assert listing.scroll_offset.y <= 59 < listing.scroll_offset.y + listing.room, "a cursor in sight stays so"

    asyncio.run(main())


class Knowing(Growing):
    """A list that knows what the looks of its lines hang on."""

    painted = 0

    def states(self, lines: range) -> list[object]:
        return [self.word if line == 3 else None for line in lines]

    def pieces(self, line: int, width: int) -> list[StyledText]:
        self.painted += 1
        return super().pieces(line, width)


class OtherList(OneList):
    def compose(self) -> ComposeResult:
        yield Knowing(id="list")


def test_only_lines_that_look_otherwise_are_painted_anew() -> None:
    async def main() -> None:
        async with OtherList().run_test(size=(40, 10)) as pilot:
            listing = pilot.app.query_one(Knowing)
            listing.grown()
            await pilot.pause()
            listing.painted, listing.lines = 0, 200
            listing.grown()
            await pilot.pause()
            assert listing.painted == 0
            listing.word = "answered"
            listing.grown()
            await pilot.pause()
            assert listing.painted == 1 and "answered" in listing.render_line(4).text

    asyncio.run(main())


_pieces = st.lists(st.text(st.sampled_from("ab 漢"), max_size=6), max_size=6)


@given(_pieces, st.integers(1, 30))
def test_what_is_cut_ends_in_an_ellipsis_and_nothing_else_does(texts: list[str], width: int) -> None:
    line = "".join(part.text for part in fitted([StyledText(text) for text in texts], width))
    whole = "".join(texts)
    assert cell_len(line) <= width
    if cell_len(whole) <= width:
        assert line == whole + " " * (width - cell_len(whole))
    elif cell_len(whole.rstrip()) > width:
        assert line.rstrip().endswith("…")


def test_the_tabs_that_have_room_keep_their_titles(tmp_path: Path) -> None:
    """One that is no tab stands among them while it is in sight: only the last ones become their keys."""

    async def work(sitting: Seat) -> None:
        await sitting.press("9")
        tabs = sitting.shown().splitlines()[0]
        assert "0 Home 1 Trans 2 Frames 3 Findings 4 Polls 5 Registers" in tabs and tabs.rstrip().endswith("9 Units")

    using(opened(sample_in(tmp_path)), work, size=(80, 24))


def test_a_cause_shows_the_first_of_what_shows_it(tmp_path: Path) -> None:
    async def work(sitting: Seat) -> None:
        await sitting.press("0")
        await sitting.until(lambda: "Enter goes there" in sitting.shown())
        home = sitting.screen.query_one(HomeList)
        assert home.cause is not None
        for index in home.cause.frames:
            assert f"Frame {index}, " in sitting.shown()
        assert home.HEAD > 3, "the load has room that nothing else needs"

    using(opened(sample_in(tmp_path)), work, size=(200, 60))


def test_narrow_terminals_leave_columns_out_whole(tmp_path: Path) -> None:
    async def work(sitting: Seat) -> None:
        registers = sitting.screen.query_one(RegisterList)
        await sitting.press("5")
        await sitting.until(lambda: registers.count() > 0)
        for width in (46, 60, 72, 80):
            heads, line = ("".join(part.text for part in parts(width)) for parts in (registers.head, _first(registers)))
            assert "…" not in heads + line
            assert len(line.rstrip()) <= width
        assert "before" in "".join(part.text for part in registers.head(80))

    using(opened(sample_in(tmp_path)), work, size=(80, 24))


def _first(registers: RegisterList) -> Callable[[int], Sequence[StyledText]]:
    return lambda width: registers.pieces(0, width)


@pytest.mark.parametrize("theme", [DARK, LIGHT, DARK_16, LIGHT_16], ids=lambda theme: theme.name)
def test_every_ink_can_be_read_and_each_means_one_thing(theme: Theme) -> None:
    """By the contrast that WCAG asks for: 4.5; 3 where there are but sixteen colours."""
    colours = theme.to_color_system().generate() | theme.variables
    least = 3.0 if theme.name.endswith("16") else 4.5
    for name, ink in INKS.items():
        for back in [ink.back] if ink.back else ["background", "surface"]:
            assert _contrast(colours[ink.front or "foreground"], colours[back]) >= least, (name, back)
    apart = [colours[name] for name in ("accent", "warn", "bad", "asks", "answers")]
    assert len(set(apart)) == len(apart)


def _contrast(front: str, back: str) -> float:
    """The ratio of relative luminances."""
    dark, bright = sorted(_luminance(Color.parse(each)) for each in (front, back))
    return (bright + 0.05) / (dark + 0.05)


def _luminance(colour: Color) -> float:
    linear = [each / 12.92 if each <= 0.04045 else ((each + 0.055) / 1.055) ** 2.4 for each in colour.normalized]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
