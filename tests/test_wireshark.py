"""Live frames in Wireshark: by its own extcap, and through a pipe. tshark reads; it lists, captures and finds."""

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import time

import pytest
from buses import adu
from livebus import Running, TeeBus, eventually, pty, served
from pymodbus.client import ModbusSerialClient
from running import PATIENCE_S, environment, ran, refused

from captures.live.tap import programs_using

pytestmark = pytest.mark.skipif(os.name != "posix", reason="pseudo-terminals are POSIX")
FRAMES = ("-Y", "mbrtu", "-e", "frame.number")
needs_tshark = pytest.mark.skipif(shutil.which("tshark") is None, reason="tshark is not installed")


def poll(port, count=20):
    """So many reads that go well, and one that is refused."""
    client = ModbusSerialClient(port, baudrate=115200, timeout=20, retries=0)
    client.connect()
    for number in range(count):
        client.read_holding_registers(number, count=3, device_id=17)
    client.read_holding_registers(9000, count=3, device_id=17)
    client.close()


@contextlib.contextmanager
def tshark_reading(*arguments, stdin=None):
    """tshark, capturing until the end of the block at most."""
    process = subprocess.Popen(["tshark", *arguments], stdin=stdin, stderr=subprocess.PIPE)
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def fields(path, *arguments):
    done = subprocess.run(["tshark", "-r", path, "-T", "fields", *arguments], capture_output=True, text=True)
    return [line.split("\t") for line in done.stdout.splitlines()]


@needs_tshark
def test_tshark_lists_and_captures_through_the_extcap(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.delenv("XDG_CONFIG_HOME", raising=False)
    for name, value in environment().items():
        monkeypatch.setenv(name, value)
    folder = ran(capsys, "wireshark", "folder").out.strip()
    assert folder.startswith(str(tmp_path))
    assert ran(capsys, "wireshark", "install").status == 0
    listed = subprocess.run(["tshark", "-D"], capture_output=True, text=True).stdout
    assert "rtuscope (Modbus RTU: a port" in listed
    file = tmp_path / "bus.pcapng"
    with TeeBus() as bus, served(bus):
        port = ["-o", f"extcap.rtuscope.port:{bus.tap_port}"]
        with tshark_reading("-i", "rtuscope", *port, "-w", str(file)) as tshark:
            assert eventually(lambda: bool(programs_using(bus.tap_port)), 30)
            time.sleep(1)  # what it receives before it is set is cleared away
            poll(bus.client_port)
            said = bus.frames()
            assert eventually(lambda: len(fields(file, *FRAMES)) >= len(said), 20)
            tshark.terminate()
            told = tshark.communicate(timeout=PATIENCE_S)[1]
        assert eventually(lambda: not programs_using(bus.tap_port)), "the capture went on"
    assert b"Traceback" not in told
    assert b"rtuscope:" not in told, told  # tshark and Wireshark show it as an error
    rows = fields(file, "-Y", "mbrtu", "-e", "_ws.col.Source", "-e", "frame.p2p_dir", "-e", "mbrtu.unit_id")
    assert [row[1] for row in rows] == ["0" if direction == "request" else "1" for direction, _ in said]
    assert {row[2] for row in rows} == {"17"}
    found = fields(file, "-Y", 'frame.comment contains "warning: exception: "', "-e", "frame.number")
    assert found == [[str(len(said))]]
    assert ran(capsys, "wireshark", "remove").status == 0
    assert "rtuscope" not in subprocess.run(["tshark", "-D"], capture_output=True, text=True).stdout


@needs_tshark
def test_a_pipe_into_tshark(tmp_path):
    with TeeBus() as bus, served(bus):
        sniff = Running("sniff", bus.tap_port, "-o", "-", "--format", "pcapng")
        out = tmp_path / "bus.pcapng"
        with tshark_reading("-i", "-", "-w", str(out), stdin=sniff.process.stdout) as tshark:
            poll(bus.client_port)
            assert eventually(lambda: len(fields(out, *FRAMES)) >= len(bus.frames()), 20)
            sniff.process.send_signal(signal.SIGTERM)
            tshark.wait(PATIENCE_S)
        sniff.process.wait(PATIENCE_S)
        said = bus.frames()
    rows = fields(out, "-Y", "mbrtu", "-e", "_ws.col.Source", "-e", "_ws.col.Destination")
    assert rows == [["0.0.1.0", "0.0.0.17"] if d == "request" else ["0.0.0.17", "0.0.1.0"] for d, _ in said]


@needs_tshark
def test_what_is_found_later_is_an_empty_packet(tmp_path):
    """The request of unit 5 goes out at once; that nobody answers is known when the next one comes."""
    master, port = pty()
    sniff = Running("sniff", port, "--format", "pcapng", "-o", "-", reads=True)
    asked, answer = adu("1103006b0003"), adu("110306ae4156524340")
    for data in (asked, answer, adu("0503006b0003"), *[asked, answer] * 60):
        os.write(master, data)
        time.sleep(0.05)
    _, out, _ = sniff.ended()
    path = tmp_path / "bus.pcapng"
    path.write_bytes(out)
    assert len(fields(path, *FRAMES)) == 123
    rows = fields(path, "-Y", "frame.comment", "-e", "mbrtu.unit_id", "-e", "frame.comment")
    late = [comment for unit, comment in rows if not unit and "no-response: " in comment]
    assert late
    assert all("(unit 5, " in comment for comment in late), rows


def test_what_wireshark_asks_is_answered_in_its_words(capsys):
    asked = ran(capsys, "wireshark", "extcap", "--extcap-interface", "rtuscope", "--extcap-config")
    assert asked.out.startswith("arg {number=0}{call=--port}")
    dlts = ran(capsys, "wireshark", "extcap", "--extcap-interface", "rtuscope", "--extcap-dlts")
    assert dlts.out.startswith("dlt {number=252}")
    assert ran(capsys, "wireshark", "extcap", "--extcap-interfaces", "--extcap-version=4.4").out.startswith("extcap {")


def test_mistakes_get_one_line(capsys, tmp_path):
    assert "no port set" in refused(capsys, "wireshark", "extcap", "--capture", "--extcap-interface", "rtuscope")
    (tmp_path / "rtuscope").write_text("somebody's")
    assert "not made by rtuscope" in refused(capsys, "wireshark", "install", "--folder", tmp_path)
    assert "-o - writes frames" in refused(capsys, "sniff", "/dev/ttyS0", "-o", "-")
    assert "a recording is a file" in refused(capsys, "record", "/dev/ttyS0", "-o", "-")


def test_a_script_that_is_installed_runs_from_anywhere(capsys, tmp_path):
    assert ran(capsys, "wireshark", "install", "--folder", tmp_path).status == 0
    done = subprocess.run(
        [tmp_path / "rtuscope", "--extcap-interfaces"], capture_output=True, text=True, env=environment(), cwd="/"
    )
    assert "interface {value=rtuscope}" in done.stdout
    assert sys.executable in (tmp_path / "rtuscope").read_text()
