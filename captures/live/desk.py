"""When what was read is told: at once where somebody waits for it, together where much comes.

A record each read would wake the listener thousands of times a second. So reads are gathered for a few milliseconds;
when the line falls quiet they are told together with a tick, which says that nothing came since.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, Final

from .records import data_record, event_record, tick_record

HOLD_NS: Final = 15_000_000  # reads are gathered for so long at most
BEAT_NS: Final = 500_000_000  # between ticks on a line that stays quiet
_CLOCK_STEP_NS: Final = 500_000_000


class Clock:
    """Nanoseconds since the epoch that never step: the monotonic clock, set by the wall clock once."""

    def __init__(self) -> None:
        self._anchor = _wall_minus_monotonic()
        self._told = self._anchor

    def now(self) -> int:
        """The time, ns."""
        return self._anchor + time.monotonic_ns()

    def step(self) -> int | None:
        """By how much the wall clock was set, or the machine slept, since this was last asked; None for hardly, ns."""
        offset = _wall_minus_monotonic()
        step, told = offset - self._told, self._told
        self._told = offset if abs(step) >= _CLOCK_STEP_NS else told
        return step if abs(step) >= _CLOCK_STEP_NS else None

    @property
    def ahead_ns(self) -> int:
        """By how much the wall clock is ahead of this one now."""
        return self._told - self._anchor


def _wall_minus_monotonic() -> int:
    """The least disturbed of a few measurements, ns."""
    best = (1 << 62, 0)
    for _ in range(3):
        before = time.monotonic_ns()
        wall = time.time_ns()
        after = time.monotonic_ns()
        best = min(best, (after - before, wall - (before + after) // 2))
    return best[1]


class Desk:
    """Gathers records and hands them to `send`. `deadline` is when `due` wants to be called next."""

    def __init__(self, clock: Clock, send: Callable[[bytes], None], quiet_ns: int, idle_ns: int) -> None:
        self.clock = clock
        self._send = send
        self._quiet, self._idle = quiet_ns, idle_ns
        self._steps: list[int] = []  # after the last byte: when to tick
        self.listen_for(0)
        self._held: list[bytes] = []
        self._since = 0  # when the first of them came
        self._last = clock.now()  # the newest read, or beat

    def listen_for(self, silence_ns: int) -> None:
        """The line's own silences are so long: shorter ones are no news."""
        quiet = max(self._quiet, silence_ns)
        self._steps = sorted({quiet, max(self._idle, quiet)})
        self._ticked = len(self._steps)

    def read(self, t_ns: int, port: int, data: bytes, errors: list[int]) -> None:
        """A read of a port."""
        if not data:
            return
        if not self._held:
            self._since = t_ns
        self._held.append(data_record(t_ns, port, data, errors))
        self._last, self._ticked = t_ns, 0
        if t_ns - self._since >= HOLD_NS:
            self._flush()

    def event(self, port: int, kind: str, text: str, **more: Any) -> None:
        """Something happened; told at once."""
        self._held.append(event_record(self.clock.now(), port, kind, text, **more))
        self._flush()

    @property
    def deadline(self) -> int:
        """When there is something to do next, ns."""
        wait = self._steps[self._ticked] if self._ticked < len(self._steps) else BEAT_NS
        tick = self._last + wait
        return min(tick, self._since + HOLD_NS) if self._held else tick

    def due(self, now_ns: int) -> None:
        """Tick if the line has been quiet for long enough; call when all that came before `now_ns` was read."""
        while self._ticked < len(self._steps) and now_ns >= self._last + self._steps[self._ticked]:
            self._ticked += 1
            self._held.append(tick_record(now_ns))
        if self._ticked >= len(self._steps) and now_ns >= self._last + BEAT_NS:
            self._beat(now_ns)
        if self._held and (self._ticked or now_ns >= self._since + HOLD_NS):
            self._flush()

    def _beat(self, now_ns: int) -> None:
        self._last = now_ns
        if self.clock.step() is not None:
            ahead = self.clock.ahead_ns
            text = f"the computer's clock was set, or it slept: now {ahead / 1e9:+.3f} s against the recorded times"
            self._held.append(event_record(now_ns, 0, "clock", text, ahead_ns=ahead))
        self._held.append(tick_record(now_ns))

    def _flush(self) -> None:
        self._send(b"".join(self._held))
        self._held.clear()
