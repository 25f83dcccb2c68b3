"""Everyone's hands: own keys, zoomed panes, few colours, a file read anew, marks, a screen read out."""

from __future__ import annotations

import asyncio
import gc
import re
import subprocess
import sys
import warnings
from functools import partial
from pathlib import Path

import pytest
from seats import Seat, opened, sample_in, using
from textual.widgets import Input

from analyzer import languages
from analyzer.languages import tr
from analyzer.model.spoken import spoken
from analyzer.model.times import GotoError, span
from analyzer.tui.against import ChangeList
from analyzer.tui.app import Rtuscope
from analyzer.tui.bars import KeyLine
from analyzer.tui.desk import Preferences
from analyzer.tui.filterbar import FilterBar
from analyzer.tui.findings import FindingList
from analyzer.tui.keys import BINDINGS, Help
from analyzer.tui.openfiles import NextFile
from analyzer.tui.registerlist import RegisterList
from captures.recording.notekinds import MARK
from captures.recording.notes import Note


@pytest.fixture
def capture(tmp_path: Path) -> Path:
    return sample_in(tmp_path)


def test_help_names_every_binding_and_each_has_an_id_of_its_own(capture: Path) -> None:
    assert len({binding.id for binding in BINDINGS}) == len(BINDINGS)
    assert all(binding.tooltip for binding in BINDINGS)

    async def work(sitting: Seat) -> None:
        await sitting.press("question_mark")
        assert isinstance(sitting.app.screen, Help)
        shown = sitting.shown()
        for words in ("filter by the value under the cursor", "the newest row", "only a span of time"):
            assert words in shown, words

    using(opened(capture), work, size=(120, 140))


def test_the_users_own_keys(capture: Path) -> None:
    async def main() -> None:
        app = Rtuscope(opened(capture), view="frames")
        app.desk.wishes.keys = {"bookmark": "B"}
        async with app.run_test(size=(100, 30)) as pilot:
            sitting = Seat(app, pilot)
            await sitting.until(lambda: sitting.bus.whole and sitting.screen.studied is not None)
            await sitting.press("B")
            assert app.desk.notes.comments
            await sitting.press("m")
            assert len(app.desk.notes.comments) == 1, "the old key is free"

    asyncio.run(main())


