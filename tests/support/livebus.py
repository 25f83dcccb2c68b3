"""A bus of pseudo-terminals with a tap: what a client and servers say to each other, and what they said for certain."""

from __future__ import annotations

import atexit
import contextlib
import os
import select
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from running import PATIENCE_S, START, environment
from scripts import script


def raw_pty() -> tuple[int, int]:
    """Both ends of a raw pseudo-terminal, master and slave; where there are none the test is skipped."""
    tty = pytest.importorskip("tty", reason="pseudo-terminals are POSIX")
    master, slave = os.openpty()
    tty.setraw(slave)
    return master, slave


def pty() -> tuple[int, str]:
    """A raw pseudo-terminal: the master's descriptor, and the name of what a port would be. Its slave stays open."""
    master, slave = raw_pty()
    _SLAVES.append(slave)
    return master, os.ttyname(slave)


_SLAVES: list[int] = []


@contextlib.contextmanager
def busy_port() -> Iterator[str]:
    """The name of a pseudo-terminal at which a client asks a unit again and again."""
    master, name = pty()
    over = threading.Event()

    def talk() -> None:
        while not over.is_set():
            for octets in ("1103006b00037687", "110306ae415652434049ad"):
                with contextlib.suppress(BlockingIOError):  # nobody listens yet
                    os.write(master, bytes.fromhex(octets))
                time.sleep(0.02)
            time.sleep(0.1)

    os.set_blocking(master, False)
    thread = threading.Thread(target=talk)
    thread.start()
    try:
        yield name
    finally:
        over.set()
        thread.join()


@dataclass
class TeeBus:
    """A client's port, a server's port, and a tap that hears both at the pace of the line.

    `said` is the truth: (from the client?, bytes), turn by turn.
    """

    character_s: float = 0.0
    burst: int = 8  # bytes that the tap gets at once, as from a FIFO
    said: list[tuple[bool, bytearray]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._masters = []
        names = []
        for _ in range(3):
            master, name = pty()
            os.set_blocking(master, False)
            self._masters.append(master)
            names.append(name)
        self.client_port, self.server_port, self.tap_port = names
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run)

    def __enter__(self) -> TeeBus:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()
        for master in self._masters:
            os.close(master)

    def frames(self) -> list[tuple[str, str]]:
        """(direction, hex) of each turn."""
        return [("request" if client else "response", bytes(data).hex()) for client, data in self.said]

    def _run(self) -> None:
        client, server, tap = self._masters
        while not self._stop.is_set():
            ready, _, _ = select.select([client, server], [], [], 0.05)
            for source in ready:
                with contextlib.suppress(BlockingIOError):
                    data = os.read(source, 4096)
                    self._pass_on(data, server if source == client else client, tap, from_client=source == client)

    def _pass_on(self, data: bytes, target: int, tap: int, *, from_client: bool) -> None:
        if not self.said or self.said[-1][0] != from_client:
            self.said.append((from_client, bytearray()))
        self.said[-1][1].extend(data)
        due = time.monotonic()
        for at in range(0, len(data), self.burst):
            part = data[at : at + self.burst]
            due += len(part) * self.character_s
            while (left := due - time.monotonic()) > 0:
                time.sleep(left)
            os.write(tap, part)
        os.write(target, data)


@contextlib.contextmanager
def served(bus: TeeBus) -> Iterator[None]:
    """A pymodbus server with units 1, 2 and 17 on the bus."""
    with script("record_samples").serving(bus):
        yield


class Running:
    """A command in a process of its own, listening. `out` is its standard output so far, where `reads` says so."""

    def __init__(self, *arguments: str | Path, reads: bool = False) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-c", START, *map(str, arguments)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            env=environment(),
        )
        atexit.register(self.process.kill)  # a test that fails leaves nobody behind who listens
        assert self.process.stdout is not None and self.process.stderr is not None
        self.stdout, self.stderr = self.process.stdout, self.process.stderr
        self.out = bytearray()
        self._reader = threading.Thread(target=self._read) if reads else None
        if self._reader is not None:
            self._reader.start()
        self.said: list[bytes] = []
        while not self.said or b"listening" not in self.said[-1]:
            self.said.append(self.process.stderr.readline())
            assert self.said[-1], f"the command ended: {self.said}"

    def ended(self, number: int | None = signal.SIGTERM) -> tuple[int, bytes, str]:
        """Status, output and what was said after it got this signal; None: it ends by itself."""
        if number is not None:
            self.process.send_signal(number)
        if self._reader is None:
            out, said = self.process.communicate(timeout=PATIENCE_S)
        else:
            assert self.process.stderr is not None
            out, said = b"", self.process.stderr.read()
            self._reader.join(PATIENCE_S)
            self.process.wait(PATIENCE_S)
        return self.process.returncode, bytes(self.out) + out, b"".join([*self.said, said]).decode()

    def _read(self) -> None:
        assert self.process.stdout is not None
        while data := os.read(self.process.stdout.fileno(), 1 << 16):
            self.out += data


def eventually(what: Callable[[], bool], seconds: float = PATIENCE_S) -> bool:
    """Whether it becomes true in time."""
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        if what():
            return True
        time.sleep(0.01)
    return what()
