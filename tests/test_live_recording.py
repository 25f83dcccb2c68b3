"""The recorder: safe within a second, whole after a kill, patient with a full disk, a ring of bounded size."""

import os
import random
import shutil
import subprocess
import time
from contextlib import contextmanager
from pathlib import Path

import pytest
from mcap.reader import make_reader
from running import ran, refused
from scripts import package

import captures
from captures import samples
from captures.chunks import Block, Chunk
from captures.errors import CaptureError
from captures.line import LineSettings
from captures.recording import recorder as recorder_module
from captures.recording.mcapfile import PART
from captures.recording.notes import Note, read
from captures.recording.recorder import Recorder
from captures.recording.ring import Ring, RingLimits

LINE = LineSettings(baud=19200, char_bits=11, parity="E", stop_bits=1, tap="usb")
posix = pytest.mark.skipif(os.name != "posix", reason="needs POSIX")


@pytest.fixture(autouse=True)
def prompt(monkeypatch):
    """Commit at each tick: no test waits for half a second."""
    monkeypatch.setattr(recorder_module, "_PERIOD_S", 0.0)


def block(number, size=100):
    return Block.from_chunks([Chunk(10**18 + number * 10**7, bytes([number & 0xFF]) * size)])


def held(path):
    return b"".join(part.data.tobytes() for part in captures.open(path).blocks())


def test_a_recording_is_readable_while_it_is_made_and_whole_when_it_is_closed(tmp_path):
    path = tmp_path / "bus.mcap"
    recorder = Recorder(path, LINE, about={"tool": "rtuscope"}, tell=pytest.fail)
    for number in range(5):
        recorder.write(block(number))
        recorder.tick()
        assert held(path.with_name("bus.mcap.part")) == b"".join(bytes([n]) * 100 for n in range(number + 1))
    recorder.note(Note(10**18, "lost", "/dev/ttyUSB0: lost"))
    recorder.close()
    assert [file.name for file in tmp_path.iterdir()] == ["bus.mcap"]
    capture = captures.open(path)
    assert held(path) == b"".join(bytes([n]) * 100 for n in range(5))
    assert capture.line == LINE
    assert not capture.damage
    assert read(path) == [Note(10**18, "lost", "/dev/ttyUSB0: lost")]
    with path.open("rb") as file:
        summary = make_reader(file, validate_crcs=True).get_summary()
    assert summary is not None and summary.statistics is not None
    assert summary.statistics.message_count == 6


def test_a_recording_never_takes_the_place_of_another(tmp_path):
    path = tmp_path / "bus.mcap"
    path.write_bytes(b"yesterday's")
    with pytest.raises(CaptureError, match="already exists"):
        Recorder(path, LINE)
    recorder = Recorder(path, LINE, overwrite=True)
    recorder.write(block(1))
    recorder.close()
    assert held(path) == block(1).data.tobytes()


@pytest.mark.parametrize("name", ["bus.jsonl", "no-such-folder/bus.mcap"])
def test_a_name_that_cannot_be_recorded_to_is_refused(tmp_path, name):
    with pytest.raises(CaptureError):
        Recorder(tmp_path / name, LINE)


def test_a_recording_of_nothing_leaves_no_file(tmp_path):
    recorder = Recorder(tmp_path / "bus.mcap", LINE)
    recorder.settings(LineSettings(baud=9600))
    recorder.tick()
    recorder.close()
    assert not list(tmp_path.iterdir())


def test_what_happened_before_the_settings_were_known_is_in_the_record(tmp_path):
    recorder = Recorder(tmp_path / "bus.mcap", LineSettings(), tell=pytest.fail)
    recorder.note(Note(10**18, "opened", "open"))
    recorder.tick()
    recorder.settings(LINE)
    recorder.close()
    assert [file.name for file in tmp_path.iterdir()] == ["bus.mcap"]
    assert captures.open(tmp_path / "bus.mcap").line == LINE
    assert read(tmp_path / "bus.mcap") == [Note(10**18, "opened", "open")]


