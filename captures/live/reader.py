"""The process that reads taps: it waits for bytes, stamps them and passes them on, and does nothing else.

In a process of its own, since a busy one stamps late: gaps of milliseconds, by which frames are told apart, would be
gone. On POSIX it waits on the descriptors; elsewhere a thread a port waits in pyserial's own blocking
read. No polling, no sleep. A port that goes is waited for, and opened again by a thread aside.

Its standard output carries records (`batching`); what the listener is too slow to take is kept here. On standard input
come commands, a JSON object a line; its end ends the process, with an event `ended`, and so does the end of all that
there was to listen to. Any other end is an event `failed`.
"""

from __future__ import annotations

import json
import os
import queue
import select
import signal
import sys
import threading
from collections.abc import Collection, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, Final

from .batching import Commands, Pipe, ReadBatching, SteadyClock
from .confinement import confine
from .ports import Attempts, Identity
from .settings import PortSettings
from .tap import PortError, PortGoneError, Tap

if sys.platform == "linux":
    _GONE = select.EPOLLHUP | select.EPOLLERR

    class Waiting:
        """`terminals` are told once each time that more has come, and must be read empty then; `others`, as long as
        there is something; `writable`, as long as there is room."""

        def __init__(self, terminals: Collection[int], others: Collection[int], writable: Collection[int]) -> None:
            self._terminals = frozenset(terminals)
            self._epoll = select.epoll()
            for descriptor in terminals:
                self._epoll.register(descriptor, select.EPOLLIN | select.EPOLLET)
            for descriptor in others:
                self._epoll.register(descriptor, select.EPOLLIN)
            for descriptor in writable:
                self._epoll.register(descriptor, select.EPOLLOUT)

        def ready(self, wait_s: float) -> list[int]:
            """Those with something, or room, as soon as there are any; none after so long."""
            ready = []
            for descriptor, events in self._epoll.poll(wait_s):
                ready.append(descriptor)
                if events & _GONE and descriptor in self._terminals:  # behind what it still has: told until let go of
                    self._epoll.modify(descriptor, select.EPOLLIN)
            return ready

        def close(self) -> None:
            """Wait for nothing any more."""
            self._epoll.close()

else:

    class Waiting:
        """As on Linux; terminals, too, are told as long as there is something."""

        def __init__(self, terminals: Collection[int], others: Collection[int], writable: Collection[int]) -> None:
            self._readable, self._writable = [*terminals, *others], list(writable)

        def ready(self, wait_s: float) -> list[int]:
            readable, writable, _ = select.select(self._readable, self._writable, (), wait_s)
            return [*readable, *writable]

        def close(self) -> None: ...


_RETRY_NS: Final = 500_000_000
_NEVER: Final = 1 << 62
_SWITCH_S: Final = 0.001  # a thread that opens a port lets the one that stamps go on


@dataclass
class Port:
    """One port: open, being opened, or waited for."""

    number: int
    settings: PortSettings
    desk: ReadBatching
    wait: bool  # for a port that was never there, too
    tap: Tap | None = None
    retry_ns: int = _NEVER  # when to try to open it
    identity: Identity = field(default_factory=Identity)
    ended: bool = False  # nothing can ever come again
    _reported: str = ""
    _opened_ns: int = 0  # when it was opened last; 0: never

    def attempted(self, result: Tap | PortError) -> None:
        """An attempt to open it is over. Raises the PortError where nobody wants to wait for another."""
        if isinstance(result, PortError):
            if not (self.wait or self._opened_ns):
                raise result
            self.retry_ns = self.desk.clock.now() + _RETRY_NS
            if str(result) != self._reported:  # once, not twice a second
                self._reported = str(result)
                self.desk.event(self.number, "waiting", f"{result}; waiting for it")
            return
        self.tap, self._reported = result, ""
        back, self._opened_ns = bool(self._opened_ns), self.desk.clock.now()
        now = result.settings
        text = f"{now.url}: {'is back' if back else 'open'}"
        self.desk.event(self.number, "opened", text, tap=result.kind, back=back, settings=now.to_json())
        if now.is_device and _wire_settings(now) != _wire_settings(self.settings):  # they were changed meanwhile
            self._set(result)
        self._tell_notices()
        if self.tap is not None and self.tap.descriptor is not None and not now.is_device:
            self.read()  # what came while it was being negotiated

    def gone(self, error: PortGoneError) -> None:
        """It was unplugged: let go of it, and wait."""
        if self.tap is not None:
            self.tap.close()
        self.tap = None
        text = f"{self.settings.url}: lost ({error})"
        if self.settings.is_bare_pty and not self.wait:  # what has this number next is somebody else's terminal
            self.ended = True
            self.desk.event(self.number, "lost", text)
            return
        self.retry_ns = max(self.desk.clock.now(), self._opened_ns + _RETRY_NS)  # soon, but not over and over
        self.desk.event(self.number, "lost", f"{text}; waiting for it to come back")

    def change(self, settings: PortSettings) -> None:
        """Listen with other settings."""
        self.settings = settings
        if self.tap is not None:
            self._set(self.tap)
        self._tell_notices()
        self.desk.listen_for(settings.silence_ns)
        self.desk.event(self.number, "settings", f"{settings.url}: {settings}", settings=settings.to_json())

    def read(self) -> None:
        """Take what has come."""
        tap, desk = self.tap, self.desk
        if tap is None:
            return
        try:
            data, errors = tap.read()
        except PortGoneError as error:
            self.gone(error)
            return
        desk.read(desk.clock.now(), self.number, data, errors)
        if tap.notices:
            self._tell_notices()

    def _set(self, tap: Tap) -> None:
        try:
            tap.change(self.settings)
        except PortGoneError as error:
            self.gone(error)

    def _tell_notices(self) -> None:
        if self.tap is not None:
            for notice in self.tap.notices:
                self.desk.event(self.number, "notice", notice)
            self.tap.notices.clear()


