"""`sniff` and `record` on buses of real stacks: everything that was said is seen, paired and recorded, nothing else."""

import atexit
import contextlib
import importlib
import json
import logging
import os
import random
import shlex
import shutil
import signal
import socket
import subprocess
import sys
import time

import pytest
from buses import adu
from livebus import Running, TeeBus, eventually, pty, raw_pty, served
from pymodbus.client import ModbusSerialClient
from running import PATIENCE_S, START, environment, ran, refused

import captures
from analyzer.cli import main, watching
from analyzer.cli import sniff as sniff_command
from analyzer.cli.app import Parser
from analyzer.cli.commands import add_arguments, load
from captures.line import LineSettings
from captures.live.tap import programs_using
from captures.recording.notes import read
from captures.recording.recorder import Recorder

pytestmark = pytest.mark.skipif(os.name != "posix", reason="pseudo-terminals are POSIX")
REQUEST, ANSWER = bytes.fromhex("1103006b00037687"), bytes.fromhex("110306ae415652434049ad")


def frames(out):
    """The frames among JSON lines, without what depends on when they were read."""
    lines = [json.loads(line) for line in out.splitlines()]
    return [
        {key: value for key, value in line.items() if key not in ("findings", "confidence")}
        for line in lines
        if "direction" in line
    ]


def untimed(frame):
    """What is said of a frame but for its response time, of which a live line knows less than its record does."""
    return {key: value for key, value in frame.items() if not key.startswith("response_time")}


def stalled(asked, answer):
    """An echo so late, on a machine so busy, that nobody could tell it from the client asking again."""
    return asked["hex"] == answer["hex"] and answer["t_start_ns"] - asked["t_end_ns"] > 25_000_000


def exported(path):
    done = subprocess.run([sys.executable, "-c", START, "export", str(path)], capture_output=True, env=environment())
    return done.stdout


def poll(port, count, seed):
    """A client's requests of many kinds, in bursts and with pauses."""
    chance = random.Random(seed)
    client = ModbusSerialClient(port, baudrate=115200, timeout=20, retries=0)
    client.connect()
    for number in range(count):
        unit, at = (1, 2, 17)[number % 3], chance.randrange(90)
        kind = chance.randrange(5)
        if kind < 2:
            done = client.read_holding_registers(at, count=chance.randint(1, 20), device_id=unit)
        elif kind == 2:
            done = client.read_coils(at, count=chance.randint(1, 90), device_id=unit)
        elif kind == 3:
            done = client.write_register(at, chance.randrange(4000), device_id=unit)
        else:
            done = client.write_registers(at, [chance.randrange(4000) for _ in range(5)], device_id=unit)
        assert not done.isError()
        if chance.random() < 0.02:
            time.sleep(0.03)
    client.close()


def test_all_that_real_stacks_say_is_sniffed_paired_and_recorded(tmp_path):
    logging.getLogger("pymodbus").setLevel(logging.CRITICAL)
    with TeeBus(10 / 115200) as bus:
        sniff = Running("sniff", bus.tap_port, "--baud", "115200", "--json", "-o", tmp_path / "bus.mcap", reads=True)
        with served(bus):
            poll(bus.client_port, 1000, seed=1)
        assert eventually(lambda: sniff.out.count(b'"direction"') == 2000)
        status, out, said = sniff.ended()
    assert status == 0, said
    found = frames(out)
    assert [frame["hex"] for frame in found] == [data for _, data in bus.frames()]
    assert len(found) == 2000
    for number, (asked, answer) in enumerate(zip(found[::2], found[1::2], strict=True)):
        if stalled(asked, answer):
            continue
        assert (asked["direction"], answer["direction"]) == ("request", "response"), number
        assert answer["request_start"] == asked["start"]
    assert list(map(untimed, frames(exported(tmp_path / "bus.mcap")))) == list(map(untimed, found))
    assert [note.kind for note in read(tmp_path / "bus.mcap")] == ["opened", "settled", "closed"]