def test_settings_with_which_nothing_was_received_leave_no_file_of_their_own(tmp_path):
    recorder = Recorder(tmp_path / "bus.mcap", LINE, tell=pytest.fail)
    notes = [Note(10**18 + n, "settled", f"the client sets it, {n}") for n in range(3)]
    for number, note in enumerate(notes):
        recorder.note(note)
        recorder._commit()
        recorder.settings(LineSettings(baud=9600 << number))
    recorder.write(block(1))
    recorder.close()
    assert [file.name for file in tmp_path.iterdir()] == ["bus.mcap"]
    assert captures.open(tmp_path / "bus.mcap").line == LineSettings(baud=38400)
    assert held(tmp_path / "bus.mcap") == block(1).data.tobytes()
    assert read(tmp_path / "bus.mcap") == notes


def test_a_port_that_is_set_back_and_set_again_begins_no_file(tmp_path):
    recorder = Recorder(tmp_path / "bus.mcap", LINE, tell=pytest.fail)
    for number in range(3):
        recorder.write(block(number))
        recorder.settings(LineSettings(baud=9600))  # as libmodbus does when it closes its port
        recorder._commit()
        recorder.settings(LINE)
    recorder.settings(LineSettings(baud=9600))
    recorder.close()
    assert [file.name for file in tmp_path.iterdir()] == ["bus.mcap"]
    assert captures.open(tmp_path / "bus.mcap").line == LINE
    assert held(tmp_path / "bus.mcap") == b"".join(block(number).data.tobytes() for number in range(3))


def test_other_settings_of_the_line_begin_another_file(tmp_path):
    recorder = Recorder(tmp_path / "bus.mcap", LineSettings(), tell=pytest.fail)
    recorder.settings(LINE)  # found before anything was heard
    recorder.write(block(1))
    recorder.settings(LineSettings(baud=9600))
    recorder.write(block(2))
    recorder.close()
    first, second = captures.open(tmp_path / "bus.mcap"), captures.open(next(tmp_path.glob("bus-*.mcap")))
    assert (first.line, second.line) == (LINE, LineSettings(baud=9600))
    assert [held(each.path) for each in (first, second)] == [block(1).data.tobytes(), block(2).data.tobytes()]


def test_files_rotate_by_size_and_lose_nothing_between_them(tmp_path):
    recorder = Recorder(tmp_path / "bus.mcap", LINE, limits=RingLimits(size=3000), tell=pytest.fail)
    chance = random.Random(1)
    blocks = [Block.from_chunks([Chunk(10**18 + n * 10**6, chance.randbytes(200))]) for n in range(60)]
    for each in blocks:
        recorder.write(each)
        recorder.tick()
    recorder.close()
    files = Ring(tmp_path / "bus.mcap", RingLimits()).files()
    assert len(files) > 3
    assert b"".join(map(held, files)) == b"".join(each.data.tobytes() for each in blocks)


def test_files_rotate_by_time(tmp_path):
    recorder = Recorder(tmp_path / "bus.mcap", LINE, limits=RingLimits(every_s=0.05), tell=pytest.fail)
    for number in range(3):
        recorder.write(block(number))
        recorder.tick()
        time.sleep(0.06)
    recorder.close()
    files = Ring(tmp_path / "bus.mcap", RingLimits()).files()
    assert [held(file) for file in files] == [bytes(100) + b"\1" * 100, b"\2" * 100]


def test_a_ring_keeps_its_size_and_only_gives_up_its_own_oldest_files(tmp_path):
    other = tmp_path / "bus-notes.mcap"
    other.write_bytes(b"not of the ring")
    limits = RingLimits(size=2000, keep_bytes=10_000)
    recorder = Recorder(tmp_path / "bus.mcap", LINE, limits=limits, tell=pytest.fail)
    chance = random.Random(2)
    sent = []
    for number in range(120):
        sent.append(chance.randbytes(300))
        recorder.write(Block.from_chunks([Chunk(10**18 + number * 10**6, sent[-1])]))
        recorder.tick()
        ring = Ring(tmp_path / "bus.mcap", limits)
        assert sum(file.stat().st_size for file in ring.files()) < 13_000
    recorder.close()
    kept = b"".join(map(held, ring.files()))
    assert len(kept) > 1000
    assert b"".join(sent).endswith(kept)
    assert other.exists()


