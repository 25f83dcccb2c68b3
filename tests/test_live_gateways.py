"""Gateways that restart, hang and vanish: listening goes on, another port is not held up, an end has its reason."""

import contextlib
import os
import signal
import socket
import threading
import time
from pathlib import Path

import pytest
from livebus import Running, eventually, pty

import captures
from captures.chunks import Block
from captures.live.gateway import CONNECT_S
from captures.live.listening import Listening
from captures.live.settings import PortSettings
from captures.live.tap import PortError
from captures.live.wire import PortEvent
from captures.recording.notes import read

REQUEST = bytes.fromhex("1103006b00037687")


class Gateway:
    """A server in raw TCP that sends so many requests to each client, without a pause, and then hangs up."""

    def __init__(self, requests=200):
        self._requests = requests
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.url = f"socket://127.0.0.1:{self.listener.getsockname()[1]}"
        self.connections, self.sent, self.received = 0, 0, b""
        threading.Thread(target=self._serve, daemon=True).start()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.listener.close()

    def _serve(self):
        while True:
            try:
                connection, _ = self.listener.accept()
            except OSError:
                return
            self.connections += 1
            with connection, contextlib.suppress(OSError):
                for _ in range(self._requests):
                    connection.sendall(REQUEST)
                    self.sent += len(REQUEST)
                    time.sleep(0.001)
                connection.setblocking(False)
                self.received += connection.recv(100)


@pytest.mark.parametrize("blocking", [False, True])
def test_a_gateway_that_restarts_while_the_line_is_busy_is_listened_to_on_and_on(blocking):
    with Gateway() as gateway, Listening([PortSettings(gateway.url)], blocking=blocking) as listening:
        events, heard = [], 0
        for item in listening.items():
            if isinstance(item, PortEvent):
                events.append(item.kind)
            if isinstance(item, Block):
                heard += len(item.data)
            if gateway.connections == 5:
                listening.close()
    assert events[:7] == ["opened", "lost"] * 3 + ["opened"]
    assert heard >= 4 * 200 * len(REQUEST)  # no byte of a connection that was is missing
    assert gateway.received == b""  # nothing is ever sent


def test_two_gateways_that_restart_at_once_are_both_heard_on():
    heard = [0, 0]
    with Gateway(50) as one, Gateway(50) as two, Listening([PortSettings(g.url) for g in (one, two)]) as listening:
        for item in listening.items():
            if isinstance(item, Block):
                for port in (0, 1):
                    heard[port] += int((item.port == port).sum())
            if min(one.connections, two.connections) == 5:
                listening.close()
    assert min(heard) > 0


@pytest.mark.skipif(os.name != "posix", reason="needs POSIX signals")
@pytest.mark.parametrize("command", ["sniff", "record"])
def test_a_command_outlives_its_gateways_restarts(tmp_path, command):
    with Gateway() as gateway:
        running = Running(command, gateway.url, "-o", tmp_path / "bus.mcap")
        assert eventually(lambda: gateway.connections >= 4)
        status, _, words = running.ended()
    assert status == 0 or "ended before all was shown" in words, words  # the latter where a machine is behind
    capture = captures.open(tmp_path / "bus.mcap")
    heard = sum(len(chunk.data) for chunk in capture.chunks())
    assert heard >= 3 * 200 * len(REQUEST)
    kinds = [note.kind for note in read(tmp_path / "bus.mcap") if note.kind in ("opened", "lost")]
    assert kinds[:6] == ["opened", "lost"] * 3


@contextlib.contextmanager
def unanswering():
    """The address of a server that never completes a connection: its queue is full."""
    listener = socket.socket()
    listener.bind(("127.0.0.1", 0))
    listener.listen(0)
    address = listener.getsockname()
    waiting = []
    for _ in range(4):
        client = socket.socket()
        client.setblocking(False)
        client.connect_ex(address)
        waiting.append(client)
    yield f"socket://127.0.0.1:{address[1]}"
    for each in (*waiting, listener):
        each.close()


@pytest.mark.skipif(os.name != "posix", reason="pseudo-terminals are POSIX")
@pytest.mark.parametrize("blocking", [False, True])
def test_a_connection_that_hangs_does_not_hold_up_the_other_port(blocking):
    master, name = pty()
    with unanswering() as url:
        ports = [PortSettings(name, 19200), PortSettings(url)]
        with Listening(ports, wait=True, blocking=blocking) as listening:
            delays, sent = [], 0.0
            for item in listening.items():
                if isinstance(item, PortEvent) and item.kind == "opened":
                    time.sleep(0.3)  # the other port is being connected to
                if isinstance(item, Block):
                    delays.append(time.monotonic() - sent)
                if isinstance(item, Block) or (isinstance(item, PortEvent) and item.kind == "opened"):
                    sent = time.monotonic()
                    os.write(master, REQUEST)
                if len(delays) == 8:
                    begun = time.monotonic()
                    listening.close()
            assert time.monotonic() - begun < CONNECT_S / 2  # nor the end
    assert max(delays) < CONNECT_S / 2


def test_a_reader_that_fails_is_an_error_with_its_reason():
    with Gateway() as gateway, Listening([PortSettings(gateway.url)]) as listening:
        listening.change(7, PortSettings("no such port"))
        with pytest.raises(PortError, match="the process that reads the port failed: IndexError"):
            list(listening.items())


@pytest.mark.skipif(os.name != "posix", reason="needs POSIX signals and /proc")
@pytest.mark.skipif(not Path("/proc/self").exists(), reason="the reader's process is looked up in /proc")
@pytest.mark.parametrize("command", ["sniff", "record"])
def test_a_reader_that_dies_ends_the_command_with_an_error_and_a_whole_recording(tmp_path, command):
    with Gateway(10_000) as gateway:
        running = Running(command, gateway.url, "-o", tmp_path / "bus.mcap")
        assert eventually(lambda: gateway.sent > 100)
        time.sleep(0.3)
        pid = running.process.pid
        (reader,) = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
        os.kill(int(reader), signal.SIGKILL)
        status, _, words = running.ended(None)
    assert status == 2
    assert "the process that reads the port ended" in words
    assert "Traceback" not in words
    assert [path.name for path in tmp_path.iterdir()] == ["bus.mcap"]
    assert not captures.open(tmp_path / "bus.mcap").damage


def test_a_gateway_that_was_never_there_is_an_error():
    with Listening([PortSettings("socket://127.0.0.1:1")]) as listening, pytest.raises(PortError, match="refused"):
        list(listening.items())
