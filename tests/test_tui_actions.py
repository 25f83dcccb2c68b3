"""Every action of the terminal interface, by its keys, on a real capture."""

from __future__ import annotations

import asyncio
import json
import shutil
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
from textual.pilot import Pilot
from textual.widgets import Input

import captures
from analyzer.frames import Batch
from analyzer.model.clock import TimeBase
from analyzer.model.source import CaptureSource, Nothing, Source
from analyzer.tui.app import Rtuscope
from analyzer.tui.details import Details
from analyzer.tui.filterbar import Completions, FilterBar
from analyzer.tui.findings import FindingList
from analyzer.tui.help import Help
from analyzer.tui.octets import Octets
from analyzer.tui.pastepane import PasteText, PieceList
from analyzer.tui.prompts import Ask, Choose
from analyzer.tui.registerlist import History, RegisterList
from analyzer.tui.screen import BusScreen
from analyzer.tui.timeline import Timeline
from analyzer.tui.unitlist import UnitList
from captures import samples
from captures.chunks import Capture, Chunk
from captures.line import LineSettings


class Seat:
    """A user at the interface."""

    def __init__(self, app: Rtuscope, pilot: Pilot[None]) -> None:
        self.app, self.pilot = app, pilot

    @property
    def screen(self) -> BusScreen:
        screen = self.app.screen_stack[0]
        assert isinstance(screen, BusScreen)
        return screen

    @property
    def row(self) -> int:
        assert self.screen.row is not None
        return self.screen.row

    @property
    def bus(self) -> Any:
        return self.app.desk.bus

    async def press(self, *keys: str) -> None:
        await self.pilot.press(*keys)
        await self.settle()

    async def type(self, text: str) -> None:
        await self.pilot.press(*("space" if c == " " else c for c in text))
        await self.settle()

    async def settle(self) -> None:
        """Workers are done and their messages handled."""
        await self.pilot.pause()
        for _ in range(400):
            if all(worker.is_finished or (self.app.desk.source.live and worker.group in ("load", "select"))
                   for worker in self.app.workers):  # fmt: skip
                break
            if any(isinstance(screen, Ask | Choose | Help) for screen in self.app.screen_stack):
                break
            await asyncio.sleep(0.01)
        await self.pilot.pause()

    async def until(self, wanted: Callable[[], bool]) -> None:
        for _ in range(500):
            if wanted():
                return
            await asyncio.sleep(0.01)
        raise AssertionError("it did not come")

    def shown(self) -> str:
        """What the terminal shows, as text."""
        return "\n".join(
            "".join(segment.text for segment in strip) for strip in self.app.screen._compositor.render_strips()
        )

    def notices(self) -> list[str]:
        return [notice.message for notice in self.app._notifications]


@asynccontextmanager
async def seat(source: Source, *, size: tuple[int, int] = (100, 30), view: str = "frames") -> AsyncIterator[Seat]:
    app = Rtuscope(source, view=view)
    async with app.run_test(size=size) as pilot:
        sitting = Seat(app, pilot)
        if not source.live:
            await sitting.until(lambda: sitting.bus.whole and (not sitting.bus.count or sitting.screen.row is not None))
            await sitting.settle()
        yield sitting


def using(source: Source, work: Callable[[Seat], Awaitable[None]], **options: Any) -> None:
    async def main() -> None:
        async with seat(source, **options) as sitting:
            await work(sitting)

    asyncio.run(main())


@pytest.fixture
def capture(tmp_path: Path) -> Iterator[Path]:
    path = tmp_path / "troubled.jsonl"
    shutil.copy(samples.path("troubled.jsonl"), path)
    yield path


def opened(path: Path) -> CaptureSource:
    return CaptureSource(captures.open(path), path.name)


