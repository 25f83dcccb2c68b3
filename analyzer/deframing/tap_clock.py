"""What the tap's times are worth, measured on the bus itself.

Bytes of a frame follow each other without a pause on a healthy line, so whatever the reads' times say beyond the
characters' own is the tap's doing: a read that came late by d shows as a silence of d, and the next one as one of -d.
Negative silences cannot be on the wire at all. From how many reads bring a frame and how far their silences stray
follows what may be said at all:

    a byte a read         silences inside frames count, give or take the jitter
    several bytes a read  only waits count, give or take the longest stray silence (FIFO, latency timer, network)

A log that writes its times to a second, or to a tenth of one, tells nothing finer: that shows, too, in the times.

Verdicts change at checkpoints, fixed numbers of frames, and rest on the frames before; the first one is made of the
first frames themselves and so is known only when they have passed.
"""

from __future__ import annotations

from bisect import bisect_right
from copy import copy
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from captures.line import LineSettings

from ..options import Options
from ..tables.bins import Spread
from ..tables.schema import NO_GAP, Kind, Protocol, Rows

FIRST: Final = 32  # frames of the first verdict
_EVERY: Final = 1024
_MEMORY: Final = 8192  # frames, beyond which old ones fade
_BYTE_BY_BYTE: Final = 0.9  # reads a byte
_QUANTILE: Final = 0.995
MARGIN: Final = 1.2  # times as far as a tap was seen to be wrong
_OFTEN: Final = 0.05  # of the sound frames that stray, by which the farthest is known
_ENOUGH: Final = 20.0  # frames that stray: of so many one goes about as far as any
_MOST_VERDICTS: Final = 512  # verdicts
USUAL_NS: Final = 5_000_000  # a read from user space, where nothing tells more
_FAST_BAUD: Final = 19200  # [2] 2.5.1.1: above it, both times are fixed
_T15_FIXED_NS, _T35_FIXED_NS = 750_000, 1_750_000
_STEPS_NS: Final = tuple(10**power for power in range(9, 3, -1))  # to which logs write their times; each holds the next
_FINE_STEP_NS: Final = 10**6  # in which no two frames end
_PLAIN_STEP_NS: Final = 10**8  # a few frames tell; finer ones may be round by chance, or packets' by a timer
_IN_STEP: Final = 0.9  # of the frames
_GLITCH: Final = 2  # bytes
UNKNOWN: Final = float("inf")


@dataclass(frozen=True, slots=True)
class TimeTrust:
    """What times can carry: `fine`, that silences inside frames count; ns by which those and waits may be wrong."""

    fine: bool = False
    jitter_ns: float = UNKNOWN
    wait_ns: float = UNKNOWN  # infinite where nothing is known
    bytes_a_read: float = 0.0
    step_ns: float = 0.0  # to which times are written


def silences(line: LineSettings, options: Options) -> tuple[float, float]:
    """t1.5 and t3.5 in ns; infinite where the line's speed is not known."""
    character_ns = line.nominal_character_ns
    if line.baud is None or character_ns is None:
        t15, t35 = UNKNOWN, UNKNOWN
    elif line.baud > _FAST_BAUD:
        t15, t35 = _T15_FIXED_NS, _T35_FIXED_NS
    else:
        t15, t35 = 1.5 * character_ns, 3.5 * character_ns
    return (
        t15 if options.t15_ns is None else float(options.t15_ns),
        t35 if options.t35_ns is None else float(options.t35_ns),
    )