def test_panes_are_zoomed_and_sized(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        screen, before = sitting.screen, sitting.screen.frames.size.height
        await sitting.press("Z")
        assert not screen.detail.display and screen.frames.size.height > before
        await sitting.press("Z")
        assert screen.frames.size.height == before
        await sitting.press("tab", "Z")
        assert screen.detail.size.height > before
        await sitting.press("Z", "greater_than_sign")
        assert screen.frames.size.height < before
        await sitting.press("less_than_sign", "less_than_sign")
        assert screen.frames.size.height > before

    using(opened(capture), work)


@pytest.mark.parametrize("width", [40, 80, 120, 200])
def test_no_view_is_wider_than_the_terminal(capture: Path, width: int) -> None:
    async def work(sitting: Seat) -> None:
        for view in "012345678":
            await sitting.press(view)
            lines = sitting.shown().splitlines()
            assert len(lines) == 24 and {len(line) for line in lines} == {width}, view
            assert sitting.screen.panes.all[0].size.width > 0

    using(opened(capture), work, size=(width, 24))


@pytest.mark.parametrize("language", ["en", "ru"])
@pytest.mark.parametrize("width", [40, 80, 120])
def test_the_footer_shows_whole_keys_and_always_help_and_the_way_out(width: int, language: str, capture: Path) -> None:
    languages.use_language(language)
    help_, leave = tr("Help"), tr("Quit")

    async def work(sitting: Seat) -> None:
        footer = sitting.screen.query_one(KeyLine)
        for view in "12345":
            await sitting.press(view)
            await sitting.until(lambda: bool(footer.keys))
            assert sum(key.width for key in footer.keys) <= width, footer.keys
            told = [key.description for key in footer.keys]
            assert help_ in told and leave in told and len(told) >= 3

    using(opened(capture), work, size=(width, 24))


def test_a_key_in_the_footer_is_pressed_by_a_click_and_told_more_of_by_the_mouse(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        await sitting.press("1")
        footer = sitting.screen.query_one(KeyLine)
        await sitting.until(lambda: any(key.description == "Filter" for key in footer.keys))
        line = sitting.shown().splitlines()[-1]
        await sitting.pilot.hover(footer, (line.index("Filter to"), 0))
        assert footer.tooltip
        await sitting.pilot.mouse_down(footer, (line.index("Filter"), 0))
        await sitting.until(lambda: isinstance(sitting.screen.focused, Input))
        await sitting.until(lambda: "Complete" in [key.description for key in footer.keys])

    using(opened(capture), work, size=(120, 24))


def test_the_footer_is_painted_anew_only_where_its_keys_are_others(
    capture: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def work(sitting: Seat) -> None:
        await sitting.press("2")
        footer = sitting.screen.query_one(KeyLine)
        painted: list[object] = []
        monkeypatch.setattr(footer, "refresh", lambda *_, **__: painted.append(None))
        await sitting.press("down", "down", "end", "home")
        sitting.screen.refresh_bindings()
        await sitting.settle()
        assert not painted and not footer.children

    using(opened(capture), work)


def test_at_40_columns_a_finding_still_says_what_was_seen(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        await sitting.press("3", "b")
        listing = sitting.screen.query_one(FindingList)
        finding = listing.finding
        assert finding is not None and not listing.grouped
        line = next(line for line in sitting.shown().splitlines() if f" {finding.code} " in line)
        assert f"{finding.code} {finding.text[:8]}" in line and line.rstrip().endswith("…")
        assert re.search(r"\d E, \d+ W, \d+ N   showing all: \d", sitting.shown())

    using(opened(capture), work, size=(40, 24))


def test_a_file_is_read_anew_with_its_filter_and_row(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        await sitting.press("equals_sign", "u", "down", "down")
        row, before, screen = sitting.row, sitting.bus, sitting.screen
        capture.write_text(capture.read_text() * 1)
        await sitting.pilot.press("ctrl+r")
        await sitting.until(lambda: sitting.bus is not before and sitting.bus.whole)
        await sitting.settle()
        assert sitting.screen is not screen and sitting.screen.view == "frames"
        assert sitting.row == row
        await sitting.until(lambda: 0 < sitting.screen.frames.count() < sitting.bus.count)
        await sitting.press("down")
        assert sitting.row > row, "it goes on as before"

    using(opened(capture), work)


def test_a_file_that_is_not_what_it_was_ends_nothing(capture: Path) -> None:
    """Ctrl+R with the file gone or rewritten: what is shown stays until the new one is open."""

    async def become(sitting: Seat, becomes: str) -> None:
        before, count, told = sitting.bus, sitting.bus.count, len(sitting.notices())
        whole = capture.read_bytes()
        capture.unlink()
        match becomes:
            case "a folder":
                capture.mkdir()
            case "another file":
                capture.write_bytes(bytes(range(256)) * 40)
            case "not readable":
                capture.write_bytes(b"\x1f\x8b\x08" + bytes(40))
            case "empty":
                capture.write_bytes(b"")
            case "cut":
                capture.write_bytes(whole[: len(whole) // 2])
        await sitting.press("ctrl+r")
        await sitting.until(lambda: sitting.bus is not before or len(sitting.notices()) > told)
        if sitting.bus is before:
            new = sitting.notices()[told:]
            assert any("not opened, the view is unchanged: " in words for words in new), (becomes, new)
            assert sitting.bus.count == count
        else:  # it is a capture of some kind: that is shown
            assert becomes not in ("gone", "a folder", "not readable")
        await sitting.press("down", "1", "2")
        assert sitting.app.is_running
        if capture.is_dir():
            capture.rmdir()
        capture.write_bytes(whole)
        await sitting.press("ctrl+r")
        await sitting.until(lambda: sitting.bus.whole and sitting.bus is not before and sitting.bus.count == count)

    async def work(sitting: Seat) -> None:
        for becomes in ("gone", "a folder", "another file", "not readable", "empty", "cut"):
            await become(sitting, becomes)

    using(opened(capture), work)


def test_another_file_keeps_the_theme_and_its_own_notes(capture: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.jsonl"
    other.write_bytes(capture.read_bytes())

    async def work(sitting: Seat) -> None:
        await sitting.press("m", "D")
        theme = sitting.app.theme
        assert sitting.app.desk.notes.comments
        sitting.app.leave(NextFile(other))
        await sitting.until(lambda: sitting.app.desk.source.path == other and sitting.bus.whole)
        assert not sitting.app.desk.notes.comments
        assert sitting.app.theme == theme
        sitting.app.leave(NextFile(capture))
        await sitting.until(lambda: sitting.app.desk.source.path == capture and sitting.bus.whole)
        assert sitting.app.desk.notes.comments

    using(opened(capture), work)


def test_who_leaves_twice_arrives_at_the_second_place(capture: Path, tmp_path: Path) -> None:
    """A key that quits while a slow file is opened is not lost."""
    files = [tmp_path / f"{name}.jsonl" for name in "abc"]
    for file in files:
        file.write_bytes(capture.read_bytes())

    async def work(sitting: Seat) -> None:
        for file in files:
            sitting.app.leave(NextFile(file))
        await sitting.until(lambda: sitting.app.desk.source.path == files[-1] and sitting.bus.whole)
        await sitting.until(lambda: not sitting.app._leaving)  # it has arrived, else the first of two is not gone to
        sitting.app.leave(NextFile(files[0]))
        sitting.app.leave()
        await sitting.until(lambda: sitting.app.return_code is not None)
        assert sitting.app.desk.source.path == files[0]

    using(opened(capture), work)


@pytest.mark.parametrize("pause_s", [0.0, 0.02])
@pytest.mark.parametrize("keys", ["jjjj", "ejjj", "/jjj", "1234", "?jjj", "q" + "j" * 50])
def test_keys_that_wait_when_it_ends_are_nobodys_trouble(capture: Path, keys: str, pause_s: float) -> None:
    from textual.events import Key

    troubles: list[dict[str, object]] = []

    async def main() -> None:
        asyncio.get_running_loop().set_exception_handler(lambda _, context: troubles.append(context))
        app = Rtuscope(opened(capture))
        async with app.run_test(size=(80, 24)) as pilot:
            sitting = Seat(app, pilot)
            await sitting.until(lambda: sitting.bus.whole)
            for key in keys:
                app.post_message(Key(key, key))
            await asyncio.sleep(pause_s)
            app.exit()
            for key in keys:  # they come until the terminal is given back
                app.post_message(Key(key, key))
        await asyncio.sleep(0.05)
        gc.collect()  # a task that failed is told of when it is thrown away
        await asyncio.sleep(0)

    asyncio.run(main())
    assert not troubles


def test_a_question_dropped_before_it_is_put_leaves_nothing_behind(capture: Path) -> None:
    """Those that wait when the program ends are cancelled before their first turn."""
    asking = ("columns", "comment", "copy", "export", "find", "goto", "kept", "mark_recording", "open", "span")

    async def work(sitting: Seat) -> None:
        screen = sitting.screen
        for action in asking:
            getattr(screen, f"action_{action}")()
            assert sitting.app.workers
            sitting.app.workers.cancel_all()
        for put in (
            partial(screen.action_door, "filter"),
            screen.action_trigger,
            screen.query_one(ChangeList).action_choose,
            screen.query_one(RegisterList).action_place,
            sitting.app.leave,
        ):
            put()
            sitting.app.workers.cancel_all()
        await asyncio.sleep(0.01)
        gc.collect()

    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        using(opened(capture), work)
    assert [str(each.message) for each in told if issubclass(each.category, RuntimeWarning)] == []


def test_marks_of_a_recording_come_back_as_comments(capture: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    source = opened(capture)
    begin = 1_795_249_796_000_000_000
    monkeypatch.setattr("analyzer.tui.openfiles.notes_of", lambda _: [Note(begin, MARK, "pump on")])

    async def work(sitting: Seat) -> None:
        assert "pump on" in sitting.app.desk.notes.comments.values()

    using(source, work)


def test_a_span_by_the_clock() -> None:
    from datetime import UTC, datetime

    class Heard:
        timed, count = True, 1
        t_first = int(datetime(2026, 11, 20, 8, tzinfo=UTC).timestamp()) * 10**9
        t_last = int(datetime(2026, 11, 22, 13, tzinfo=UTC).timestamp()) * 10**9

    bus = Heard()
    now = datetime(2026, 11, 22, 15, tzinfo=UTC)

    def times(text: str) -> list[str]:
        return [f"{datetime.fromtimestamp(t / 1e9, UTC):%d %H:%M}" for t in span(text, bus, UTC, now)]  # type: ignore[arg-type]

    assert times("14:00-16:00") == ["21 14:00", "21 16:00"], "the last day that has it"
    assert times("9-10:30") == ["22 09:00", "22 10:30"]
    assert times("y 14-16") == times("yesterday 14:00 - 16:00") == ["21 14:00", "21 16:00"]
    assert times("2026-11-20 22-24") == ["20 22:00", "21 00:00"]
    assert span("10s-25s", bus)[0] == bus.t_first + 10 * 10**9  # type: ignore[arg-type]
    for text in ("16-14", "25-26", "2026-13-40 1-2", "soon", "5s-1s"):
        with pytest.raises(GotoError):
            span(text, bus, UTC, now)  # type: ignore[arg-type]


def test_a_capture_is_read_out_in_plain_lines(capture: Path) -> None:
    lines = list(spoken(opened(capture), "exception"))
    assert "Cause 1" in lines[2] and all(line.isprintable() and "  " not in line for line in lines)
    assert any("illegal data address" in line for line in lines)
    assert any("after 796..941 us, exception: unit 2" in line for line in lines), "as far as the tap carries"
    command = [sys.executable, "-m", "analyzer.cli", "open", str(capture), "--plain", "--filter"]
    done = subprocess.run([*command, "exception"], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == lines
    wrong = subprocess.run([*command, "unit ="], capture_output=True, text=True, check=False)
    assert wrong.returncode == 2 and len(wrong.stderr.splitlines()) == 1


@pytest.mark.parametrize("language", ["en", "ru"])
def test_what_came_of_a_request_is_read_out_once(capture: Path, language: str) -> None:
    with languages.telling(language):
        lines = list(spoken(opened(capture)))
        for words in (tr("no answer"), "illegal data address"):
            assert all(line.count(words) <= 1 for line in lines), words
        silent = [line for line in lines if "no-response: " in line]
        assert silent and not any(f", {tr('no answer')}, " in line for line in silent)
        assert any("exception: " in line for line in lines)


def test_columns_are_hidden_and_stay_so(capture: Path, tmp_path: Path) -> None:
    kept = tmp_path / "interface.json"

    async def work(sitting: Seat) -> None:
        wishes = sitting.app.desk.wishes
        wishes.path = kept
        head = sitting.shown().splitlines()[2]
        assert "gap" in head
        await sitting.press("C", "3")
        await sitting.until(lambda: "frames.gap" in wishes.hidden)
        await sitting.press("escape")
        lines = sitting.shown().splitlines()
        assert "gap" not in lines[2]
        assert lines[2].index("what") == head.index("what") - 7
        await sitting.press("1")
        assert "register" in sitting.shown().splitlines()[2]
        await sitting.press("C", "down", "down", "down", "down", "enter", "escape")
        assert "register" not in sitting.shown().splitlines()[2]

    using(opened(capture), work)
    assert Preferences.read(kept).hidden == {"frames.gap", "transactions.register"}


def test_filters_of_the_settings_stand_among_the_kept_ones(
    capture: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "rtuscope.toml").write_text('[filters]\nsick = "exception or unanswered"\n')
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("RTUSCOPE_CONFIG", raising=False)

    async def work(sitting: Seat) -> None:
        await sitting.press("S")
        await sitting.until(lambda: "sick: exception or unanswered" in sitting.shown())
        assert "drop one" not in sitting.shown(), "they are the file's"
        await sitting.press("1")
        await sitting.until(lambda: 0 < sitting.screen.frames.count() < sitting.bus.count)

    using(opened(capture), work)


def test_without_colours_the_cursor_stands_in_reverse(capture: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NO_COLOR", "1")

    async def work(sitting: Seat) -> None:
        strips = list(sitting.app.screen._compositor.render_strips())
        styles = [segment.style for strip in strips for segment in strip if segment.style is not None]
        assert styles and all(
            colour is None or colour.is_default for style in styles for colour in (style.color, style.bgcolor)
        )
        turned = ["".join(s.text for s in strip if s.style is not None and s.style.reverse).strip() for strip in strips]
        row, *_ = [text for text in turned if "read 3 holding registers" in text]
        assert row.startswith("0"), "the line under the cursor, whole"
        assert not any("what" in text for text in turned), "the head of the list is no cursor"
        await sitting.press("question_mark")
        await sitting.until(lambda: isinstance(sitting.app.screen, Help))
        strips = list(sitting.app.screen._compositor.render_strips())
        behind = [each.style for each in strips[-1] if each.style is not None and each.text.strip()]
        assert behind and not any(style.reverse for style in behind), "what shines through is as it was"

    using(opened(capture), work)


def test_where_one_types_the_footer_has_the_keys_of_the_line_alone(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        await sitting.press("slash")
        await sitting.until(lambda: sitting.screen.query_one(FilterBar).line.has_focus)
        footer = sitting.shown().splitlines()[-1]
        assert all(words in footer for words in ("Tab Complete", "Enter Use", "Esc Leave", "F1 Help"))
        assert "Find" not in footer and "Go to" not in footer, "f and g are text there"
        await sitting.press("f1")
        await sitting.until(lambda: isinstance(sitting.app.screen, Help))
        await sitting.press("escape", "escape")
        assert "f Find" in sitting.shown().splitlines()[-1]

    using(opened(capture), work)


def test_on_forty_columns_help_and_what_an_empty_list_says_can_be_read(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        sitting.screen.query_one(FilterBar).use_filter("unit == 99 and exception")
        await sitting.settle()
        said = " ".join(sitting.shown().split())
        assert "nothing here matches unit == 99 and exception; Esc removes it" in said
        await sitting.press("question_mark")
        await sitting.until(lambda: isinstance(sitting.app.screen, Help))
        assert "/            the filter; Tab" in sitting.shown(), "words beside the key, not one below the other"

    using(opened(capture), work, size=(40, 24))
