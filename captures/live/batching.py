"""The reader process's side of its pipes: records that it writes without waiting, commands that it reads, and when.

What was read is told at once where somebody waits for it, together where much comes.
"""

from __future__ import annotations

import json
import os
import struct
import time
from collections.abc import Callable, Sequence
from typing import Any, Final

HEAD: Final = struct.Struct("<BBqI")  # kind, port, t_ns, bytes that follow
READS: Final = 1
TICK: Final = 2
EVENT: Final = 3
POSITION: Final = 4  # over a network: which record comes next, JSON
COUNTS: Final = struct.Struct("<II")  # of READS: reads, bytes with an error; then the columns of `reads_record`

_BACKLOG: Final = 64 << 20  # bytes kept for a listener that does not take them

Read = tuple[int, int, bytes, Sequence[int]]  # t_ns, port, bytes (some), offsets of those with an error


def reads_record(reads: Sequence[Read]) -> bytes:
    """Some reads as columns: t_ns (int64), size (uint16) and port (uint8) of each, marked bytes (uint32), all bytes."""
    times, ports, parts, marks = zip(*reads, strict=True)
    errors: list[int] = []
    if any(marks):
        begin = 0
        for data, offsets in zip(parts, marks, strict=True):
            errors += [begin + offset for offset in offsets]
            begin += len(data)
    n = len(reads)
    columns = struct.pack(f"<{n}q{n}H{n}B{len(errors)}I", *times, *map(len, parts), *ports, *errors)
    body = COUNTS.pack(n, len(errors)) + columns + b"".join(parts)
    return HEAD.pack(READS, 0, times[-1], len(body)) + body


def tick_record(t_ns: int) -> bytes:
    """Nothing more came up to then."""
    return HEAD.pack(TICK, 0, t_ns, 0)


def event_record(t_ns: int, port: int, kind: str, text: str, **more: Any) -> bytes:
    """Something happened to a port."""
    said = json.dumps({"kind": kind, "text": text, **more}).encode()
    return HEAD.pack(EVENT, port, t_ns, len(said)) + said


def position_record(t_ns: int, position: dict[str, Any]) -> bytes:
    """From here on another place in the stream: see `tapstream`."""
    said = json.dumps(position).encode()
    return HEAD.pack(POSITION, 0, t_ns, len(said)) + said


class Commands:
    """Lines of standard input, as they come."""

    def __init__(self) -> None:
        self._rest = b""

    def take_commands(self) -> list[dict[str, Any]] | None:
        """The commands that came; None at the end."""
        data = os.read(0, 1 << 16)
        if not data:
            return None
        *lines, self._rest = (self._rest + data).split(b"\n")
        return [json.loads(line) for line in lines if line]


class Pipe:
    """Standard output; what it does not take at once is kept, up to a limit."""

    def __init__(self, *, blocking: bool) -> None:
        self._kept = bytearray()
        if not blocking:
            os.set_blocking(1, False)

    @property
    def waiting(self) -> bool:
        return bool(self._kept)

    def send(self, data: bytes) -> None:
        """Write, or keep; a listener that is stuck for good ends this process, which must not eat all memory."""
        self._kept += data
        if len(self._kept) > _BACKLOG:
            raise SystemExit("the listener takes nothing")
        self.push()

    def push(self) -> None:
        """Write what is kept, as far as it goes."""
        while self._kept:
            try:
                written = os.write(1, self._kept)
            except BlockingIOError:
                return
            except OSError:  # the listener is gone
                raise SystemExit(0) from None
            del self._kept[:written]

    def drain(self) -> None:
        """Write all of it, waiting for the listener."""
        if self._kept:
            os.set_blocking(1, True)
            self.push()


BEAT_NS: Final = 500_000_000  # between ticks on a line that stays quiet
_PAUSE_NS: Final = 1_200_000  # more than is between the reads of a USB adapter amid a frame
_MORE: Final = 1.1  # times as long reads are gathered where no pause comes
_CLOCK_STEP_NS: Final = 500_000_000


