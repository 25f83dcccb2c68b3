"""A relay as a session's source: two ports, of which each carries one direction for certain."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from captures.line import DIRECTIONS_NOTE, LineSettings
from captures.live.relaying import Relaying
from captures.live.settings import PortSettings
from captures.live.wire import Item, PortEvent


class BetweenSource:
    """What passes between a client's program and its line. `given` is the port for the client's program."""

    waits = False
    lost = 0  # nothing lies between the relay and here

    def __init__(self, relaying: Relaying, port: PortSettings | None) -> None:
        """`port`: the line's, as it is set until the client sets it otherwise; None where it is a gateway's."""
        self._relaying = relaying
        self._port = port
        self._tap: str | None = None
        self.given = relaying.given
        for event in relaying.begun:
            self._learn(event)

    @property
    def more(self) -> bool:
        """See `SessionSource`."""
        return self._relaying.more

    @property
    def line(self) -> LineSettings:
        """What is known of the line."""
        line = LineSettings(tap=self._tap) if self._port is None else self._port.line(self._tap)
        return replace(line, notes={DIRECTIONS_NOTE: "request,response"})

    def items(self) -> Iterator[Item]:
        """What passes. PortError where the relay fails."""
        with self._relaying as relaying:
            for item in relaying.items():
                if isinstance(item, PortEvent):
                    self._learn(item)
                yield item
                if isinstance(item, PortEvent) and item.kind == "opened":  # what the line is stands in the record
                    words = "with the gateway's own settings" if self._port is None else str(self._port)
                    yield PortEvent(item.t_ns, item.port, "settled", f"listening: {words}", {})

    def judge(self, heard: int, sense: int, line: LineSettings) -> None:
        """The client says how the line is set."""

    def close(self) -> None:
        """End soon."""
        self._relaying.close()

    def _learn(self, event: PortEvent) -> None:
        if event.kind == "opened":
            self._tap = event.more["tap"]
        elif event.kind == "settled" and event.more:
            self._port = PortSettings.from_json(event.more["settings"])
