"""`replay`: a capture again, in its own time or faster, into the view or onto a port; what the view lets through."""

import json
import os
import select
import signal
import struct
import subprocess
import sys
import threading
import time

import pytest
from buses import LINE, adu, spaced
from livebus import eventually, pty
from running import PATIENCE_S, START, environment, ran, refused

import captures
from analyzer.core import Analyzer
from analyzer.live.conditions import TriggerWindow
from analyzer.live.lines import Recent
from analyzer.live.replaying import Replay
from analyzer.live.session import SessionStep
from captures import samples
from captures.chunks import Block, Capture, Chunk
from captures.live.wire import Tick

HEALTHY, TROUBLED = samples.path("healthy.jsonl"), samples.path("troubled.jsonl")
if os.name == "posix":
    import fcntl
    import termios

posix = pytest.mark.skipif(os.name != "posix", reason="pseudo-terminals are POSIX")


def test_a_replay_shows_the_frames_of_an_export(capsys):
    shown = [json.loads(line) for line in ran(capsys, "replay", TROUBLED, "--speed", "max", "--json").out.splitlines()]
    exported = [json.loads(line) for line in ran(capsys, "export", TROUBLED).out.splitlines()]
    frames = [line for line in shown if "direction" in line]
    keys = ("index", "start", "hex", "direction", "request_start", "t_start_ns", "response_time_ns", "fields")
    assert [[line[key] for key in keys] for line in frames] == [[line[key] for key in keys] for line in exported]
    said = {(f["code"], line["start"]) for line in frames for f in line["findings"]}
    late = [line for line in shown if line.get("kind") == "finding" and line["index"] is not None]
    said |= {(line["code"], line["start"]) for line in late}
    assert said == {(f["code"], line["start"]) for line in exported for f in line["findings"]}


def test_what_a_silence_brings_to_light_is_said_of_the_row_that_it_concerns(capsys):
    """A step may bring findings and no row; each is told, whatever comes when."""
    capture = captures.open(TROUBLED)
    analyzer, recent = Analyzer(capture.line), Recent()
    told: set[tuple[str, int]] = set()
    alone = 0

    def tell(t_ns: int) -> None:
        nonlocal alone
        step = SessionStep(t_ns, analyzer.latest)
        alone += not len(step.batch) and len(step.findings) > 0
        for shown in recent.feed(step):
            start = int(shown.batch.rows.start[shown.row])
            told.update((finding.code, start) for finding in shown.findings)

    for chunk in capture.chunks():
        analyzer.feed(Block.from_chunks([chunk]))
        tell(chunk.t_ns)
        analyzer.tick(chunk.t_ns + 1_000_000)
        tell(chunk.t_ns)
    analyzer.close()
    tell(0)
    exported = [json.loads(line) for line in ran(capsys, "export", TROUBLED, "--noise").out.splitlines()]
    assert alone > 0
    assert told == {(f["code"], line["start"]) for line in exported for f in line["findings"]}


def test_a_line_a_frame_with_what_was_found_below_it(capsys):
    lines = ran(capsys, "replay", TROUBLED, "--speed", "max").out.splitlines()
    refused = next(i for i, line in enumerate(lines) if "exception 02 illegal data address" in line)
    assert lines[refused + 1].strip().startswith("? exception: unit 2 refuses")
    assert any("outside frames: 00" in line for line in lines)
    assert any("WRONG CHECK VALUE" in line for line in lines)


def played(capture, speed, act=lambda _: None):
    """What a replay gives, each with the seconds after its begin."""
    replay = Replay(capture, speed)
    begun, given = time.monotonic(), []
    threading.Thread(target=act, args=(replay,)).start()
    for item in replay.items():
        given.append((time.monotonic() - begun, item))
    return given


def apart(gap_ns, count=4):
    return Capture.of(LINE, [Chunk(10**9 + n * gap_ns, bytes([n])) for n in range(count)])


def test_reads_come_when_their_time_has_come():
    for speed in (1.0, 4.0):
        given = [at for at, item in played(apart(200_000_000), speed) if isinstance(item, Block)]
        for number, at in enumerate(given):
            assert at >= number * 0.2 / speed - 0.005
    (at, hours), _ = played(apart(3600 * 10**9), None)
    assert len(hours) == 4
    assert at < 3600


