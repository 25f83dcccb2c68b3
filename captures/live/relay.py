"""The process that passes bytes on between a client's program and its line, untouched, and tells what passes.

In a process of its own, which goes on when whoever listens to it is killed: a client must not lose its bus because of
an analyzer. It passes bytes first and tells of them then; without a listener it passes them alone, until no client has
had its port open for a minute.

What a client sends is port 0 of the records, what the line says is port 1. Where bytes wait to be sent at a known rate,
a request is told when its last stop bit is due, as a tap on the wire would hear it.

Its standard output and input are those of `reader`; the command `end` ends it.
"""

from __future__ import annotations

import json
import os
import selectors
import signal
from collections import deque
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, Final

from .batching import Commands, Pipe, ReadBatching, SteadyClock
from .reader import prefer
from .relayends import ClientTerminal, DevicePort, End, SocketEnd, line_end, listener_at, place_of
from .settings import PortSettings
from .tap import PortError, PortGoneError

REQUESTS: Final = 0
RESPONSES: Final = 1

_RETRY_NS: Final = 500_000_000
_LOOK_NS: Final = 100_000_000  # so often at settings that a client changes without sending
_ALONE_NS: Final = 60_000_000_000  # without a listener and a client
_NEVER: Final = 1 << 62
_MOST: Final = 1 << 20  # bytes that wait for an end


class RecordTaker:
    """Whoever takes the records, as long as there is somebody."""

    def __init__(self) -> None:
        self._pipe = Pipe(blocking=False)
        self.gone = False

    @property
    def waiting(self) -> bool:
        """Whether records wait for it."""
        return not self.gone and self._pipe.waiting

    def send(self, data: bytes) -> None:
        """Write, or keep."""
        if not self.gone:
            try:
                self._pipe.send(data)
            except SystemExit:
                self.leave()

    def push(self) -> None:
        """Write what is kept."""
        self.send(b"")

    def leave(self) -> None:
        """Nobody listens any more, or so slowly that it is as good as nobody."""
        self.gone = True
        with suppress(OSError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), 1)

    def drain(self) -> None:
        """Write all of it, waiting for the listener."""
        with suppress(OSError, SystemExit):
            if not self.gone:
                self._pipe.drain()


@dataclass(eq=False)
class Link:
    """A client and its line; None while that is away. `to` are the bytes that wait, by the port of their records."""

    client: End
    line: End | None
    name: str = ""
    to: tuple[bytearray, bytearray] = field(default_factory=lambda: (bytearray(), bytearray()))
    over: set[int] = field(default_factory=set)  # directions in which nothing comes any more
    ended: set[int] = field(default_factory=set)  # those whose far end was told so

    def source(self, port: int) -> End | None:
        """Where bytes of a direction come from."""
        return self.line if port == RESPONSES else self.client

    def target(self, port: int) -> End | None:
        """Where they go."""
        return self.client if port == RESPONSES else self.line

    def interests(self) -> dict[int, int]:
        """What to wait for, by descriptor."""
        waits: dict[int, int] = {}
        for port in (REQUESTS, RESPONSES):
            source, target, kept = self.source(port), self.target(port), self.to[port]
            if source is not None and port not in self.over and (len(kept) < _MOST or not source.pressed):
                waits[source.descriptor] = waits.get(source.descriptor, 0) | selectors.EVENT_READ
            if target is not None and kept:
                waits[target.descriptor] = waits.get(target.descriptor, 0) | selectors.EVENT_WRITE
        return waits


