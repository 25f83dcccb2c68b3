"""Rings of recordings: whose a file is, who records, and that a rotation never ends a recording."""

import errno
import os
import random
import shutil
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace

import pytest
from livebus import pty
from running import PATIENCE_S, START, environment

import captures
from captures.chunks import Block, Chunk
from captures.errors import CaptureError
from captures.line import LineSettings
from captures.recording import mcapfile, ringlist
from captures.recording import recorder as recorder_module
from captures.recording import ring as ring_module
from captures.recording.mcapfile import PART
from captures.recording.recorder import Recorder
from captures.recording.ring import Ring, RingLimits

LINE = LineSettings(baud=19200, char_bits=11, parity="E", stop_bits=1, tap="usb")
posix = pytest.mark.skipif(os.name != "posix", reason="needs POSIX")
RING = RingLimits(size=1, keep_bytes=1 << 20)


@pytest.fixture(autouse=True)
def prompt(monkeypatch):
    """Commit at each tick, and wait for no disk."""
    monkeypatch.setattr(recorder_module, "_PERIOD_S", 0.0)
    monkeypatch.setattr(os, "fsync", lambda _: None)


@pytest.fixture
def ticking(monkeypatch):
    """A clock to be set: seconds."""
    now = [1000.0]
    fake = SimpleNamespace(time=lambda: 1.8e9 + now[0], monotonic=lambda: now[0])
    for module in (ring_module, recorder_module, mcapfile):
        monkeypatch.setattr(module, "time", fake)
    return now


def block(number, size=100):
    return Block.from_chunks([Chunk(10**18 + number * 10**7, bytes([number & 0xFF]) * size)])


def held(path):
    return b"".join(part.data.tobytes() for part in captures.open(path).blocks())


def recorded(folder, ports, numbers, limits=RING, tell=pytest.fail):
    recorder = Recorder(folder / "bus.mcap", LINE, limits=limits, about={"ports": ports}, tell=tell)
    for number in numbers:
        recorder.write(block(number))
        recorder.tick()
    recorder.close()
    return recorder


def kept(folder):
    """The first byte of each file, by name."""
    return sorted(held(path)[0] for path in folder.glob("bus-*.mcap"))


@posix
def test_a_second_recorder_of_the_same_ring_is_refused(tmp_path):
    first = Recorder(tmp_path / "bus.mcap", LINE, limits=RING, about={"ports": "/dev/ttyA"}, tell=pytest.fail)
    first.write(block(1))
    first.tick()
    for ports in ("/dev/ttyA", "/dev/ttyB"):
        with pytest.raises(CaptureError, match="another recorder is writing this ring"):
            Recorder(tmp_path / "bus.mcap", LINE, limits=RING, about={"ports": ports}, tell=pytest.fail)
    Recorder(tmp_path / "other.mcap", LINE, limits=RING, about={"ports": "/dev/ttyB"}, tell=pytest.fail).close()
    first.write(block(2))
    first.close()
    assert kept(tmp_path) == [1, 2]
    recorded(tmp_path, "/dev/ttyA", [3])


def test_a_ring_gives_up_files_of_its_own_port_only(tmp_path):
    recorded(tmp_path, "/dev/ttyA", [1, 2, 3])
    said: list[str] = []
    least = RingLimits(size=1, keep_bytes=1)
    recorded(tmp_path, "/dev/ttyB", [4, 5, 6], RING, said.append)
    assert kept(tmp_path) == [1, 2, 3, 4, 5, 6]
    assert len(said) == 1 and "files named like this ring's, but not from it: 3" in said[0]
    recorded(tmp_path, "/dev/ttyA", [7, 8], least, said.append)  # goes on where it was
    assert kept(tmp_path) == [4, 5, 6]


