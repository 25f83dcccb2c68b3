"""A live view: few bytes a second, a line that says how things are, and a recording that does not end unasked."""

from __future__ import annotations

import asyncio
import os
import re
import signal
import time
from collections import deque
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from seats import Seat, sample_in, using
from terminals import Terminal, posix

from analyzer.core import Analysed
from analyzer.model.source import CaptureSource
from analyzer.outages import Deaf
from analyzer.simulation import Scenario, simulate
from analyzer.tui.live import LiveSource
from analyzer.tui.openfiles import NextFile
from captures.chunks import Capture
from captures.line import LineSettings
from dissectors.crc import crc_bytes


class Recorder:
    """As far as the interface looks at one."""

    bytes, lost, paused = 1_234_567, 0, False
    path = Path("bus.mcap")


class Quiet(LiveSource):
    """A tap on which nothing comes until it is asked to end."""

    def __init__(self, recording: Recorder | None) -> None:
        from analyzer.live.status import LineStatus

        self.name, self.recording = "/dev/ttyUSB0", recording
        self._notices, self._missed, self._gone = [], 0, set()
        self._status = LineStatus(self.line)
        self._fired = deque()

    line = LineSettings(baud=19200, char_bits=10)
    over = False

    def steps(self, stop: Callable[[], bool]) -> Iterator[Analysed]:

        try:
            while not stop():
                time.sleep(0.02)
                yield Analysed.nothing()
        finally:
            self.over = True


def test_a_recording_is_in_sight_and_does_not_end_unasked() -> None:
    recorder, ended = Recorder(), list[bool]()
    source = Quiet(recorder)

    async def work(sitting: Seat) -> None:
        sitting.app.exit = lambda *_: ended.append(True)  # type: ignore[method-assign]
        await sitting.until(lambda: bool(re.search(r"[-|/\\] REC bus.mcap 1.2 MB", sitting.shown())))
        await sitting.pilot.press("q")
        await sitting.until(lambda: "would end" in sitting.shown())
        await sitting.pilot.press("escape")
        await asyncio.sleep(0.1)
        await sitting.pilot.press("q")
        await sitting.until(lambda: "would end" in sitting.shown())
        await sitting.pilot.press("enter")  # the first choice is to stay
        await asyncio.sleep(0.1)
        assert not ended
        recorder.lost = 77
        source._gone.add(0)
        await sitting.until(lambda: "LOST 77 bytes" in sitting.shown() and "UNPLUGGED" in sitting.shown())
        assert "listening" not in sitting.shown() and not re.search(r"[-|/\\] REC", sitting.shown()), "nothing turns"
        await sitting.pilot.press("q")
        await sitting.until(lambda: "would end" in sitting.shown())
        await sitting.pilot.press("q")
        await sitting.until(lambda: bool(ended))

    using(source, work, size=(120, 24))


@pytest.mark.parametrize("door", ["q", "й", "ctrl+q", "palette", "open", "ctrl+q over a question", "twice"])
def test_no_door_ends_a_recording_unasked(door: str, tmp_path: Path) -> None:
    ended = list[bool]()
    other = sample_in(tmp_path)

    async def work(sitting: Seat) -> None:
        app = sitting.app
        app.exit = lambda *_, **__: ended.append(True)  # type: ignore[method-assign]
        await sitting.until(lambda: "REC" in sitting.shown())
        match door:
            case "palette":
                quits = [each.callback for each in app.get_system_commands(sitting.screen) if each.title == "Quit"]
                assert len(quits) == 1
                quits[0]()
            case "open":
                app.leave(NextFile(other))
            case "ctrl+q over a question":
                await sitting.pilot.press("slash", "escape", "ctrl+p")
                await sitting.pilot.press("ctrl+q")
            case "twice":
                await sitting.pilot.press("ctrl+q", "ctrl+q", "ctrl+q")
            case _:
                await sitting.pilot.press(door)
        await sitting.until(lambda: "would end" in sitting.shown())
        await sitting.pilot.press("escape")
        await sitting.until(lambda: "would end" not in sitting.shown())
        assert not ended
        assert app.desk.source is source
        if door == "open":
            app.leave(NextFile(other))
            await sitting.until(lambda: "would end" in sitting.shown())
            await sitting.pilot.press("q")
            await sitting.until(lambda: app.desk.source.path == other and app.desk.bus.whole)
            await sitting.until(lambda: source.over)  # the session of before has ended
            return
        await sitting.pilot.press("ctrl+q")
        await sitting.until(lambda: "would end" in sitting.shown())
        await sitting.pilot.press("q")
        await sitting.until(lambda: bool(ended))

    source = Quiet(Recorder())
    using(source, work, size=(120, 24))


def test_without_a_recording_it_is_said_and_left_at_once() -> None:
    ended: list[bool] = []

    async def work(sitting: Seat) -> None:
        sitting.app.exit = lambda *_: ended.append(True)  # type: ignore[method-assign]
        await sitting.until(lambda: "not recorded" in sitting.shown())
        await sitting.pilot.press("й")  # q of the Cyrillic layout
        await sitting.until(lambda: bool(ended))

    using(Quiet(None), work, size=(120, 24))


