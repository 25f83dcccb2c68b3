"""A relay, as the rest of the program sees it: the port that it gives, and what passes as blocks, ticks and events."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from .child import RecordsOfChild
from .listening import HOLD_NS, IDLE_NS, QUIET_NS
from .settings import PortSettings
from .wire import Item, PortEvent


class Relaying(RecordsOfChild):
    """Bytes being passed on by `relay`, in a process that goes on where this one is killed.

    `given` is the port for the client's program: a pseudo-terminal's name, or HOST:PORT.
    """

    def __init__(
        self,
        port: PortSettings | None = None,
        *,
        listen: tuple[str, int] | None = None,
        to: tuple[str, int] | None = None,
        idle_ns: int = IDLE_NS,
        wait: bool = False,
    ) -> None:
        """Start it between a pseudo-terminal and `port`, or between what connects at `listen` and the gateway `to`.

        Waits until it gives its port: PortError where it can't. `wait`: for a line's port that is not there yet.
        """
        options: dict[str, Any] = {
            "hold_ns": HOLD_NS,
            "quiet_ns": min(QUIET_NS, idle_ns),
            "idle_ns": idle_ns,
            "port": None if port is None else port.to_json(),
            "wait": wait,
            "listen": listen,
            "to": to,
        }
        super().__init__("relay", options)
        self.begun: list[PortEvent] = []  # before the port was given
        self._items = super().items()
        try:
            self.given = self._until_given()
        except BaseException:
            self.__exit__()
            raise

    def items(self) -> Iterator[Item]:
        """See `RecordsOfChild`: what came before the port was given, too."""
        yield from self.begun
        yield from self._items

    def close(self) -> None:
        """Have it end; without that word it goes on."""
        if not self._closing:
            self.command(end=True)
        super().close()

    def _until_given(self) -> str:
        for item in self._items:
            if isinstance(item, PortEvent):
                if item.kind == "given":
                    return item.text
                self.begun.append(item)
        raise AssertionError("the relay ended without a word")  # `items` raises PortError before