class TapClock:
    """Learns from frames as they pass; `verdict` says what was known at a frame."""

    _speed_declared: bool
    _character_ns: float
    _frames: int
    _next: int
    _timed: float
    _in_step: NDArray[np.float64]
    _heard: dict[Protocol, _HeardFrames]
    _waiting: list[Rows]
    _last: Rows
    _rest: tuple[NDArray[Any], ...]
    _count: int
    _since: list[int]
    _verdicts: list[TimeTrust]
    _best: TimeTrust

    def __init__(self, line: LineSettings) -> None:
        self._speed_declared = bool(line.baud)
        self._character_ns = line.nominal_character_ns or UNKNOWN
        self._frames = 0
        self._next = FIRST
        self._timed = 0.0  # frames
        self._in_step = np.zeros(len(_STEPS_NS))  # of these, those whose last byte's time is written to such a step
        self._heard = {protocol: _HeardFrames() for protocol in Protocol}
        self._waiting = []  # and the columns of rows before these: frames since the newest checkpoint
        self._last = Rows.zeros(0)  # the row before all that wait
        self._rest = _columns_of(Rows.zeros(0), Rows.zeros(0))
        self._count = 0  # of all of these
        self._since = []  # from which frame on each verdict holds
        self._verdicts = []
        self._best = TimeTrust()

    def feed(self, rows: Rows) -> None:
        """Learn from the frames among rows, in their order."""
        if len(rows):
            self._waiting.append(rows)  # looked at where a checkpoint is passed: on a live line they are few
        self._count += int(np.count_nonzero(rows.kind))  # all but NOISE
        if self._frames + self._count < self._next:
            return
        columns, low = self._taken(), 0
        while (high := low + self._next - self._frames) <= len(columns[0]):
            self._learn(*(column[low:high] for column in columns))
            self._frames, low = self._next, high
            self._conclude()
            self._next += self._next if self._next < _EVERY else _EVERY
        self._rest = tuple(column[low:].copy() for column in columns)
        self._count = len(self._rest[0])

    def _taken(self) -> tuple[NDArray[Any], ...]:
        columns = self._columns()
        self._last = [self._last, *self._waiting][-1][-1:].copy()
        self._waiting, self._rest, self._count = [], _columns_of(Rows.zeros(0), Rows.zeros(0)), 0
        return columns

    def _columns(self) -> tuple[NDArray[Any], ...]:
        """What waits to be learnt."""
        before = (rows[-1:] for rows in (self._last, *self._waiting))
        parts = [self._rest, *map(_columns_of, self._waiting, before)]
        return tuple(np.concatenate(column) for column in zip(*parts, strict=True))

    def close(self) -> None:
        """No more frames come: the first verdict is made of those there were."""
        if not self._verdicts:
            if self._count:
                self._learn(*self._taken())
            self._conclude()

    def verdict(self, index: int) -> TimeTrust:
        """What was known at a frame; nothing, as long as the first verdict is to come."""
        return self._verdicts[max(bisect_right(self._since, index) - 1, 0)] if self._verdicts else TimeTrust()

    def best(self) -> TimeTrust:
        """The verdict so far by which most may be said."""
        return self._best

    @property
    def off_ns(self) -> float:
        """By how much a response time may be wrong, as measured; 0 where nothing speaks against it, UNKNOWN if it is.

        Before the first verdict, by what has passed so far.
        """
        if not self.known and self._count:
            return self._early().off_ns
        verdict = self.newest()
        if verdict.wait_ns == UNKNOWN:
            return UNKNOWN if self.known else 0.0
        return verdict.step_ns if not verdict.fine and verdict.wait_ns == USUAL_NS else verdict.wait_ns

    def _early(self) -> TapClock:
        """The same as if no more frames came; nothing is learnt of any before the first verdict."""
        early = copy(self)
        early._in_step, early._heard = np.zeros(len(_STEPS_NS)), {each: _HeardFrames() for each in Protocol}
        early._since, early._verdicts = [], []
        early._learn(*self._columns())
        early._conclude()
        return early

    @property
    def known(self) -> bool:
        """Whether the first verdict is made."""
        return bool(self._verdicts)

    def newest(self) -> TimeTrust:
        """The verdict of now; nothing before the first one."""
        return self._verdicts[-1] if self._verdicts else TimeTrust()

    def _conclude(self) -> None:
        self._since.append(self._frames if self._verdicts else 0)
        self._verdicts.append(self._now())
        self._best = max(self._best, self._verdicts[-1], key=lambda verdict: (verdict.fine, -verdict.wait_ns))
        if len(self._verdicts) > _MOST_VERDICTS:
            del self._since[0], self._verdicts[0]
        if self._timed > _MEMORY:
            self._timed /= 2
            self._in_step /= 2
            for heard in self._heard.values():
                heard.fade()

    def _learn(self, protocol: NDArray[Any], ends: NDArray[Any], *columns: NDArray[Any]) -> None:
        self._timed += len(ends)
        in_step = ends
        for which in range(len(_STEPS_NS) - 1, -1, -1):  # what is in step with one is with all that are finer
            in_step = in_step[in_step % _STEPS_NS[which] == 0]
            if not len(in_step):
                break
            self._in_step[which] += len(in_step)
        if not protocol.any():
            self._heard[Protocol.RTU].add(ends, *columns)
            return
        for each, heard in self._heard.items():
            if len(own := np.flatnonzero(protocol == each)):
                heard.add(ends[own], *(column[own] for column in columns))

    def _now(self) -> TimeTrust:
        rtu, ascii_mode, _ = self._heard.values()
        finest = 0 if self._timed >= FIRST and (rtu.octets or ascii_mode.octets) else _PLAIN_STEP_NS
        enough = _IN_STEP * self._timed
        steps = zip(_STEPS_NS, self._in_step.tolist(), strict=True)
        step = next((step for step, count in steps if step >= finest and count >= enough), 0)
        if rtu.octets:
            trust = self._by_silences(rtu, rtu.shared + (rtu.together if step <= _FINE_STEP_NS else 0))
        elif ascii_mode.octets:
            whole = ascii_mode.reads < _BYTE_BY_BYTE * ascii_mode.octets  # several bytes a read
            trust = self._by_silences(ascii_mode, ascii_mode.shared) if whole else self._by_lateness(ascii_mode)
        else:  # packets, which have times of their own
            trust = TimeTrust(False, UNKNOWN, USUAL_NS if self._timed else UNKNOWN)
        return replace(trust, step_ns=step, wait_ns=max(trust.wait_ns, step)) if step else trust

    def _by_silences(self, heard: _HeardFrames, shared: float) -> TimeTrust:
        each = heard.octets / max(heard.reads, 1.0)
        jitter = heard.late.quantile(_QUANTILE)
        fine = self._speed_declared and heard.reads >= _BYTE_BY_BYTE * heard.octets and jitter is not None
        if fine and jitter is not None:
            return TimeTrust(True, jitter, jitter, each)
        astray = heard.astray.quantile(_QUANTILE) if self._speed_declared else None
        if astray is not None and self._strays_tell(heard, astray, each):
            return TimeTrust(False, UNKNOWN, astray * MARGIN, each)
        return TimeTrust(False, UNKNOWN, USUAL_NS if heard.alone(shared) else UNKNOWN, each)

    def _by_lateness(self, heard: _HeardFrames) -> TimeTrust:
        """Of ASCII mode byte by byte, whose senders may pause within a frame: only what comes too soon is the tap's."""
        each = heard.octets / max(heard.reads, 1.0)
        late = heard.late.quantile(_QUANTILE) if self._speed_declared else None
        if late:
            return TimeTrust(False, UNKNOWN, late * MARGIN, each)
        return TimeTrust(False, UNKNOWN, USUAL_NS if heard.alone(heard.shared) else UNKNOWN, each)

    def _strays_tell(self, heard: _HeardFrames, astray: float, each: float) -> bool:
        """Whether frames that stray tell how late reads may be: many do, or enough, and by as much as a usual read must
        be late for the first of the bytes that it brings."""
        many, weight = _OFTEN * heard.sound, heard.astray.weight
        return weight >= many or (weight >= _ENOUGH and astray >= each * self._character_ns)