class Away(CaptureSource):
    """A tap at a sound bus whose port goes, and comes back."""

    live = True
    outages: tuple[Deaf, ...] = ()

    def __init__(self) -> None:
        made = simulate(Scenario("clean", "precise", transactions=40, seed=3))
        super().__init__(Capture.of(made.line, made.chunks, timed=True), "/dev/ttyUSB0")

    @property
    def deaf(self) -> tuple[Deaf, ...]:
        return self.outages

    def steps(self, stop: Callable[[], bool]) -> Iterator[Analysed]:
        yield from super().steps(stop)
        while not stop():
            time.sleep(0.02)
            yield Analysed.nothing()


@pytest.mark.parametrize(
    ("language", "well", "away", "back", "more"),
    [
        ("en", "No problems so far", "Nothing heard since 2026-11-30 12:00:00 UTC: A: lost",
         "Nothing heard for 10 s from 2026", "1 more such time"),
        ("ru", "Пока всё в порядке", "Ничего не слышно с 2026-11-30 12:00:00 UTC: A: lost",
         "Ничего не слышно 10 с, с 2026", "1 такой случай"),
    ],
)  # fmt: skip
def test_home_says_while_nothing_is_heard_and_behind_it_that_nothing_was(
    language: str, well: str, away: str, back: str, more: str
) -> None:
    from analyzer.languages import use_language

    source, begun = Away(), 1_796_040_000_000_000_000

    async def work(sitting: Seat) -> None:
        await sitting.until(lambda: well in sitting.shown())
        source.outages = (Deaf(begun, None, "A: lost"),)
        await sitting.until(lambda: away in sitting.shown())
        assert well not in sitting.shown()
        source.outages = (Deaf(begun, begun + 10_000_000_000, "A: lost"),)
        await sitting.until(lambda: back in sitting.shown())
        source.outages = (*source.outages, Deaf(begun + 20_000_000_000, None, "A: lost"))
        await sitting.until(lambda: more in sitting.shown())
        assert well not in sitting.shown()

    use_language(language)
    try:
        using(source, work, size=(120, 24), view="home")
    finally:
        use_language("en")


@posix
@pytest.mark.parametrize("view", ["1", "6"])
def test_a_second_of_a_live_view_costs_little(view: str, tmp_path: Path) -> None:

    from emulator import Watched

    import captures

    made = simulate(Scenario("noisy", "precise", transactions=600, seed=3))
    captures.write(tmp_path / "bus.jsonl", Capture.of(made.line, made.chunks))
    with Watched("replay", "bus.jsonl", "--tui", cwd=tmp_path) as terminal:
        terminal.until("frames/s")
        terminal.press(view, 0.1)
        rates, moved = list[float](), False
        while len(rates) < 5 and not (moved and 50 < min(rates) < 10_000):  # a machine that lags catches up in bursts
            terminal.settle(5, most=2.5)
            before, terminal.count = terminal.shown(), 0
            begun = time.monotonic()
            terminal.settle(5, most=4.0)
            rates.append(terminal.count / (time.monotonic() - begun))
            moved = moved or terminal.shown() != before
        assert moved, "it goes on"
        assert 50 < min(rates) < 10_000, rates


def say(line: int, units: range) -> None:
    """A request to each of these units, into the line."""
    for unit in units:
        asked = bytes([unit, 3, 0, 0, 0, 1])
        os.write(line, asked + crc_bytes(asked))
        time.sleep(0.03)


@posix
def test_a_list_goes_on_following_after_a_look_at_other_views_and_says_so_at_80_columns(tmp_path: Path) -> None:
    from emulator import Watched
    from livebus import pty

    line, name = pty()
    with Watched("sniff", name, "--baud", "19200", "--tui", "-o", "bus.mcap", cwd=tmp_path) as terminal:
        terminal.until("REC bus.mcap").until("following").press("1")
        say(line, range(1, 31))
        terminal.until("30   3 ")
        terminal.press("605321")
        say(line, range(31, 61))
        terminal.until("60   3 ").until("following")
        terminal.press("\x1b[A").until(lambda: "below (F follows)" in terminal.shown())
        terminal.press("F2").until(lambda: "following" in terminal.shown())
        say(line, range(61, 71))
        terminal.until(" 70   3 ")


@posix
def test_a_live_line_is_read_by_a_map(tmp_path: Path) -> None:
    from emulator import Watched
    from livebus import pty

    line, name = pty()
    tmp_path.joinpath("map.csv").write_text("address,name,type\n40001,Flow setpoint,u16\n", "utf-8")
    with Watched("sniff", name, "--baud", "19200", "--tui", "--map", "map.csv", cwd=tmp_path, columns=120) as terminal:
        terminal.until("following").press("1")
        for body in (bytes([7, 3, 0, 0, 0, 1]), bytes([7, 3, 2, 1, 44])):
            os.write(line, body + crc_bytes(body))
            time.sleep(0.05)
        terminal.until("7   3 ")
        terminal.press("5").until("Flow setpoint")


