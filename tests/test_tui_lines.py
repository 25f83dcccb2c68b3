"""Lists: what is painted is what is known, and what is cut says so."""

from __future__ import annotations

import asyncio

from hypothesis import given
from hypothesis import strategies as st
from rich.cells import cell_len
from textual.app import App, ComposeResult

from analyzer.tui.lines import Lines
from analyzer.tui.paint import DARK, StyledText, fitted


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
