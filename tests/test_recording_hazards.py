"""What a recorder meets besides bytes: files in its way or taken away, disks that fail, clocks that are set."""

import errno
import os
import random
import shutil
import signal
import subprocess
import sys
import threading
import time
import tracemalloc
from types import SimpleNamespace

import pytest
from livebus import raw_pty
from running import PATIENCE_S, START, environment

import captures
from captures.chunks import Block, Chunk
from captures.disposal import move_to_free_name
from captures.formats.mcap import writer
from captures.line import LineSettings
from captures.recording import mcapfile
from captures.recording import recorder as recorder_module
from captures.recording import ring as ring_module
from captures.recording.mcapfile import PART, repair
from captures.recording.notes import Note, read
from captures.recording.recorder import Recorder
from captures.recording.ring import Ring, RingLimits

LINE = LineSettings(baud=19200, char_bits=11, parity="E", stop_bits=1, tap="usb")
posix = pytest.mark.skipif(os.name != "posix", reason="needs POSIX")
DAY = 86_400


@pytest.fixture(autouse=True)
def prompt(monkeypatch):
    """Commit at each tick, and wait for no disk."""
    monkeypatch.setattr(recorder_module, "_PERIOD_S", 0.0)
    monkeypatch.setattr(os, "fsync", lambda _: None)


def block(number, size=100):
    return Block.from_chunks([Chunk(10**18 + number * 10**7, bytes([number & 0xFF]) * size)])


def noise(number, size=300):
    return Block.from_chunks([Chunk(10**18 + number * 10**6, random.Random(number).randbytes(size))])


def held(path):
    return b"".join(part.data.tobytes() for part in captures.open(path).blocks())


def names(folder):
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize("content", [b"", b"x" * 5000, b"\x89MCAP0\r\n", bytes(4096)])
@pytest.mark.parametrize("limits", [RingLimits(), RingLimits(size=10**6)])
def test_an_unreadable_file_in_the_way_is_set_aside_and_recording_begins(tmp_path, content, limits):
    name = "bus.mcap.part" if not limits.rotates else "bus-20261121T104500.123Z.mcap.part"
    (tmp_path / name).write_bytes(content)
    for attempt in (1, 2):
        said: list[str] = []
        recorder = Recorder(tmp_path / "bus.mcap", LINE, limits=limits, overwrite=True, tell=said.append)
        recorder.write(block(attempt))
        recorder.close()
        assert len(said) == (attempt == 1)
        assert all("set aside as" in text for text in said)
        assert (tmp_path / f"{name}.1").read_bytes() == content
        newest = max(tmp_path.glob("*.mcap"), key=lambda path: path.stat().st_mtime_ns)
        assert held(newest) == block(attempt).data.tobytes()
    (tmp_path / name).write_bytes(content)
    Recorder(tmp_path / "bus.mcap", LINE, limits=limits, overwrite=True, tell=said.append).close()
    assert (tmp_path / f"{name}.2").read_bytes() == content


def test_a_recorder_that_was_killed_before_it_heard_anything_leaves_nothing(tmp_path):
    killed = Recorder(tmp_path / "bus.mcap", LINE)
    copy = (tmp_path / "bus.mcap.part").read_bytes()
    killed.close()
    (tmp_path / "bus.mcap.part").write_bytes(copy)
    Recorder(tmp_path / "bus.mcap", LINE, tell=pytest.fail).close()
    assert names(tmp_path) == []


