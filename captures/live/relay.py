"""The process that passes bytes on between a client's program and its line, untouched, and tells what passes.

In a process of its own, which goes on when whoever listens to it is killed: a client must not lose its bus because of
an analyzer. It passes bytes first and tells of them then; without a listener it passes them alone, until no client has
had its port open for a minute.

What a client sends is port 0 of the records, what the line says is port 1. Where bytes wait to be sent at a known rate,
a request is told when its last stop bit is due, as a tap on the wire would hear it.

Its standard output and input are those of `reader`; the command `end` ends it.
"""

from __future__ import annotations

import gc
import json
import signal
from typing import Any, Final

from .batching import ReadBatching, SteadyClock
from .reader import prefer
from .relayends import ClientTerminal, DevicePort, SocketEnd, line_end, listener_at, place_of
from .relaylinks import REQUESTS, RESPONSES, Link, RecordTaker, Relay
from .settings import PortSettings
from .tap import PortError, PortGoneError

_RETRY_NS: Final = 500_000_000
_LOOK_NS: Final = 100_000_000  # so often at settings that a client changes without sending
_NEVER: Final = 1 << 62


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
        if settings is self._settings or settings == self._settings:
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
            self.ended = True
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
            self.push(link, port)
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
        gc.freeze()  # what was imported is not looked through between two bytes
        relay.run()
        relay.end()
        desk.event(0, "ended", "")
    except PortError as error:
        desk.event(0, "failed", str(error))
    except Exception as error:
        desk.event(0, "failed", f"the process that passes bytes on failed: {type(error).__name__}: {error}")
    listener.drain()