class SteadyClock:
    """Nanoseconds since the epoch that never step: a monotonic clock, set by the wall clock once.

    `perf_counter`, not `monotonic`, which on Windows ticks every 16 ms in the older Pythons: no gap would be left.
    """

    def __init__(self) -> None:
        self._anchor = _wall_minus_monotonic()
        self._told = self._anchor

    def now(self) -> int:
        """The time, ns."""
        return self._anchor + time.perf_counter_ns()

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
        before = time.perf_counter_ns()
        wall = time.time_ns()
        after = time.perf_counter_ns()
        best = min(best, (after - before, wall - (before + after) // 2))
    return best[1]


class ReadBatching:
    """Gathers records and hands them to `send`. `deadline` is when `due` wants to be called next, ns."""

    def __init__(
        self, clock: SteadyClock, send: Callable[[bytes], None], *, hold_ns: int, quiet_ns: int, idle_ns: int
    ) -> None:
        """The times are those of `listening.Listening`."""
        self.clock = clock
        self._send = send
        self._hold, self._quiet, self._idle = hold_ns, quiet_ns, idle_ns
        self._most = int(_MORE * hold_ns)
        self._steps: list[int] = []  # after the last byte: when to tick
        self.listen_for(0)
        self._reads: list[Read] = []  # gathered
        self._since = 0  # since when they wait, ns: the first of them, or the end of the oldest frame not told,
        self._whole = False  # where one is known
        self._held: list[bytes] = []  # records behind them
        self._last = clock.now()  # the newest read, or beat
        self.deadline = 0
        self._plan()

    def listen_for(self, silence_ns: int) -> None:
        """The line's own silences are so long: shorter ones are no news."""
        quiet = max(self._quiet, silence_ns)
        self._steps = sorted({quiet, max(self._idle, quiet)})
        self._pause = max(_PAUSE_NS, silence_ns)
        self._ticked = len(self._steps)

    def read(self, t_ns: int, port: int, data: bytes, errors: Sequence[int]) -> None:
        """A read of a port."""
        if not data:
            return
        reads, last = self._reads, self._last
        paused = t_ns - last > self._pause
        if not reads:
            self._since = t_ns
        if paused and not self._whole and not self._ticked:  # else it was told with a tick
            self._whole, self._since = True, last
        reads.append((t_ns, port, data, errors))
        self._last, self._ticked = t_ns, 0
        latest = self._since + self._most
        if t_ns >= (self._since + self._hold if paused else latest):
            self._held.append(tick_record(t_ns))  # this read is over: the next one will be later
            self._flush()
        else:
            self.deadline = min(t_ns + self._steps[0], latest)

    def event(self, port: int, kind: str, text: str, **more: Any) -> None:
        """Something happened; told at once."""
        self._held.append(event_record(self.clock.now(), port, kind, text, **more))
        self._flush()

    def due(self, now_ns: int) -> None:
        """Tick if the line has been quiet for long enough; call when all that came before `now_ns` was read."""
        while self._ticked < len(self._steps) and now_ns >= self._last + self._steps[self._ticked]:
            self._ticked += 1
            self._held.append(tick_record(now_ns))
        if self._ticked >= len(self._steps) and now_ns >= self._last + BEAT_NS:
            self._beat(now_ns)
        if self._reads and not self._held and now_ns >= self._since + self._most:
            self._held.append(tick_record(now_ns))
        if self._held:
            self._flush()
        else:
            self._plan()

    def _beat(self, now_ns: int) -> None:
        self._last = now_ns
        if self.clock.step() is not None:
            ahead = self.clock.ahead_ns
            text = f"the computer's clock was changed, or it slept: now {ahead / 1e9:+.3f} s off the recorded times"
            self._held.append(event_record(now_ns, 0, "clock", text, ahead_ns=ahead))
        self._held.append(tick_record(now_ns))

    def _flush(self) -> None:
        if self._reads:
            self._held.insert(0, reads_record(self._reads))
            self._reads.clear()
        self._whole = False
        self._send(b"".join(self._held))
        self._held.clear()
        self._plan()

    def _plan(self) -> None:
        """When there is something to do next, if nothing more comes."""
        wait = self._steps[self._ticked] if self._ticked < len(self._steps) else BEAT_NS
        self.deadline = self._last + wait
        if self._reads:
            self.deadline = min(self.deadline, self._since + self._most)
