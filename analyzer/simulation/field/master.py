"""The client: it polls its list, waits, asks again, goes on; what it got and what it lost is the truth of a case."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from random import Random
from typing import Literal

from dissectors.crc import crc_ok

from ..conversation import adu
from .units import RTU, Shape, WireEnvelope, burst_of
from .wire import FieldWire, LineUart, ReceivedOctet

MS = 1e6
_BAD_NS = 6 * MS  # of silence behind bytes that make no answer, for a client that does not wait for its timeout


@dataclass(slots=True)
class FieldPoll:
    """One entry of a client's list: a PDU (made anew each time, for writes), how often (ns; 0: each cycle)."""

    unit: int
    pdu: Callable[[float], bytes]
    period_ns: float = 0.0
    due: float = 0.0


@dataclass(slots=True)
class FieldRequest:
    """What became of one request."""

    unit: int
    end: float
    result: Literal["open", "answered", "exception", "lost", "broadcast"] = "open"


@dataclass(slots=True)
class Manners:
    """How a client goes about it; times in ms."""

    timeout_ms: float = 300.0
    retries: int = 1
    pause_ms: Callable[[float], float] = lambda _: 5.0
    cycle_ms: float = 0.0  # least time of a cycle; 0: at once again
    turnaround_ms: float = 120.0
    on_bad: Literal["wait", "again"] = "wait"
    on_stranger: Literal["ignore", "again"] = "ignore"
    deaf_ms: float = 0.0  # behind its requests
    compares_values: bool = True  # of an answer to a write with those that it wrote