@posix
@pytest.mark.parametrize("fails", ["", "write", "replace"])
def test_a_list_of_files_long_gone_is_written_anew_or_stays_as_it_was(tmp_path, monkeypatch, fails):
    monkeypatch.setattr(ringlist, "_GONE", 2)
    told: list[str] = []
    least = RingLimits(size=1, keep_bytes=1)
    recorded(tmp_path, "/dev/ttyB", [9])
    recorded(tmp_path, "/dev/ttyA", [1, 2, 3], least, told.append)
    before = (tmp_path / "bus.ring").read_bytes()
    with monkeypatch.context() as patch:
        if fails == "write":
            patch.setattr(ringlist, "part_of", lambda _: (os.open("/dev/full", os.O_WRONLY), spare(tmp_path)))
        elif fails == "replace":
            patch.setattr(ringlist, "put_in_place", full)
        recorded(tmp_path, "/dev/ttyA", [4], RING, told.append)
    assert (tmp_path / "bus.ring").read_bytes().startswith(before) == bool(fails)
    recorded(tmp_path, "/dev/ttyA", [5, 6], least, told.append)
    assert kept(tmp_path) == [9]  # of the other ring, which this list still knows
    assert {path.suffix for path in tmp_path.iterdir()} == {".mcap", ".ring"}


def spare(folder: Path) -> Path:
    path = folder / ".bus.ring.part"
    path.touch()
    return path


def full(*_: object) -> None:
    raise OSError(errno.ENOSPC, "no space left on device")


@pytest.mark.parametrize("change", ["copied", "rewritten", "linked", "without list", "another's list", "of before"])
def test_what_is_no_ring_file_is_told_and_never_deleted(tmp_path, change):
    recorded(tmp_path, "/dev/ttyA", [1, 2, 3])
    first, second, _ = sorted(tmp_path.glob("bus-*.mcap"))
    mine = first
    if change == "copied":
        mine = tmp_path / "bus-20200101T000000.000Z.mcap"
        shutil.copy(first, mine)
    elif change == "rewritten":
        captures.write(first, captures.Capture.of(LINE, [Chunk(10**18, b"mine")]))
    elif change == "linked":
        if os.name != "posix":
            pytest.skip("makes links")
        (tmp_path / "mine").mkdir()
        first.rename(tmp_path / "mine" / "precious")
        first.symlink_to(tmp_path / "mine" / "precious")
    elif change == "without list":
        (tmp_path / "bus.ring").unlink()
    elif change == "another's list":
        (tmp_path / "bus.ring").write_bytes(b"notes on the ring main unit")
    else:
        plain = Recorder(tmp_path / "old.mcap", LINE, tell=pytest.fail)
        plain.write(block(9))
        plain.close()
        mine = tmp_path / "bus-20990101T000000.000Z.mcap"
        (tmp_path / "old.mcap").rename(mine)
    before = mine.read_bytes()
    said: list[str] = []
    recorded(tmp_path, "/dev/ttyA", [4, 5, 6], RingLimits(size=1, keep_bytes=1), said.append)
    assert mine.read_bytes() == before
    assert any("not from it" in each for each in said)
    if change == "linked":
        assert (tmp_path / "mine" / "precious").read_bytes() == before
    if change == "another's list":
        assert (tmp_path / "bus.ring.1").read_bytes() == b"notes on the ring main unit"
    gone = change not in ("without list", "another's list")
    assert second.exists() != gone


def test_a_file_that_changes_hands_while_recording_stays(tmp_path):
    recorder = Recorder(tmp_path / "bus.mcap", LINE, limits=RingLimits(size=1, keep_bytes=1), tell=lambda _: None)
    recorder._ring.limits = RING
    for number in (1, 2):
        recorder.write(block(number))
        recorder.tick()
    oldest = min(tmp_path.glob("bus-*.mcap"))
    oldest.write_bytes(b"mine now")
    said: list[str] = []
    recorder._tell = said.append
    recorder._ring.limits = RingLimits(size=1, keep_bytes=1)
    for number in (3, 4):
        recorder.write(block(number))
        recorder.tick()
    recorder.close()
    assert oldest.read_bytes() == b"mine now"
    assert len(said) == 1 and "is a different file now: old files are kept" in said[0]