@posix
def test_marks_and_a_pause_typed_fast_on_a_live_line(tmp_path: Path) -> None:
    from emulator import Watched
    from livebus import pty

    import captures

    line, name = pty()

    def listed() -> list[str]:
        lines = terminal.picture.lines()
        return [each for each in lines if "read 1 holding register" in each and "request" not in each]

    with Watched("sniff", name, "--baud", "19200", "--tui", "-o", "bus.mcap", cwd=tmp_path, columns=120) as terminal:
        terminal.until("REC bus.mcap")
        say(line, range(1, 9))
        terminal.until("8 frames")
        terminal.press("Mpump on\rMpump off\r2\x1b[H\x1b[B\x1b[BmP").until("PAUSED").until('"pump off"')
        held = listed()
        assert len(held) == 8, terminal.shown()  # the notices of it all leave the list in sight
        say(line, range(9, 13))
        terminal.until("12 frames")
        assert listed() == held
        terminal.press("PPP").until(lambda: "PAUSED" not in terminal.shown())
        terminal.press("Mvalve\r\x1b[F").until('"valve"')
        terminal.press("qq").until(lambda: (tmp_path / "bus.mcap").exists())
    notes = [note.text for note in captures.open(tmp_path / "bus.mcap").notes() if note.kind == "mark"]
    assert notes == ["pump on", "pump off", "valve"]


@posix
@pytest.mark.parametrize("octets", [b"\xff", b"\xf4\xfb", b"\x1b[200~\x01\x02\xff\xfeabc\x1b[201~"])
def test_bytes_that_are_no_utf8_end_neither_the_interface_nor_a_recording(octets: bytes, tmp_path: Path) -> None:
    from emulator import Watched
    from livebus import pty

    line, name = pty()
    with Watched("sniff", name, "--baud", "19200", "--tui", "-o", "bus.mcap", cwd=tmp_path) as terminal:
        terminal.until("REC bus.mcap").press("1")
        terminal.press(octets).press("8").press(octets).press("\x1b[17~").press("1")  # in a list, and among typed bytes
        say(line, range(1, 9))
        terminal.until("8 frames")


_BREAKS = """
import sys

if "--tui" in sys.orig_argv:  # not the process that reads the port
    from analyzer.tui.app import Rtuscope

    def broken(self):
        raise LookupError("on purpose")

    Rtuscope.action_theme_flip = broken
"""


@posix
@pytest.mark.parametrize("record", [(), ("-o", "bus.mcap")])
def test_a_defect_that_ends_the_interface_is_a_failure_and_tells_what_was_recorded(
    record: tuple[str, ...], tmp_path: Path
) -> None:
    from emulator import Watched
    from livebus import pty
    from running import ROOT

    import captures

    line, name = pty()
    tmp_path.joinpath("sitecustomize.py").write_text(_BREAKS, "utf-8")
    paths = f"{tmp_path}{os.pathsep}{ROOT}"
    arguments = "sniff", name, "--baud", "19200", "--tui", *record
    with Watched(*arguments, cwd=tmp_path, PYTHONPATH=paths, columns=200) as terminal:
        terminal.until("following").press("1")
        say(line, range(1, 9))
        terminal.until("8 frames").press("D")
        assert terminal.status() == 2
        assert "rtuscope: the interface failed, as told above" in terminal.shown()
        assert ("the recording ended with it: recorded 64 bytes of the line" in terminal.shown()) == bool(record)
    if record:
        assert len(b"".join(chunk.data for chunk in captures.open(tmp_path / "bus.mcap").chunks())) == 64


@posix
@pytest.mark.parametrize("way", ["SIGTERM", "SIGHUP", "closed"])
def test_who_ends_the_process_has_a_whole_recording_and_the_terminal_back(tmp_path: Path, way: str) -> None:
    import captures

    master, slave = os.openpty()
    bus, path = os.ttyname(slave), tmp_path / "bus.mcap"
    terminal = Terminal("sniff", bus, "-b", "9600", "-o", str(path), "--tui")
    try:
        terminal.until(b"REC")
        request = bytes.fromhex("0103006b0002")
        for _ in range(4):
            os.write(master, request + crc_bytes(request))
            terminal.press("")
        if way == "closed":
            os.close(terminal.fd)
            _, status = os.waitpid(terminal.pid, 0)
            assert os.waitstatus_to_exitcode(status) == 0
        else:
            os.kill(terminal.pid, getattr(signal, way))
            assert terminal.status() == 0
            assert terminal.seen.rfind(b"\x1b[?1049l") > terminal.seen.rfind(b"\x1b[?1049h")
    finally:
        os.close(master)
        os.close(slave)
    assert [each.name for each in tmp_path.iterdir()] == ["bus.mcap"]
    assert b"".join(bytes(block.data) for block in captures.open(path).blocks(1 << 16)) == 4 * (
        request + crc_bytes(request)
    )