def test_what_a_killed_recorder_left_is_made_whole_by_the_next_one(tmp_path):
    path = tmp_path / "bus.mcap"
    killed = Recorder(path, LINE, limits=RingLimits(size=10**6))
    killed.write(block(7))
    killed.note(Note(10**18, "clock", "the clock was set"))
    killed.tick()
    part = next(tmp_path.glob(f"*{PART}"))
    copy = part.read_bytes()
    killed.close()
    for file in tmp_path.iterdir():
        file.unlink()
    part.write_bytes(copy[:-3])  # and its last write was cut
    said: list[str] = []
    recorder = Recorder(path, LINE, limits=RingLimits(size=10**6), tell=said.append)
    recorder.close()
    (whole,) = tmp_path.glob("*.mcap*")
    assert "is now repaired" in said[0]
    assert not captures.open(whole).damage
    assert read(whole) in ([], [Note(10**18, "clock", "the clock was set")])


@posix
def test_a_recorder_leaves_alone_what_another_one_is_writing(tmp_path):
    first = Recorder(tmp_path / "bus.mcap", LINE, limits=RingLimits(size=10**6))
    first.write(block(1))
    first.tick()
    Recorder(tmp_path / "bus.mcap", LINE, tell=pytest.fail).close()
    with pytest.raises(CaptureError, match="another recorder is writing this ring"):
        Recorder(tmp_path / "bus.mcap", LINE, limits=RingLimits(size=10**6), tell=pytest.fail)
    first.write(block(2))
    first.close()
    (file,) = Ring(tmp_path / "bus.mcap", RingLimits()).files()
    assert held(file) == block(1).data.tobytes() + block(2).data.tobytes()


@contextmanager
def small_disk(folder, size="200k"):
    """A file system of this size; without the right to mount one the test is skipped."""
    folder.mkdir()
    done = subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(folder)], capture_output=True)
    if done.returncode:
        pytest.skip(f"no small disk without the right to mount one: {done.stderr.decode().strip()}")
    try:
        yield folder
    finally:
        subprocess.run(["umount", str(folder)], check=True)


def filled(folder):
    """Fill the disk but for nothing."""
    filler = folder / "filler"
    with filler.open("wb", buffering=0) as file:
        try:
            while file.write(b"x" * 4096):
                pass
        except OSError:
            pass
    return filler


@posix
def test_a_full_disk_pauses_the_recording_and_loses_nothing(tmp_path):
    with small_disk(tmp_path / "disk", "400k") as folder:
        said: list[str] = []
        recorder = Recorder(folder / "bus.mcap", LINE, tell=said.append)
        chance = random.Random(3)
        sent = [chance.randbytes(5000) for _ in range(40)]
        filler = None
        for number, data in enumerate(sent):
            if number == 10:
                filler = filled(folder)
            if number == 30:
                assert filler is not None
                filler.unlink()
            recorder.write(Block.from_chunks([Chunk(10**18 + number * 10**6, data)]))
            recorder.tick()
            assert recorder.paused == (10 <= number < 30)
            assert b"".join(sent).startswith(held(folder / "bus.mcap.part"))
        recorder.close()
        assert held(folder / "bus.mcap") == b"".join(sent)
        assert not captures.open(folder / "bus.mcap").damage
    assert "no space left on device: paused" in said[0]
    assert said[1] == "recording: resumed"


