"""Keys typed fast through a real terminal: each acts on what the one before it left."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from buses import write_meter
from seats import opened, sample_in

if os.name != "posix":
    pytest.skip("ptys are POSIX", allow_module_level=True)

from emulator import Watched

from analyzer.model.bus import Bus

DOWN, UP, ENTER, ESC = "\x1b[B", "\x1b[A", "\r", "\x1b"


@pytest.fixture
def capture(tmp_path: Path) -> Path:
    return sample_in(tmp_path)


@pytest.fixture
def seen(capture: Path) -> Iterator[Watched]:
    with Watched("open", str(capture), columns=100, rows=30, cwd=capture.parent) as terminal:
        terminal.until("causes explain").settle(1.0)
        terminal.press("2\x1b[H").until("registers from 107").settle(0.5)
        yield terminal


def bus_of(capture: Path) -> Bus:
    source = opened(capture)
    bus = Bus.of(source)
    for analysed in source.steps(bool):
        bus.feed(analysed)
    bus.close()
    return bus


def noted(capture: Path, terminal: Watched, count: int = 1) -> list[int]:
    """Rows of the bookmarks that are kept beside the capture, once there are so many."""
    beside = capture.with_name(capture.name + ".rtuscope.json")
    terminal.until(lambda: beside.exists() and len(json.loads(beside.read_text())["bookmarks"]) >= count)
    bus = bus_of(capture)
    kept = json.loads(beside.read_text())["bookmarks"]
    return [bus.table.row_of_byte(note["port"], note["start"]) for note in kept]


def test_a_bookmark_is_set_where_the_cursor_is(seen: Watched, capture: Path) -> None:
    seen.press(DOWN * 3 + "m" + DOWN * 4 + "m")
    assert noted(capture, seen, 2) == [3, 7]


def test_a_click_acts_on_what_the_keys_before_it_left(seen: Watched) -> None:
    """In Findings, which the key brings up, the line under the mouse is a group; in Frames it was a frame."""
    below, click = "\x1b[<0;40;{row}M\x1b[<0;40;{row}m", 6
    seen.press("3").until("by cause")  # which come later than the findings, and put these in another order
    seen.press("2\x1b[H").until("registers from 107").settle(0.5)
    seen.press("3\x1b[H" + below.format(row=click)).settle(1.0)
    clicked = seen.shown()
    seen.press("\x1b[H").settle(0.5)
    seen.press(below.format(row=click)).settle(1.0)
    assert "findings:" in clicked
    assert seen.shown() == clicked


def test_the_wheel_behind_a_question_turns_its_page(seen: Watched) -> None:
    before = seen.shown().splitlines()[2:6]
    seen.press("?" + "\x1b[<65;50;15M" * 3).settle(1.0)
    seen.press(ESC).settle(1.0)
    assert seen.shown().splitlines()[2:6] == before


def test_findings_are_jumped_to_one_by_one(seen: Watched, capture: Path) -> None:
    bus = bus_of(capture)
    rows = sorted({bus.found.row(i) for i in range(bus.found.count)} - {-1})
    rows = [row for row in rows if row > 0]
    seen.press("]" * 6 + "m")
    assert noted(capture, seen) == [rows[5]]


def test_a_question_gets_what_is_typed_behind_its_key(seen: Watched, capture: Path) -> None:
    seen.press(f"g50{ENTER}m;pump off{ENTER}")
    (row,) = noted(capture, seen)
    assert bus_of(capture).frame(row).index == 50
    seen.until("pump off")


def test_the_next_hit_is_counted_from_the_last(seen: Watched, capture: Path) -> None:
    seen.press(f"fdiscrete{ENTER}nnnm")
    bus = bus_of(capture)
    hits = [r for r in range(bus.count) if not bus.is_noise(r) and "discrete" in bus.frame(r).summary()]
    assert noted(capture, seen) == [hits[3]]


def test_a_filter_typed_at_once_and_a_selection_kept(seen: Watched, capture: Path) -> None:
    seen.press(f"/unit == 2{ENTER}").until("rows shown")
    seen.press(f" {DOWN}{DOWN} {DOWN}{DOWN}{DOWN}e\x15two.jsonl{ENTER}")
    seen.until(lambda: (capture.parent / "two.jsonl").exists())
    rows = [json.loads(line) for line in (capture.parent / "two.jsonl").read_text().splitlines()]
    assert len(rows) == 3 and {row["unit"] for row in rows} == {2}


def rows_by_unit(capture: Path) -> dict[int, list[int]]:
    bus = bus_of(capture)
    kinds, units = (bus.table.column(0, name)[: bus.count].tolist() for name in ("kind", "unit"))
    found: dict[int, list[int]] = {}
    for row in range(bus.count):
        if kinds[row]:
            found.setdefault(units[row], []).append(row)
    return found


def test_a_filter_typed_at_once_is_in_use_for_the_keys_behind_it(seen: Watched, capture: Path) -> None:
    seen.press(f"/unit == 17{ENTER}" + DOWN * 2 + "m")
    assert noted(capture, seen) == [rows_by_unit(capture)[17][2]]


def test_a_unit_that_is_opened_has_its_rows_under_the_next_keys(seen: Watched, capture: Path) -> None:
    seen.press("9" + DOWN + ENTER + DOWN + "m")
    rows = rows_by_unit(capture)
    assert noted(capture, seen) == [rows[sorted(rows)[1]][1]]


def test_escape_leaves_the_filter_in_use_on_its_line(seen: Watched) -> None:
    seen.press(f"/unit == 2{ENTER}").until("rows shown")
    seen.press("/ and exce").press(ESC)
    line = next(line for line in seen.picture.lines() if "unit == 2" in line)
    assert "exce" not in line and "rows shown" in seen.shown()


def test_a_comment_that_was_deleted_comes_back(seen: Watched, capture: Path) -> None:
    seen.press(f"{DOWN};valve{ENTER}m").until("u restores")
    seen.press("u").until('"valve"')
    assert noted(capture, seen) == [1]


def test_home_says_whose_fault_and_the_cause_is_gone_to(seen: Watched, capture: Path) -> None:
    seen.press("0").until("causes explain what is wrong").until("to confirm").until("do ")
    causes = bus_of(capture).causes()
    assert seen.shown().index(causes[0].text[:40]) < seen.shown().index("unit   1")
    seen.press(f"{ENTER}m")
    assert bus_of(capture).frame(noted(capture, seen)[0]).index == causes[0].frames[0]


def test_a_float_is_listed_and_plotted_as_a_float(tmp_path: Path) -> None:
    values = [20 + (i % 50) / 10 for i in range(300)]
    path = tmp_path / "meter.jsonl"
    write_meter(path, values)
    with Watched("open", str(path), columns=120, rows=40, cwd=tmp_path) as terminal:
        terminal.until("outcome").settle(1.0)
        terminal.press("5").until("f32").until("300 readings").settle(0.5)
        shown = terminal.shown()
        assert "of 40001" in shown and f"{max(values):.6g}" in shown and "16825" not in shown
        assert f"{values[-2]:.7g}" in shown, "the value before it, as a float too"
        terminal.press("v").until(" !")  # the user's own word, kept beside the capture
        kept = json.loads((tmp_path / "meter.jsonl.rtuscope.json").read_text())["types"]
        assert kept == {"1:3:0": "f32 CDAB"}
        terminal.press("x").until("300 readings")
        assert "types" not in json.loads((tmp_path / "meter.jsonl.rtuscope.json").read_text())


def test_a_file_that_grows_is_followed_to_its_end(capture: Path, tmp_path: Path) -> None:
    lines = capture.read_text().splitlines(keepends=True)
    growing = tmp_path / "growing.jsonl"
    growing.write_text("".join(lines[:200]))
    whole = bus_of(capture).frames
    with Watched("open", str(growing), columns=100, rows=30, cwd=tmp_path) as terminal:
        terminal.until(" frames").settle(1.0)
        assert f"{whole} frames" not in terminal.shown()
        terminal.press("2F").settle(0.5)
        for i in range(200, len(lines), 100):
            with growing.open("a") as file:
                file.write("".join(lines[i : i + 100]))
            terminal.settle(0.3, most=1.5)
        terminal.until(f"{whole} frames")
        terminal.until(lambda: any(line[2:].lstrip().startswith(f"{whole - 1} ") for line in terminal.picture.lines()))


def test_no_key_fails_in_any_view_that_the_filter_has_emptied(seen: Watched) -> None:
    seen.press("/unit == 246" + ENTER)
    for view in "0123456":
        seen.press(view + "][cn." + DOWN + UP + "d" + "zz" + " " + ESC + "w" + "m" + "tr" + "[]")
    seen.press("2").until("unit == 246")
    assert "Traceback" not in seen.raw.decode(errors="replace")
