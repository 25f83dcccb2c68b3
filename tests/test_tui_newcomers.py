"""What somebody meets who has only read the footer and the help: what is typed halfway, what hides, what flattens."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from seats import Seat, opened, sample_in, using
from textual.widgets import Label

import analyzer
import captures
from analyzer import languages
from analyzer.languages import grouped, page_words, tr
from analyzer.meant import meant
from analyzer.model.selection import compiled
from analyzer.model.source import CaptureSource, Nothing
from analyzer.model.spoken import spoken
from analyzer.model.times import span
from analyzer.simulation import Scenario, simulate
from analyzer.tui.filterbar import FilterBar
from analyzer.tui.home import HomeList
from analyzer.tui.items import cause_facts, whose
from analyzer.tui.keys import key_name
from analyzer.tui.picking import _no_file
from analyzer.tui.plot import Series, told_apart
from analyzer.words import percent
from captures import samples
from captures.chunks import Capture, Chunk
from captures.line import LineSettings

_NMEA = b"$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47\r\n"


@pytest.fixture
def capture(tmp_path: Path) -> Path:
    return sample_in(tmp_path)


def trouble(sitting: Seat) -> str:
    label = sitting.screen.query_one("#filter-trouble", Label)
    return str(label.content) if label.display else ""


def test_a_word_that_was_begun_is_taken_as_the_one_listed(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        bar = sitting.screen.query_one(FilterBar)
        await sitting.press("slash")
        await sitting.type("exc")
        assert not trouble(sitting), "it may still become a word"
        await sitting.press("enter")
        assert bar.text == "exception" and sitting.screen.frames.has_focus
        await sitting.press("slash")
        await sitting.type(" and ")
        await sitting.press("enter")
        assert bar.text == "exception" and bar.line.has_focus and trouble(sitting), "nothing was begun: it is told"

    using(opened(capture), work)


@pytest.mark.parametrize("size", [(40, 20), (80, 24)])
def test_a_span_leaves_room_to_type(size: tuple[int, int], capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        await sitting.press("T")
        await sitting.type("0s-1s")
        await sitting.press("enter")
        assert sitting.app.desk.span_words(sitting.app.desk.scope.span or (0, 0))[:10] in sitting.shown()
        await sitting.press("slash")
        assert sitting.screen.query_one(FilterBar).line.size.width >= 30

    using(opened(capture), work, size=size, view="transactions")


def test_what_narrows_is_told_as_long_as_it_does(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        await sitting.press("d", "z")
        line = sitting.shown().splitlines()[1]
        assert "changed only (d)" in line and "no noise (z)" in line
        await sitting.press("d", "z")
        assert "(d)" not in sitting.shown() and "(z)" not in sitting.shown()

    using(opened(capture), work, view="transactions")


def test_below_stands_the_row_under_the_cursor_and_the_place_is_kept(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        listing = sitting.screen.transactions
        await sitting.press("end", "up", "up")
        before, at = sitting.row, listing.cursor
        own = sitting.bus.table.value("unit", before)
        for text in (f"unit != {own}", f"unit == {own}"):
            sitting.screen.query_one(FilterBar).use_filter(text)
            await sitting.settle()
            assert sitting.row == sitting.screen.studied
            assert f"frame {sitting.bus.table.value('frame', sitting.row)}" in sitting.shown()
        sitting.screen.jumps.go_to_row(before)
        await sitting.settle()
        await sitting.press("escape")
        assert (sitting.row, listing.cursor) == (before, at), "where one was before the filter"

    using(opened(capture), work, view="transactions")


def test_an_export_has_all_rows_however_early_it_is_asked_for(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        sitting.app.desk.scope.filter = compiled("response", sitting.bus.line)
        sitting.screen.jobs.reselect()
        assert sitting.screen.jobs.unsettled and sitting.screen.jobs.shown_count is None
        early = sitting.screen.jobs.shown()(bool)
        await sitting.settle()
        assert sitting.screen.jobs.selection is not None
        assert early.tolist() == sitting.screen.jobs.selection.rows().tolist() and len(early)
        await sitting.press("1", "d")
        changed = sitting.screen.jobs.shown()(bool)
        assert 0 < len(changed) < 2 * sitting.screen.transactions.count() + 1, "of transactions that changed, no others"

    using(opened(capture), work)


def test_a_file_that_could_not_be_opened_again_is_not_written(tmp_path: Path) -> None:
    assert "whole capture" in _no_file(str(tmp_path / "some.mcap"))
    assert not _no_file(str(tmp_path / "some.pcapng"))


def test_help_begins_with_the_view_in_sight_and_keys_are_called_as_they_are_engraved(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        assert "Space Pin" in sitting.shown().splitlines()[-1]
        await sitting.press("question_mark")
        assert "In Registers" in sitting.shown().split("Views")[0]

    using(opened(capture), work, view="registers")


def test_where_bytes_are_typed_help_and_ctrl_c_tell_what_acts_there(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        await sitting.press("8", "ctrl+c")
        await sitting.until(lambda: "Ctrl+Q quits, q is typed here; a running" in sitting.notices()[-1])
        await sitting.press("f1")
        first = sitting.shown().split("Views")[0]
        assert "Where bytes are typed" in first and "Ctrl+L" in first and "Back to the keys of the views" in first
        await sitting.press("escape", "escape", "2", "ctrl+c")
        await sitting.until(lambda: sitting.notices()[-1].startswith("q quits"))

    using(opened(capture), work)


def test_that_there_is_no_capture_is_told_in_the_language_in_use() -> None:
    from analyzer.languages import telling

    assert Nothing().name == "no capture"
    with telling("ru"):
        assert Nothing().name == "без записи"


def test_a_list_that_comes_up_has_its_own_row_below(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        for view in "01023":
            await sitting.press(view)
        await sitting.press("0", "1")
        assert ("cause:" not in sitting.shown() and "versus" in sitting.shown()) or "byte" in sitting.shown()
        assert sitting.screen.studied == sitting.row

    using(opened(capture), work, size=(40, 20), view="home")


@pytest.mark.parametrize("view", ["transactions", "frames"])
def test_forty_columns_have_room_for_what_happened(view: str, capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        head, *lines = sitting.shown().splitlines()[2:7]
        at = head.index("what")
        assert at <= 28 and head.rstrip().endswith("what")
        assert all(line[at:].strip() for line in lines)

    using(opened(capture), work, size=(40, 20), view=view)


def test_the_zone_is_asked_with_the_time(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        begun = sitting.bus.t_first
        words = sitting.app.desk.span_words((begun // 10**9 * 10**9, begun // 10**9 * 10**9 + 90 * 10**9))
        assert words.endswith("UTC") and "–" in words
        text = words.removesuffix(" UTC").replace("–", "-")
        if text.count(":") == 2:
            assert span(text, sitting.bus)[1] > begun
        await sitting.press("T")
        assert "UTC" in sitting.shown()

    using(opened(capture), work)


@pytest.mark.parametrize(
    ("key", "name"),
    [("space", "Space"), ("ctrl+up", "Ctrl+↑"), ("ctrl+l", "Ctrl+L"), ("f1", "F1"), ("shift+tab", "Shift+Tab"),
     ("G", "G"), ("f", "f"), ("pagedown", "PgDn"), ("plus", "+")],
)  # fmt: skip
def test_a_key_is_called_as_it_is_engraved(key: str, name: str) -> None:
    assert key_name(key) == name


numbers = st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=300)


@given(numbers, st.lists(st.floats(-1e9, 1e9), max_size=3))
def test_a_scale_holds_nearly_all_numbers_and_names_the_others(many: list[float], far: list[float]) -> None:
    series = Series("", np.arange(len(many) + len(far)), np.array(many + far))
    assert series.scale is not None and series.range is not None
    low, high = series.scale
    assert series.range[0] <= low <= high <= series.range[1]
    inside = (series.numbers >= low) & (series.numbers <= high)
    assert len(series.beyond) == int((~inside).sum()) <= 0.02 * len(inside) + 2
    assert len(series.beyond) == 0 or (high - low) * 5 <= series.range[1] - series.range[0]


def test_one_value_that_stands_for_none_does_not_flatten_a_week() -> None:
    week = 200 + 80 * np.sin(np.arange(10_080) / 229)
    week[::1000] = 65_535
    series = Series("", np.arange(len(week)), week)
    assert series.scale == (week.min(), np.sort(week[week < 65_535])[-1]) and len(series.beyond) == 11
    steps = np.repeat([0.0, 1000.0], 500)
    assert Series("", np.arange(1000), steps).scale == (0.0, 1000.0), "what is often there is on the scale"
    rare = np.zeros(1000)
    rare[500] = 1.0
    assert Series("", np.arange(1000), rare).scale == (0.0, 1.0), "what stands still but once is shown"


@given(st.floats(0, 1))
def test_a_share_that_is_not_nothing_is_never_called_so(share: float) -> None:
    assert len(percent(share)) <= 5
    assert (percent(share) == "0%") == (share == 0)


def test_a_word_that_was_begun_is_meant_before_one_that_looks_alike() -> None:
    assert meant("exc", ["hex", "exception", "exceptional"]) == "exception"
    assert meant("unti", ["unit", "untimed_thing"]) in ("unit", "untimed_thing")
    assert meant("xyzzy", ["unit"]) is None


@pytest.mark.parametrize(
    ("low", "high", "room", "told"),
    [
        (230.0, 231.5, 11, ("230", "231.5")),
        (22790850.0, 22790853.0, 11, ("22790850", "22790853")),
        (-443433898344449.0, -443429603442689.0, 11, ("-4.4343e+14", "-4.4343e+14")),
        (-443433898344449.0, -443429603442689.0, 24, ("-443433898344449", "-443429603442689")),
        (5.0, 5.0, 8, ("5", "5")),
    ],
)
def test_the_ends_of_a_scale_are_told_apart_where_there_is_room(
    low: float, high: float, room: int, told: tuple[str, str]
) -> None:
    assert told_apart(low, high, room) == told


@pytest.mark.parametrize("language", ["en", "ru"])
@pytest.mark.parametrize(("said", "told"), [(_NMEA, "NMEA 0183"), (bytes(range(7, 40)), 1320)])
def test_a_capture_without_a_frame_opens_at_what_it_is_instead(
    said: bytes, told: str | int, language: str, tmp_path: Path
) -> None:
    languages.use_language(language)
    told = told if isinstance(told, str) else grouped(told)
    path = tmp_path / "other.jsonl"
    chunks = [Chunk(10**18 + second * 10**9, said) for second in range(40)]
    captures.write(path, Capture.of(LineSettings(baud=9600), chunks))

    async def work(sitting: Seat) -> None:
        await sitting.until(lambda: sitting.screen.view == "home")
        await sitting.settle()
        assert tr("no Modbus frames found") in sitting.shown() and told in sitting.shown()
        assert f"  {page_words('span')} " in sitting.shown() or sitting.screen.query_one(HomeList).cause is not None
        assert not sitting.notices(), "it is said once"
        for view in "145":
            await sitting.press(view)
            await sitting.until(
                lambda: tr("no Modbus frames found; press 0 to see what was captured") in sitting.shown()
            )

    using(opened(path), work, view=None)
    lines = list(spoken(opened(path)))
    assert lines[1].startswith(page_words("No Modbus frame was found.")) and any(told in line for line in lines)
    assert not [line for line in lines if tr("No cause of trouble.") in line or line.startswith("0 ")]


@pytest.mark.parametrize("blame", ["master", "line", "tap", "nobody"])
def test_whose_fault_it_is_is_said_in_each_language(blame: str) -> None:
    languages.use_language("ru")
    assert not re.search("[a-z]", whose(SimpleNamespace(blame=blame, units=())))  # type: ignore[arg-type]


def test_how_often_a_cause_comes_again_is_told_in_a_unit_that_people_use() -> None:
    cause = analyzer.open(samples.path("troubled.jsonl")).report().causes[0]
    assert cause_facts(replace(cause, period_s=10_600.0))["again"] == "every 2 h 56 min"


def test_a_unit_that_is_found_to_be_slow_is_not_called_sound() -> None:
    """Though all of its requests are answered: Home says of it what the list of findings says."""
    made = simulate(Scenario("clean", "precise", transactions=300, seed=49, defect="slow-device"))

    async def look(sitting: Seat) -> None:
        await sitting.press("0")
        await sitting.until(lambda: "asked" in sitting.shown())
        (unit,) = re.findall(r"unit +(\d+) +slow", sitting.shown())
        assert re.search(rf"found +unit {unit} answers in", sitting.shown())  # the first line, and told below

    using(CaptureSource(Capture.of(made.line, made.chunks), "bus"), look, size=(100, 30))