def test_silences_are_told_as_a_tap_tells_them():
    items = [item for _, item in played(apart(200_000_000, 2), 8.0)]
    assert [type(item) for item in items] == [Block, Tick, Tick, Block, Tick]
    assert 8_000_000 <= items[1].t_ns - 10**9 < 200_000_000


def test_a_paused_replay_stands_still_and_steps_read_by_read():
    seen = []

    def act(replay):
        replay.pause()
        time.sleep(0.3)
        seen.append("paused")
        replay.step()
        time.sleep(0.1)
        replay.set_speed(None)
        replay.pause()

    given = played(apart(10_000_000_000, 3), 1.0, act)
    blocks = [(at, item.data.tobytes()) for at, item in given if isinstance(item, Block)]
    assert [data for _, data in blocks] == [b"\0", b"\1", b"\2"]
    assert blocks[1][0] >= 0.3
    assert blocks[2][0] >= 0.4


@posix
def test_a_capture_is_played_onto_a_port_with_its_gaps(capsys, tmp_path):
    master, name = pty()
    path = tmp_path / "bus.jsonl"
    frames = [adu("1103006b0003"), bytes.fromhex("110306ae415652434049ad")] * 2
    captures.write(path, spaced(frames, gap_ns=60_000_000), line=LINE)
    heard: list[tuple[float, bytes]] = []

    def listen():
        while sum(len(data) for _, data in heard) < sum(map(len, frames)):
            if not select.select([master], [], [], 5)[0]:
                return
            heard.append((time.monotonic(), os.read(master, 4096)))

    listener = threading.Thread(target=listen)
    listener.start()
    begun = time.monotonic()
    done = ran(capsys, "replay", path, "--to", name)
    listener.join()
    assert done.status == 0
    assert "transmitting" in done.err
    assert [data for _, data in heard] == frames
    for (at, _), number in zip(heard, range(4), strict=True):
        assert at >= begun + number * 0.06  # late on a busy machine, never early
    heard.clear()
    assert ran(capsys, "replay", path, "--to", name, "--only", "requests", "--speed", "max").status == 0
    while select.select([master], [], [], 0.1)[0]:
        heard.append((0, os.read(master, 4096)))
    assert b"".join(data for _, data in heard) == frames[0] * 2


@posix
def test_a_port_that_goes_away_is_told_in_one_line(capsys, tmp_path):
    master, name = pty()
    path = tmp_path / "bus.jsonl"
    captures.write(path, spaced([adu("1103006b0003")] * 4, gap_ns=100_000_000), line=LINE)

    def listen():
        os.read(master, 4096)
        os.close(master)

    listener = threading.Thread(target=listen)
    listener.start()
    done = ran(capsys, "replay", path, "--to", name)
    listener.join()
    assert done.status == 2
    assert done.err.endswith("bytes: closed by the other end, or unplugged\n")


def test_a_filter_shows_only_what_passes(capsys):
    lines = ran(capsys, "replay", TROUBLED, "--speed", "max", "--json", "--filter", "unit == 17").out.splitlines()
    frames = [json.loads(line) for line in lines]
    assert {line["unit"] for line in frames if "direction" in line} == {17}
    assert len(frames) > 30


def test_it_stops_at_a_frame_that_passes_and_shows_that_one(capsys):
    lines = ran(capsys, "replay", TROUBLED, "--speed", "max", "--json", "--until", "exception").out.splitlines()
    frames = [json.loads(line) for line in lines if "direction" in line]
    assert frames[-1]["exception"] is not None
    assert all(line["exception"] is None for line in frames[:-1])


def test_it_stops_at_a_finding_that_comes_after_its_frame(capsys):
    until = 'finding == "no-response"'
    lines = ran(capsys, "replay", TROUBLED, "--speed", "max", "--until", until).out.splitlines()
    assert sum("no-response" in line for line in lines) == 1
    assert any("no-response" in line for line in lines[-4:])