def _wire_settings(settings: PortSettings) -> tuple[int | None, str, int]:
    return settings.baud, settings.parity, settings.data_bits


class Ports:
    """All ports: those that are open, and attempts to open the others. First attempts are made one after the other."""

    def __init__(self, ports: list[Port], attempts: Attempts) -> None:
        self.all = ports
        self._attempts = attempts
        self._first = iter(ports)  # those that were never tried
        self._try_next()

    def attempt(self, now_ns: int) -> int:
        """Begin the attempts that are due; when the next one is, ns."""
        due = _NEVER
        for port in self.all:
            if port.retry_ns <= now_ns:
                port.retry_ns = _NEVER
                self._attempts.begin(port.number, port.settings, port.identity)
            due = min(due, port.retry_ns)
        return due

    def attempted(self) -> list[Port]:
        """Take the attempts that are over; the ports that are open now. PortError: see `Port.attempted`."""
        over = self._attempts.take_opened()
        for number, result in over:
            self.all[number].attempted(result)
            self._try_next()
        return [self.all[number] for number, result in over if self.all[number].tap is result]

    def _try_next(self) -> None:
        port = next(self._first, None)
        if port is not None:
            port.retry_ns = 0

    @property
    def ended(self) -> bool:
        """Whether nothing can come of any port."""
        return all(port.ended for port in self.all)

    def obey(self, commands: list[dict[str, Any]]) -> None:
        """Change settings."""
        for command in commands:
            self.all[command["port"]].change(PortSettings.from_json(command["settings"]))


def main(arguments: str) -> None:
    """Read until standard input ends. `arguments`: JSON of ports, hold_ns, quiet_ns, idle_ns, wait, blocking."""
    options = json.loads(arguments)
    prefer()
    clock = SteadyClock()
    out = Pipe(blocking=os.name != "posix")
    desk = ReadBatching(
        clock,
        out.send,
        hold_ns=options["hold_ns"],
        quiet_ns=options["quiet_ns"],
        idle_ns=options["idle_ns"],
    )
    settings = [PortSettings.from_json(values) for values in options["ports"]]
    desk.listen_for(max(each.silence_ns for each in settings))
    ports = [Port(number, each, desk, options["wait"]) for number, each in enumerate(settings)]
    confine(network=not all(each.is_device for each in settings))
    by_threads = options["blocking"] or os.name != "posix"
    try:
        if by_threads:
            _by_threads(ports, desk)
        else:
            _by_waiting(ports, desk, out)
        desk.event(0, "ended", "")
    except PortError as error:
        desk.event(0, "failed", str(error))
    except Exception as error:
        desk.event(0, "failed", f"the process that reads the port failed: {type(error).__name__}: {error}")
    finally:
        for port in ports:
            if port.tap is not None:
                port.tap.close()
        with suppress(OSError):
            out.drain()
    if by_threads:
        os._exit(0)  # at its own end Python fails where a thread still waits for standard input