def _columns_of(rows: Rows, last: Rows) -> tuple[NDArray[Any], ...]:
    """Of the frames among rows, what a clock learns from; `last`: the row before them, if there is one."""
    frames = rows.kind != Kind.NOISE
    before = np.where(rows.start > 0, rows.gap_before_ns, 0)  # before the first one of a port nothing came at all
    if not frames.all() or (last.kind == Kind.NOISE).any():
        before[_hard_behind_a_glitch(rows, last)] = 0  # the read brought no other frame, nor a silence
        rows, before = rows[frames], before[frames]
    most, least = rows.gap_most_ns, rows.gap_least_ns
    return rows.protocol, rows.t_end_ns, rows.reads, rows.length, before, most, least, rows.check


def _hard_behind_a_glitch(rows: Rows, last: Rows) -> NDArray[np.bool_]:
    """Which rows go on in the read of the one before, which is a byte or two that a driver made."""
    kind, port, length, start = (
        np.concatenate((last.column(name), rows.column(name))) for name in ("kind", "port", "length", "start")
    )
    follows = (kind == Kind.NOISE) & (length <= _GLITCH)
    follows = follows[:-1] & (port[1:] == port[:-1]) & (start[1:] == start[:-1] + length[:-1])
    found: NDArray[np.bool_] = rows.gap_before_ns == NO_GAP
    found[1 - len(last) :] &= follows
    found[: 1 - len(last)] = False
    return found


class _HeardFrames:
    """What the reads tell of frames of one protocol, old ones fading."""

    reads: float
    octets: float
    shared: float
    together: float
    counted: float
    sound: float
    late: Spread
    astray: Spread

    def __init__(self) -> None:
        self.reads = self.octets = self.shared = self.together = self.counted = self.sound = 0.0
        self.late = Spread()  # frames by their least silence, if negative
        self.astray = Spread()  # frames of several reads by their silence that is farthest from none

    def fade(self) -> None:
        """Half of it is forgotten."""
        for name in ("reads", "octets", "shared", "together", "counted", "sound"):
            setattr(self, name, getattr(self, name) / 2)
        self.late.fade()
        self.astray.fade()

    def alone(self, shared: float) -> bool:
        """Whether each frame came in a read of its own."""
        return shared <= 0.01 * self.counted

    def add(
        self,
        ends: NDArray[Any],
        reads: NDArray[Any],
        length: NDArray[Any],
        before: NDArray[Any],
        most: NDArray[Any],
        least: NDArray[Any],
        check: NDArray[Any],
    ) -> None:
        """Frames in their order: columns of `Rows`."""
        self.counted += len(reads)
        self.sound += float(np.count_nonzero(check))
        self.reads += float(reads.sum())
        self.octets += float(length.sum())
        shared = before == NO_GAP
        self.shared += float(np.count_nonzero(shared))
        self.together += float(np.count_nonzero(ends[1:] == ends[:-1]))
        early = np.maximum(-before, 0)
        early[shared] = 0
        several = least != NO_GAP
        if several.any():
            least, first = least[several], early[several]
            self.late.add(np.maximum(-least, first))
            astray = np.maximum(np.maximum(np.abs(most[several]), np.abs(least)), first)
            self.astray.add(astray[check[several]])  # a damaged frame may hold a silence of the line's own
            early = early[~several]
        if early.any():
            self.astray.add(early)
