"""What leaves a session for other programs, beside what is shown: metrics, MQTT, Foxglove.

An outlet is fed the steps of the session, which the views get too. It waits for nobody: what a broker or a viewer does
not take is dropped, the oldest first, and counted.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from captures.line import LineSettings

    from ..session import SessionStep

Tell = Callable[[str], None]  # says a line to the user, and waits for nobody


class OutletError(Exception):
    """An outlet that cannot begin: what, where, what to do."""


class Outlet(Protocol):
    """Where steps go to."""

    def feed(self, step: SessionStep, line: LineSettings) -> None:
        """A step, and what is known of the line by then."""

    def close(self) -> None:
        """No more comes; ends soon."""
