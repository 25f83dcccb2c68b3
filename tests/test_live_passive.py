"""A tap is passive: RTS and DTR low from the first moment on, a port that a program has open is not touched."""

import errno
import os
import re
import shutil
import stat
import struct
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from livebus import pty
from running import START, environment, ran

from captures.chunks import Block
from captures.live import ports, tap
from captures.live.listening import Listening
from captures.live.settings import PortSettings
from captures.live.tap import DeviceTap, PortError
from captures.live.wire import PortEvent

fcntl = pytest.importorskip("fcntl", reason="elsewhere pyserial opens the port")
termios = pytest.importorskip("termios", reason="elsewhere pyserial opens the port")
RTS, DTR = 0x004, 0x002


class Uart:
    """A pseudo-terminal with the modem lines of a 16550A, as Linux drives them: each open raises both.

    `raised_by_settings`: a driver that raises them with each change of settings, too. `stuck` stay high whatever is
    asked. `calls` tells what was done to the device, in order.
    """

    def __init__(self, patch, *, raised_by_settings=False, stuck=0, refuses=False):
        _, self.name = pty()
        self.calls, self.lines, self.descriptors = [], 0, set()
        self._stuck, self._refuses, self._raised_by_settings = stuck, refuses, raised_by_settings
        self._real = SimpleNamespace(
            open=os.open, ioctl=fcntl.ioctl, tcsetattr=termios.tcsetattr, flock=fcntl.flock, close=os.close
        )
        patch.setattr(os, "open", self.open)
        patch.setattr(os, "close", self.close)
        patch.setattr(fcntl, "ioctl", self.ioctl)
        patch.setattr(fcntl, "flock", self.flock)
        patch.setattr(termios, "tcsetattr", self.tcsetattr)
        patch.setattr(tap, "port_kind", lambda _: "uart")

    def open(self, path, flags, *more, **named):
        descriptor = self._real.open(path, flags, *more, **named)
        if path == self.name:
            self.calls.append("open")
            assert flags & os.O_ACCMODE == os.O_RDONLY
            assert flags & os.O_NONBLOCK
            assert flags & os.O_NOCTTY
            self.descriptors.add(descriptor)
            self.lines = RTS | DTR
        return descriptor

    def close(self, descriptor):
        if descriptor in self.descriptors:
            self.descriptors.remove(descriptor)
            self.calls.append("close")
        self._real.close(descriptor)

    def flock(self, descriptor, operation):
        self.calls.append("lock")
        self._real.flock(descriptor, operation)

    def ioctl(self, descriptor, request, *more):
        if descriptor in self.descriptors and request in (termios.TIOCMBIC, termios.TIOCMGET, termios.TIOCMBIS):
            if self._refuses:
                raise OSError(errno.ENOTTY, "Inappropriate ioctl for device")
            if request == termios.TIOCMBIC:
                (lines,) = struct.unpack("i", more[0])
                self.lines = self.lines & ~lines | self._stuck
                self.calls.append("low" if lines == RTS | DTR else "one low")
            else:
                assert request == termios.TIOCMGET
                self.calls.append("read back")
            return struct.pack("i", self.lines)
        return self._real.ioctl(descriptor, request, *more)

    def tcsetattr(self, descriptor, *more):
        self._real.tcsetattr(descriptor, *more)
        if descriptor in self.descriptors:
            first = "no echo" not in self.calls and "open" in self.calls
            self.calls.append("no echo" if first else "settings")
            assert not more[1][3] & (termios.ECHO | termios.ECHONL)
            if self._raised_by_settings:
                self.lines |= RTS | DTR


@pytest.mark.parametrize("blocking", [False, True])
@pytest.mark.parametrize("raised_by_settings", [False, True])
def test_both_lines_are_low_at_once_and_after_each_change(monkeypatch, raised_by_settings, blocking):
    uart = Uart(monkeypatch, raised_by_settings=raised_by_settings)
    device = DeviceTap(PortSettings(uart.name, 9600), blocking=blocking)
    assert uart.calls[:4] == ["open", "lock", "no echo", "low"]  # nothing else is set before
    assert uart.calls.count("open") == 1
    assert uart.calls[-2:] == ["low", "read back"]
    assert uart.lines == 0
    for baud, parity in ((19200, "E"), (76800, "N"), (250000, "O")):
        uart.calls.clear()
        device.change(PortSettings(uart.name, baud, parity))
        assert uart.lines == 0
        assert "open" not in uart.calls
        assert uart.calls[-1] == "read back"
        assert re.fullmatch(r"((settings )?low )+read back", " ".join(uart.calls))
    assert not [notice for notice in device.notices if "high" in notice]
    device.close()
    assert uart.calls.count("close") == 1