def test_a_trigger_shows_what_was_around_it(capsys):
    around = ["--trigger", "exception", "--before", "30ms", "--after", "20ms"]
    lines = ran(capsys, "replay", TROUBLED, "--speed", "max", "--json", *around).out.splitlines()
    frames = [json.loads(line) for line in lines if "direction" in line]
    triggers = [line["t_end_ns"] for line in frames if line["exception"] is not None]
    assert len(triggers) == 8
    for line in frames:
        assert any(at - 30_000_000 <= line["t_end_ns"] <= at + 20_000_000 for at in triggers)
    assert 8 < len(frames) < 60


def test_a_filter_that_is_none_is_refused_in_one_line(capsys):
    assert "unit" in refused(capsys, "replay", HEALTHY, "--filter", "unti == 17")


def test_a_window_keeps_so_much_before_and_after_each_trigger():
    window, out = TriggerWindow[int](3, 2), list[int]()
    for t in range(20):
        if t in (6, 7, 15):
            out += window.fire(t)
        out += window.offer(t, t)
    assert out == [3, 4, 5, 6, 7, 8, 9, 12, 13, 14, 15, 16, 17]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--speed", "0"], "neither max nor a number"),
        (["--only", "requests"], "--only works with --to"),
        (["--to", "/dev/no-such-port"], "/dev/no-such-port: no such port; `rtuscope ports` lists"),
    ],
)
def test_arguments_that_cannot_be_used_are_refused(capsys, arguments, words):
    done = ran(capsys, "replay", HEALTHY, *arguments)
    assert done.status == 2
    assert words in done.err.splitlines()[-1]
    assert "transmitting" not in done.err


class Terminal:
    """A command on a terminal of its own, 100 columns wide."""

    def __init__(self, *arguments):
        self._master, slave = os.openpty()
        fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 100, 0, 0))
        command = [sys.executable, "-c", START, *map(str, arguments)]
        self.process = subprocess.Popen(
            command, stdin=slave, stdout=slave, stderr=slave, env=environment(TERM="xterm"), start_new_session=True
        )
        os.close(slave)
        self.screen = ""

    def press(self, keys):
        os.write(self._master, keys.encode())

    def shows(self, words):
        """Whether these words come up soon."""
        return eventually(lambda: self._look() and words in self.screen)

    def ended(self):
        """Status, once it is over."""
        while self._look():
            pass
        os.close(self._master)
        return self.process.wait(PATIENCE_S)

    def _look(self):
        try:
            ready = select.select([self._master], [], [], 5)[0]
            self.screen += os.read(self._master, 65536).decode() if ready else ""
        except OSError:  # the last one who had it open is gone
            return False
        return True


@posix
def test_on_a_terminal_keys_pause_step_and_end_a_replay_and_a_status_line_stands_below():
    terminal = Terminal("replay", HEALTHY, "--speed", "0.01")
    assert terminal.shows("frames/s")
    assert terminal.shows("x0.01")
    terminal.press("+")
    assert terminal.shows("x0.02")
    terminal.press(" ")
    assert terminal.shows("PAUSED")
    terminal.press("...")
    assert terminal.shows("read 3 holding registers from 107")
    terminal.press("q")
    assert terminal.ended() == 0
    assert all(len(line) < 100 + 40 for line in terminal.screen.replace("\r", "\n").split("\n"))  # with colours


@posix
def test_ctrl_c_on_a_terminal_ends_a_sniff_in_order(tmp_path):
    master, name = pty()
    terminal = Terminal("sniff", name, "--baud", "19200", "-o", tmp_path / "bus.mcap")
    assert terminal.shows("listening")
    os.write(master, adu("1103006b0003"))
    assert terminal.shows("read 3 holding registers")
    terminal.process.send_signal(signal.SIGINT)
    assert terminal.ended() == 0
    assert "Traceback" not in terminal.screen
    assert "REC 8 B" in terminal.screen
    assert not captures.open(tmp_path / "bus.mcap").damage


def test_seconds_count_from_the_first_row_of_all_whatever_is_left_out(capsys: pytest.CaptureFixture[str]) -> None:
    fields = ("--speed", "max", "--fields", "index,seconds")
    every = ran(capsys, "replay", TROUBLED, *fields).out.splitlines()
    assert ran(capsys, "replay", TROUBLED, *fields, "--filter", "index in (7, 40)").out.splitlines() == [
        line for line in every if line.split("\t")[0] in ("7", "40")
    ]