@pytest.mark.parametrize(
    "limits", [RingLimits(every_s=1, keep_s=3600), RingLimits(every_s=1, keep_s=2, keep_bytes=10**6)]
)
@pytest.mark.parametrize("line", [LINE, LineSettings()])
def test_a_recorder_that_hears_nothing_rotates_on(tmp_path, ticking, limits, line):
    recorder = Recorder(tmp_path / "bus.mcap", line, limits=limits, tell=pytest.fail)
    for _ in range(50):
        ticking[0] += 1.5
        recorder.tick()
    recorder.write(block(1))
    recorder.settings(LINE)
    recorder.close()
    assert kept(tmp_path) == [1]


def test_silence_that_lasts_longer_than_a_ring_keeps_costs_no_newer_file(tmp_path, ticking):
    limits = RingLimits(every_s=10, keep_s=100)
    recorder = Recorder(tmp_path / "bus.mcap", LINE, limits=limits, tell=pytest.fail)
    for number in (1, 2, 3):
        recorder.write(block(number))
        recorder.tick()
        ticking[0] += 11
        recorder.tick()
    for _ in range(100):
        ticking[0] += 11
        recorder.tick()
    assert kept(tmp_path) == [3]  # the last that was heard
    recorder.write(block(4))
    recorder.close()
    assert kept(tmp_path) == [3, 4]


class Hazards:
    """A recorder of a ring, and what happens to it."""

    def __init__(self, folder, chance, ticking, monkeypatch):
        self.folder, self.chance, self.ticking = folder, chance, ticking
        self.full = self.sent = 0
        self.kept = RingLimits(every_s=10, keep_s=chance.choice((30, 300)), keep_bytes=chance.choice((None, 20_000)))
        self.mine = folder / "bus-20200101T000000.000Z.mcap"
        self.mine.write_bytes(b"mine")
        (folder / "bus.ring.txt").write_bytes(b"mine")
        write = os.write

        def limited(descriptor, data):
            if self.full:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            return write(descriptor, data)

        monkeypatch.setattr(os, "write", limited)
        self.full = chance.random() < 0.3
        self.start()

    def start(self):
        self.said: list[str] = []
        self.recorder = Recorder(self.folder / "bus.mcap", LINE, limits=self.kept, tell=self.said.append)

    def step(self):
        self.chance.choice((self.hear, self.hear, self.silence, self.fill, self.free, self.take, self.restart))()
        self.ticking[0] += self.chance.choice((0.1, 1, 11))
        self.recorder.tick()

    def hear(self):
        self.recorder.write(block(self.sent, 500))
        self.sent += 1

    def silence(self):
        for _ in range(self.chance.randint(1, 15)):
            self.ticking[0] += 11
            self.recorder.tick()

    def fill(self):
        self.full = 1

    def free(self):
        self.full = 0

    def take(self):
        """Files, whole ones, empty ones, the one that is written, or the list."""
        files = [path for path in self.folder.iterdir() if path != self.mine and path.suffix != ".txt"]
        for path in self.chance.sample(files, min(len(files), self.chance.randint(0, 3))):
            with suppress(PermissionError):  # Windows
                path.unlink()

    def restart(self):
        self.recorder.close()
        self.start()


@pytest.mark.parametrize("seed", range(40))
def test_a_ring_lives_through_whatever_happens(seed, tmp_path, ticking, monkeypatch):
    """No file, empty files, files taken away, a full disk from the start, silence: recording goes on, all is told."""
    hazards = Hazards(tmp_path, random.Random(seed), ticking, monkeypatch)
    for _ in range(30):
        hazards.step()
    hazards.full = 0
    hazards.recorder.tick()
    hazards.hear()
    last = hazards.sent - 1
    hazards.recorder.close()
    assert hazards.recorder.lost == 0
    hazards.restart()  # which makes whole what a full disk left without its index
    hazards.recorder.close()
    files = Ring(tmp_path / "bus.mcap", hazards.kept).files()
    assert last & 0xFF in [held(path)[-1] for path in files]
    assert hazards.mine.read_bytes() == (tmp_path / "bus.ring.txt").read_bytes() == b"mine"
    order = [number for path in files for number in dict.fromkeys(held(path))]
    assert order == sorted(order) and not list(tmp_path.glob(f"*{PART}"))


