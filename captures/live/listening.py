"""Taps, as the rest of the program sees them: blocks, ticks and events, one by one, from the reader's process."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from .child import RecordsOfChild
from .settings import PortSettings

HOLD_NS: Final = 26_000_000  # reads are gathered for so long: most of the 30 ms that a line may be late
RECORD_HOLD_NS: Final = 100_000_000  # where nobody looks
QUIET_NS: Final = 8_000_000  # after the last byte: what is whole may be shown
IDLE_NS: Final = 50_000_000


class Listening(RecordsOfChild):
    """Ports that are listened to, numbered as they were given."""

    def __init__(
        self,
        ports: Sequence[PortSettings],
        *,
        hold_ns: int = HOLD_NS,
        quiet_ns: int = QUIET_NS,
        idle_ns: int = IDLE_NS,
        wait: bool = False,
        blocking: bool = False,
    ) -> None:
        """Start the reader, which gathers reads for `hold_ns`. `quiet_ns`, `idle_ns`: silences that it tells.

        `wait`: for a port that is not there, too; `blocking`: by pyserial's own read alone."""
        options = {
            "ports": [port.to_json() for port in ports],
            "hold_ns": hold_ns,
            "quiet_ns": quiet_ns,
            "idle_ns": idle_ns,
            "wait": wait,
            "blocking": blocking,
        }
        super().__init__("reader", options)

    def change(self, port: int, settings: PortSettings) -> None:
        """Listen with other line settings; an event `settings` tells from when on."""
        self.command(port=port, settings=settings.to_json())
