"""The process that reads taps: it waits for bytes, stamps them and passes them on, and does nothing else.

In a process of its own, since a busy one stamps late: gaps of milliseconds, by which frames are told apart, would be
gone. On POSIX it waits on the descriptors (`select`); elsewhere, and for ports without one, a thread a port waits in
pyserial's own blocking read. No polling, no sleep.

Its standard output carries `records`; what the listener is too slow to take is kept here. On standard input come
commands, a JSON object a line; its end ends the process. A port that goes is waited for, and opened again.
"""

from __future__ import annotations

import json
import os
import queue
import select
import signal
import sys
import threading
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, Final

from .desk import Clock, Desk
from .pipes import Commands, Pipe
from .ports import Identity
from .settings import PortSettings
from .tap import PortError, PortGoneError, Tap

_RETRY_NS: Final = 500_000_000


@dataclass
class Port:
    """One port: open, or waited for."""

    number: int
    settings: PortSettings
    desk: Desk
    blocking: bool
    wait: bool  # for a port that was never there, too
    tap: Tap | None = None
    retry_ns: int = 0
    identity: Identity = field(default_factory=Identity)
    _said: str = ""

    def open(self) -> bool:
        """Try to open it; False ends the process, since it was never there and nobody wants to wait for it."""
        settings = self.identity.found(self.settings)
        try:
            self.tap = Tap(settings, blocking=self.blocking)
        except PortError as error:
            self.retry_ns = self.desk.clock.now() + _RETRY_NS
            if not (self.wait or self.identity.known):
                self.desk.event(self.number, "failed", str(error))
                return False
            if str(error) != self._said:  # once, not twice a second
                self._said = str(error)
                self.desk.event(self.number, "waiting", f"{error}; waiting for it")
            return True
        back = self.identity.known
        self.identity.learn(settings)
        self._said = ""
        what = "is back" if back else "open"
        self.desk.event(self.number, "opened", f"{settings.url}: {what}", tap=self.tap.kind, back=back)
        self._tell_notices()
        return True

    def gone(self, error: PortGoneError) -> None:
        """It was unplugged: let go of it, and wait."""
        if self.tap is not None:
            self.tap.close()
        self.tap = None
        self.retry_ns = self.desk.clock.now() + _RETRY_NS
        self.desk.event(self.number, "lost", f"{self.settings.url}: lost ({error}); waiting for it to come back")

    def change(self, settings: PortSettings) -> None:
        """Listen with other settings."""
        self.settings = settings
        try:
            if self.tap is not None:
                self.tap.change(settings)
        except PortGoneError as error:
            self.gone(error)
        self._tell_notices()
        self.desk.listen_for(settings.silence_ns)
        self.desk.event(self.number, "settings", f"{settings.url}: {settings}", settings=settings.to_json())

    def read(self) -> int:
        """Take what has come; when that was, ns."""
        data, errors = b"", list[int]()
        if self.tap is not None:
            try:
                data, errors = self.tap.read()
            except PortGoneError as error:
                self.gone(error)
        now = self.desk.clock.now()
        self.desk.read(now, self.number, data, errors)
        return now

    def _tell_notices(self) -> None:
        if self.tap is not None:
            for notice in self.tap.notices:
                self.desk.event(self.number, "notice", notice)
            self.tap.notices.clear()


def main(arguments: str) -> None:
    """Read until standard input ends. `arguments`: JSON of ports, hold_ns, quiet_ns, idle_ns, wait, blocking."""
    given = json.loads(arguments)
    _prefer()
    clock = Clock()
    out = Pipe(blocking=os.name != "posix")
    desk = Desk(clock, out.send, hold_ns=given["hold_ns"], quiet_ns=given["quiet_ns"], idle_ns=given["idle_ns"])
    settings = [PortSettings.from_json(values) for values in given["ports"]]
    desk.listen_for(max(each.silence_ns for each in settings))
    blocking = bool(given["blocking"]) or os.name != "posix"
    ports = [Port(number, each, desk, blocking, given["wait"]) for number, each in enumerate(settings)]
    try:
        if blocking or not all(_has_descriptor(each) for each in settings):
            _by_threads(ports, desk)
        else:
            _by_waiting(ports, desk, out)
    finally:
        for port in ports:
            if port.tap is not None:
                port.tap.close()
        with suppress(OSError):
            desk.event(0, "ended", "")
            out.drain()


