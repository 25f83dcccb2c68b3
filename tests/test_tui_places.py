"""Nothing acts on what is not shown: what an action takes stands under the cursor of the view in sight."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest
from rich.style import Style
from seats import Seat, opened, sample_in, using
from textual.command import CommandList, CommandPalette
from textual.events import Click
from textual.widgets import Input

from analyzer.tui.keys import BINDINGS
from analyzer.tui.places import OF_ROWS, OFFERED, CausePlace, RegisterPlace, RowPlace, Trail, UnitPlace, Visited
from analyzer.tui.prompts import Ask
from analyzer.tui.report import ReportPage
from analyzer.tui.views import VIEWS

_VIEWS = {view.key[0]: view.name for view in VIEWS}


@pytest.fixture
def capture(tmp_path: Path) -> Path:
    return sample_in(tmp_path)


def test_an_action_is_in_a_view_only_where_the_view_offers_it() -> None:
    for view in VIEWS:
        assert view.offers <= OFFERED, view.name
    of_rows = {view.name for view in VIEWS if view.offers >= {"bookmark", "comment", "reference", "counterpart"}}
    assert of_rows == {"transactions", "frames", "findings"}
    named = {binding.action.partition("(")[0] for binding in BINDINGS}
    assert named >= OF_ROWS, "what is offered has a key"


def test_notes_are_made_of_rows_in_sight_only(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        screen, notes = sitting.screen, sitting.app.desk.notes
        await sitting.press("1", "down", "down")
        for view in "0456789":
            await sitting.press(view)
            for key in ("m", "r", "c", "w"):
                await sitting.press(key)
            assert screen.view == _VIEWS[view]
            if view != "8":
                assert screen.row is None
                focused = sitting.app.focused
                assert focused is not None and focused.region.height > 0, "the keys are where one sees them"
            else:
                await sitting.press("ctrl+l", "escape")
        assert not notes.comments and notes.reference is None

    using(opened(capture), work)


def test_a_view_says_what_its_cursor_stands_on(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        screen = sitting.screen
        assert isinstance(screen.place, RowPlace)
        await sitting.press("0")
        await sitting.until(lambda: screen.place is not None)
        assert isinstance(screen.place, CausePlace)
        await sitting.press("end")
        assert isinstance(screen.place, UnitPlace)
        await sitting.press("3")
        await sitting.press("home")
        place = screen.place
        assert isinstance(place, CausePlace)
        await sitting.press("=")
        assert {cell.text for cell in _choices(sitting)} == {f"unit == {unit}" for unit in place.cause.units[:8]}
        await sitting.press("escape", "5")
        assert isinstance(screen.place, RegisterPlace)

    using(opened(capture), work)


def _choices(sitting: Seat) -> Sequence[object]:
    from analyzer.tui.views import BY_NAME

    return BY_NAME[sitting.screen.view].cells(sitting.screen)


def test_back_and_forward_go_where_one_was(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        screen = sitting.screen
        await sitting.press("down", "down", "down")
        first = sitting.row
        await sitting.press("right_square_bracket")
        second = sitting.row
        assert second != first
        await sitting.press("5", "minus")
        assert (screen.view, sitting.row) == ("frames", second)
        await sitting.press("minus")
        assert (screen.view, sitting.row) == ("frames", first)
        await sitting.press("underscore")
        assert (screen.view, sitting.row) == ("frames", second)
        await sitting.press("underscore")
        assert screen.view == "registers"

    using(opened(capture), work)


def test_a_trail_forgets_what_is_ahead_once_one_goes_elsewhere() -> None:
    trail = Trail()
    trail.leave(Visited("frames", 1))
    trail.leave(Visited("frames", 2))
    assert trail.back(Visited("frames", 3)) == Visited("frames", 2)
    trail.leave(Visited("frames", 2))
    assert trail.forward(Visited("frames", 9)) is None
    assert trail.back(Visited("frames", 9)) == Visited("frames", 2)


def test_the_next_finding_stays_in_the_list_in_sight(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        screen = sitting.screen
        rows = []
        for _ in range(12):
            await sitting.press("right_square_bracket")
            assert screen.view == "transactions"
            rows.append(sitting.row)
        assert rows == sorted(set(rows)), "each further on than the one before"
        assert any(sitting.bus.is_noise(row) for row in rows), "noise unfolds below its transaction"

    using(opened(capture), work, view="transactions")


def test_every_command_of_the_view_stands_in_the_palette(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        screen = sitting.screen
        for view in ("frames", "units", "timeline"):
            screen.action_view(view)
            await sitting.settle()
            titles = {command.title for command in sitting.app.get_system_commands(screen)}
            offered = view == "frames"
            assert ("Mark" in titles) == offered and ("Next hit" in titles) == offered
            assert {"Span", "Kept filters", "Undo", "Quit", "Open", "Read anew", "Dark or light", "Back"} <= titles
        assert "Zoom in" in titles

    using(opened(capture), work)


def test_notes_stand_in_the_report_and_it_is_written(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        await sitting.press("down", "semicolon")
        await sitting.type("inverter trips here")
        await sitting.press("enter", "7")
        page = sitting.screen.query_one(ReportPage)
        await sitting.until(lambda: page.report is not None)
        assert "inverter trips here" in page.text()
        for name in ("report.html", "report.txt"):
            await sitting.press("e")
            line = sitting.app.focused
            assert line is not None
            line.value = str(capture.parent / name)  # type: ignore[attr-defined]
            await sitting.press("enter")
            await sitting.until(lambda name=name: (capture.parent / name).exists())  # type: ignore[misc]
            assert "inverter trips here" in (capture.parent / name).read_text(encoding="utf-8")

    using(opened(capture), work)


def test_the_story_of_a_cause_is_written_with_the_users_notes(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        screen, story = sitting.screen, capture.parent / "story.md"
        await sitting.press("0")
        await sitting.until(lambda: isinstance(screen.place, CausePlace))
        cause = sitting.bus.causes()[0]
        await sitting.press("home", "enter", "semicolon")
        await sitting.type("pump off here")
        await sitting.press("enter", "0", "home", "e")
        line = sitting.app.focused
        assert line is not None
        line.value = str(story)  # type: ignore[attr-defined]
        await sitting.press("enter")
        await sitting.until(story.exists)
        head, *lines = story.read_text(encoding="utf-8").splitlines()
        assert head == f"# {cause.cause}, {cause.sure}" and f"- do: {cause.remedy}" in lines
        shown = [words for words in lines if words.startswith("- Frame")]
        frames = [int(words.split(",")[0].removeprefix("- Frame ")) for words in shown]
        assert frames == sorted(set(frames)) and set(frames) >= set(cause.frames)
        assert ["note: pump off here" in words for words in shown] == [True] + [False] * (len(shown) - 1)

    using(opened(capture), work)


def test_a_cause_is_walked_through_in_wire_order_from_its_line(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        screen = sitting.screen
        await sitting.press("0")
        await sitting.until(lambda: isinstance(screen.place, CausePlace))
        await sitting.press("home", "enter")
        assert screen.view == "transactions"
        rows = [screen.jumps.here]
        for _ in range(3):
            await sitting.press("n")
            rows.append(screen.jumps.here)
        assert rows == sorted(rows) and len(set(rows)) > 1
        await sitting.press("N")
        assert screen.jumps.here == rows[-2]
        await sitting.press(*["minus"] * 5)
        assert screen.view == "home", "and back"

    using(opened(capture), work, view="transactions")


@pytest.mark.parametrize("key", ["ctrl+o", "e", "A"])
def test_what_no_file_can_be_called_is_refused_where_it_is_typed(capture: Path, key: str) -> None:
    async def work(sitting: Seat) -> None:
        for name in ("~nobody-of-this-name/x.csv", "x" * 300 + ".csv", "я" * 200):
            told = len(sitting.notices())
            await sitting.press("home", key)
            line = sitting.app.focused
            assert isinstance(line, Input)
            line.value = name
            await sitting.press("enter")
            await sitting.until(
                lambda told=told: len(sitting.notices()) > told or isinstance(sitting.app.screen, Ask)  # type: ignore[misc]
            )
            await sitting.press("escape", "end")
            assert sitting.app.is_running and sitting.screen.view in ("frames", "against"), name
            assert {each.name for each in capture.parent.iterdir()} == {capture.name}, name

    using(opened(capture), work)


def test_a_click_on_a_command_that_is_gone_by_then(capture: Path) -> None:
    """What was typed meanwhile has made the list shorter than what was pointed at."""

    async def work(sitting: Seat) -> None:
        await sitting.press("ctrl+p")
        listing = sitting.app.screen.query_one(CommandList)
        await sitting.until(lambda: listing.option_count > 0)
        x, y = listing.region.x + 2, listing.region.y + 1
        gone = Style(meta={"option": listing.option_count + 3})
        listing.post_message(Click(listing, 2, 1, 0, 0, 1, False, False, False, x, y, gone))
        await sitting.settle()
        assert sitting.app.return_code is None and len(sitting.app.screen_stack) == 2
        await sitting.press("escape")

    using(opened(capture), work)


def test_no_command_is_chosen_over_a_question(capture: Path) -> None:
    """It would act on what stands behind it; and what came there since was not drawn."""

    async def work(sitting: Seat) -> None:
        await sitting.press("g", "ctrl+p")
        assert isinstance(sitting.app.screen, Ask)
        await sitting.press("escape", "ctrl+p")
        assert isinstance(sitting.app.screen, CommandPalette)

    using(opened(capture), work)


def test_a_double_click_beside_the_palette_closes_it_once(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        await sitting.press("ctrl+p")
        palette = sitting.app.screen
        for _ in range(2):
            palette.post_message(Click(palette, 0, 0, 0, 0, 1, False, False, False, 0, 0, Style()))
        await sitting.settle()
        assert sitting.app.return_code is None and sitting.app.screen is sitting.screen

    using(opened(capture), work)


def test_a_command_that_is_chosen_twice_is_done_once(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        await sitting.press("ctrl+p")
        listing = sitting.app.screen.query_one(CommandList)
        await sitting.until(lambda: listing.option_count > 0)
        for _ in range(2):
            listing.post_message(CommandList.OptionSelected(listing, listing.get_option_at_index(0), 0))
        await sitting.settle()
        assert sitting.app.return_code is None

    using(opened(capture), work)


def test_a_page_in_the_palette_before_its_list_stands(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        await sitting.press("ctrl+p", "pagedown", "pageup")
        assert isinstance(sitting.app.screen, CommandPalette)
        await sitting.press("escape", "down")
        assert sitting.app.is_running and sitting.row == 1

    using(opened(capture), work)
