"""The views of the interface beside the list of frames, live lists, and captures out of the ordinary."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import takewhile
from pathlib import Path

import numpy as np
import pytest
from seats import Seat, opened, sample_in, using

import captures
from analyzer.core import Analysed, deframe
from analyzer.diagnosis.judge import Judge
from analyzer.model.rowstores import by_cause
from analyzer.model.source import CaptureSource, Nothing
from analyzer.options import Options
from analyzer.tables.batch import Batch
from analyzer.tui.details import Details
from analyzer.tui.filterbar import FilterBar
from analyzer.tui.findings import FindingList
from analyzer.tui.keys import Help
from analyzer.tui.pastepane import PasteText, PieceList
from analyzer.tui.plot import Plot
from analyzer.tui.registerlist import RegisterList
from analyzer.tui.timeline import Timeline
from analyzer.tui.unitlist import UnitList
from captures import samples
from captures.chunks import Capture, Chunk
from captures.line import LineSettings
from dissectors.crc import crc_bytes


@pytest.fixture
def capture(tmp_path: Path) -> Path:
    return sample_in(tmp_path)


def test_views_of_transactions_findings_units_registers_timeline_and_report(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        screen = sitting.screen
        await sitting.press("1")
        kinds = [
            sitting.bus.table.value("kind", screen.transactions.rows.row(i)) for i in range(screen.transactions.count())
        ]
        assert kinds.count(1) == 112
        await sitting.press("down", "c", "2")
        await sitting.press("3")
        found = screen.query_one(FindingList)
        await sitting.until(lambda: found.grouped)
        causes = [block for block in found._blocks if not block.code]
        assert len(causes) >= len(found.causes) > 0
        assert sum(len(block.numbers) for block in found._blocks) == sitting.bus.found.count
        await sitting.press("home", "down")
        assert found.cause is None and found.finding is not None
        closed = found.count()
        await sitting.press("right")
        assert found.count() > closed
        await sitting.press("left", "b")
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
        await sitting.press("9")
        units = screen.query_one(UnitList)
        await sitting.until(lambda: units.count() > 0)
        assert [unit.unit for unit in units.report.units] == [1, 2, 9, 17]  # type: ignore[union-attr]
        await sitting.press("down", "enter")
        assert screen.query_one(FilterBar).text == "unit == 2" and screen.view == "frames"
        await sitting.press("escape", "5")
        registers = screen.query_one(RegisterList)
        assert registers.count() == len(sitting.bus.registers)
        await sitting.press("end")
        await sitting.until(lambda: "readings" in screen.query_one(Plot).title)
        await sitting.press("home", "v")
        assert (
            registers.register is not None and registers.meaning(registers.owner(registers.register)).source == "yours"
        )
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
        await sitting.press("minus", "a")
        assert timeline.t_end - timeline.t_start == whole
        await sitting.press("home", "space", *["right"] * 8)
        assert "span" in sitting.shown()
        await sitting.press("enter")
        frames = sitting.screen.frames
        assert sitting.screen.view == "frames" and 0 < frames.count() < sitting.bus.count
        await sitting.press("escape")
        assert frames.count() == sitting.bus.count
        await sitting.press("6", "a", "end", "enter")
        assert sitting.row > sitting.bus.count // 2

    using(opened(capture), work)


def test_the_timeline_has_a_row_for_each_cause(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        await sitting.press("6")
        timeline, bus = sitting.screen.query_one(Timeline), sitting.bus
        causes = bus.causes()
        await sitting.until(lambda: any(band.cause is not None for band in timeline.bands))
        own = {band.cause: int(band.counts.sum()) for band in timeline.bands if band.cause is not None}
        numbers = np.arange(bus.found.count)
        for cause, by_code in by_cause(bus, numbers, causes):
            rows = {bus.found.row(i) for each in by_code.values() for i in each.tolist()} - {-1}
            if cause is not None:
                assert own.get(cause, 0) == len(rows)
        first = next(band for band in timeline.bands if band.cause == 0)
        await sitting.press("home", *["right"] * int(np.flatnonzero(first.counts)[0]))
        assert f"1 {causes[0].text[:30]}" in sitting.shown()

    using(opened(capture), work, size=(120, 40))


def test_esc_leaves_a_paste_however_often_it_is_pressed() -> None:
    async def work(sitting: Seat) -> None:
        text = sitting.screen.query_one(PasteText)
        await sitting.press("z")
        for _ in range(2):
            await sitting.press("escape")
            assert not text.has_focus
        await sitting.press("2")
        assert sitting.screen.view == "frames" and text.text == "z"

    using(Nothing(), work, view="paste")


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
        assert isinstance(sitting.app.screen, Help) and "filter by the value under the cursor" in sitting.shown()
        await sitting.press("down", "escape")
        dark = sitting.app.theme
        await sitting.press("D")
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
        await sitting.pilot.click("#tabs", offset=(44, 0))
        await sitting.settle()
        assert sitting.screen.view != "frames"
        await sitting.press("3")
        await sitting.pilot.click("#findings", offset=(12, 4), times=2)
        await sitting.until(lambda: sitting.screen.view == "frames")

    using(opened(capture), work)


class Live:
    """A tap that gives what it is told to."""

    name, timed, live, path = "/dev/ttyUSB0 [bold]", True, True, None
    line = LineSettings(baud=19200, char_bits=10)

    def __init__(self) -> None:
        from queue import Queue

        known = captures.open(samples.path("healthy.jsonl"))
        self.batches_of = list(deframe(known))
        self.queue: Queue[Batch | None] = Queue()
        self.judge = Judge(self.line, Options())

    def steps(self, stop: Callable[[], bool]) -> Iterator[Analysed]:
        from queue import Empty

        while not stop():
            try:
                batch = self.queue.get(timeout=0.01)
            except Empty:
                yield Analysed.nothing()
                continue
            if batch is None:
                raise OSError("the adapter is gone: \x1b[31mreplug it")
            yield Analysed(batch, *self.judge.feed(batch, 1 << 62))

    def notices(self) -> list[str]:
        return []

    def give(self, first: int, last: int) -> None:
        """Rows of the healthy sample."""
        whole = self.batches_of[0]
        rows = whole.rows[first:last]
        asked = {row.request: whole.request_of(first + i, row.request) or b"" for i, row in enumerate(rows)
                 if row.request >= 0}  # fmt: skip
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
        await sitting.until(lambda: "21 below" in sitting.shown())
        assert frames.cursor == 58
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


def test_findings_are_gone_to_however_many_there_are(capture: Path) -> None:
    class Wordy(CaptureSource):
        """Says everything fifty times."""

        def steps(self, stop: Callable[[], bool]) -> Iterator[Analysed]:
            for step in super().steps(stop):
                yield replace(step, findings=step.findings[np.repeat(np.arange(len(step.findings)), 50)])

    async def work(sitting: Seat) -> None:
        found = sitting.screen.query_one(FindingList)
        await sitting.press("end", "left_square_bracket", "3", "b")
        assert found.count() == sitting.bus.found.count > 4096
        assert found.row == sitting.row == max(sitting.bus.found.row(i) for i in range(found.count()))
        await sitting.press("2", "home", "3")
        assert found.row is not None and found.row < 20

    using(Wordy(captures.open(capture), "bus"), work)


def test_hostile_text_is_shown_harmless() -> None:
    """A device that names itself in escape sequences and markup; a file name that does."""
    from dissectors.crc import crc_bytes

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
        await sitting.press("ctrl+l", "escape", "2", "down")
        assert sitting.row == 1
        assert "\\x1b[2J[red]x[/red]" in sitting.shown()

    using(CaptureSource(capture, "[link=x]\x1b[31m.jsonl"), work, size=(160, 40))


def test_a_bad_file_of_notes_is_told_left_alone_and_stops_nothing(capture: Path) -> None:
    beside = capture.with_name(capture.name + ".rtuscope.json")
    beside.write_text("[" * 100_000)

    async def work(sitting: Seat) -> None:
        assert any("holds no notes of this program: left unchanged" in notice for notice in sitting.notices())
        await sitting.press("m", "down", "r", "apostrophe")
        assert sitting.row == 0

    using(opened(capture), work)
    assert beside.read_text(encoding="utf-8") == "[" * 100_000


def test_a_damaged_file_opens_with_what_is_whole(tmp_path: Path) -> None:
    path = tmp_path / "cut.jsonl"
    text = samples.path("healthy.jsonl").read_text(encoding="utf-8")
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
                assert "Zoom in" not in sitting.shown() and "Span" not in sitting.shown()  # keys that would do nothing
        await sitting.press("ctrl+l", "escape", "1", "t", "r", "c", "right_square_bracket", "apostrophe", "n", "escape")
        assert sitting.bus.count == 3
        await sitting.press("0")
        assert sitting.shown().count("no times in this capture") == 1

    using(CaptureSource(untimed, "dump"), look)

    async def empty(sitting: Seat) -> None:
        for key in "1346":
            await sitting.press(key, "down", "enter", "m", "y", "e", "c", "space", "escape")
        assert sitting.bus.count == 0
        await sitting.press("3")
        assert "nothing captured yet" in sitting.shown() and "all is well" not in sitting.shown()

    using(CaptureSource(Capture.of(LineSettings(), []), "empty"), empty)


def test_a_unit_s_answer_times_are_drawn_as_far_as_the_clock_carries_them(capture: Path) -> None:
    async def look(sitting: Seat) -> None:
        await sitting.press("9")
        units = sitting.screen.query_one(UnitList)
        for off_ns, most in ((0, "36ms"), (16_000_000, "≤52ms")):
            sitting.bus.off_ns = off_ns
            _, points, written = units.history()
            assert points and written(36e6) == most and written(0) == "0us"
        sitting.bus.off_ns = None
        assert units.history()[1] == []

    using(opened(capture), look)


def test_keys_pressed_while_it_starts_do_not_go_to_the_filter(capture: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    focused: list[str] = []
    monkeypatch.setattr(FilterBar, "on_descendant_focus", lambda _: focused.append("filter"))

    async def work(sitting: Seat) -> None:
        assert focused == []
        await sitting.press("/")
        assert focused == ["filter"]

    using(opened(capture), work)


def test_a_narrow_terminal_shows_what_frames_say(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        frames = sitting.screen.frames
        assert "gap" in "".join(piece.text for piece in frames.head(80))
        narrow = "".join(piece.text for piece in frames.head(40))
        assert "gap" not in narrow
        assert len(narrow) <= 36
        assert sum(len(piece.text) for piece in frames.pieces(0, 40)) <= 40

    using(opened(capture), work)


def test_forty_columns_show_list_fields_and_bytes(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        await sitting.press("down")
        for pane in (sitting.screen.frames, sitting.screen.detail.fields, sitting.screen.detail.octets):
            assert pane.region.width > 30 and pane.region.height > 3, pane
        assert "01 03 06 00 E6" in sitting.shown() and "function" in sitting.shown()
        for view in "0235":
            await sitting.press(view)
            assert max(len(line.rstrip()) for line in sitting.shown().splitlines()) <= 40

    using(opened(capture), work, size=(40, 24))


def test_the_report_is_no_wider_than_eighty_columns(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        await sitting.press("7")
        await sitting.until(lambda: "what is wrong" in sitting.shown() or "response" in sitting.shown())
        report = sitting.screen.query_one("#report")
        assert report.max_scroll_x == 0

    using(opened(capture), work, size=(80, 24))


def test_forty_columns_show_what_came_of_transactions_and_a_report_wrapped(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        await sitting.press("1", "home")
        assert "230" in sitting.shown().splitlines()[3]
        await sitting.press("7")
        await sitting.until(lambda: "what is wrong" in str(sitting.screen.query_one("#page").render()))
        page = str(sitting.screen.query_one("#page").render()).splitlines()
        told = list(takewhile(lambda line: not line.startswith("unit "), page))  # tables scroll
        assert len(told) > 20 and max(map(len, told)) <= 40
        await sitting.press("9")
        await sitting.until(lambda: "100%" in sitting.shown())
        head = sitting.screen.query_one(UnitList).columns(40)
        assert {"unit", "err", "p95", "max"} <= set(head) and sum(head.values()) <= 40

    using(opened(capture), work, size=(40, 24))


def test_forty_columns_show_the_values_of_registers(capture: Path) -> None:
    async def work(sitting: Seat) -> None:
        await sitting.press("5")
        await sitting.settle()
        head, first = sitting.shown().splitlines()[2:4]
        assert "value" in head and "40002" in first and "564" in first

    using(opened(capture), work, size=(40, 24))


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ("43 66 40 00", ["f32 ABCD 230.25", "f32 CDAB 2.004114"]),
        ("40 00 43 66 00 00 42 48", ["f32 CDAB 230.25 50"]),
        ("00 E6 02 A2", []),
        ("7F 7F 7F 7F", []),
        ("00 00 00 00", []),
    ],
)
def test_a_lone_paste_shows_its_floats_at_once_at_80_columns(values: str, told: list[str]) -> None:
    body = bytes.fromhex(f"01 03 {len(values.split()):02x} {values}")

    async def work(sitting: Seat) -> None:
        await sitting.type((body + crc_bytes(body)).hex())
        await sitting.until(lambda: "registers" in sitting.shown())
        lines = [" ".join(line[:40].split()) for line in sitting.shown().splitlines() if "f32" in line]
        assert lines == told

    using(Nothing(), work, view="paste", size=(80, 24))