@posix
def test_a_disk_that_stays_full_leaves_a_file_that_opens(tmp_path):
    with small_disk(tmp_path / "disk") as folder:
        said: list[str] = []
        recorder = Recorder(folder / "bus.mcap", LINE, tell=said.append)
        recorder.write(block(1))
        recorder.tick()
        filled(folder)
        chance = random.Random(4)
        recorder.write(Block.from_chunks([Chunk(10**18 + 10**9, chance.randbytes(9000))]))
        recorder.close()
        assert held(folder / "bus.mcap.part") == block(1).data.tobytes()
    assert "left without its index" in said[-2]
    assert "9,000 bytes of the line that were waiting for the disk are lost" in said[-1]
    assert recorder.lost == 9000
    assert recorder.result == "recorded 100 bytes of the line, LOST 9,000"


@posix
def test_a_full_disk_costs_a_ring_its_oldest_file(tmp_path):
    with small_disk(tmp_path / "disk") as folder:
        said: list[str] = []
        recorder = Recorder(folder / "bus.mcap", LINE, limits=RingLimits(size=20_000, keep_s=10**6), tell=said.append)
        chance = random.Random(5)
        sent = [chance.randbytes(2000) for _ in range(300)]
        for number, data in enumerate(sent):
            recorder.write(Block.from_chunks([Chunk(10**18 + number * 10**6, data)]))
            recorder.tick()
            assert not recorder.paused
        recorder.close()
        kept = b"".join(map(held, Ring(folder / "bus.mcap", RingLimits()).files()))
        assert b"".join(sent).endswith(kept)
        assert len(kept) > 60_000
    assert "deleted the oldest file" in said[0]


def test_memory_is_bounded_while_the_disk_takes_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr(recorder_module, "_MEMORY", 1000)
    said: list[str] = []
    recorder = Recorder(tmp_path / "bus.mcap", LINE, tell=said.append)
    for number in range(30):
        recorder.write(block(number))  # no tick: nothing is committed
    assert recorder.lost == 2200
    assert len(said) == 1
    recorder.close()
    assert held(tmp_path / "bus.mcap") == b"".join(bytes([n]) * 100 for n in range(8))
    assert [note.kind for note in read(tmp_path / "bus.mcap")] == ["gap"]


@posix
def test_a_killed_recorder_loses_at_most_a_second(tmp_path):
    chance = random.Random()
    crashes = [package("attack.kills").crash(tmp_path, chance.uniform(0.05, 1.2)) for _ in range(5)]
    for each in crashes:
        assert each.in_order, each
        assert each.whole_after_repair, each
        assert each.lost_s <= 1.0, each


def test_repair_makes_a_whole_file_and_leaves_the_cut_one(capsys, tmp_path):
    recorder = Recorder(tmp_path / "bus.mcap", LINE)
    for number in range(10):
        recorder.write(block(number))
        recorder.tick()
    part = tmp_path / "bus.mcap.part"
    cut = part.read_bytes()[:-200]
    recorder.close()
    part.write_bytes(cut)
    assert "already exists" in refused(capsys, "repair", part)
    done = ran(capsys, "repair", part, "-o", tmp_path / "whole.mcap")
    assert done.status == 0
    assert "without a footer" in done.err
    assert part.read_bytes() == cut
    assert (b"".join(bytes([n]) * 100 for n in range(10))).startswith(held(tmp_path / "whole.mcap"))
    assert captures.open(tmp_path / "whole.mcap").line == LINE
    assert not captures.open(tmp_path / "whole.mcap").damage


def test_repair_of_what_is_no_recording_is_refused(capsys, tmp_path):
    path = tmp_path / "x.mcap"
    path.write_bytes(os.urandom(100))
    refused(capsys, "repair", path)
    refused(capsys, "repair", Path("/no/such/file.mcap"))
    assert [file.name for file in tmp_path.iterdir()] == ["x.mcap"]


def test_an_intact_recording_is_not_copied(tmp_path, capsys):
    path = tmp_path / "bus.mcap"
    shutil.copyfile(samples.path("mbpoll.mcap"), path)
    assert "nothing to repair" in ran(capsys, "repair", path).out
    assert list(tmp_path.iterdir()) == [path]