@pytest.mark.skipif(not shutil.which("mbpoll"), reason="mbpoll is not installed")
def test_mbpoll_is_sniffed_by_a_blocking_read_too():
    with TeeBus(10 / 19200, burst=3) as bus:
        sniff = Running("sniff", bus.tap_port, "--baud", "19200", "--json", "--blocking-read")
        with served(bus):
            for kind in ("4", "3", "0"):
                command = f"mbpoll -m rtu -b 19200 -P none -a 1,2,17 -t {kind} -c 5 -1".split()
                subprocess.run([*command, bus.client_port], capture_output=True, timeout=PATIENCE_S, check=True)
        time.sleep(0.2)
        _, out, _ = sniff.ended()
    found = frames(out)
    assert [(frame["direction"], frame["hex"]) for frame in found] == bus.frames()
    assert len(found) == 18


@pytest.mark.parametrize("command", ["sniff", "record"])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, getattr(signal, "SIGHUP", None)])
def test_a_signal_ends_it_cleanly_with_a_whole_recording(tmp_path, command, number):
    master, name = pty()
    running = Running(command, name, "--baud", "9600", "-o", tmp_path / "bus.mcap")
    os.write(master, REQUEST)
    time.sleep(0.03)
    os.write(master, ANSWER)
    time.sleep(0.1)
    status, _, said = running.ended(number)
    assert status == 0, said
    assert "Traceback" not in said
    assert [file.name for file in tmp_path.iterdir()] == ["bus.mcap"]
    capture = captures.open(tmp_path / "bus.mcap")
    assert b"".join(chunk.data for chunk in capture.chunks()) == REQUEST + ANSWER
    assert not capture.damage
    assert (capture.line.baud, capture.line.char_bits, capture.line.tap) == (9600, 10, "pty")


def test_what_nohup_asked_for_stays():
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with watching.ended_from_outside(lambda: None):
            assert signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
            assert signal.getsignal(signal.SIGTERM) not in (signal.SIG_IGN, signal.SIG_DFL)
    finally:
        signal.signal(signal.SIGHUP, before)


def test_frames_are_shown_in_a_line_each_while_the_bus_goes_on():
    master, name = pty()
    sniff = Running("sniff", name, "--baud", "9600", "--count", "2")
    os.write(master, REQUEST)
    line = sniff.stdout.readline().decode()
    assert line.endswith(">  17 03 read 3 holding registers from 107 (40108)\n")
    os.write(master, ANSWER)
    status, out, _ = sniff.ended(None)
    assert status == 0
    assert "<  17 03 3 registers: 44609 22098 17216" in out.decode()


def test_a_silent_bus_holds_no_frame():
    _, name = pty()
    status, out, said = Running("sniff", name, "--duration", "0.3s").ended(None)
    assert (status, out) == (1, b""), said
    assert "rtuscope: nothing was received" in said


@pytest.mark.parametrize("command", ["sniff", "record"])
def test_a_pseudo_terminal_that_is_closed_has_ended(tmp_path, command):
    """Its number is given to the next one, which is somebody else's: nobody waits for that, takes its bytes and locks
    it. A listener left behind by one test did so to the others."""
    master, slave = raw_pty()
    running = Running(command, os.ttyname(slave), "-o", tmp_path / "bus.mcap")
    os.write(master, REQUEST)
    assert eventually(lambda: recorded(tmp_path / "bus.mcap.part") == REQUEST)
    os.close(master)
    os.close(slave)
    status, _, said = running.ended(None)
    assert status == 0, said
    assert "lost (" in said
    assert "waiting" not in said
    assert recorded(tmp_path / "bus.mcap") == REQUEST


def test_a_pipe_that_closes_ends_it_and_the_recording_is_whole(tmp_path):
    master, name = pty()
    sniff = Running("sniff", name, "-o", tmp_path / "bus.mcap")
    sniff.stdout.close()
    for _ in range(3):
        os.write(master, REQUEST)
        time.sleep(0.1)
    assert sniff.process.wait(PATIENCE_S) == 0
    sniff.stderr.close()
    assert not captures.open(tmp_path / "bus.mcap").damage


def flooded(master, count, data=(REQUEST + ANSWER) * 4):
    """Far more than a pipe holds of lines, at the pace of a fast line; all that was sent."""
    for _ in range(count):
        os.write(master, data)
        time.sleep(0.002)
    return data * count