@dataclass(slots=True)
class FieldMaster:
    """A client on the line."""

    uart: LineUart
    wire: FieldWire
    random: Random
    polls: list[FieldPoll]
    manners: Manners
    shapes: list[Shape] = field(default_factory=list)
    requests: list[FieldRequest] = field(default_factory=list)
    strength: float = 1.2
    takes_prefix: bool = False  # reads as many bytes as it expects and lets go of more
    envelope: WireEnvelope = RTU
    hasty_ns: float | None = None  # its pause, where it does not keep t3.5
    _at: int = 0
    _cycle: float = 0.0
    _tries: int = 0
    _turn: int = 0  # a number a request, so that an old timeout does nothing
    _poll: FieldPoll | None = None
    _sent: bytes = b""
    _waiting: bool = False
    _heard: list[ReceivedOctet] = field(default_factory=list)

    @property
    def waits(self) -> bool:
        """Whether an answer is due."""
        return self._waiting

    def start(self, t: float) -> None:
        """Begin to poll then."""
        self.wire.listeners.append(self)
        self._cycle = t
        self.wire.schedule.at(t, self._next)

    def hear(self, octets: Sequence[ReceivedOctet], t: float) -> None:
        """Bytes since the last time; nobody sends any more at `t`."""
        if not self._waiting or not self.requests:
            return
        deaf_ns = max(0.5 * self.uart.char_ns, self.manners.deaf_ms * MS)
        mine = [octet for octet in octets if octet.t_ns > self.requests[-1].end + deaf_ns]
        self._heard += mine
        if not self._heard:
            return
        data = self.envelope.take(bytes(octet.value for octet in self._heard))
        if self.takes_prefix and len(data) > 5 and not data[-1]:
            data = _whole_before_zeros(data)
        adu = None if any(octet.error for octet in self._heard) or not crc_ok(data) else data
        if adu is not None and fits(self._sent, adu, values=self.manners.compares_values):
            self.requests[-1].result = "exception" if adu[1] & 0x80 else "answered"
            self._done(self._heard[-1].t_ns)
        elif adu is not None:
            self._heard = []
            if self.manners.on_stranger == "again":
                self._fail(t)
        elif mine and self.manners.on_bad == "again":
            turn, count = self._turn, len(self._heard)
            wait = _BAD_NS + self.uart.silence_ns
            self.wire.schedule.at(t + wait, lambda now: self._gave_up_on_bad(turn, count, now))

    def _gave_up_on_bad(self, turn: int, count: int, now: float) -> None:
        if turn == self._turn and self._waiting and len(self._heard) == count:
            self._fail(now)

    def _next(self, now: float) -> None:
        timed = [poll for poll in self.polls if poll.period_ns and poll.due <= now]
        if timed:
            poll = min(timed, key=lambda one: one.due)
            poll.due = max(poll.due + poll.period_ns, now)
            self._begin(poll, now)
            return
        listed = [poll for poll in self.polls if not poll.period_ns]
        if listed and self._at >= len(listed):
            if now < self._cycle:
                soonest = min((poll.due for poll in self.polls if poll.period_ns), default=self._cycle)
                self.wire.schedule.at(min(max(soonest, now), self._cycle), self._next)
                return
            self._at = 0
        if not listed:
            self.wire.schedule.at(min(poll.due for poll in self.polls), self._next)
            return
        if self._at == 0:
            self._cycle = max(self._cycle, now - self.manners.cycle_ms * MS) + self.manners.cycle_ms * MS
        poll = listed[self._at]
        self._at += 1
        self._begin(poll, now)

    def _begin(self, poll: FieldPoll, now: float) -> None:
        self._poll, self._tries = poll, 0
        self._sent = adu(poll.unit, poll.pdu(now))
        self._send(now)

    def _send(self, now: float) -> None:
        assert self._poll is not None
        self._turn += 1
        self._heard = []
        burst = burst_of(self, self.uart, self.envelope.put(self._sent), now)
        burst.strength = self.strength
        for shape in self.shapes:
            shape(burst, self.random)
        self.requests.append(FieldRequest(self._poll.unit, burst.last))
        self.wire.send(burst)
        if self._poll.unit == 0:
            self.requests[-1].result = "broadcast"
            self._waiting = False
            self.wire.schedule.at(burst.last + self.manners.turnaround_ms * MS, self._next)
            return
        self._waiting = True
        turn = self._turn
        self.wire.schedule.at(burst.last + self.manners.timeout_ms * MS, lambda t: self._timed_out(turn, t))

    def _timed_out(self, turn: int, now: float) -> None:
        if turn == self._turn and self._waiting:
            self._fail(now)

    def _fail(self, now: float) -> None:
        self.requests[-1].result = "lost"
        self._tries += 1
        if self._tries <= self.manners.retries:
            self._waiting = False
            self.wire.schedule.at(now + self._pause(now), self._send)
        else:
            self._done(now)

    def _done(self, t: float) -> None:
        self._waiting = False
        self.wire.schedule.at(max(t + self._pause(t), self.wire.schedule.now), self._next)

    def _pause(self, t: float) -> float:
        if self.hasty_ns is not None:
            return self.hasty_ns
        return max(self.manners.pause_ms(t) * MS, self.uart.silence_ns + 0.2 * MS)


_ZEROS = 8  # behind an answer, at most


def _whole_before_zeros(data: bytes) -> bytes:
    """The frame that stands before the last zeros; all of it where none does."""
    for zeros in range(1, _ZEROS + 1):
        if data[-zeros:].count(0) == zeros and len(data) - zeros > 4 and crc_ok(data[:-zeros]):
            return data[:-zeros]
    return data


def fits(request: bytes, answer: bytes, *, values: bool = True) -> bool:
    """Whether a client takes this for the answer; `values`: to a write, by the values too."""
    if answer[0] != request[0] or answer[1] & 0x7F != request[1]:
        return False
    if answer[1] & 0x80:
        return len(answer) == 5
    quantity = int.from_bytes(request[4:6])
    match request[1]:
        case 3 | 4:
            return answer[2] == 2 * quantity == len(answer) - 5
        case 1 | 2:
            return answer[2] == (quantity + 7) // 8 == len(answer) - 5
        case 5 | 6 | 15 | 16:
            return answer[2:6] == request[2:6] if values else answer[2:4] == request[2:4]
        case 22:
            return answer == request
        case 23:
            return answer[2] == 2 * quantity == len(answer) - 5
        case 43:
            return answer[2:4] == request[2:4]
    return True
