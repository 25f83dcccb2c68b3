"""Modbus TCP: frames by their MBAP headers, which say where they end ([3] 3.1.3); no check value, no silences.

A header is transaction, protocol 0, a length of 2 to 254, unit. Frames follow each other end to end. One whose length
its function does not predict, or behind which none follows, is cut where another frame begins inside it; what no header
covers is noise, up to the next header whose length its function does predict. Direction comes from length and
conversation, as in RTU mode.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Collection, Sequence
from typing import Final, NamedTuple

import numpy as np

from captures.chunks import Mark
from dissectors.envelopes import MBAP
from dissectors.length_rules import Role
from dissectors.lengths import Expectation, expectation, sound_roles
from dissectors.limits import EXCEPTION

from ..options import Options
from ..tables.schema import Protocol
from .buffer import ByteBuffer, CharacterTime
from .segments import NOISE, NOISE_MOST, noise_parts
from .selfdelimited import SelfDelimitedEngine

_BEFORE: Final = 6  # bytes of a header that its length does not count
_ZEROS: Final = 4  # bytes from where a frame begins to the last of the zeros that all have
_LENGTHS: Final = range(2, 255)
_NO_WIRE: Final = CharacterTime(1e6, known=False)  # a network has no character time
_OPEN: Final = 64  # transactions of a port that may be open at once
_PIPELINED: Final = 8  # requests of one transaction number that may be


class MbapEngine(SelfDelimitedEngine):
    """The same contract as `engine.Engine`, for a port that speaks Modbus TCP.

    `marked`: marks say which side each byte is of, as in what a network's packets carried: then a frame ends where the
    other side speaks, and reads begin where frames do.
    """

    _astray: bool
    _open: dict[bytes, list[Expectation]]
    _marked: bool
    _sides: int

    def __init__(self, options: Options = Options(), role: Role | None = None, *, marked: bool = False) -> None:  # noqa: B008
        super().__init__(_NO_WIRE, options, role)
        self._astray = False  # in noise: only what a function predicts is a frame
        self._open = {}  # by transaction, the oldest first
        self._marked = marked
        self._sides = (
            0  # frames that are as long as a request is alone, of who is marked as the one who asks; less others
        )

    def _work(self, *, last: bool = False, silence_ns: int = 0) -> None:
        buffer = self.buffer
        ready = buffer.ready
        data = buffer.data[:ready].tobytes()
        pauses = set(buffer.quiet(0, ready, self._options.idle_ns).tolist()) if ready else set()
        if silence_ns >= self._options.idle_ns:
            pauses.add(len(buffer))
        reads = ReadEdges.of(buffer, ready) if self._marked and ready else NO_EDGES
        frames, done = frames_in(data, astray=self._astray, last=last, pauses=pauses, edges=reads)
        if not done:
            return
        parts: list[tuple[int, int, int]] = []
        at = 0
        for begin, behind, roles in [*frames, (done, done, ())]:
            parts += [(*cut, NOISE) for cut in noise_parts(at, begin)]
            if behind > begin:
                parts.append((begin, behind, self._role_of(data[begin:behind], roles, reads.mark(begin))))
            at = behind
        self._astray = parts[-1][2] == NOISE
        start, end, role = (np.array(column, np.intp) for column in zip(*parts, strict=True))
        places = np.minimum(start[:, None] + np.arange(MBAP - 1, MBAP + 2), end[:, None] - 1)
        heads = buffer.data[:done][places]
        self._give(Protocol.TCP, start, end, role.astype(np.uint8), role != NOISE, heads, done)

    def _role_of(self, adu: bytes, roles: Sequence[Role], mark: int) -> Role:
        """The direction of a frame: that of its bytes where they are marked, else its length tells (`roles`), else the
        port, else the request that is open."""
        transaction, body = adu[:2], adu[MBAP - 1 :]
        asked = self._open.get(transaction, [])
        found = next(
            (one for one in reversed(asked) if one.fits(body) or (not roles and one.function == body[1])), None
        )
        if mark and self._role is None:
            role = self._role_by_mark(roles, mark, body)
        elif len(roles) == 1:
            role = roles[0]
        elif self._role is not None:
            role = self._role
        else:
            role = Role.RESPONSE if found is not None or body[1] & EXCEPTION else Role.REQUEST
        if role is Role.RESPONSE:
            if found is not None:
                asked.remove(found)
            return role
        self._open.pop(transaction, None)  # so that the oldest go first
        self._open[transaction] = [*asked, expectation(body)][-_PIPELINED:]
        if len(self._open) > _OPEN:
            del self._open[next(iter(self._open))]
        return role

    def _role_by_mark(self, roles: Sequence[Role], mark: int, body: bytes) -> Role:
        """Who asks, by the marks: who opened the connection asks, unless frames show that this was guessed wrong."""
        if len(roles) == 1 and not body[1] & EXCEPTION:
            self._sides += 1 if (roles[0] is Role.REQUEST) == (mark == Mark.TX) else -1
        asks = Mark.TX if self._sides >= 0 else Mark.RX
        return Role.REQUEST if mark == asks else Role.RESPONSE


class ReadEdges(NamedTuple):
    """Where in some bytes reads begin, in order, and the mark of each read."""

    starts: Sequence[int]
    marks: Sequence[int]

    @classmethod
    def of(cls, buffer: ByteBuffer, stop: int) -> ReadEdges:
        """Those of the first `stop` bytes of a buffer."""
        begins = buffer.begins(stop)
        return cls(begins.tolist(), buffer.marks(begins).tolist())

    def mark(self, at: int) -> int:
        """The mark of a byte; 0 where nothing is known."""
        return self.marks[bisect_right(self.starts, at) - 1] if self.starts else 0

    def turn(self, at: int) -> int | None:
        """Where behind a byte the other side speaks; None where it does not."""
        read = bisect_right(self.starts, at)
        own = self.marks[read - 1] if read else 0
        return next((self.starts[i] for i in range(read, len(self.starts)) if self.marks[i] != own), None)

    def begins(self, at: int) -> bool:
        """Whether a read begins there."""
        i = bisect_right(self.starts, at) - 1
        return i >= 0 and self.starts[i] == at

    def following(self, at: int) -> int | None:
        """Where the next read behind a byte begins."""
        read = bisect_right(self.starts, at)
        return self.starts[read] if read < len(self.starts) else None


NO_EDGES: Final = ReadEdges((), ())


TcpFrame = tuple[int, int, tuple[Role, ...]]  # where it begins and ends, the roles in which it is as long as predicted


class _Onward(NamedTuple):
    """Where the next frame is looked for; `waits`: only what follows can tell."""

    at: int
    frame: TcpFrame | None = None
    waits: bool = False


class _StreamBytes(NamedTuple):
    """Bytes of a stream, and what is known of them besides; see `frames_in`."""

    data: bytes
    last: bool
    pauses: Collection[int]
    edges: ReadEdges

    def beyond_noise(self, at: int) -> _Onward:
        """To the next byte from `at` on where a frame may begin."""
        size = len(self.data)
        at = _next_frame(self.data, at, size, self.edges, last=self.last)
        return _Onward(at, waits=at < size and not _is_whole(self.data, at) and self.edges.turn(at) is None)

    def beyond_frame(self, at: int) -> _Onward:
        """Behind the frame that begins here, or to one inside it, if it is none."""
        data, size, edges = self.data, len(self.data), self.edges
        end = at + _BEFORE + data[at + 5] if at + _BEFORE <= size else size + 1
        turn = edges.turn(at) or (size if self.last and edges.starts else end)
        if turn < end:  # the capture lacks its end
            return _Onward(turn, (at, turn, ()) if turn - at > MBAP else None)
        roles = sound_roles(data[at + MBAP : end]) if end <= size else ()
        if (edges.starts and end <= size) or (roles and end in self.pauses):
            return _Onward(end, (at, end, roles))
        if end + _BEFORE > size and not self.last:
            return _Onward(at, waits=True)  # what follows may tell that it was cut
        inner = end if roles and _may_begin(data, end) else _next_sound(data, at + 1, size, last=self.last, before=end)
        if inner >= end:
            return _Onward(end, (at, end, roles))
        return _Onward(at, waits=True) if inner < size and not _is_whole(data, inner) else _Onward(inner)


def frames_in(
    data: bytes, *, astray: bool = False, last: bool, pauses: Collection[int] = (), edges: ReadEdges = NO_EDGES
) -> tuple[list[TcpFrame], int]:
    """The frames in bytes of a stream with the roles in which each is as long as its function predicts.

    And how many of the bytes are decided: what is in no frame is noise.

    `astray`: these bytes begin in noise, else where a frame should; `last`: no more come. `pauses`: bytes before which
    nothing came for a while: a frame as long as predicted that ends there needs none behind it. `edges`: of reads that
    are known to begin where frames do; a frame whose header is whole is one, and ends where the other side speaks.
    """
    stream = _StreamBytes(data, last, pauses, edges)
    frames: list[TcpFrame] = []
    onward = stream.beyond_noise(0) if astray and data else _Onward(0)
    while onward.at < len(data) and not onward.waits:
        begins = _may_begin(data, onward.at)
        onward = stream.beyond_frame(onward.at) if begins else stream.beyond_noise(onward.at + 1)
        frames += [onward.frame] if onward.frame is not None else []
    at, behind = onward.at, frames[-1][1] if frames else 0
    return frames, at if at == len(data) else behind + (at - behind) // NOISE_MOST * NOISE_MOST


def _next_frame(data: bytes, at: int, stop: int, edges: ReadEdges, *, last: bool) -> int:
    """Where, from `at` on, the next frame begins: one whose function predicts its length, or one that begins a read."""
    sound = _next_sound(data, at, stop, last=last, before=stop)
    read = at if edges.begins(at) else edges.following(at)
    while read is not None and read < sound:
        if _may_begin(data, read):
            return read
        read = edges.following(read)
    return sound


def _is_whole(data: bytes, at: int) -> bool:
    return at + _BEFORE <= len(data) and at + _BEFORE + data[at + 5] <= len(data)


def _may_begin(data: bytes, at: int) -> bool:
    """Whether a header may begin here, as far as the bytes reach."""
    head = data[at : at + _BEFORE]
    return not any(head[2:5]) and (len(head) < _BEFORE or head[5] in _LENGTHS)


def _next_sound(data: bytes, at: int, stop: int, *, last: bool, before: int) -> int:
    """Where, from `at` on and before `stop`, a frame begins whose function predicts its header's length; else `stop`.

    Unless these bytes are the last ones, where more of them might be one. None behind `before` is looked for.
    """
    most = min(before + _ZEROS, stop)
    while at < stop:
        at = data.find(b"\0\0\0", at + 2, most) - 2  # protocol, and the upper byte of the length
        if at < 0:
            return stop if last else _tail(data, stop)
        end = at + _BEFORE + data[at + 5] if at + _BEFORE <= stop else stop + 1
        if end <= stop:
            if data[at + 5] in _LENGTHS and sound_roles(data[at + MBAP : end]):
                return at
        elif not last and _may_begin(data, at):
            return at
        at += 1
    return stop


def _tail(data: bytes, stop: int) -> int:
    """Where the last bytes before `stop` may begin a header of which the rest is still to come."""
    return next(at for at in range(max(stop - _BEFORE + 1, 0), stop + 1) if at == stop or _may_begin(data[:stop], at))
