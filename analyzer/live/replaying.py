"""A capture as a session's source: played back in its own time, faster, or step by step.

Items carry the capture's own times, with the ticks that a tap would have given between its reads.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final, Literal

from captures.chunks import Block, Capture
from captures.errors import CaptureError
from captures.line import LineSettings
from captures.live.listening import IDLE_NS, QUIET_NS
from captures.live.pace import sleep_until
from captures.live.settings import FALLBACK_BAUD, PortSettings
from captures.live.wire import Item, Tick

from ..core import deframe
from ..tables.schema import Kind

_TOGETHER_NS: Final = 15_000_000  # of the player's time: reads given at once
_BEAT_NS: Final = 500_000_000
_BURST: Final = 1 << 16  # bytes at once at full speed


class Replay:
    """Plays `capture` at `speed` times its own; None is as fast as it goes. Pause, step and speed at any time."""

    waits = True
    more = False

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

    def judge(self, heard: int, sense: int, line: LineSettings) -> None:
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
                return max(first + 1, int(block.offsets.searchsorted(block.offsets[first] + _BURST)) - 1)
            until = int(block.t_ns[first]) + int(_TOGETHER_NS * min(1.0, self._speed))
            return max(first + 1, first + int(block.t_ns[first:].searchsorted(until)))

    def _wait(self, now: int, due: int) -> Iterator[Item]:
        """Let the time from `now` to `due` go by, with the ticks that fall into it."""
        ticks = [now + wait for wait in (QUIET_NS, IDLE_NS) if now + wait < due]
        position, clock = float(now), time.monotonic_ns()
        next_beat = clock + _BEAT_NS
        while not self._closed:
            with self._change:
                if self._steps or (self._speed is None and not self._paused):
                    break
                speed = 0.0 if self._paused or self._speed is None else self._speed
                until = min([*ticks[:1], due]) if speed else due
                left_s = (until - position) / speed / 1e9 if speed else 3600.0
                self._change.wait(max(0.0, min(left_s, (next_beat - clock) / 1e9)))
                before, clock = clock, time.monotonic_ns()
                position += (clock - before) * speed
            if position >= due:
                break
            if ticks and position >= ticks[0]:
                yield Tick(ticks.pop(0))
            elif clock >= next_beat:
                next_beat = clock + _BEAT_NS
                yield Tick(int(position))
        for tick in ticks[-1:]:
            yield Tick(tick)


# A capture played onto a port: the one place in this project that transmits, and only when asked to.
#
# Bytes go out when the wire carried them, read by read, or frame by frame where only one direction is wanted; silences
# between them are kept as well as the system's timers allow (about 0.1 ms).


Only = Literal["requests", "responses"]


@dataclass(frozen=True, slots=True)
class TimedBytes:
    """Bytes that began on the wire at `t_ns`, by the capture's clock."""

    t_ns: int
    data: bytes


def pieces(capture: Capture, only: Only | None = None) -> Iterator[TimedBytes]:
    """What to play: every read, or the frames of one direction."""
    if only is not None:
        kind = Kind.REQUEST if only == "requests" else Kind.RESPONSE
        for batch in deframe(capture):
            for row in (batch.rows.kind == kind).nonzero()[0].tolist():
                yield TimedBytes(int(batch.rows.t_start_ns[row]), batch.bytes_of(row))
        return
    line = capture.line
    character = line.nominal_character_ns or 0.0
    for chunk in capture.chunks():
        yield TimedBytes(chunk.t_ns - round(len(chunk.data) * character), chunk.data)


def play(
    capture: Capture,
    port: PortSettings,
    *,
    speed: float | None = 1.0,
    only: Only | None = None,
    stop: Callable[[], bool] = bool,
    opened: Callable[[], object] = bool,
) -> int:
    """Play onto a port; how many bytes went out. CaptureError where it can't be used; else `opened` is called first."""
    import serial

    from captures.live.tap import GONE, refusal

    try:
        out = serial.serial_for_url(
            port.url, baudrate=port.baud or FALLBACK_BAUD, parity=port.parity, stopbits=port.stop_bits, write_timeout=5
        )
    except (OSError, ValueError) as error:
        raise CaptureError(refusal(port.url, error)) from error
    opened()
    sent, begun, first = 0, time.monotonic_ns(), None
    with out:
        try:
            for read in pieces(capture, only):
                first = read.t_ns if first is None else first
                if speed is not None:
                    sleep_until(begun + round((read.t_ns - first) / speed), stop)
                if stop():
                    break
                out.write(read.data)
                sent += len(read.data)
            out.flush()
        except serial.SerialTimeoutException as error:
            raise CaptureError(f"{port.url}: after {sent:,} bytes: the other end accepts no more") from error
        except _losses() as error:
            raise CaptureError(f"{port.url}: after {sent:,} bytes: {GONE}") from error
    return sent


def _losses() -> tuple[type[Exception], ...]:
    """What is raised by a port that is not there any more."""
    import serial

    try:
        from termios import error
    except ImportError:  # Windows
        return (serial.SerialException,)
    return serial.SerialException, error