def recorded(path):
    """The bytes of a recording, whole or in work; none where there is none yet."""
    try:
        return b"".join(chunk.data for chunk in captures.open(path).chunks())
    except captures.CaptureError:
        return b""


def test_a_reader_that_takes_nothing_does_not_hold_up_the_recording(tmp_path):
    master, name = pty()
    sniff = Running("sniff", name, "--json", "--noise", "-o", tmp_path / "bus.mcap")
    sent = flooded(master, 300)  # and nobody reads the lines
    part = tmp_path / "bus.mcap.part"
    assert eventually(lambda: recorded(part) == sent)
    lines = [sniff.stdout.readline() for _ in range(2400)]
    assert "".join(frame["hex"] for frame in frames(b"".join(lines))) == sent.hex()
    assert sniff.ended()[0] == 0


@contextlib.contextmanager
def full_pipe():
    """A pipe that takes nothing."""
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    with contextlib.suppress(BlockingIOError):
        while True:
            os.write(writer, bytes(4096))
    os.set_blocking(writer, True)
    yield writer
    os.close(reader)
    os.close(writer)


def end(process):
    """Tell it to end, which it does by itself."""
    process.send_signal(signal.SIGTERM)
    process.wait(PATIENCE_S)


def test_an_end_that_does_not_come_is_waited_for_less_than_two_seconds():
    """What the tests below give a busy machine more time for: a process that hangs ends after these waits."""
    assert watching._GRACE_S + sniff_command._GRACE_S <= 1.6


def test_sigterm_ends_it_soon_where_its_output_is_not_taken(tmp_path):
    master, name = pty()
    sniff = Running("sniff", name, "--json", "-o", tmp_path / "bus.mcap")
    sent = flooded(master, 300)
    assert eventually(lambda: recorded(tmp_path / "bus.mcap.part") == sent)
    end(sniff.process)
    assert sniff.process.returncode == 130  # not all was shown
    words = sniff.stderr.read().decode()
    assert "ended before all was shown" in words
    assert f"{len(sent):,} bytes are recorded" in words
    assert recorded(tmp_path / "bus.mcap") == sent
    assert not captures.open(tmp_path / "bus.mcap").damage


@pytest.mark.parametrize("command", ["sniff", "record"])
def test_sigterm_ends_it_soon_where_nothing_that_it_says_is_taken(tmp_path, command):
    """And what is heard is recorded, although no word of it can be told."""
    master, name = pty()
    arguments = [sys.executable, "-c", START, command, name, "-o", str(tmp_path / "bus.mcap")]
    with full_pipe() as full, subprocess.Popen(arguments, stdout=full, stderr=full, env=environment()) as process:
        atexit.register(process.kill)
        part = tmp_path / "bus.mcap.part"
        assert eventually(lambda: bool(programs_using(name)))
        time.sleep(0.2)
        sent = flooded(master, 100)
        assert eventually(lambda: recorded(part) == sent)
        end(process)
    assert recorded(tmp_path / "bus.mcap") == sent


def test_sigterm_ends_it_soon_where_the_analysis_is_far_behind(tmp_path):
    """A gateway that sends what takes longest, frames and noise in turns, all at once."""
    chance = random.Random(1)
    sent = b"".join(adu("0503" + chance.randbytes(4).hex()) + chance.randbytes(9) for _ in range(4000))
    server = socket.create_server(("127.0.0.1", 0))
    url = f"socket://127.0.0.1:{server.getsockname()[1]}"
    sniff = Running("sniff", url, "-o", tmp_path / "bus.mcap", reads=True)
    connection, _ = server.accept()
    connection.sendall(sent)
    assert eventually(lambda: recorded(tmp_path / "bus.mcap.part") == sent)
    end(sniff.process)
    status, _, said = sniff.ended(None)
    assert status == 130, said
    assert f"; {len(sent):,} bytes are recorded" in said
    assert "Traceback" not in said
    assert recorded(tmp_path / "bus.mcap") == sent
    connection.close()
    server.close()


