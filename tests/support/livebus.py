"""A bus of pseudo-terminals with a tap: what a client and servers say to each other, and what they said for certain."""

from __future__ import annotations

import contextlib
import os
import select
import threading
import time
import tty
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from scripts import script


def pty() -> tuple[int, str]:
    """A raw pseudo-terminal: the master's descriptor, and the name of what a port would be. Its slave stays open."""
    master, slave = os.openpty()
    tty.setraw(slave)
    _SLAVES.append(slave)
    return master, os.ttyname(slave)


_SLAVES: list[int] = []


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


def eventually(what: Callable[[], bool], seconds: float = 10.0) -> bool:
    """Whether it becomes true in time."""
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        if what():
            return True
        time.sleep(0.01)
    return what()
