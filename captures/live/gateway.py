"""A gateway's socket as a tap: the bytes of a line in raw TCP. Nothing is sent on it.

The connection is watched by TCP's own keep-alive, since a gateway that lost its power says nothing: without it a
recorder would wait for ever, and call it a quiet line.
"""

from __future__ import annotations

import select
import socket
from contextlib import suppress
from typing import Final
from urllib.parse import urlsplit

from ..errors import os_reason
from .settings import PortSettings
from .tap import READ_BYTES, WAIT_S, PortError, PortGoneError, Tap

CONNECT_S: Final = 5.0
_ALIVE: Final = {"TCP_KEEPIDLE": 10, "TCP_KEEPALIVE": 10, "TCP_KEEPINTVL": 5, "TCP_KEEPCNT": 3}  # s, s, s, times


class SocketTap(Tap):
    """A connection to `SCHEME://HOST:PORT`, whose bytes are those of the line."""

    def __init__(self, settings: PortSettings, *, blocking: bool = False) -> None:
        """Connect; PortError says in one line why it can't be done. `blocking`: `read` waits."""
        super().__init__(settings, settings.url.partition("://")[0])
        self._socket = connected(settings.url)
        self._socket.setblocking(False)
        self.descriptor = None if blocking else self._socket.fileno()

    def read(self) -> tuple[bytes, list[int]]:
        """See `Tap`."""
        try:
            if self.descriptor is None and not select.select([self._socket], [], [], WAIT_S)[0]:
                return b"", []
            data = self._socket.recv(READ_BYTES)
        except BlockingIOError:
            return b"", []
        except (OSError, ValueError) as error:  # ValueError: closed by another thread
            raise PortGoneError(os_reason(error) if isinstance(error, OSError) else "closed") from error
        if not data:
            raise PortGoneError("closed at its other end")
        return data, []

    def close(self) -> None:
        """See `Tap`."""
        self.descriptor = None
        self._socket.close()


def connected(url: str) -> socket.socket:
    """A connection that notices when its other end is gone. PortError where there is none within 5 s."""
    try:
        parts = urlsplit(url)
        host, port = parts.hostname, parts.port
    except ValueError:
        host = port = None
    if not host or not port:
        raise PortError(f"{url}: not an address: {url.partition('://')[0]}://HOST:PORT is wanted")
    try:
        connection = socket.create_connection((host, port), timeout=CONNECT_S)
    except (OSError, UnicodeError) as error:
        reason = os_reason(error) if isinstance(error, OSError) else str(error)
        raise PortError(f"{url}: cannot be opened: {reason}") from error
    keep_alive(connection)
    return connection


def keep_alive(connection: socket.socket) -> None:
    """Have the system notice when the other end is gone."""
    with suppress(OSError):
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        for name, value in _ALIVE.items():
            if hasattr(socket, name):
                connection.setsockopt(socket.IPPROTO_TCP, getattr(socket, name), value)