def test_both_lines_are_low_again_when_an_adapter_comes_back(monkeypatch):
    uart = Uart(monkeypatch)
    for _ in range(2):
        DeviceTap(PortSettings(uart.name, 9600)).close()
        assert uart.calls[:4] == ["open", "lock", "no echo", "low"]
        assert uart.lines == 0
        uart.calls.clear()


@pytest.mark.parametrize(
    ("stuck", "words"),
    [(RTS, "RTS stays high"), (DTR, "DTR stays high"), (RTS | DTR, "RTS and DTR stay high")],
)
def test_a_line_that_stays_high_is_told_once(monkeypatch, stuck, words):
    uart = Uart(monkeypatch, stuck=stuck)
    device = DeviceTap(PortSettings(uart.name, 9600))
    device.change(PortSettings(uart.name, 19200))
    assert [words in notice and "BLOCKS THE BUS" in notice for notice in device.notices] == [True]
    device.close()


def test_lines_that_cannot_be_read_back_are_told(monkeypatch):
    uart = Uart(monkeypatch, refuses=True)
    device = DeviceTap(PortSettings(uart.name, 9600))
    assert ["cannot check that RTS and DTR are low" in notice for notice in device.notices] == [True]
    device.close()


def test_a_port_that_another_program_has_locked_keeps_its_lines(monkeypatch):
    uart = Uart(monkeypatch)
    other = os.open(uart.name, os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY)
    fcntl.flock(other, fcntl.LOCK_EX | fcntl.LOCK_NB)
    uart.calls.clear()
    with pytest.raises(PortError, match="in use by another program"):
        DeviceTap(PortSettings(uart.name, 9600))
    assert uart.calls == ["open", "lock", "close"]
    os.close(other)


def test_a_port_that_a_program_has_open_is_not_even_opened(monkeypatch):
    uart = Uart(monkeypatch)
    code = "import os, sys, time; os.open(sys.argv[1], os.O_RDWR | os.O_NOCTTY); print('', flush=True); time.sleep(60)"
    with subprocess.Popen([sys.executable, "-c", code, uart.name], stdout=subprocess.PIPE) as other:
        assert other.stdout is not None
        other.stdout.readline()
        with pytest.raises(PortError, match=rf"in use by python[\d.]* \({other.pid}\): close it first"):
            DeviceTap(PortSettings(uart.name, 9600))
        other.kill()
    assert uart.calls == []


def test_a_port_that_fails_while_it_is_set_up_is_closed_once(monkeypatch):
    from captures.live.readonly import ReadOnlyPort

    def fails(_):
        raise OSError(errno.EIO, "Input/output error")

    uart = Uart(monkeypatch)
    monkeypatch.setattr(ReadOnlyPort, "_set_modes", fails)
    with pytest.raises(PortError):
        DeviceTap(PortSettings(uart.name, 9600))
    assert uart.calls.count("open") == uart.calls.count("close") == 1


