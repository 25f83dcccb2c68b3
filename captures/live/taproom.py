"""Who is at a tap: viewers that proved that they know its token, and a few connections that have not yet.

A place is for who proved. Who has not waits in a room of its own, for a few seconds at most; when that is full, the
oldest of the address with the most connections there gives way, so that one address cannot keep another out.
"""

from __future__ import annotations

import ipaddress
import os
import socket
import threading
import time
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Final

PLACES: Final = 16
STRANGERS: Final = 16
_REPEATED_S: Final = 10.0  # between two lines of the log about the same thing
_READING: Final = socket.SHUT_RD if os.name == "posix" else socket.SHUT_RDWR  # Windows: else a wait goes on

CROWDED: Final = "too many unauthenticated connections; try again"
TOO_SLOW: Final = "the token was not confirmed in time"


@dataclass(eq=False)
class Visitor:
    """A connection to a tap. `why`: it has to go, for this reason."""

    connection: socket.socket
    address: str
    why: str = ""

    def turn_out(self, why: str) -> None:
        """Whatever it sends is read no more, so that the thread that waits for it goes on and gives the reason."""
        self.why = self.why or why
        with suppress(OSError):
            socket.socket.shutdown(self.connection, _READING)  # of TLS too: its own would take the words away

    @property
    def origin(self) -> str:
        """What one stranger has one of: an IPv4 address, or a network of IPv6."""
        with suppress(ValueError):
            address = ipaddress.ip_address(self.address.partition("%")[0])
            if address.version == 6 and not address.is_loopback:
                return str(ipaddress.ip_network((address, 64), strict=False))
        return self.address


class Rooms:
    """Places for those who proved, and the room for those who have not. Threads may use it at once."""

    def __init__(self, places: int = PLACES, strangers: int = STRANGERS) -> None:
        self._places, self._most = places, strangers
        self._lock = threading.Lock()
        self._strangers: list[Visitor] = []
        self._viewers: set[Visitor] = set()

    def enter(self, visitor: Visitor) -> None:
        """It is here and has proved nothing yet; another may have to go for it."""
        leaving = None
        with self._lock:
            if len(self._strangers) >= self._most:
                (crowd, _), *_ = Counter(each.origin for each in self._strangers).most_common(1)
                leaving = next(each for each in self._strangers if each.origin == crowd)
                self._strangers.remove(leaving)
            self._strangers.append(visitor)
        if leaving is not None:
            leaving.turn_out(CROWDED)

    def admit(self, visitor: Visitor) -> bool:
        """It has proved what it has to; whether there is a place for it."""
        with self._lock:
            if visitor not in self._strangers or len(self._viewers) >= self._places:
                return False
            self._strangers.remove(visitor)
            self._viewers.add(visitor)
            return True

    def leave(self, visitor: Visitor) -> None:
        """It is gone."""
        with self._lock:
            self._viewers.discard(visitor)
            if visitor in self._strangers:
                self._strangers.remove(visitor)

    @property
    def viewers(self) -> int:
        """How many have a place."""
        return len(self._viewers)


@dataclass
class SparingLog:
    """Lines that strangers cause: each kind at once, then every ten seconds at most, with how many were left out."""

    tell: Callable[[str], None]
    _told: dict[str, tuple[float, int]] = field(default_factory=dict)
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def __call__(self, who: str, what: str) -> None:
        """`what` is its kind; it happened to a viewer at `who`."""
        with self._lock:
            at, left_out = self._told.get(what, (-_REPEATED_S, 0))
            now = time.monotonic()
            if now - at < _REPEATED_S:
                self._told[what] = at, left_out + 1
                return
            self._told[what] = now, 0
        line = f"viewer at {who}: {what}{f' ({left_out} more before it)' if left_out else ''}"
        self.tell(line)