def _has_descriptor(settings: PortSettings) -> bool:
    return settings.is_device or settings.url.startswith("socket://")


def _by_waiting(ports: list[Port], desk: Desk, out: Pipe) -> None:
    """All ports, commands and the pipe in one wait."""
    commands = Commands()
    if not all(port.open() for port in ports):
        return
    clock, taps = desk.clock, None
    now = clock.now()
    while True:
        if taps != [port.tap for port in ports]:
            taps = [port.tap for port in ports]
            away = [port for port in ports if port.tap is None]
            by_descriptor = {p.tap.descriptor: p for p in ports if p.tap is not None and p.tap.descriptor is not None}
            waiting = [0, *by_descriptor]
        until = min([desk.deadline, *(port.retry_ns for port in away)]) if away else desk.deadline
        wait = (until - now) / 1e9
        ready, _, _ = select.select(waiting, [1] if out.waiting else [], [], wait if wait > 0 else 0)
        for descriptor in ready:
            now = by_descriptor[descriptor].read() if descriptor else clock.now()
        if 0 in ready:
            given = commands.take()
            if given is None:
                return
            _obey(given, ports)
        if not ready:
            now = clock.now()
        if desk.deadline <= now and (not ready or _quiet(by_descriptor)):
            desk.due(now)
        if out.waiting:
            out.push()
        for port in away:
            if port.retry_ns <= now and not port.open():
                return


def _quiet(by_descriptor: dict[int, Port]) -> bool:
    """Whether nothing waits to be read, so that a tick would not overtake it."""
    return not select.select([*by_descriptor], [], [], 0)[0]


def _by_threads(ports: list[Port], desk: Desk) -> None:
    """A thread a port waits in a blocking read, one for commands; this one tells what they bring, in order."""
    brought: queue.SimpleQueue[tuple[Any, ...]] = queue.SimpleQueue()
    ended = threading.Event()
    if not all(port.open() for port in ports):
        return
    for port in ports:
        threading.Thread(target=_listen, args=(port, brought, ended), daemon=True).start()
    threading.Thread(target=_command, args=(brought,), daemon=True).start()
    while True:
        now = desk.clock.now()
        try:
            item = brought.get(timeout=max(0, desk.deadline - now) / 1e9)
        except queue.Empty:
            desk.due(desk.clock.now())
            continue
        if item[0] == "end":
            ended.set()
            return
        if item[0] == "read":
            _, port, t_ns, data = item
            desk.read(t_ns, port.number, data, [])
        elif item[0] == "gone":
            _, port, error, done = item
            port.gone(error)
            done.set()
        elif item[0] == "open":
            _, port, done = item
            port.open()
            done.set()
        elif item[0] == "command":
            _obey(item[1], ports)


def _listen(port: Port, brought: queue.SimpleQueue[tuple[Any, ...]], ended: threading.Event) -> None:
    """Wait for bytes of one port; opening and telling is the main thread's."""
    clock = port.desk.clock
    while not ended.is_set():
        tap, done = port.tap, threading.Event()
        if tap is None:
            if not ended.wait(_RETRY_NS / 1e9):
                brought.put(("open", port, done))
                done.wait()
            continue
        try:
            data, _ = tap.read()
        except PortGoneError as error:
            if port.tap is tap:
                brought.put(("gone", port, error, done))
                done.wait()
            continue
        if data:
            brought.put(("read", port, clock.now(), data))


def _command(brought: queue.SimpleQueue[tuple[Any, ...]]) -> None:
    for line in sys.stdin.buffer:
        with suppress(ValueError):
            brought.put(("command", [json.loads(line)]))
    brought.put(("end",))


def _obey(commands: list[dict[str, Any]], ports: list[Port]) -> None:
    for command in commands:
        ports[command["port"]].change(PortSettings.from_json(command["settings"]))


def _prefer() -> None:
    """Be scheduled before others, where that is allowed; Ctrl-C is the listener's business."""
    for name in ("SIGINT", "SIGHUP", "SIGTERM"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    with suppress(AttributeError, OSError, ValueError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