class Relay:
    """All links, the listener and its commands in one wait."""

    def __init__(self, desk: ReadBatching, listener: RecordTaker) -> None:
        self.desk, self._listener, self._commands = desk, listener, Commands()
        self.links: list[Link] = []
        self._selector = selectors.DefaultSelector()
        self._waits: dict[int, int] = {}
        self._ended = self._alone = False
        self._sending: deque[tuple[int, bytes]] = deque()  # requests on their way: when they are over
        self._free_ns = 0  # when the line has sent all of them
        self._client_ns = desk.clock.now()  # when a client was last there

    def run(self) -> None:
        """Pass on until it is told to end."""
        while not self._ended:
            self._wait_for()
            now = self.desk.clock.now()
            due = min(self.desk.deadline, self.next_ns(now), self._sending[0][0] if self._sending else _NEVER)
            ready = self._selector.select(max(0, due - now) / 1e9)
            for key, events in ready:
                self._serve(key.fd, events)
            now = self.desk.clock.now()
            self._tell_sent(now)
            self.look(now)
            if self.desk.deadline <= now and not (ready and self._selector.select(0)):
                self.desk.due(now)
            self._ended = self._ended or (self._alone and now - self._client_ns > _ALONE_NS)

    def next_ns(self, now: int) -> int:
        """When `look` wants to be called next, ns."""
        raise NotImplementedError

    def look(self, now: int) -> None:
        """Called after whatever came."""
        if self._alone and self.has_client():
            self._client_ns = now

    def has_client(self) -> bool:
        """Whether a client has its port open."""
        raise NotImplementedError

    def character_ns(self) -> float:
        """Of the line that requests are sent on; 0 where that is no matter."""
        return 0

    def before_request(self) -> None:
        """A client's bytes are about to be passed on."""

    def gone(self, link: Link, port: int, error: PortGoneError) -> None:
        """Nothing more comes of the source of a direction, or nothing more goes to its target."""
        raise NotImplementedError

    def other(self, descriptor: int) -> None:
        """Something came of a descriptor that is no link's."""

    def also(self) -> tuple[int, ...]:
        """Descriptors to wait for besides."""
        return ()

    def _wait_for(self) -> None:
        waits = dict.fromkeys(self.also(), selectors.EVENT_READ)
        if not self._alone:
            waits[0] = selectors.EVENT_READ
        if self._listener.waiting:
            waits[1] = selectors.EVENT_WRITE
        for link in self.links:
            waits.update(link.interests())
        if waits == self._waits:
            return
        for descriptor in self._waits.keys() - waits.keys():
            with suppress(KeyError, ValueError, OSError):
                self._selector.unregister(descriptor)
        for descriptor, events in waits.items():
            if descriptor not in self._waits:
                self._selector.register(descriptor, events)
            elif events != self._waits[descriptor]:
                self._selector.modify(descriptor, events)
        self._waits = waits

    def let_go(self, end: End) -> None:
        """Close an end; its number may be another's soon."""
        if self._waits.pop(end.descriptor, 0):
            with suppress(KeyError, ValueError, OSError):
                self._selector.unregister(end.descriptor)
        end.close()

    def _serve(self, descriptor: int, events: int) -> None:
        if descriptor == 0:
            self._obey()
        elif descriptor == 1:
            self._listener.push()
        elif descriptor in self.also():
            self.other(descriptor)
        else:
            for link in list(self.links):
                for port in (REQUESTS, RESPONSES):
                    self._pass(link, port, descriptor, events)

    def _pass(self, link: Link, port: int, descriptor: int, events: int) -> None:
        source, target = link.source(port), link.target(port)
        try:
            if target is not None and target.descriptor == descriptor and events & selectors.EVENT_WRITE:
                self._push(link, port)
            if source is not None and source.descriptor == descriptor and events & selectors.EVENT_READ:
                self._pull(link, port, source)
        except PortGoneError as error:
            self.gone(link, port, error)

    def _pull(self, link: Link, port: int, source: End) -> None:
        """Take what came, pass it on, tell it."""
        data = source.read()
        if port == REQUESTS:
            self.before_request()
        target, kept = link.target(port), link.to[port]
        if not data or target is None:
            return
        now = self.desk.clock.now()
        kept += data
        try:
            self._push(link, port)
        finally:
            self._told(now, port, data)
        if len(kept) > _MOST and not source.pressed:
            self.desk.event(port, "notice", f"the client takes nothing: {len(kept):,} bytes for it are dropped")
            kept.clear()

    @staticmethod
    def _push(link: Link, port: int) -> None:
        target, kept = link.target(port), link.to[port]
        while kept and target is not None and (written := target.write(kept)):
            del kept[:written]
        if target is not None and not kept and port in link.over - link.ended:
            link.ended.add(port)
            target.end()

    def _told(self, now: int, port: int, data: bytes) -> None:
        if self._listener.gone:
            return
        character = self.character_ns() if port == REQUESTS else 0
        if character:
            self._free_ns = max(self._free_ns, now) + round(len(data) * character)
            self._sending.append((self._free_ns, data))
            return
        self._tell_sent(_NEVER)  # what is answered was sent
        self.desk.read(now, port, data, ())

    def _tell_sent(self, until_ns: int) -> None:
        while self._sending and self._sending[0][0] <= until_ns:
            self.desk.read(self.desk.clock.now(), REQUESTS, self._sending.popleft()[1], ())

    def _obey(self) -> None:
        commands = self._commands.take()
        if commands is None:
            self._alone = True
            self._client_ns = self.desk.clock.now()
            self._listener.leave()
        elif any(command.get("end") for command in commands):
            self._ended = True

    def end(self) -> None:
        """Tell what is on its way."""
        self._tell_sent(_NEVER)


