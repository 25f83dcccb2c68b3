"""`rtuscope open` and `demo` as users start them: on a terminal, on a pipe, in a browser."""

from __future__ import annotations

import os
import select
import shutil
import signal
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest
from running import ran, refused

from captures import samples

_ROOT = Path(__file__).parents[1]
posix = pytest.mark.skipif(os.name != "posix", reason="ptys are POSIX")


class Terminal:
    """A command on a pty of 100x30."""

    def __init__(self, *arguments: str, term: str = "xterm-256color") -> None:
        import fcntl
        import pty
        import struct
        import termios

        self.pid, self.fd = pty.fork()
        if self.pid == 0:
            os.environ.update(TERM=term, PYTHONPATH=str(_ROOT))
            os.execv(sys.executable, [sys.executable, "-m", "analyzer.cli", *arguments])
        fcntl.ioctl(self.fd, termios.TIOCSWINSZ, struct.pack("HHHH", 30, 100, 0, 0))
        self.seen = b""

    def until(self, wanted: bytes, seconds: float = 60) -> None:
        end = time.monotonic() + seconds
        while wanted not in self.seen:
            assert time.monotonic() < end, self.seen[-2000:]
            if select.select([self.fd], [], [], 0.2)[0]:
                try:
                    self.seen += os.read(self.fd, 1 << 16)
                except OSError:
                    break
        assert wanted in self.seen, self.seen[-2000:]

    def status(self, seconds: float = 30) -> int:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            if select.select([self.fd], [], [], 0.05)[0]:
                with suppress(OSError):
                    self.seen += os.read(self.fd, 1 << 16)
            pid, status = os.waitpid(self.pid, os.WNOHANG)
            if pid:
                return os.waitstatus_to_exitcode(status)
        os.kill(self.pid, signal.SIGKILL)
        raise AssertionError("it did not end")


@posix
def test_a_capture_opens_on_a_terminal_and_q_leaves(tmp_path: Path) -> None:
    shutil.copy(samples.path("troubled.jsonl"), tmp_path / "bus.jsonl")
    terminal = Terminal("open", str(tmp_path / "bus.jsonl"))
    terminal.until(b"holding registers")
    os.write(terminal.fd, b"q")
    assert terminal.status() == 0
    assert [file.name for file in tmp_path.iterdir()] == ["bus.jsonl"]


@posix
def test_without_a_capture_it_is_a_prompt_and_ctrl_c_hints_how_to_leave() -> None:
    terminal = Terminal("open")
    terminal.until(b"paste or type bytes")
    os.write(terminal.fd, b"\x1b[200~11 03 00 6B\n00 03 76 87\x1b[201~")
    terminal.until(b"unit 17")
    os.write(terminal.fd, b"\x1b")
    time.sleep(0.3)
    os.write(terminal.fd, b"\x11")  # Ctrl+Q
    assert terminal.status() == 0


@posix
def test_the_demo_opens_the_sample_on_a_terminal() -> None:
    terminal = Terminal("demo")
    terminal.until(b"troubled.jsonl")
    os.write(terminal.fd, b"q")
    assert terminal.status() == 0
    assert not list(samples.path("troubled.jsonl").parent.glob("*.rtuscope.json"))


def test_the_demo_reports_on_a_pipe(capsys: pytest.CaptureFixture[str]) -> None:
    done = ran(capsys, "demo")
    assert done.status == 0 and done.out.startswith("capture")


def test_limits_are_checked_and_go_along_to_the_browser(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = samples.path("healthy.jsonl")
    assert "longer than --t35-ms" in refused(capsys, "open", path, "--t15-ms", "3", "--t35-ms", "2")
    given: list[str] = []

    class Server:
        def __init__(self, command: str, **_: object) -> None:
            given.append(command)

        def serve(self) -> None:
            pass

    monkeypatch.setattr("textual_serve.server.Server", Server)
    ran(capsys, "open", path, "--web", "--t35-ms", "2.5", "--idle-ms", "20")
    assert given[0].endswith("--t35-ms 2.5 --idle-ms 20")


def test_a_pipe_is_no_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    assert "needs a terminal" in refused(capsys, "open", samples.path("troubled.jsonl"))


def test_what_cannot_be_opened_is_said_before_the_screen_is_taken(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert "no such file" in refused(capsys, "open", tmp_path / "missing.jsonl")


@contextmanager
def served(*arguments: str) -> Iterator[int]:
    """The interface in a browser's reach; its port."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = int(probe.getsockname()[1])
    command = [sys.executable, "-m", "analyzer.cli", "open", *arguments, "--web", "--port", str(port)]
    environment = {**os.environ, "PYTHONPATH": str(_ROOT)}
    server = subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        for _ in range(200):
            with socket.socket() as client:
                if client.connect_ex(("127.0.0.1", port)) == 0:
                    break
            time.sleep(0.1)
        yield port
    finally:
        server.send_signal(signal.SIGINT)
        try:
            server.wait(10)
        except subprocess.TimeoutExpired:
            server.kill()
            server.wait()


@posix
def test_in_a_browser_it_listens_on_loopback_only_and_shows_the_capture() -> None:
    pytest.importorskip("textual_serve")
    import asyncio

    aiohttp = pytest.importorskip("aiohttp")

    async def shown(port: int) -> bytes:
        seen = b""
        async with aiohttp.ClientSession() as session, session.ws_connect(
            f"http://127.0.0.1:{port}/ws?width=100&height=30"
        ) as socket:  # fmt: skip
            while b"holding registers" not in seen:
                message = await asyncio.wait_for(socket.receive(), 60)
                if message.type not in (aiohttp.WSMsgType.BINARY, aiohttp.WSMsgType.TEXT):
                    break
                seen += message.data if isinstance(message.data, bytes) else message.data.encode()
        return seen

    with served(str(samples.path("troubled.jsonl"))) as port:
        page = urllib.request.urlopen(f"http://127.0.0.1:{port}/", timeout=20).read()
        assert b"textual" in page.lower()
        assert b"holding registers" in asyncio.run(shown(port))
        address = _other_address()
        if address is not None:
            with socket.socket() as client:
                client.settimeout(2)
                assert client.connect_ex((address, port)) != 0


def _other_address() -> str | None:
    """An address of this machine other than loopback."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(("192.0.2.1", 9))
        except OSError:
            return None
        address = str(probe.getsockname()[0])
    return None if address.startswith("127.") else address


def test_without_its_extra_the_browser_is_refused_in_one_line(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "textual_serve.server", None)
    assert "rtuscope[web]" in refused(capsys, "open", samples.path("troubled.jsonl"), "--web")


@posix
def test_a_terminal_that_places_no_text_gets_the_report() -> None:
    terminal = Terminal("demo", term="dumb")
    terminal.until(b"what costs this bus")
    assert b"\x1b" not in terminal.seen
    assert terminal.status() == 0
