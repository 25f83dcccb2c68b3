"""What leaves a session for other programs, beside what is shown: metrics, MQTT, Foxglove.

An outlet is fed the steps of the session, which the views get too. It waits for nobody: what a broker or a viewer does
not take is dropped, the oldest first, and counted.
"""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Protocol

from ...errors import RtuscopeError

if TYPE_CHECKING:
    from captures.line import LineSettings

    from ..session import SessionStep

Tell = Callable[[str], None]  # says a line to the user, and waits for nobody


class OutletError(RtuscopeError):
    """An outlet that cannot begin: what, where, what to do."""


class Outlet(Protocol):
    """Where steps go to."""

    def feed(self, step: SessionStep, line: LineSettings) -> None:
        """A step, and what is known of the line by then."""

    def close(self) -> None:
        """No more comes; ends soon."""


MOST: Final = 10_000  # messages that wait


@dataclass(frozen=True, slots=True)
class Letter:
    """A message. `state`: kept by the broker, and only its newest counts; else an event, told once."""

    topic: str
    payload: str
    state: bool = True


class Mailbox:
    """Messages from the analysis to the thread that sends them."""

    def __init__(self, most: int = MOST) -> None:
        self._most = most
        self._waiting: OrderedDict[object, Letter] = OrderedDict()
        self._events = 0  # so far: their keys
        self._lock = threading.Condition()
        self._dropped = 0

    def put(self, letter: Letter) -> None:
        """Leave a message; waits for nobody."""
        with self._lock:
            key: object = letter.topic
            if not letter.state:
                self._events += 1
                key = self._events
            elif self._waiting.pop(key, None) is not None:
                self._dropped += 1
            self._waiting[key] = letter
            if len(self._waiting) > self._most:
                self._waiting.popitem(last=False)
                self._dropped += 1
            self._lock.notify()

    def put_back(self, letter: Letter) -> None:
        """A message that did not go out, unless a newer one of its topic waits."""
        with self._lock:
            self._waiting.setdefault(letter.topic if letter.state else object(), letter)
            self._waiting.move_to_end(next(reversed(self._waiting)), last=False)

    def get(self, timeout_s: float) -> Letter | None:
        """The oldest message, or None where none comes in time."""
        with self._lock:
            if not self._waiting:
                self._lock.wait(timeout_s)
            return self._waiting.popitem(last=False)[1] if self._waiting else None

    def dropped(self) -> int:
        """Messages that were dropped since this was asked last."""
        with self._lock:
            dropped, self._dropped = self._dropped, 0
            return dropped

    def __len__(self) -> int:
        return len(self._waiting)