class TerminalRelay(Relay):
    """A pseudo-terminal for one client, and a port, which is waited for where it goes away."""

    def __init__(self, desk: ReadBatching, listener: RecordTaker, settings: PortSettings, *, wait: bool) -> None:
        """PortError where the port can't be opened and nobody wants to `wait` for it."""
        super().__init__(desk, listener)
        self._settings, self._wait = settings, wait
        self._client = ClientTerminal(settings)
        self._link = Link(self._client, None)
        self._retry_ns = self._look_ns = 0
        self._back = False  # it was open before
        self._reported = ""
        self._open(desk.clock.now())
        self.links.append(self._link)
        desk.event(REQUESTS, "given", self._client.name)

    def next_ns(self, now: int) -> int:
        """See `Relay`."""
        return min(self._look_ns, self._retry_ns) if self._look_ns > now else now

    def look(self, now: int) -> None:
        """See `Relay`."""
        if self._retry_ns <= now:
            self._open(now)
        if self._look_ns <= now:
            self._look_ns = now + _LOOK_NS
            self.before_request()
            super().look(now)
        if self._client.emptied:
            self._client.emptied = False
            self._link.to[RESPONSES].clear()

    def has_client(self) -> bool:
        """See `Relay`."""
        return self._client.in_use

    def character_ns(self) -> float:
        """See `Relay`."""
        line, settings = self._link.line, self._settings
        if not isinstance(line, DevicePort) or line.kind == "pty" or settings.baud is None:
            return 0
        return settings.char_bits * 1e9 / settings.baud

    def before_request(self) -> None:
        """Settings that the client has changed go before its bytes."""
        settings, line = self._client.settings, self._link.line
        if settings == self._settings:
            return
        self._settings = settings
        text = f"{settings.url}: {settings}, as the client sets it"
        if line is not None:
            try:
                line.change(settings)  # type: ignore[attr-defined]
            except ValueError as error:
                self.desk.event(RESPONSES, "notice", str(error))
                return
            except PortGoneError as error:
                self.gone(self._link, RESPONSES, error)
        self.desk.event(RESPONSES, "settled", text, settings=settings.to_json())

    def gone(self, link: Link, port: int, error: PortGoneError) -> None:  # noqa: ARG002
        """Wait for the port, and open it again; bytes for it are dropped meanwhile, as by a port that is not there."""
        if link.line is not None:
            self.let_go(link.line)
        link.line = None
        link.to[REQUESTS].clear()
        text = f"{self._settings.url}: lost ({error})"
        if self._settings.is_bare_pty and not self._wait:  # what has this number next is somebody else's terminal
            self.desk.event(RESPONSES, "lost", text)
            self._ended = True
            return
        self._retry_ns = self.desk.clock.now() + _RETRY_NS
        self.desk.event(RESPONSES, "lost", f"{text}; waiting for it to come back")

    def _open(self, now: int) -> None:
        try:
            line = line_end(self._settings)
        except PortError as error:
            if not (self._wait or self._back):
                raise
            self._retry_ns = now + _RETRY_NS
            if str(error) != self._reported:
                self._reported = str(error)
                self.desk.event(RESPONSES, "waiting", f"{error}; waiting for it")
            return
        self._link.line, self._retry_ns, self._reported = line, _NEVER, ""
        text = f"{self._settings.url}: {'is back' if self._back else 'open'}"
        self.desk.event(RESPONSES, "opened", text, tap=line.kind, back=self._back, settings=self._settings.to_json())
        self._back = True
        for notice in line.notices:
            self.desk.event(RESPONSES, "notice", notice)