@posix
@pytest.mark.parametrize("limits", [RingLimits(), RingLimits(every_s=0.05), RingLimits(size=1)])
@pytest.mark.parametrize("folder_too", [False, True])
def test_a_file_that_is_taken_away_is_followed_by_another(tmp_path, limits, folder_too):
    folder = tmp_path / "recordings"
    folder.mkdir()
    said: list[str] = []
    recorder = Recorder(folder / "bus.mcap", LINE, limits=limits, tell=said.append)
    recorder.write(block(1))
    recorder.tick()
    shutil.rmtree(folder)
    if not folder_too:
        folder.mkdir()
    other = os.open(tmp_path, os.O_RDONLY)  # what a descriptor closed twice would hit
    time.sleep(0.06)
    for number in (2, 3):
        recorder.write(block(number))
        recorder.tick()
    recorder.close()
    os.close(other)
    kept = b"".join(map(held, sorted(folder.glob("*.mcap"))))
    assert kept == block(2).data.tobytes() + block(3).data.tobytes() or kept == block(3).data.tobytes()
    assert not list(folder.glob(f"*{PART}"))
    if not limits.rotates:
        assert len(said) == 1
        assert "taken away, and 100 bytes of the line with it; recording goes on in a new file" in said[0]
        assert recorder.result == "recorded 200 bytes of the line, 100 deleted by someone"


@posix
def test_a_file_that_is_moved_is_finished_where_it_is(tmp_path):
    said: list[str] = []
    recorder = Recorder(tmp_path / "bus.mcap", LINE, tell=said.append)
    recorder.write(block(1))
    recorder.tick()
    (tmp_path / "bus.mcap.part").rename(tmp_path / "elsewhere.mcap")
    recorder.write(block(2))
    recorder.tick()
    recorder.close()
    (new,) = tmp_path.glob("bus-*.mcap")
    assert held(tmp_path / "elsewhere.mcap") + held(new) == block(1).data.tobytes() + block(2).data.tobytes()
    assert not captures.open(tmp_path / "elsewhere.mcap").damage
    assert "it is finished where it is" in said[0]
    assert recorder.bytes == 200


@pytest.mark.parametrize("overwrite", [False, True])
def test_a_file_that_appears_under_the_final_name_is_never_overwritten(tmp_path, overwrite):
    path = tmp_path / "bus.mcap"
    if overwrite:
        path.write_bytes(b"yesterday's, to be replaced")
    said: list[str] = []
    recorder = Recorder(path, LINE, overwrite=overwrite, tell=said.append)
    recorder.write(block(1))
    recorder.tick()
    path.write_bytes(b"precious")
    recorder.close()
    assert path.read_bytes() == b"precious"
    (new,) = tmp_path.glob("bus-*.mcap")
    assert held(new) == block(1).data.tobytes()
    assert len(said) == 1
    assert str(new) in said[0]
    assert names(tmp_path) == [new.name, "bus.mcap"]


@pytest.mark.parametrize("links", [True, False])
def test_a_name_is_taken_without_overwriting_on_any_file_system(tmp_path, monkeypatch, links):
    if not links:
        monkeypatch.setattr(os, "link", lambda *_: (_ for _ in ()).throw(OSError(errno.EPERM, "no links here")))
    source, first, second = (tmp_path / name for name in ("source", "first", "second"))
    source.write_bytes(b"new")
    first.write_bytes(b"old")
    assert move_to_free_name(source, (first, second)) == second
    assert (first.read_bytes(), second.read_bytes()) == (b"old", b"new")
    assert names(tmp_path) == ["first", "second"]
    with pytest.raises(FileNotFoundError):
        move_to_free_name(source, (tmp_path / "third",))
    assert names(tmp_path) == ["first", "second"]


@posix
def test_a_disk_that_fails_costs_a_file_its_index_and_nothing_else(tmp_path, monkeypatch):
    said: list[str] = []
    recorder = Recorder(tmp_path / "bus.mcap", LINE, tell=said.append)
    recorder.write(block(1))
    recorder.tick()
    failing = (tmp_path / "bus.mcap.part").stat().st_ino
    real = os.write

    def write(descriptor, data):
        if os.fstat(descriptor).st_ino == failing:
            raise OSError(errno.EIO, "input/output error")
        return real(descriptor, data)

    monkeypatch.setattr(os, "write", write)
    for number in (2, 3):
        recorder.write(block(number))
        recorder.tick()
    recorder.close()
    (new,) = tmp_path.glob("bus-*.mcap")
    assert held(tmp_path / "bus.mcap.part") + held(new) == b"".join(block(n).data.tobytes() for n in (1, 2, 3))
    assert len(said) == 1
    assert "input/output error: left without its index" in said[0]
    assert recorder.lost == 0


