"""Links between clients and their line: bytes that are passed on first and told of then, all in one wait.

What clients of relays have in common; `relay` knows the two kinds.
"""

from __future__ import annotations

import os
import selectors
from collections import deque
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Final

from .batching import Commands, Pipe, ReadBatching
from .relayends import End
from .tap import PortGoneError

REQUESTS: Final = 0
RESPONSES: Final = 1

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
            ready = self._selector.select(max(0, due - now) / 1e9)
            for key, events in ready:
                self._serve(key.fd, events)
            now = self.desk.clock.now()
            self._tell_sent(now)
            self.look(now)
            if self.desk.deadline <= now and not (ready and self._selector.select(0)):
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
                self.push(link, port)
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
            self.push(link, port)
        finally:
            self._told(now, port, data)
        if len(kept) > _MOST and not source.pressed:
            self.desk.event(port, "notice", f"the client does not read: {len(kept):,} bytes for it are dropped")
            kept.clear()

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