class SocketRelay(Relay):
    """A listening socket; each client that connects gets a connection of its own to the gateway."""

    def __init__(self, desk: ReadBatching, listener: RecordTaker, listen: tuple[str, int], to: tuple[str, int]) -> None:
        """PortError where it can't listen, or the gateway's name leads nowhere."""
        super().__init__(desk, listener)
        self._gateway = f"{to[0]}:{to[1]}"
        self._place = place_of(*to)
        self._listener_socket = listener_at(*listen)
        self._listener_socket.setblocking(False)
        host, port = self._listener_socket.getsockname()[:2]
        desk.event(RESPONSES, "opened", f"{self._gateway}: passed on to", tap="tcp", back=False, settings=None)
        desk.event(REQUESTS, "given", f"[{host}]:{port}" if ":" in host else f"{host}:{port}")

    def next_ns(self, now: int) -> int:
        """See `Relay`."""
        return now + _RETRY_NS

    def look(self, now: int) -> None:
        """See `Relay`."""
        super().look(now)
        for link in [each for each in self.links if {REQUESTS, RESPONSES} <= each.ended]:
            self._close(link)

    def has_client(self) -> bool:
        """See `Relay`."""
        return bool(self.links)

    def also(self) -> tuple[int, ...]:
        """See `Relay`."""
        return (self._listener_socket.fileno(),)

    def other(self, descriptor: int) -> None:  # noqa: ARG002
        """A client connects."""
        try:
            connection, peer = self._listener_socket.accept()
        except OSError:
            return
        name = f"{peer[0]}:{peer[1]}"
        self.links.append(Link(SocketEnd(connection), SocketEnd.to(self._place), name))
        self.desk.event(REQUESTS, "notice", f"{name}: a client connects to {self._gateway}")

    def gone(self, link: Link, port: int, error: PortGoneError) -> None:
        """An end of one direction is the far end's business; anything worse is the end of both."""
        if link not in self.links:
            return
        link.over.add(port)
        try:
            self._push(link, port)
        except PortGoneError as far:
            error = error if str(error) else far
        if str(error):
            self.desk.event(port, "notice", f"{link.name}: the connection to {self._gateway} breaks: {error}")
            self._close(link)

    def _close(self, link: Link) -> None:
        self.links.remove(link)
        for end in (link.client, link.line):
            if end is not None:
                self.let_go(end)
        self.desk.event(REQUESTS, "notice", f"{link.name}: the client has left")


def main(arguments: str) -> None:
    """Pass on until told to end. `arguments`: JSON of hold_ns, quiet_ns, idle_ns, and `port` with `wait`, or `listen`
    and `to` (host and port each)."""
    options: dict[str, Any] = json.loads(arguments)
    prefer()
    signal.signal(signal.SIGTERM, signal.SIG_DFL)  # nobody else may be left to end it
    signal.signal(signal.SIGPIPE, signal.SIG_IGN)
    listener = RecordTaker()
    desk = ReadBatching(
        SteadyClock(),
        listener.send,
        hold_ns=options["hold_ns"],
        quiet_ns=options["quiet_ns"],
        idle_ns=options["idle_ns"],
    )
    relay: Relay | None = None
    try:
        if options.get("port"):
            settings = PortSettings.from_json(options["port"])
            desk.listen_for(settings.silence_ns)
            relay = TerminalRelay(desk, listener, settings, wait=options["wait"])
        else:
            relay = SocketRelay(desk, listener, tuple(options["listen"]), tuple(options["to"]))
        relay.run()
        relay.end()
        desk.event(0, "ended", "")
    except PortError as error:
        desk.event(0, "failed", str(error))
    except Exception as error:
        desk.event(0, "failed", f"the process that passes bytes on failed: {type(error).__name__}: {error}")
    listener.drain()