def _by_waiting(ports: list[Port], desk: ReadBatching, out: Pipe) -> None:
    """All ports, commands, attempts and the pipe in one wait."""
    commands, clock = Commands(), desk.clock
    over, over_writer = os.pipe()
    taps = Ports(ports, Attempts(lambda: os.write(over_writer, b"."), blocking=False))
    now = due = clock.now()  # `due`: when a port is to be tried
    listening: dict[int, Port] = {}
    waiting = Waiting((), (0, over), ())
    same = full = False  # no port came or went since these were made; the pipe is waited for
    while same or not taps.ended:
        if not same or due <= now or full != out.waiting:
            due, listening, same, full = taps.attempt(now), _descriptors(ports), True, out.waiting
            waiting.close()
            waiting = _waiting_on(listening, (0, over), (1,) if full else ())
        wait = (min(desk.deadline, due) - now) / 1e9
        ready = waiting.ready(wait if wait > 0 else 0)
        for descriptor in ready:
            port = listening.get(descriptor)
            if port is not None:
                port.read()
                same = same and port.tap is not None
        if 0 in ready:
            command = commands.take_commands()
            if command is None:
                return
            taps.obey(command)
            same = False
        if over in ready:
            os.read(over, 4096)
            taps.attempted()
            same = False
        now = clock.now()
        if desk.deadline <= now and (not ready or _quiet(ports)):
            desk.due(now)
        if full:
            out.push()


def _descriptors(ports: list[Port]) -> dict[int, Port]:
    """What to wait on: made anew when ports come and go, since numbers of descriptors are used again."""
    return {p.tap.descriptor: p for p in ports if p.tap is not None and p.tap.descriptor is not None}


def _waiting_on(listening: dict[int, Port], others: Sequence[int], writable: Sequence[int]) -> Waiting:
    terminals = [descriptor for descriptor, port in listening.items() if port.settings.is_device]
    return Waiting(terminals, [*others, *(each for each in listening if each not in terminals)], writable)


def _quiet(ports: list[Port]) -> bool:
    """Whether nothing waits to be read, so that a tick would not overtake it."""
    return not select.select(list(_descriptors(ports)), [], [], 0)[0]


def _by_threads(ports: list[Port], desk: ReadBatching) -> None:
    """A thread a port waits in a blocking read, one for commands; this one tells what they bring, in order."""
    brought: queue.SimpleQueue[tuple[Any, ...]] = queue.SimpleQueue()
    ended = threading.Event()
    taps = Ports(ports, Attempts(lambda: brought.put(("attempted",)), blocking=True))
    threading.Thread(target=_command, args=(brought,), daemon=True).start()
    while not taps.ended:
        now = desk.clock.now()
        until = min(desk.deadline, taps.attempt(now))
        try:
            kind, *more = brought.get(timeout=max(0, until - now) / 1e9)
        except queue.Empty:
            if desk.clock.now() >= desk.deadline:
                desk.due(desk.clock.now())
            continue
        if kind == "end":
            break
        if kind == "read":
            port, t_ns, data, errors = more
            desk.read(t_ns, port.number, data, errors)
        elif kind == "gone":
            port, tap, error = more
            if port.tap is tap:
                port.gone(error)
        elif kind == "attempted":
            for port in taps.attempted():
                threading.Thread(target=_listen, args=(port, port.tap, brought, ended), daemon=True).start()
        elif kind == "command":
            taps.obey(more)
        elif kind == "failed":
            raise more[0]
    ended.set()


def _listen(port: Port, tap: Tap, brought: queue.SimpleQueue[tuple[Any, ...]], ended: threading.Event) -> None:
    """Wait for bytes of one tap until it is gone; to tell that, and to open it again, is the main thread's."""
    clock = port.desk.clock
    while not ended.is_set():
        try:
            data, errors = tap.read()
        except PortGoneError as error:
            brought.put(("gone", port, tap, error))
            return
        except Exception as error:
            brought.put(("failed", error))
            return
        if data:
            brought.put(("read", port, clock.now(), data, errors))


def _command(brought: queue.SimpleQueue[tuple[Any, ...]]) -> None:
    for line in sys.stdin.buffer:
        with suppress(ValueError):
            brought.put(("command", json.loads(line)))
    brought.put(("end",))


def prefer() -> None:
    """Be scheduled before others, where that is allowed; Ctrl-C and Ctrl-Break are the listener's business."""
    sys.setswitchinterval(_SWITCH_S)
    for name in ("SIGINT", "SIGHUP", "SIGTERM", "SIGBREAK"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    with suppress(AttributeError, OSError, ValueError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
