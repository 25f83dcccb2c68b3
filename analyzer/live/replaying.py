"""A capture as a session's source: played back in its own time, faster, or step by step.

Items carry the capture's own times, with the ticks that a tap would have given between its reads.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from typing import Final

from captures.chunks import Block, Capture
from captures.line import LineSettings
from captures.live.listening import IDLE_NS, QUIET_NS
from captures.live.wire import Item, Tick

_TOGETHER_NS: Final = 15_000_000  # of the player's time: reads given at once
_BEAT_NS: Final = 500_000_000
_PIECE: Final = 1 << 16  # bytes at once at full speed


class Replay:
    """Plays `capture` at `speed` times its own; None is as fast as it goes. Pause, step and speed at any time."""

    waits = True

    def __init__(self, capture: Capture, speed: float | None = 1.0) -> None:
        self._capture = capture
        self._change = threading.Condition()
        self._speed = speed
        self._paused = False
        self._steps = 0
        self._closed = False

    @property
    def line(self) -> LineSettings:
        """The capture's."""
        return self._capture.line

    @property
    def paused(self) -> bool:
        """Whether it stands still."""
        return self._paused

    @property
    def speed(self) -> float | None:
        """How many times as fast as it was; None for as fast as it goes."""
        return self._speed

    def pause(self) -> None:
        """Stand still, or go on."""
        with self._change:
            self._paused = not self._paused
            self._change.notify_all()

    def step(self) -> None:
        """Stand still, but give one more read."""
        with self._change:
            self._paused = True
            self._steps += 1
            self._change.notify_all()

    def set_speed(self, speed: float | None) -> None:
        """Another speed from now on."""
        with self._change:
            self._speed = speed
            self._change.notify_all()

    def close(self) -> None:
        """End soon."""
        self._closed = True  # no lock: a signal's handler may call this
        if self._change.acquire(blocking=False):
            self._change.notify_all()
            self._change.release()

    def judge(self, heard: int, sense: int) -> None:
        """A capture's settings are what they are."""

    def items(self) -> Iterator[Item]:
        """Blocks and ticks, when their time has come."""
        now: int | None = None  # the capture's time
        for block in self._capture.blocks():
            at = 0
            while at < len(block) and not self._closed:
                due = int(block.t_ns[at])
                if now is not None:
                    yield from self._wait(now, due)
                now = due
                last = self._batch(block, at)
                if self._closed:
                    return
                yield block.slice(at, last)
                at, now = last, int(block.t_ns[last - 1])
        if now is not None:
            yield Tick(now + IDLE_NS)

    def _batch(self, block: Block, first: int) -> int:
        """The end of the reads that are given together."""
        with self._change:
            if self._steps:
                self._steps -= 1
                return first + 1
            if self._paused:
                return first + 1
            if self._speed is None:
                return max(first + 1, int(block.offsets.searchsorted(block.offsets[first] + _PIECE)) - 1)
            until = int(block.t_ns[first]) + int(_TOGETHER_NS * min(1.0, self._speed))
            return max(first + 1, first + int(block.t_ns[first:].searchsorted(until)))

    def _wait(self, now: int, due: int) -> Iterator[Item]:
        """Let the time from `now` to `due` go by, with the ticks that fall into it."""
        ticks = [now + wait for wait in (QUIET_NS, IDLE_NS) if now + wait < due]
        place, seen = float(now), time.monotonic_ns()
        next_beat = seen + _BEAT_NS
        while not self._closed:
            with self._change:
                if self._steps or (self._speed is None and not self._paused):
                    break
                speed = 0.0 if self._paused or self._speed is None else self._speed
                until = min([*ticks[:1], due]) if speed else due
                left_s = (until - place) / speed / 1e9 if speed else 3600.0
                self._change.wait(max(0.0, min(left_s, (next_beat - seen) / 1e9)))
                before, seen = seen, time.monotonic_ns()
                place += (seen - before) * speed
            if place >= due:
                break
            if ticks and place >= ticks[0]:
                yield Tick(ticks.pop(0))
            elif seen >= next_beat:
                next_beat = seen + _BEAT_NS
                yield Tick(int(place))
        for tick in ticks[-1:]:
            yield Tick(tick)