@pytest.mark.skipif(not shutil.which("strace"), reason="strace is not installed")
def test_the_system_calls_of_a_sniffer_are_those_of_a_tap(tmp_path):
    """What the kernel is really asked: one open, for reading; lines lowered before settings and after; no write."""
    _, name = pty()
    command = [sys.executable, "-c", START, "sniff", name, "--baud", "9600", "--duration", "5s"]
    calls = "trace=open,openat,ioctl,write,writev,pwrite64,flock,fcntl,dup,dup2,dup3"
    trace = ["strace", "-f", "-yy", "-e", calls, "-o", str(tmp_path / "trace"), *command]
    subprocess.run(trace, env=environment(), capture_output=True, check=False)
    lines = [line for line in (tmp_path / "trace").read_text(errors="replace").splitlines() if "resumed>" not in line]
    opens = [n for n, line in enumerate(lines) if "open" in line and f'"{name}"' in line]
    assert len(opens) == 1
    assert "O_RDONLY|O_NOCTTY|O_NONBLOCK" in lines[opens[0]]
    asked = [line for line in lines[opens[0] + 1 :] if f"<{name}" in line.partition(",")[0]]
    assert "flock(" in asked[0]
    words = [(word[0], line) for line in asked[1:] if (word := re.search(r"TIOC\w+|TC\w+", line))]
    steps = [(word, line) for word, line in words if word != "TCGETS"]  # to ask changes nothing
    assert [word for word, _ in steps[:4]] == ["TCSETS", "TCFLSH", "TIOCMBIC", "TIOCEXCL"]
    assert not re.search(r"\bECHO\b", steps[0][1])
    sets = [n for n, (word, _) in enumerate(steps) if word.startswith("TCSET")]
    assert len(sets) >= 3
    assert all("TIOCMBIC" in [word for word, _ in steps[n + 1 : n + 3]] for n in sets)
    assert [word for word, _ in steps[-2:]] == ["TIOCMBIC", "TIOCMGET"]
    assert not [line for line in asked if "write" in line.partition("(")[0]]


def test_what_a_fresh_device_receives_is_not_sent_back():
    """Until somebody says otherwise the kernel echoes what a serial port receives, as to a typist."""
    master, slave = os.openpty()
    modes = termios.tcgetattr(slave)
    assert modes[3] & termios.ECHO
    os.set_blocking(master, False)
    with Listening([PortSettings(os.ttyname(slave), 9600)]) as listening:
        heard = b""
        for item in listening.items():
            if isinstance(item, PortEvent) and item.kind == "opened":
                os.write(master, b"\x11\x03\x00\x6b\x00\x03\x76\x87\r\n")
            heard += item.data.tobytes() if isinstance(item, Block) else b""
            if len(heard) == 10:
                listening.close()
    with pytest.raises(BlockingIOError):
        os.read(master, 100)
    os.close(master)
    os.close(slave)


def permission_denied(monkeypatch, group, mode):
    """A device that this user may not open, of this group."""
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setattr(Path, "group", lambda _: group)
    monkeypatch.setattr(Path, "stat", lambda *_, **__: SimpleNamespace(st_mode=stat.S_IFCHR | mode))


@pytest.mark.parametrize("group", ["root", "disk", "sudo", "wheel", "docker", "adm", "tty", "shadow", "kmem"])
def test_nobody_is_sent_into_a_group_that_is_not_for_serial_ports(monkeypatch, group):
    permission_denied(monkeypatch, group, 0o660)
    for advice in (tap.access_advice("/dev/ttyX"), tap.refusal("/dev/ttyX", PermissionError(errno.EACCES, "no"))):
        assert "usermod" not in advice
        assert group not in advice.replace("root)", "").split()
        assert "udev rule" in advice


def test_a_group_that_is_for_serial_ports_is_named_where_it_helps(monkeypatch):
    permission_denied(monkeypatch, "dialout", 0o660)
    assert tap.access_advice("/dev/ttyX") == "`sudo usermod -aG dialout $USER`, then log in again"
    permission_denied(monkeypatch, "dialout", 0o600)
    assert "usermod" not in tap.access_advice("/dev/ttyX")
    monkeypatch.setattr(sys, "platform", "darwin")
    assert "usermod" not in tap.access_advice("/dev/ttyX")


@pytest.mark.parametrize(("group", "words"), [("root", "udev rule"), ("uucp", "usermod -aG uucp $USER")])
def test_ports_advises_what_the_device_needs(monkeypatch, capsys, group, words):
    from serial.tools import list_ports

    port = SimpleNamespace(
        device="/dev/ttyX", name="ttyX", description="n/a", vid=None, pid=None, serial_number=None, manufacturer=None
    )
    monkeypatch.setattr(list_ports, "comports", lambda: [port])
    monkeypatch.setattr(ports, "may_listen", lambda _: False)
    permission_denied(monkeypatch, group, 0o660)
    out = ran(capsys, "ports").out
    assert words in out
    assert "-aG root" not in out
