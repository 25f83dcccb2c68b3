"""One scope, obeyed by every view; every cell is a door to it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from seats import Seat, opened, sample_in, using

import captures
from analyzer.model.bus import Bus
from analyzer.model.scope import Scope, ScopedFigures
from analyzer.model.selection import Unfolded, compiled
from analyzer.model.source import CaptureSource
from analyzer.tables.schema import Kind
from analyzer.tui.desk import KeptFilter, Preferences
from analyzer.tui.filterbar import FilterBar
from analyzer.tui.findings import FindingList
from analyzer.tui.home import HomeList
from analyzer.tui.plot import Plot
from analyzer.tui.registerlist import RegisterList
from analyzer.tui.timeline import Timeline
from analyzer.tui.unitlist import AnswerTimes, UnitList
from captures import samples


@pytest.fixture
def capture(tmp_path: Path) -> Path:
    return sample_in(tmp_path)


@pytest.fixture(scope="module")
def bus() -> Bus:
    source = CaptureSource(captures.open(samples.path("troubled.jsonl")), "bus")
    bus = Bus.of(source)
    for analysed in source.steps(bool):
        bus.feed(analysed)
    bus.close()
    return bus


@pytest.mark.parametrize("text", ["unit == 2", "exception", "response_time > 100ms", 'finding == "no-response"'])
def test_transactions_are_whole(bus: Bus, text: str) -> None:
    """A transaction is in the scope if its request or its answer is."""
    scope = Scope(compiled(text, bus.line))
    rows, asked = scope.selections(bus)
    assert rows is not None
    rows.extend()
    asked.extend()
    passed = set(rows.rows().tolist())
    assert passed
    for row in asked.rows().tolist():
        assert passed & {row, bus.partner(row)}
    begun = set(asked.rows().tolist())
    for row in passed:
        if not bus.is_noise(row):
            partner = bus.partner(row)
            assert row in begun or partner in begun


def test_the_figures_of_all_rows_are_those_of_the_bus(bus: Bus) -> None:
    source = CaptureSource(captures.open(samples.path("troubled.jsonl")), "bus")
    figures = ScopedFigures(bus, np.arange(bus.count))
    whole, own = bus.report(source), figures.report(source)
    assert own.transactions == whole.transactions and own.units == whole.units
    assert figures.registers.all() == bus.registers.all()
    bins = figures.over(bus.t_first, bus.t_last + 1, 50)
    assert (bins.octets == bus.over(bus.t_first, bus.t_last + 1, 50).octets).all()


def test_only_answers_that_changed(bus: Bus) -> None:
    changed = Scope(only_changed=True).selections(bus)[1]
    changed.extend()
    newest: dict[bytes, bytes] = {}
    expected = []
    for row in range(bus.count):
        partner = bus.partner(row)
        if bus.table.value("kind", row) == Kind.REQUEST and partner is not None and bus.table.value("check", partner):
            asked, said = bus.captured(row), bus.captured(partner)
            if newest.get(asked) != said:
                expected.append(row)
            newest[asked] = said
    assert changed.rows().tolist() == expected


def test_rows_fold_out_below_their_transaction(bus: Bus) -> None:
    asked = Scope().selections(bus)[1]
    asked.extend()
    lines = Unfolded(bus, asked)
    for line in (5, 2, 0):
        assert lines.turn(line, True) == line
    seen = [lines.place(i) for i in range(lines.count)]
    assert [row for row, below in seen if not below] == asked.rows().tolist()
    for i, (row, below) in enumerate(seen):
        if below:
            assert lines.turn(i, True) == i - below, "a line below belongs to its transaction"
        else:
            assert lines.line(row) == i
    first = lines.place(0)[0]
    assert [row for row, below in seen[1:] if below][: bus.partner(first) is not None] == [first]
    lines.turn(1, False)
    assert lines.place(1)[1] == 0


def test_every_view_obeys_the_scope_and_says_what_empties_it(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        screen = sitting.screen
        await sitting.press("equals_sign", "u")
        assert screen.query_one(FilterBar).text == "unit == 1"
        await sitting.press("9")
        units = screen.query_one(UnitList)
        await sitting.until(lambda: units.report is not None and [u.unit for u in units.report.units] == [1])
        await sitting.press("5")
        registers = screen.query_one(RegisterList)
        assert registers.count() and {spot[0] for spot in registers._spots} == {1}
        await sitting.press("0")
        home = screen.query_one(HomeList)
        await sitting.until(lambda: home.state is not None and len(home.state.report.units) == 1)
        await sitting.press("6")
        bins = screen.query_one(Timeline)._bins
        assert bins is not None and bins.frames.sum() == sitting.app.desk.figures.frames
        screen.query_one(FilterBar).use_filter("unit == 99")
        await sitting.settle()
        for view in "01234567":
            await sitting.press(view)
            await sitting.until(lambda: "nothing here matches unit == 99; Esc removes it" in sitting.shown())
        await sitting.press("5")
        await sitting.press("escape")
        assert registers.count() == len(sitting.bus.registers)

    using(opened(capture), work)


def test_what_a_scope_leaves_out_stands_nowhere_below_and_comes_back_with_esc(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        screen, bar = sitting.screen, sitting.screen.query_one(FilterBar)
        await sitting.press("9")
        times = screen.query_one(AnswerTimes)
        await sitting.until(lambda: times.unit == 1)
        await sitting.press("5", "down")
        plot = screen.query_one(Plot)
        await sitting.until(lambda: len(plot.series) == 1)
        await sitting.press("2", "g", "2", "9", "enter")
        row = sitting.row
        bar.use_filter("unit == 99")
        await sitting.settle()
        assert screen.row is None and not screen.detail.look.items
        await sitting.press("9")
        await sitting.until(lambda: times.unit is None)
        await sitting.press("5")
        await sitting.until(lambda: not plot.series)
        await sitting.press("3")
        findings = screen.query_one(FindingList)
        await sitting.until(lambda: findings.count() == 0)
        assert "0 errors, 0 warnings, 0 notes" in sitting.shown() and not screen.detail.look.items
        await sitting.press("2", "escape")
        await sitting.until(lambda: screen.frames.count() == sitting.bus.count)
        assert sitting.row == row and screen.detail.look.title == "frame 29"
        await sitting.press("1")
        bar.use_filter("unit == 99")
        await sitting.until(lambda: screen.row is None)
        await sitting.press("escape")
        await sitting.until(lambda: screen.transactions.count() > 0)
        assert sitting.row == row and screen.detail.look.title == "frame 29"

    using(opened(capture), work)


def test_findings_under_a_scope_are_counted_and_stand_under_the_causes_of_it_alone(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        findings = sitting.screen.query_one(FindingList)
        await sitting.press("3")
        await sitting.until(lambda: findings.grouped)
        sitting.screen.query_one(FilterBar).use_filter("noise")
        await sitting.until(lambda: "1 error, 11 warnings, 0 notes   showing all by cause: 12" in sitting.shown())
        headings = [block for block in findings._blocks if not block.code]
        assert [block.cause is None for block in headings] == [False, True], "the other causes explain nothing of it"

    using(opened(capture), work)


def test_what_is_under_the_cursor_is_filtered_out_joined_and_followed(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        bar = sitting.screen.query_one(FilterBar)
        await sitting.press("exclamation_mark", "u")
        assert bar.text == "not (unit == 1)"
        await sitting.press("ampersand", "f")
        assert bar.line.has_focus and bar.line.value.startswith("not (unit == 1) and function == ")
        await sitting.press("escape", "escape")
        assert bar.text == ""
        before = sitting.row
        await sitting.press("full_stop", "p")
        after = sitting.row
        assert after > before and sitting.bus.captured(after)[:2] == sitting.bus.captured(before)[:2]

    using(opened(capture), work)


def test_filters_are_remembered_and_kept_with_a_colour(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        screen, wishes = sitting.screen, sitting.app.desk.wishes
        bar = screen.query_one(FilterBar)
        for text in ("unit == 2", "exception"):
            bar.use_filter(text)
        await sitting.settle()
        await sitting.press("S", "k")
        await sitting.type("refused red")
        await sitting.press("enter")
        assert KeptFilter("refused", "exception", "red") in wishes.filters
        await sitting.press("escape")
        row = next(row for row in range(sitting.bus.count) if sitting.bus.frame(row).exception)
        assert sitting.app.desk.tint(row) == "tint-red" and not sitting.app.desk.tint(0)
        await sitting.press("slash", "up", "up")
        assert bar.line.value == "unit == 2"
        await sitting.press("escape", "S", "1")
        assert bar.text == wishes.filters[0].text
        await sitting.press("S", "d", "1")
        assert not wishes.filters

    using(opened(capture), work)


def test_colour_rules_of_the_settings_light_rows_and_are_listed(
    capture: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rules = tmp_path / "config.toml"
    rules.write_text('[colours]\nviolet = "unit =="\nred = "exception"\nblue = "unit == 2 or exception"\n')
    monkeypatch.setenv("RTUSCOPE_CONFIG", str(rules))
    trouble = Preferences.of_user().trouble
    assert trouble.startswith(f"{rules}, line 2: colours.violet: column 8: ") and "\n" not in trouble

    async def work(sitting: Seat) -> None:
        assert trouble in sitting.notices()
        bus, desk = sitting.bus, sitting.app.desk
        frames = [bus.frame(row) if not bus.is_noise(row) else None for row in range(bus.count)]
        wanted = [
            "" if frame is None else "tint-red" if frame.exception else "tint-blue" if frame.unit == 2 else ""
            for frame in frames
        ]
        assert {"tint-red", "tint-blue", ""} == set(wanted)
        assert [desk.tint(row) for row in range(bus.count)] == wanted
        await sitting.press("S")
        shown = sitting.shown()
        assert "red: exception" in shown and "blue: unit == 2 or exception" in shown and "violet" not in shown

    using(opened(capture), work)


def test_settings_that_cannot_be_read_are_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "interface.json"
    wishes = Preferences.read(path)
    wishes.keep(KeptFilter("late", "late", "blue"))
    wishes.used("unit == 2")
    assert Preferences.read(path).filters == wishes.filters and Preferences.read(path).past == ["unit == 2"]
    for text in (
        "[]",
        "{}",
        '{"version": 99}',
        "[" * 100_000,
        '{"version": 1, "filters": 3}',
        json.dumps({"version": 1, "keys": 5}),
    ):
        path.write_text(text)
        wishes = Preferences.read(path)
        assert "left unchanged" in wishes.trouble
        wishes.used("unit == 3")
        assert path.read_text() == text
