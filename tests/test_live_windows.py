"""What Windows has that others have not; and any pair of ports that is wired crosswise, as com0com makes them."""

import ctypes
import os
import threading
from importlib import import_module

import pytest
import serial
from serial.tools import list_ports

from analyzer.cli.terminal import coloured, places
from captures.chunks import Block
from captures.errors import CaptureError
from captures.files import replacing
from captures.line import LineSettings
from captures.live import ports, tap
from captures.live.listening import Listening
from captures.live.settings import PortSettings
from captures.live.wire import PortEvent, Tick
from captures.recording.recorder import Recorder

windows = pytest.mark.skipif(os.name != "nt", reason="names and consoles of Windows")
PAIR = os.environ.get("RTUSCOPE_TEST_PAIR", "")  # COM1,COM2
REQUEST = bytes.fromhex("1103006b00037687")


class WindowsPort:
    """pyserial's port as it answers on Windows: each read is as told."""

    def __init__(self, **_):
        self.answers = []

    def open(self):
        """Nothing to be done."""

    close = open
    in_waiting = 0

    def read(self, _):
        answer = self.answers.pop(0)
        if isinstance(answer, bytes):
            return answer
        raise serial.SerialException(f"GetOverlappedResult failed (OSError(22, 'words', None, {answer}))")


def test_a_read_that_times_out_is_no_loss(monkeypatch):
    monkeypatch.setattr(tap, "_POSIX", False)
    monkeypatch.setattr(tap, "_port_class", lambda: WindowsPort)
    port = tap.DeviceTap(PortSettings("COM3", 9600), blocking=True)
    port._port.answers = [1460, b"\x11", 1460, 22]
    assert [port.read()[0] for _ in range(3)] == [b"", b"\x11", b""]
    with pytest.raises(tap.PortGoneError, match="words"):  # error 22: unplugged
        port.read()


def test_a_list_of_adapters_that_fails_ends_nothing(monkeypatch):
    def fails():
        raise AttributeError("function 'CM_MapCrToWin32Err' not found")

    monkeypatch.setattr(list_ports, "comports", fails)
    identity, settings = ports.Identity(), PortSettings("COM3", 9600)
    identity.learn(settings)
    assert identity.found(settings) == settings
    with pytest.raises(tap.PortError, match="cannot be listed: AttributeError: function 'CM_"):
        ports.ports()


@windows
@pytest.mark.parametrize("name", ["com1.mcap", "COM3", "nul.mcap", "lpt1.csv"])
def test_a_file_is_not_named_as_a_port(name, tmp_path):
    words = f"on Windows this name means the device {name.split('.')[0].upper()}: give another"
    with pytest.raises(CaptureError, match=words), replacing(tmp_path / name):
        raise AssertionError("it was opened")
    with pytest.raises(CaptureError, match=words):
        Recorder(tmp_path / f"{name.split('.')[0]}.mcap", LineSettings(9600))


@windows
def test_what_goes_nowhere_is_no_terminal():
    with replacing("NUL") as nowhere:
        nowhere.write(b"anything")
    with open(os.devnull, "w", encoding="utf-8") as nowhere:  # noqa: PTH123
        assert nowhere.isatty()
        assert not places(nowhere)
        assert not coloured(nowhere)


@windows
def test_a_console_is_told_to_obey_escape_sequences(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("TERM", raising=False)
    try:
        console = open("CONOUT$", "w", encoding="utf-8")  # noqa: PTH123, SIM115
    except OSError:
        pytest.skip("no console here")
    mode, handle = ctypes.c_ulong(), import_module("msvcrt").get_osfhandle(console.fileno())
    with console:
        assert places(console)
        assert vars(ctypes)["windll"].kernel32.GetConsoleMode(handle, ctypes.byref(mode))
    assert mode.value & 4  # ENABLE_VIRTUAL_TERMINAL_PROCESSING


@pytest.mark.skipif(not PAIR, reason="RTUSCOPE_TEST_PAIR=COM1,COM2 names no pair of ports that are wired crosswise")
def test_what_goes_in_at_one_port_is_heard_at_the_other_and_a_pause_is_no_loss():
    heard, sender = PAIR.split(",")
    port = serial.Serial(None, 9600, timeout=1)
    port.port, port.rts, port.dtr = sender, False, False
    port.open()
    got, events = b"", []
    with port, Listening([PortSettings(heard, 9600)]) as listening:
        for item in listening.items():
            if isinstance(item, PortEvent):
                events.append(item.kind)
            got += item.data.tobytes() if isinstance(item, Block) else b""
            if len(got) == 3 * len(REQUEST):
                listening.close()
            elif not isinstance(item, Tick) and events[-1] == "opened" and not len(got) % len(REQUEST):
                threading.Timer(0.6, port.write, (REQUEST,)).start()
    assert got == 3 * REQUEST
    assert events == ["opened"]