def clocks(monkeypatch):
    """A wall clock and a monotonic one, to be set: seconds."""
    wall, ticking = [1.8e9], [1000.0]
    fake = SimpleNamespace(time=lambda: wall[0], monotonic=lambda: ticking[0])
    for module in (ring_module, recorder_module, mcapfile):
        monkeypatch.setattr(module, "time", fake)
    return wall, ticking


@pytest.mark.parametrize("step_s", [-3 * DAY, 0, 3 * DAY, -1.8e9, 1e15])
@pytest.mark.parametrize("again", [False, True])
def test_a_ring_of_so_many_bytes_gives_up_its_oldest_whatever_the_clock(tmp_path, monkeypatch, step_s, again):
    wall, ticking = clocks(monkeypatch)
    limits = RingLimits(size=4000, keep_bytes=40_000)
    sent: list[bytes] = []

    def record(recorder, count):
        for _ in range(count):
            wall[0] += 1
            ticking[0] += 1
            part = noise(len(sent))
            sent.append(part.data.tobytes())
            recorder.write(part)
            recorder.tick()

    recorder = Recorder(tmp_path / "bus.mcap", LINE, limits=limits, tell=pytest.fail)
    record(recorder, 100)
    if again:
        recorder.close()
        recorder = Recorder(tmp_path / "bus.mcap", LINE, limits=limits, tell=pytest.fail)
    wall[0] += step_s
    record(recorder, 100)
    recorder.close()
    kept = b"".join(map(held, Ring(tmp_path / "bus.mcap", limits).files()))
    assert len(kept) > 5000
    assert b"".join(sent).endswith(kept)
    assert sum(file.stat().st_size for file in tmp_path.iterdir()) < 46_000


@pytest.mark.parametrize("step_s", [-3 * DAY, 0, 3 * DAY])
@pytest.mark.parametrize("again", [False, True])
def test_a_ring_of_so_much_time_counts_time_of_recording(tmp_path, monkeypatch, step_s, again):
    wall, ticking = clocks(monkeypatch)
    limits = RingLimits(every_s=3600, keep_s=DAY)
    seconds = [0]

    def record(recorder, hours):
        for _ in range(hours * 6):
            for clock in (wall, ticking, seconds):
                clock[0] += 600
            recorder.write(Block.from_chunks([Chunk(10**18 + seconds[0] * 10**9, b"%08d" % seconds[0])]))
            recorder.tick()

    recorder = Recorder(tmp_path / "bus.mcap", LINE, limits=limits, tell=pytest.fail)
    record(recorder, 20)
    files = len(Ring(tmp_path / "bus.mcap", limits).files())
    wall[0] += step_s
    if again:
        recorder.close()
        ticking[0] = 5.0  # the computer was started anew
        recorder = Recorder(tmp_path / "bus.mcap", LINE, limits=limits, tell=pytest.fail)
    record(recorder, 3)
    assert len(Ring(tmp_path / "bus.mcap", limits).files()) >= files  # nothing is a day old
    record(recorder, 40)
    recorder.close()
    kept = b"".join(map(held, Ring(tmp_path / "bus.mcap", limits).files()))
    assert 24 * 6 <= len(kept) // 8 <= 27 * 6  # a day, and what is in files that ended later
    assert kept.endswith(b"%08d" % seconds[0])


