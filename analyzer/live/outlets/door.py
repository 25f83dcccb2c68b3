"""A door before a WebSocket server of a library's own, which lets in any page of the web.

What comes to the port is let through to the server behind it when its Host and Origin are right (`analyzer.webguard`).
The server behind listens at an address of its own that no page can guess: one of 16 million of 127.0.0.0/8, where the
system has them all (Linux, Windows); elsewhere only its port is unknown.
"""

from __future__ import annotations

import asyncio
import secrets
import socket
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Final

from . import OutletError

_HEAD: Final = 1 << 14  # bytes of a request's head
_HEAD_S: Final = 5.0
_MOST: Final = 64  # connections
_PIECE: Final = 1 << 16
_END_S: Final = 1.0

Judge = Callable[[str, list[str]], str]  # Host, Origins: why that is refused, or nothing


def hidden_address() -> str:
    """An address of this machine that a page of the web cannot guess, if there are such here."""
    host = f"127.{secrets.randbelow(254) + 1}.{secrets.randbelow(256)}.{secrets.randbelow(254) + 1}"
    with suppress(OSError), socket.create_server((host, 0)):
        return host
    return "127.0.0.1"


class Door:
    """Passes on what may pass, to a server behind. A thread of its own; `close` ends all connections."""

    def __init__(self, host: str, port: int, judge: Judge) -> None:
        """Listen; OutletError where it cannot. `lead_to` names the server, before which nobody gets through."""
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        try:
            self._listener = socket.create_server((host, port), family=family)
        except (OSError, OverflowError) as error:
            reason = (error.strerror or str(error)).lower() if isinstance(error, OSError) else str(error)
            raise OutletError(f"--foxglove {host}:{port}: {reason}") from error
        self.port: int = self._listener.getsockname()[1]
        self._judge, self._behind = judge, ("", 0)
        self._loop = asyncio.new_event_loop()
        self._tasks: set[asyncio.Task[None]] = set()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def lead_to(self, host: str, port: int) -> None:
        """Begin, with the server that stands there."""
        self._behind = host, port
        self._thread.start()

    def close(self) -> None:
        """Let go of all."""
        if self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._loop.stop)
            self._thread.join(_END_S)
        else:
            self._listener.close()
            self._loop.close()

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        server = self._loop.run_until_complete(
            asyncio.start_server(self._arrived, sock=self._listener, limit=_HEAD)  # its own words of errors go nowhere
        )
        self._loop.run_forever()
        server.close()
        for task in self._tasks:
            task.cancel()
        self._loop.run_until_complete(asyncio.gather(*self._tasks, return_exceptions=True))
        self._loop.close()

    async def _arrived(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None  # a server's handler runs in one
        self._tasks.add(task)
        try:
            if len(self._tasks) <= _MOST:
                await self._let_through(reader, writer)
        except (OSError, EOFError, TimeoutError, asyncio.LimitOverrunError, asyncio.CancelledError):
            pass  # gone, or no request: it is let go of
        finally:
            self._tasks.discard(task)
            writer.close()

    async def _let_through(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        head = await asyncio.wait_for(reader.readuntil(b"\r\n\r\n"), _HEAD_S)
        hosts, origins = _values(head, b"host"), _values(head, b"origin")
        why = self._judge(hosts[0], origins) if len(hosts) == 1 else "one Host is wanted"
        if why:
            body = f"{why}\n".encode()
            writer.write(
                b"HTTP/1.1 403 Forbidden\r\nContent-Type: text/plain; charset=utf-8\r\nConnection: close\r\n"
                b"Content-Length: %d\r\n\r\n%b" % (len(body), body)
            )
            await writer.drain()
            return
        inner_reader, inner_writer = await asyncio.open_connection(*self._behind)
        try:
            inner_writer.write(head)
            ways = [
                asyncio.create_task(_pass_on(reader, inner_writer)),
                asyncio.create_task(_pass_on(inner_reader, writer)),
            ]
            try:
                await asyncio.wait(ways, return_when=asyncio.FIRST_COMPLETED)
            finally:
                for way in ways:
                    way.cancel()
                await asyncio.gather(*ways, return_exceptions=True)
        finally:
            inner_writer.close()


async def _pass_on(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    while data := await reader.read(_PIECE):
        writer.write(data)
        await writer.drain()


def _values(head: bytes, name: bytes) -> list[str]:
    """The values of a header in a request's head. A line that goes on (obsolete) has no name, and is none."""
    lines = [line.partition(b":") for line in head.split(b"\r\n")[1:]]
    return [value.strip().decode("latin-1") for key, colon, value in lines if colon and key.strip().lower() == name]