def test_an_adapter_unplugged_while_recording_is_a_gap_in_the_record(tmp_path):
    link = tmp_path / "tty"
    first = raw_pty()
    link.symlink_to(os.ttyname(first[1]))
    record = Running("record", link, "--baud", "9600", "-o", tmp_path / "bus.mcap")
    os.write(first[0], REQUEST)
    part = tmp_path / "bus.mcap.part"
    assert eventually(lambda: recorded(part) == REQUEST)
    link.unlink()
    for descriptor in first:
        os.close(descriptor)
    while b"lost" not in record.said[-1]:
        record.said.append(record.stderr.readline())
    second, name = pty()
    link.symlink_to(name)
    while b"is back" not in record.said[-1]:
        record.said.append(record.stderr.readline())
    os.write(second, ANSWER)
    assert eventually(lambda: b"".join(chunk.data for chunk in captures.open(part).chunks()) == REQUEST + ANSWER)
    status, _, said = record.ended()
    assert status == 0, said
    chunks = list(captures.open(tmp_path / "bus.mcap").chunks())
    assert b"".join(chunk.data for chunk in chunks) == REQUEST + ANSWER
    notes = [note for note in read(tmp_path / "bus.mcap") if note.kind in ("lost", "opened")]
    assert [note.kind for note in notes] == ["opened", "lost", "opened"]
    assert chunks[0].t_ns < notes[1].t_ns < notes[2].t_ns < chunks[-1].t_ns


def test_a_line_whose_settings_make_no_difference_needs_none():
    master, name = pty()  # no --baud: it is sought, but a pseudo-terminal has none
    sniff = Running("sniff", name, "--count", "1")
    os.write(master, REQUEST)
    status, out, said = sniff.ended(None)
    assert status == 0
    assert "no rate to set" in said
    assert b"read 3 holding registers" in out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["/dev/no-such-port"], "no such port"),
        (["/dev/ttyS0", "--idle-ms", "1"], "not between 5 and 5000 ms"),
        (["/dev/ttyS0", "--baud", "fast"], "--baud: 'fast' is not a rate"),
        (["/dev/ttyS0", "--port2", "/dev/ttyS0"], "the same port"),
        (["/dev/ttyS0", "-o", "bus.jsonl"], "suffix .mcap"),
        (["/dev/ttyS0", "--keep", "seven"], "'seven' is neither a time"),
        (["/dev/ttyS0", "--duration", "-1s"], "expected one argument"),
    ],
)
def test_arguments_that_cannot_be_used_are_refused_in_one_line(capsys, arguments, words):
    assert words in refused(capsys, "sniff", *arguments)


@pytest.mark.parametrize("command", ["sniff", "record"])
def test_bytes_that_were_lost_are_told_last_and_by_the_status(monkeypatch, capfd, command):
    class Full(Scripted):
        """A recorder whose disk was full for too long."""

        bytes, lost, taken, paused, size = 10, 12_345, 0, False, 0
        result = Recorder.result
        write = note = settings = tick = close = lambda *_: None

    module = importlib.import_module(f"analyzer.cli.{command}")
    monkeypatch.setattr(module, "recorder_of", lambda *_: Full())
    monkeypatch.setattr(module, "tap_of", lambda *_, **__: Scripted())
    assert main([command, "/dev/ttyX", "-o", "bus.mcap"]) == 1
    assert capfd.readouterr().err.splitlines()[-1] == "rtuscope: recorded 10 bytes of the line, LOST 12,345"


class Scripted:
    """A source on which nothing comes."""

    line, waits, lost = LineSettings(), False, 0
    items = staticmethod(lambda: iter(()))
    judge = close = lambda *_: None


@pytest.mark.parametrize("command", ["sniff", "record"])
def test_the_examples_can_be_typed(command):
    parser = Parser()
    add_arguments(parser, command)
    for line in load(command).EXAMPLE.splitlines():
        assert parser.parse_args(shlex.split(line.partition(" | ")[0])[2:]).port


def test_ports_lists_what_there_is(capsys):
    assert isinstance(json.loads(ran(capsys, "ports", "--json").out), list)
    assert ran(capsys, "ports").status == 0
