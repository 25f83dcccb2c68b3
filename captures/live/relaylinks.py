"""Links between clients and their line: bytes that are passed on first and told of then, all in one wait.

What clients of relays have in common; `relay` knows the two kinds.
"""

from __future__ import annotations

import os
import select
import sys
from collections import deque
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Final

from .batching import Commands, Pipe, ReadBatching
from .relayends import End
from .tap import PortGoneError

REQUESTS: Final = 0
RESPONSES: Final = 1

if sys.platform == "linux":
    READ: Final = select.EPOLLIN
    WRITE: Final = select.EPOLLOUT
    Waiting = select.epoll  # itself: what `selectors` adds stands between a byte that came and its being passed on
else:
    import selectors

    READ: Final = selectors.EVENT_READ
    WRITE: Final = selectors.EVENT_WRITE

    class Waiting(selectors.DefaultSelector):
        """As on Linux, as far as it is used here."""

        def poll(self, wait_s: float) -> list[tuple[int, int]]:
            return [(key.fd, events) for key, events in self.select(wait_s)]


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
                waits[source.descriptor] = waits.get(source.descriptor, 0) | READ
            if target is not None and kept:
                waits[target.descriptor] = waits.get(target.descriptor, 0) | WRITE
        return waits


class Relay:
    """All links, the listener and its commands in one wait."""

    def __init__(self, desk: ReadBatching, listener: RecordTaker) -> None:
        self.desk, self._listener, self._commands = desk, listener, Commands()
        self.links: list[Link] = []
        self._waiting = Waiting()
        self._waits: dict[int, int] = {}
        self._ways: dict[int, tuple[Link, int, End]] = {}  # by descriptor: where bytes come from, and by which port
        self.ended = self._alone = False
        self._sending: deque[tuple[int, bytes]] = deque()  # requests on their way: when they are over
        self._free_ns = 0  # when the line has sent all of them
        self._client_ns = desk.clock.now()  # when a client was last there

    def run(self) -> None:
        """Pass on until it is told to end."""
        while not self.ended:
            self._wait_for()
            now = self.desk.clock.now()
            due = min(self.desk.deadline, self.next_ns(now), self._sending[0][0] if self._sending else _NEVER)
            ready = self._waiting.poll(max(0, due - now) / 1e9)
            for descriptor, events in ready:
                way = self._ways.get(descriptor) if events == READ else None
                if way is not None:
                    self._pull(*way)
                else:
                    self._serve(descriptor, events)
            now = self.desk.clock.now()
            self._tell_sent(now)
            self.look(now)
            if self.desk.deadline <= now and not (ready and self._waiting.poll(0)):
                self.desk.due(now)
            self.ended = self.ended or (self._alone and now - self._client_ns > _ALONE_NS)

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
        waits = dict.fromkeys(self.also(), READ)
        if not self._alone:
            waits[0] = READ
        if self._listener.waiting:
            waits[1] = WRITE
        for link in self.links:
            waits.update(link.interests())
        if waits == self._waits:
            return
        for descriptor in self._waits.keys() - waits.keys():
            with suppress(KeyError, ValueError, OSError):
                self._waiting.unregister(descriptor)
        for descriptor, events in waits.items():
            if descriptor not in self._waits:
                self._waiting.register(descriptor, events)
            elif events != self._waits[descriptor]:
                self._waiting.modify(descriptor, events)
        self._waits = waits
        self._ways = {
            source.descriptor: (link, port, source)
            for link in self.links
            for port in (REQUESTS, RESPONSES)
            if (source := link.source(port)) is not None and waits.get(source.descriptor, 0) & READ
        }

    def let_go(self, end: End) -> None:
        """Close an end; its number may be another's soon."""
        self._ways.pop(end.descriptor, None)
        if self._waits.pop(end.descriptor, 0):
            with suppress(KeyError, ValueError, OSError):
                self._waiting.unregister(end.descriptor)
        end.close()

    def _serve(self, descriptor: int, events: int) -> None:
        if descriptor == 0:
            self._obey()
        elif descriptor == 1:
            self._listener.push()
        elif descriptor in self.also():
            self.other(descriptor)
        else:
            self._serve_links(descriptor, events, self._waits.get(descriptor, 0))

    def _serve_links(self, descriptor: int, events: int, wanted: int) -> None:
        """Whatever came of an end of a link; what is neither of those two is an end that breaks: told by both."""
        if wanted & WRITE and events & ~READ:
            for link in list(self.links):
                for port in (REQUESTS, RESPONSES):
                    target = link.target(port)
                    if target is not None and target.descriptor == descriptor:
                        self._push(link, port)
        way = self._ways.get(descriptor)
        if way is not None and events & ~WRITE:
            self._pull(*way)

    def _push(self, link: Link, port: int) -> None:
        try:
            self.push(link, port)
        except PortGoneError as error:
            self.gone(link, port, error)

    def _pull(self, link: Link, port: int, source: End) -> None:
        """Take what came, pass it on, tell it: before the write, nothing that it does not need."""
        try:
            data = source.read()
            if port == REQUESTS:
                self.before_request()
            target = link.target(port)
            if data and target is not None:
                self._through(link, port, target, data)
        except PortGoneError as error:
            self.gone(link, port, error)
        if len(link.to[port]) > _MOST and not source.pressed:
            self.desk.event(
                port, "notice", f"the client does not read: {len(link.to[port]):,} bytes for it are dropped"
            )
            link.to[port].clear()

    def _through(self, link: Link, port: int, target: End, data: bytes) -> None:
        now, kept = self.desk.clock.now(), link.to[port]
        try:
            if kept:
                kept += data
                self.push(link, port)
            elif (written := target.write(data)) < len(data):
                kept += data[written:]
        finally:
            self._told(now, port, data)

    @staticmethod
    def push(link: Link, port: int) -> None:
        """Write what waits for the target of a direction. PortGoneError."""
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
        commands = self._commands.take_commands()
        if commands is None:
            self._alone = True
            self._client_ns = self.desk.clock.now()
            self._listener.leave()
        elif any(command.get("end") for command in commands):
            self.ended = True

    def end(self) -> None:
        """Tell what is on its way."""
        self._tell_sent(_NEVER)