def test_a_ring_that_was_cut_keeps_its_order(tmp_path):
    limits = RingLimits(size=1, keep_s=10**6)
    recorder = Recorder(tmp_path / "bus.mcap", LINE, limits=limits, tell=pytest.fail)
    for number in (1, 2):
        recorder.write(block(number))
        recorder.tick()
    recorder.write(block(3))
    part = next(tmp_path.glob(f"*{PART}"))
    recorder._commit()
    copy = part.read_bytes()
    recorder.close()
    part.write_bytes(copy)
    part.with_name(part.name.removesuffix(PART)).unlink()
    again = Recorder(tmp_path / "bus.mcap", LINE, limits=limits, tell=lambda _: None)
    again.write(block(4))
    again.close()
    assert [held(file)[0] for file in Ring(tmp_path / "bus.mcap", limits).files()] == [1, 2, 3, 4]


def test_memory_stays_flat(tmp_path, monkeypatch):
    """Half-second commits for days: what stays of each is what its index takes, packed."""
    recorder = Recorder(tmp_path / "bus.mcap", LINE, tell=pytest.fail)

    def commits(count):
        for number in range(count):
            recorder.write(noise(number, 20))
            recorder._commit()

    monkeypatch.setattr(writer, "_INDEXES_AT_ONCE", 128)
    tracemalloc.start()
    try:
        commits(130)
        before = tracemalloc.get_traced_memory()[0]
        commits(384)
        grown = tracemalloc.get_traced_memory()[0] - before
    finally:
        tracemalloc.stop()
    recorder.close()
    assert grown < 40 * 384
    assert len(held(tmp_path / "bus.mcap")) == 514 * 20


def test_a_repaired_file_says_what_is_missing_in_it(tmp_path):
    recorder = Recorder(tmp_path / "bus.mcap", LINE, tell=pytest.fail)
    for number in range(30):
        recorder.write(noise(number))
        recorder.tick()
    recorder.note(Note(10**18, "clock", "the clock was set"))
    recorder.close()
    content = bytearray((tmp_path / "bus.mcap").read_bytes())
    middle = len(content) // 2
    content[middle : middle + 512] = random.Random(1).randbytes(512)
    (tmp_path / "damaged.mcap").write_bytes(content)
    done = repair(tmp_path / "damaged.mcap", tmp_path / "whole.mcap")
    assert done.bytes >= 27 * 300
    assert done.damage_count == 1
    assert not captures.open(tmp_path / "whole.mcap").damage
    gap, clock = sorted(read(tmp_path / "whole.mcap"), key=lambda note: note.kind, reverse=True)
    assert clock.text == "the clock was set"
    assert gap.kind == "gap"
    assert "data received between 2001-09-09T01:46:40.0" in gap.text
    before = [chunk.t_ns for chunk in captures.open(tmp_path / "whole.mcap").chunks() if chunk.t_ns <= gap.t_ns]
    assert before[-1] == gap.t_ns


@posix
def test_bytes_that_a_full_disk_cost_are_told_last_with_a_status(tmp_path):
    import resource

    master, slave = raw_pty()
    process = subprocess.Popen(
        [sys.executable, "-c", START, "record", os.ttyname(slave), "--baud", "115200", "-o", tmp_path / "bus.mcap"],
        stderr=subprocess.PIPE,
        text=True,
        env=environment(),
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000)),
    )
    assert process.stderr is not None
    while "listening" not in process.stderr.readline():
        assert process.poll() is None
    chance = random.Random(1)

    def talk():
        for _ in range(40):
            os.write(master, chance.randbytes(1000))
            time.sleep(0.02)

    talker = threading.Thread(target=talk)
    talker.start()
    talker.join()
    time.sleep(1)
    process.send_signal(signal.SIGTERM)
    _, err = process.communicate(timeout=PATIENCE_S)
    os.close(master)
    os.close(slave)
    kept = held(tmp_path / "bus.mcap.part")
    assert process.returncode == 1
    assert f"recorded {len(kept):,} bytes of the line, LOST {40_000 - len(kept):,}" in err.splitlines()[-1]
    assert "paused" in err