def test_a_full_disk_from_the_start_costs_the_oldest_file_and_is_waited_for(tmp_path, monkeypatch):
    recorded(tmp_path, "", [1, 2])
    write, room = os.write, [0]

    def limited(descriptor, data):
        if len(list(tmp_path.glob("bus-*.mcap"))) > room[0]:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return write(descriptor, data)

    monkeypatch.setattr(os, "write", limited)
    said: list[str] = []
    room[0] = 1
    recorder = Recorder(tmp_path / "bus.mcap", LINE, limits=RING, tell=said.append)
    assert any("deleted the oldest file" in each for each in said)
    recorder.close()
    room[0] = -1
    recorder = Recorder(tmp_path / "bus.mcap", LINE, limits=RING, tell=said.append)
    assert recorder.paused and "paused" in said[-1]
    recorder.write(block(3))
    recorder.tick()
    room[0] = 9
    recorder.tick()
    recorder.close()
    assert said[-1] == "recording: resumed" and recorder.lost == 0 and kept(tmp_path) == [3]


def test_a_rotation_that_fails_is_told_once_and_recording_goes_on(tmp_path, monkeypatch):
    said: list[str] = []
    recorder = Recorder(tmp_path / "bus.mcap", LINE, limits=RingLimits(size=1, keep_bytes=1), tell=said.append)
    unlink = os.unlink

    def refuse(name, **more):
        if str(name).endswith(".mcap"):
            raise PermissionError(errno.EPERM, "operation not permitted")
        unlink(name, **more)

    monkeypatch.setattr(os, "unlink", refuse)
    for number in (1, 2, 3):
        recorder.write(block(number))
        recorder.tick()
    recorder.close()
    assert kept(tmp_path) == [1, 2, 3]
    assert all("operation not permitted: old files are kept" in each for each in said) and said


def test_a_cut_file_goes_only_where_all_of_it_is_in_the_whole_one(tmp_path):
    recorder = Recorder(tmp_path / "bus.mcap", LINE, tell=pytest.fail)
    for number in range(6):
        recorder.write(block(number, 3000))
        recorder.tick()
    copy = bytearray((tmp_path / "bus.mcap.part").read_bytes())
    recorder.close()
    (tmp_path / "bus.mcap").unlink()
    copy[len(copy) // 2 : len(copy) // 2 + 40] = b"\xff" * 40
    part = tmp_path / "bus.mcap.part"
    part.write_bytes(copy)
    (tmp_path / "bus.mcap.part.mending").write_bytes(b"mine")
    said: list[str] = []
    Recorder(tmp_path / "bus.mcap", LINE, tell=said.append).close()
    assert (tmp_path / "bus.mcap.part.1").read_bytes() == bytes(copy)
    assert (tmp_path / "bus.mcap.part.mending").read_bytes() == b"mine"
    assert any("could be read only in part: set aside as" in each for each in said)


@posix
def test_two_recorders_of_two_ports_by_the_command(tmp_path):
    """The second is refused in one line with status 2, and the first goes on."""
    (master, name), (_, other) = pty(), pty()
    words = ["--baud", "9600", "-o", str(tmp_path / "bus.mcap"), "--rotate-every", "1h", "--keep", "1d"]
    command = [sys.executable, "-c", START, "record"]
    first = subprocess.Popen([*command, name, *words], stderr=subprocess.PIPE, text=True, env=environment())
    assert first.stderr is not None
    while "listening" not in first.stderr.readline():
        assert first.poll() is None
    second = subprocess.run(
        [*command, other, *words], stderr=subprocess.PIPE, text=True, env=environment(), check=False, timeout=60
    )
    assert second.returncode == 2 and "another recorder is writing this ring" in second.stderr
    assert second.stderr.count("\n") == 1
    os.write(master, b"\x11\x03\x00\x6b")
    time.sleep(1)
    first.send_signal(2)
    first.stderr.read()
    assert first.wait(PATIENCE_S) == 0
    assert [held(path) for path in tmp_path.glob("bus-*.mcap")] == [b"\x11\x03\x00\x6b"]