def test_moving_shows_fields_and_bytes_both_ways(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        assert sitting.row == 0
        await sitting.press("down", "down", "up")
        assert sitting.row == 1
        await sitting.press("end")
        assert sitting.row == sitting.bus.count - 1
        await sitting.press("home", "pagedown")
        assert sitting.row == sitting.screen.frames.room - 1
        await sitting.press("home", "down", "tab")  # an answer with registers
        details, octets = sitting.screen.query_one(Details), sitting.screen.query_one(Octets)
        assert details.has_focus
        await sitting.press("home", "down", "down", "down", "down", "down")
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
        for way, text, wanted in (
            ("h", "83 02", lambda row: b"\x83\x02" in sitting.bus.captured(row)),
            ("t", "discrete", lambda row: "discrete" in sitting.bus.frame(row).summary()),
            ("v", "674", lambda row: b"\x02\xa2" in sitting.bus.captured(row)),
        ):
            await sitting.press("home", "f", way)
            sitting.app.screen.query_one(Input).value = text
            await sitting.press("enter")
            first = sitting.row
            assert first and wanted(first)
            await sitting.press("n")
            assert sitting.row >= first and wanted(sitting.row)
            await sitting.press("N")
            assert sitting.row == first

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
        await sitting.press("2")
        assert screen.talk.count() <= len(rows)
        await sitting.press("1", "escape")
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
        await sitting.press("t")
        assert sitting.app.desk.base is TimeBase.ABSOLUTE and "08:29:51.4" in sitting.shown()
        await sitting.press("t")
        assert sitting.app.desk.base is TimeBase.PREVIOUS
        await sitting.press("down", "down", "r")
        assert sitting.app.desk.base is TimeBase.REFERENCE
        assert "0.000000" in sitting.shown() and "-0.0" in sitting.shown()
        await sitting.press("r")
        assert sitting.app.desk.base is TimeBase.START

    using(opened(capture), work)


def test_bookmarks_and_comments_stay_beside_the_capture(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        await sitting.press("down", "m", "end", "m", "semicolon")
        await sitting.type("pump [red]off")
        await sitting.press("enter", "home", "apostrophe")
        assert sitting.row == 1
        await sitting.press("apostrophe")
        assert sitting.row == sitting.bus.count - 1
        assert '"pump [red]off"' in sitting.shown()
        await sitting.press("home", "down", "m", "apostrophe", "apostrophe")
        assert sitting.row == sitting.bus.count - 1

    using(opened(capture), work)
    kept = json.loads(capture.with_name("troubled.jsonl.rtuscope.json").read_text())
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
        assert sitting.screen.selected().tolist() == [0, 1, 2]
        await sitting.press("y", "h")
        assert len(bytes.fromhex(sitting.app.clipboard)) == sum(len(sitting.bus.captured(row)) for row in range(3))
        await sitting.press("escape")
        assert not len(sitting.screen.selected())
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
            return (tmp_path / name).read_text().splitlines()

        await sitting.press("e")
        sitting.app.screen.query_one(Input).value = "frames.xyz"
        await sitting.press("enter")
        assert "formats are" in sitting.shown()
        await sitting.press("escape", "space", "down")
        assert len(await export("two.jsonl")) == 2
        await sitting.press("escape", "slash")
        sitting.screen.query_one(FilterBar).line.value = "unit == 2"
        await sitting.press("enter")
        lines = [json.loads(line) for line in await export("unit.jsonl")]
        assert {line["unit"] for line in lines} == {2} and len(lines) == sitting.screen.frames.count()

    using(opened(capture), work)


def test_views_of_conversations_findings_units_registers_timeline_and_report(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        screen = sitting.screen
        await sitting.press("2")
        kinds = [sitting.bus.table.value("kind", screen.talk.rows.row(i)) for i in range(screen.talk.count())]
        assert kinds.count(1) == 112
        await sitting.press("down", "c")
        await sitting.press("3")
        found = screen.query_one(FindingList)
        assert found.count() == sitting.bus.found.count > 0
        await sitting.press("s", "s")
        assert 0 < found.count() < sitting.bus.found.count
        await sitting.press("s", "o")
        assert (
            found.code == sorted(sitting.bus.found.by_code)[0]
            and found.count() == sitting.bus.found.by_code[found.code]
        )
        await sitting.press("O", "down", "down", "enter")
        assert screen.view == "frames" and sitting.bus.findings(sitting.row)
        await sitting.press("4")
        units = screen.query_one(UnitList)
        await sitting.until(lambda: units.count() > 0)
        assert [unit.unit for unit in units.report.units] == [1, 2, 9, 17]  # type: ignore[union-attr]
        await sitting.press("down", "enter")
        assert screen.query_one(FilterBar).text == "unit == 2" and screen.view == "frames"
        await sitting.press("escape", "5")
        registers = screen.query_one(RegisterList)
        assert registers.count() == len(sitting.bus.registers)
        await sitting.press("end")
        await sitting.until(lambda: "readings" in screen.query_one("#history", History).title)
        before = sitting.shown()
        await sitting.press("v")
        assert sitting.shown() != before and "s16" in sitting.shown()
        await sitting.press("enter")
        assert screen.view == "frames"
        await sitting.press("7")
        await sitting.until(lambda: "troubled.jsonl" in sitting.shown() and "response" in sitting.shown())

    using(opened(capture), work, size=(120, 40))


def test_the_timeline_zooms_and_chooses_a_span(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        await sitting.press("6")
        timeline = sitting.screen.query_one(Timeline)
        whole = timeline.t_end - timeline.t_start
        await sitting.press("right", "right", "plus", "plus")
        assert timeline.t_end - timeline.t_start < whole / 3
        await sitting.press("minus", "0")
        assert timeline.t_end - timeline.t_start == whole
        await sitting.press("home", "space", *["right"] * 8)
        assert "span" in sitting.shown()
        await sitting.press("enter")
        frames = sitting.screen.frames
        assert sitting.screen.view == "frames" and 0 < frames.count() < sitting.bus.count
        await sitting.press("escape")
        assert frames.count() == sitting.bus.count
        await sitting.press("6", "0", "end", "enter")
        assert sitting.row > sitting.bus.count // 2

    using(opened(capture), work)


def test_pasting_reads_what_parse_reads_and_remembers() -> None:
    async def work(sitting: Seat) -> None:
        text = sitting.screen.query_one(PasteText)
        assert text.has_focus
        text.load_text("11 03 00 6B 00 03 76 87\n11 03 06 AE 41 56 52 43 40 49 AD")
        await sitting.settle()
        pieces = sitting.screen.query_one(PieceList)
        assert pieces.count() == 2 and "read 3 holding registers from 107" in sitting.shown()
        await sitting.press("tab", "down")
        assert "40108: 44609" in sitting.shown()
        await sitting.press("tab", "end", "tab", "tab", "ctrl+l")
        assert pieces.count() == 0
        text.load_text("zz")
        await sitting.settle()
        assert "no hex bytes" in sitting.shown()
        text.load_text(":1103006B00037E")
        await sitting.settle()
        assert pieces.count() == 1
        await sitting.press("ctrl+up")
        assert text.text.startswith("11 03 00 6B")
        await sitting.press("ctrl+down")
        assert text.text == ":1103006B00037E"
        for digit in "12":
            await sitting.press(digit)
        assert text.text.endswith("12")

    using(Nothing(), work, view="paste")


def test_help_palette_themes_and_quit(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        await sitting.press("question_mark")
        assert isinstance(sitting.app.screen, Help) and "display filter" in sitting.shown()
        await sitting.press("down", "escape")
        dark = sitting.app.theme
        await sitting.press("d")
        assert sitting.app.theme != dark
        await sitting.press("ctrl+p")
        await sitting.type("View: Reg")
        await sitting.until(lambda: "View: Registers" in sitting.shown())
        await sitting.press("enter")
        await sitting.until(lambda: sitting.screen.view == "registers")
        await sitting.press("q")
        assert not sitting.app.is_running or sitting.app._exit

    using(opened(capture), work)


def test_the_mouse_chooses_rows_bytes_and_views(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        await sitting.pilot.click("#frames", offset=(10, 5))
        await sitting.settle()
        assert sitting.row == 4
        await sitting.pilot.click("#octets", offset=(9, 1))
        await sitting.settle()
        details = sitting.screen.query_one(Details)
        assert details.item is not None and details.item.label == "function"
        await sitting.pilot.click("#tabs", offset=(24, 0))
        await sitting.settle()
        assert sitting.screen.view != "frames"

    using(opened(capture), work)


class Live:
    """A tap that gives what it is told to."""

    name, timed, live, path = "/dev/ttyUSB0 [bold]", True, True, None
    line = LineSettings(baud=19200, char_bits=10)

    def __init__(self) -> None:
        from queue import Queue

        known = captures.open(samples.path("healthy.jsonl"))
        self.batches_of = list(CaptureSource(known, "").batches(lambda: False))
        self.queue: Queue[Batch | None] = Queue()

    def batches(self, stop: Callable[[], bool]) -> Iterator[Batch]:
        from queue import Empty

        while not stop():
            try:
                batch = self.queue.get(timeout=0.01)
            except Empty:
                yield Batch.empty()
                continue
            if batch is None:
                raise OSError("the adapter is gone: \x1b[31mreplug it")
            yield batch

    def notices(self) -> list[str]:
        return []

    def give(self, first: int, last: int) -> None:
        """Rows of the healthy sample."""
        whole = self.batches_of[0]
        rows = whole.rows[first:last]
        asked = {int(r["request"]): whole.request_of(first + i, int(r["request"])) or b"" for i, r in enumerate(rows)
                 if r["request"] >= 0}  # fmt: skip
        self.queue.put(Batch(rows, whole.data, asked))


def test_a_live_list_follows_until_the_user_looks_back() -> None:
    tap = Live()

    async def work(sitting: Seat) -> None:
        frames = sitting.screen.frames
        tap.give(0, 40)
        await sitting.until(lambda: frames.cursor == 39)
        tap.give(40, 60)
        await sitting.until(lambda: frames.cursor == 59)
        assert "following" in sitting.shown()
        await sitting.press("up")
        tap.give(60, 80)
        await sitting.until(lambda: frames.count() == 80)
        await sitting.pilot.pause(0.2)
        assert frames.cursor == 58 and "21 below" in sitting.shown()
        await sitting.press("F")
        assert frames.cursor == 79
        await sitting.press("slash")
        sitting.screen.query_one(FilterBar).line.value = "unit > 0"
        await sitting.pilot.press("enter")
        tap.give(80, 90)
        await sitting.until(lambda: frames.count() == 90)
        tap.queue.put(None)
        await sitting.until(lambda: sitting.bus.whole)
        await sitting.pilot.pause(0.1)
        assert any("the adapter is gone: \\x1b[31mreplug it" in notice for notice in sitting.notices())

    using(tap, work)


def test_hostile_text_is_shown_harmless() -> None:
    """A device that names itself in escape sequences and markup; a file name that does."""
    from dissectors.checks import crc_bytes

    said = b"\x1b[2J[red]x[/red]\x07\xc2\x9b31m"
    body = bytes((17, 0x2B, 0x0E, 1, 1, 0, 0, 1, 0, len(said))) + said
    request = bytes.fromhex("112b0e0100")
    chunks = [Chunk(10_000_000 * (i + 1), frame + crc_bytes(frame)) for i, frame in enumerate((request, body) * 3)]
    capture = Capture.of(LineSettings(baud=19200, char_bits=10, tap="[bold]tap\x1b]0;x\x07"), chunks)

    async def work(sitting: Seat) -> None:
        for view in "12345678":
            await sitting.press(view)
            shown = sitting.shown()
            assert "\x1b" not in shown and "\x07" not in shown and "\x9b" not in shown
        await sitting.press("ctrl+l", "escape", "1", "down")
        assert sitting.row == 1
        assert "\\x1b[2J[red]x[/red]" in sitting.shown()

    using(CaptureSource(capture, "[link=x]\x1b[31m.jsonl"), work, size=(160, 40))


def test_a_damaged_file_opens_with_what_is_whole(tmp_path: Path) -> None:
    path = tmp_path / "cut.jsonl"
    text = samples.path("healthy.jsonl").read_text()
    path.write_text(text[: len(text) // 2] + "\n[red]broken\n")

    async def work(sitting: Seat) -> None:
        assert sitting.bus.frames > 10
        assert any("line" in notice for notice in sitting.notices())

    using(opened(path), work)


def test_no_capture_no_times_and_no_frames() -> None:
    untimed = Capture.of(LineSettings(), [Chunk(0, bytes.fromhex("1103006b00037687"))] * 3, timed=False)

    async def look(sitting: Seat) -> None:
        for view in "12345678":
            await sitting.press(view)
            if view == "6":
                assert "no times" in sitting.shown()
        await sitting.press("ctrl+l", "escape", "1", "t", "r", "c", "right_square_bracket", "apostrophe", "n", "escape")
        assert sitting.bus.count == 3

    using(CaptureSource(untimed, "dump"), look)

    async def empty(sitting: Seat) -> None:
        for key in "1346":
            await sitting.press(key, "down", "enter", "m", "y", "e", "c", "space", "escape")
        assert sitting.bus.count == 0

    using(CaptureSource(Capture.of(LineSettings(), []), "empty"), empty)
