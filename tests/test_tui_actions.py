"""Every action of the terminal interface, by its keys, on a real capture."""

from __future__ import annotations

import gc
import json
from collections import Counter
from pathlib import Path

import pytest
from seats import Seat, opened, sample_in, using
from textual.widgets import Input
from textual.widgets._toast import ToastRack

from analyzer.tables.schema import Kind
from analyzer.tui.details import BytesPane, Details
from analyzer.tui.filterbar import Completions, FilterBar
from analyzer.tui.prompts import Ask
from analyzer.words import TimeBase


@pytest.fixture
def capture(tmp_path: Path) -> Path:
    return sample_in(tmp_path)


def test_moving_shows_fields_and_bytes_both_ways(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        assert sitting.row == 0
        await sitting.press("down", "down", "up")
        await _move_without_laying_out(sitting)
        await sitting.press("home", "down")
        assert sitting.row == 1
        await sitting.press("end")
        assert sitting.row == sitting.bus.count - 1
        await sitting.press("home", "pagedown")
        assert sitting.row == sitting.screen.frames.room - 1
        await sitting.press("home", "down", "tab")  # an answer with registers
        details, octets = sitting.screen.query_one(Details), sitting.screen.query_one(BytesPane)
        assert details.has_focus
        await sitting.press("home", "down", "down", "down", "down", "down", "down")
        assert details.item is not None and details.item.label == "register"
        assert octets.lit == range(details.item.start, details.item.start + 2)
        await sitting.press("tab", "end")
        assert octets.has_focus and octets.offset_at == len(octets.look.data) - 1
        assert details.item.label == "crc"
        await sitting.press("home")
        assert details.item.label == "unit"
        await sitting.press("b")
        assert octets.bits and "0000 0001" in sitting.shown()
        await sitting.press("tab")
        assert sitting.screen.frames.has_focus

    using(opened(capture), work)


async def _move_without_laying_out(sitting: Seat) -> None:
    """Only what changes is painted: no other widget has to be laid out anew for a list that is longer or shorter."""
    screen, laid_out = sitting.screen, []
    lay_out = screen._refresh_layout
    screen._refresh_layout = lambda *given, **more: (laid_out.append(1), lay_out(*given, **more))  # type: ignore
    await sitting.press("pagedown", "down", "down", "pagedown", "up", "pageup")
    assert not laid_out
    del screen._refresh_layout


def test_garbage_is_looked_for_only_once_the_first_rows_stand(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        await sitting.until(gc.isenabled)
        below = sitting.screen.size.height - sitting.screen.query_one("#status").region.y
        notices = ToastRack()  # tests have none
        await sitting.screen.mount(notices)
        assert notices.styles.margin.bottom >= below  # what goes on can be read beside them

    gc.disable()
    try:
        using(opened(capture), work)
    finally:
        gc.enable()
        gc.unfreeze()


def test_fields_open_and_close_and_registers_show_every_reading(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        await sitting.press("down", "tab", "home")
        details = sitting.screen.query_one(Details)
        closed = details.count()
        await sitting.press("right")
        assert details.count() > closed and "confidence" in sitting.shown()
        await sitting.press("space")
        assert details.count() == closed
        await sitting.press("v")
        for words in ("s16", "0000 0000 1110 0110", "CDAB", "f32"):
            assert words in sitting.shown() or details.count() > closed + 8
        await sitting.press("v")
        assert details.count() == closed

    using(opened(capture), work, size=(160, 50))


def test_counterpart_findings_and_go_to(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        await sitting.press("c")
        assert sitting.row == sitting.bus.partner(0)
        await sitting.press("c")
        assert sitting.row == 0
        await sitting.press("right_square_bracket")
        first = sitting.row
        assert sitting.bus.findings(first)
        await sitting.press("right_square_bracket")
        assert sitting.row > first
        await sitting.press("left_square_bracket")
        assert sitting.row == first
        await sitting.press("g")
        await sitting.type("nowhere")
        await sitting.press("enter")
        assert isinstance(sitting.app.screen, Ask)
        await sitting.press("escape", "g")
        await sitting.type("50")
        await sitting.press("enter")
        assert sitting.bus.frame(sitting.row).index == 50

    using(opened(capture), work)


def test_find_bytes_text_and_values(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        for text, wanted in (
            ("83 02", lambda row: b"\x83\x02" in sitting.bus.captured(row)),
            ("discrete", lambda row: "discrete" in sitting.bus.frame(row).summary()),
            ("674", lambda row: b"\x02\xa2" in sitting.bus.captured(row)),
        ):
            await sitting.press("home", "f")
            sitting.app.screen.query_one(Input).value = text
            await sitting.press("enter")
            first = sitting.row
            assert first and wanted(first)
            await sitting.press("n")
            assert sitting.row >= first and wanted(sitting.row)
            await sitting.press("N")
            assert sitting.row == first
        await sitting.press("f")
        sitting.app.screen.query_one(Input).value = "83 02"
        await sitting.settle()
        assert "looks for the bytes 83 02" in sitting.shown()
        await sitting.press("enter")
        octets = sitting.screen.query_one(BytesPane)
        assert bytes(octets.look.data[i] for i in octets.lit) == b"\x83\x02", "hits are lit"
        before = sitting.row
        rows = [row for row in range(sitting.bus.count) if b"\x83\x02" in sitting.bus.captured(row)]
        await sitting.press(*"n" * len(rows))
        assert sitting.row == before and any("wrapped to the beginning" in said for said in sitting.notices())
        await sitting.press("f")
        sitting.app.screen.query_one(Input).value = "50%"
        await sitting.press("enter")
        assert sitting.row == sitting.bus.count // 2

    using(opened(capture), work)


def test_the_filter_narrows_completes_and_says_what_is_wrong(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        screen, bar = sitting.screen, sitting.screen.query_one(FilterBar)
        await sitting.press("slash")
        await sitting.type("func")
        assert screen.query_one(Completions).found
        await sitting.press("tab")
        assert bar.line.value.strip() == "function"
        bar.line.value = "unit = "
        await sitting.press("enter")
        assert bar.line.has_focus and "column" in sitting.shown()
        bar.line.value = "unit == 2 and exception"
        await sitting.press("enter")
        assert screen.frames.has_focus
        rows = [screen.frames.rows.row(i) for i in range(screen.frames.count())]
        expected = [
            row for row in range(sitting.bus.count)
            if not sitting.bus.is_noise(row) and (frame := sitting.bus.frame(row)).unit == 2 and frame.exception
        ]  # fmt: skip
        assert rows == expected != []
        assert f"{len(rows)} of {sitting.bus.count} rows shown" in sitting.shown()
        await sitting.press("1")
        assert screen.transactions.count() == len(rows), "the answers that pass bring their requests"
        await sitting.press("2", "escape")
        assert screen.frames.count() == sitting.bus.count
        await sitting.press("slash")
        bar.line.value = 'finding == "exception" or severity >= error'
        await sitting.press("enter")
        assert {
            sitting.bus.table.value("mark", screen.frames.rows.row(i)) > 0 for i in range(screen.frames.count())
        } == {True}

    using(opened(capture), work)


def test_noise_is_in_place_or_hidden(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        assert sitting.screen.frames.count() == sitting.bus.count
        await sitting.press("z")
        assert sitting.screen.frames.count() == sitting.bus.frames < sitting.bus.count
        await sitting.press("z")
        assert sitting.screen.frames.count() == sitting.bus.count

    using(opened(capture), work)


def test_times_are_shown_four_ways(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        def base() -> TimeBase:
            return sitting.app.desk.base

        await sitting.press("t")
        assert base() is TimeBase.ABSOLUTE and "08:29:51.4" in sitting.shown()
        await sitting.press("t")
        assert base() is TimeBase.PREVIOUS
        await sitting.press("down", "down", "r")
        assert base() is TimeBase.REFERENCE
        assert "0.000000" in sitting.shown() and "-0.0" in sitting.shown()
        await sitting.press("r")
        assert base() is TimeBase.START

    using(opened(capture), work)


def test_bookmarks_and_comments_stay_beside_the_capture(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        await sitting.press("down", "m")
        assert any("saved in troubled.jsonl.rtuscope.json" in notice for notice in sitting.notices())
        await sitting.press("end", "m", "semicolon")
        await sitting.type("pump [red]off")
        await sitting.press("enter", "home", "apostrophe")
        assert sitting.row == 1
        await sitting.press("apostrophe")
        assert sitting.row == sitting.bus.count - 1
        assert '"pump [red]off"' in sitting.shown()
        await sitting.press("home", "down", "m")
        assert "bookmark removed; u restores it" in sitting.notices()
        await sitting.press("apostrophe", "apostrophe")
        assert sitting.row == sitting.bus.count - 1

    using(opened(capture), work)
    kept = json.loads(capture.with_name("troubled.jsonl.rtuscope.json").read_text(encoding="utf-8"))
    assert [mark["comment"] for mark in kept["bookmarks"]] == ["pump [red]off"]


def test_copying_and_selecting(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        for key, wanted in (
            ("h", "01 03 00 6B 00 03 74 17"),
            ("c", "{ 0x01, 0x03, 0x00"),
            ("p", 'bytes.fromhex("0103006b00037417")'),
            ("r", "rtuscope parse 01 03 00 6B"),
        ):
            await sitting.press("y", key)
            assert wanted in sitting.app.clipboard
        await sitting.press("space", "down", "down")
        assert sitting.screen.picked.rows().tolist() == [0, 1, 2]
        await sitting.press("y", "h")
        assert len(bytes.fromhex(sitting.app.clipboard)) == sum(len(sitting.bus.captured(row)) for row in range(3))
        await sitting.press("escape")
        assert not len(sitting.screen.picked.rows())
        await sitting.press("tab", "end", "y", "h")
        assert sitting.app.clipboard == sitting.bus.captured(sitting.row)[-2:].hex(" ").upper()

    using(opened(capture), work)


def test_exporting_what_is_selected_or_shown(capture: Path, tmp_path: Path) -> None:
    async def work(sitting: Seat) -> None:
        async def export(name: str) -> list[str]:
            await sitting.press("e")
            sitting.app.screen.query_one(Input).value = str(tmp_path / name)
            await sitting.press("enter")
            await sitting.until(lambda: (tmp_path / name).exists())
            return (tmp_path / name).read_text(encoding="utf-8").splitlines()

        await sitting.press("e")
        sitting.app.screen.query_one(Input).value = "frames.xyz"
        await sitting.press("enter")
        assert "formats: " in sitting.shown()
        await sitting.press("escape", "space", "down")
        assert len(await export("two.jsonl")) == 2
        await sitting.press("escape", "slash")
        sitting.screen.query_one(FilterBar).line.value = "unit == 2"
        await sitting.press("enter")
        lines = [json.loads(line) for line in await export("unit.jsonl")]
        assert {line["unit"] for line in lines} == {2} and len(lines) == sitting.screen.frames.count()

    using(opened(capture), work)


def test_what_findings_write_is_findings_and_a_suffix_is_advised_by_what_there_is(
    capture: Path, tmp_path: Path
) -> None:
    async def work(sitting: Seat) -> None:
        await sitting.press("3", "b", "home", "e")
        assert "Export the findings of" in sitting.shown()
        for name, advice in (
            ("x.html", "as x.html; formats: .csv .jsonl .parquet"),
            ("x.mcap", "MCAP"),
        ):
            sitting.app.screen.query_one(Input).value = str(tmp_path / name)
            await sitting.press("enter")
            said = " ".join(sitting.shown().split())
            assert advice in said and "--format" not in said, said
        sitting.app.screen.query_one(Input).value = str(tmp_path / "out.jsonl")
        await sitting.press("enter")
        await sitting.until(lambda: any("out.jsonl" in notice for notice in sitting.notices()))
        lines = [json.loads(line) for line in (tmp_path / "out.jsonl").read_text("utf-8").splitlines()]
        assert Counter(line["code"] for line in lines) == sitting.bus.found.by_code

    using(opened(capture), work)


def test_an_export_asks_before_it_overwrites(capture: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.csv"
    out.write_text("precious")

    async def work(sitting: Seat) -> None:
        async def export(answer: str) -> None:
            await sitting.press("e")
            sitting.app.screen.query_one(Input).value = str(out)
            await sitting.press("enter")
            assert "out.csv already exists" in sitting.shown()
            await sitting.press(answer)

        for answer in ("n", "escape", "enter"):  # Enter is the first choice
            await export(answer)
            assert out.read_text(encoding="utf-8") == "precious", answer
            assert sitting.notices()[-1] == "out.csv left unchanged"
        await export("o")
        await sitting.until(lambda: out.read_text(encoding="utf-8") != "precious")
        assert out.read_text(encoding="utf-8").count("\n") == sitting.bus.count + 1
        await sitting.press("e")
        sitting.app.screen.query_one(Input).value = str(capture)
        await sitting.press("enter", "o")
        await sitting.until(lambda: any("capture being read" in notice for notice in sitting.notices()))

    using(opened(capture), work)


def test_an_answer_is_compared_with_the_one_that_was_marked(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        bus = sitting.bus

        def versus() -> dict[str, str]:
            return {item.name: item.text for item in sitting.screen.detail.look.items if "versus" in item.name}

        answers = [
            row
            for row in range(bus.count)
            if bus.table.value("kind", row) == Kind.RESPONSE
            and bus.partner(row) is not None
            and bus.captured(bus.partner(row))[1:6] == b"\x03\x00\x6b\x00\x03"
            and bus.table.value("length", row) == 11
        ]
        first, other = answers[0], next(row for row in answers if bus.captured(row)[0] != bus.captured(answers[0])[0])
        await sitting.press("2", "g", *str(bus.frame(first).index), "enter", "r")
        assert not versus()
        await sitting.press("g", *str(bus.frame(other).index), "enter")
        assert versus()["versus R"].startswith("4 values differ from frame 1, ")
        await sitting.press("up")
        assert not versus(), "a request is compared with nothing"
        await sitting.press("g", "1", "enter", "r", "g", *str(bus.frame(other).index), "enter")
        assert "versus R" not in versus(), "undone"

    using(opened(capture), work)


def test_a_bookmark_set_in_the_transactions_is_seen_there(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        await sitting.press("1", "down", "m")
        assert sitting.bus.table.value("kind", sitting.row) == Kind.RESPONSE, "the answer is under study"
        line = next(line for line in sitting.shown().splitlines() if "0.017406" in line)
        assert line.startswith(" *"), "and the line of its transaction has the mark"

    using(opened(capture), work)
