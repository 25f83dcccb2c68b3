"""Modbus TCP: frames by their MBAP headers, which say where they end ([3] 3.1.3); no check value, no silences.

A header is transaction, protocol 0, a length of 2 to 254, unit. Frames follow each other end to end. One whose length
its function does not predict, or behind which none follows, is cut where another frame begins inside it; what no header
covers is noise, up to the next header whose length its function does predict. Direction comes from length and
conversation, as in RTU mode.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Final

import numpy as np

from dissectors.crc import crc_ok
from dissectors.envelopes import MBAP
from dissectors.length_rules import Role
from dissectors.lengths import Expectation, expectation, pdu_length, sound_roles
from dissectors.limits import EXCEPTION, MAX_ADU, OVERHEAD

from ..options import Options
from ..tables.schema import Protocol
from .buffer import CharacterTime
from .segments import NOISE, NOISE_MOST, noise_parts
from .selfdelimited import SelfDelimitedEngine

_BEFORE: Final = 6  # bytes of a header that its length does not count
_LENGTHS: Final = range(2, 255)
_NO_WIRE: Final = CharacterTime(1e6, known=False)  # a network has no character time
_OPEN: Final = 64  # transactions of a port that may be open at once


def mbap_after(head: bytes) -> tuple[int | None, int | None]:
    """After how many of the first bytes of a stream it is sure that they are Modbus TCP, and after how many that not.

    They are where the first header's length is that which its function predicts, and no RTU frame with a right CRC, be
    it longer, begins there.
    """
    for at in range(2, min(len(head), 5)):
        if head[at]:
            return None, at + 1
    if len(head) < _BEFORE:
        return None, None
    if head[5] not in _LENGTHS:
        return None, _BEFORE
    end = _BEFORE + head[5]
    predicted = [length + OVERHEAD for role in Role if (length := pdu_length(head[1:MAX_ADU], role) or 0) > 0]
    for length in sorted(predicted):
        if length <= len(head) and crc_ok(head[:length]):
            return None, length
    if len(head) < end:
        return None, None
    if not sound_roles(head[MBAP:end]):
        return None, end
    sure = max(end, *predicted) if predicted else end
    return (sure, None) if len(head) >= sure else (None, None)


def is_mbap(data: bytes) -> bool:
    """Whether bytes that are all there is begin with a frame of Modbus TCP."""
    sure, _ = mbap_after(data)
    if sure is not None:
        return True
    end = _BEFORE + data[5] if len(data) > MBAP else len(data) + 1
    return end <= len(data) and mbap_after(data[:end] + bytes(MAX_ADU))[0] is not None


class MbapEngine(SelfDelimitedEngine):
    """The same contract as `engine.Engine`, for a port that speaks Modbus TCP."""

    _astray: bool
    _open: dict[bytes, Expectation]

    def __init__(self, options: Options = Options(), role: Role | None = None) -> None:  # noqa: B008 - frozen
        super().__init__(_NO_WIRE, options, role)
        self._astray = False  # in noise: only what a function predicts is a frame
        self._open = {}  # by transaction

    def _work(self, *, last: bool = False, silence_ns: int = 0) -> None:
        ready = self.buffer.ready
        data = self.buffer.data[:ready].tobytes()
        pauses = set(self.buffer.quiet(0, ready, self._options.idle_ns).tolist()) if ready else set()
        if silence_ns >= self._options.idle_ns:
            pauses.add(len(self.buffer))
        frames, done = frames_in(data, astray=self._astray, last=last, pauses=pauses)
        if not done:
            return
        parts: list[tuple[int, int, int]] = []
        at = 0
        for begin, behind, roles in [*frames, (done, done, ())]:
            parts += [(*cut, NOISE) for cut in noise_parts(at, begin)]
            if behind > begin:
                parts.append((begin, behind, self._role_of(data[begin:behind], roles)))
            at = behind
        self._astray = parts[-1][2] == NOISE
        start, end, role = (np.array(column, np.intp) for column in zip(*parts, strict=True))
        places = np.minimum(start[:, None] + np.arange(MBAP - 1, MBAP + 2), end[:, None] - 1)
        heads = self.buffer.data[:done][places]
        self._give(Protocol.TCP, start, end, role.astype(np.uint8), role != NOISE, heads, done)

    def _role_of(self, adu: bytes, roles: Sequence[Role]) -> Role:
        """The direction of a frame: its length tells (`roles`), else the port, else the request that is open."""
        transaction, body = adu[:2], adu[MBAP - 1 :]
        asked = self._open.get(transaction)
        if len(roles) == 1:
            role = roles[0]
        elif self._role is not None:
            role = self._role
        else:
            answers = asked is not None and (asked.fits(body) or (not roles and asked.function == body[1]))
            role = Role.RESPONSE if answers or body[1] & EXCEPTION else Role.REQUEST
        if role is Role.RESPONSE:
            self._open.pop(transaction, None)
        else:
            self._open.pop(transaction, None)
            self._open[transaction] = expectation(body)
            if len(self._open) > _OPEN:
                del self._open[next(iter(self._open))]
        return role


def frames_in(
    data: bytes, *, astray: bool = False, last: bool, pauses: Collection[int] = ()
) -> tuple[list[tuple[int, int, tuple[Role, ...]]], int]:
    """The frames in bytes of a stream with the roles in which each is as long as its function predicts.

    And how many of the bytes are decided: what is in no frame is noise.

    `astray`: these bytes begin in noise, else where a frame should; `last`: no more come. `pauses`: bytes before which
    nothing came for a while: a frame as long as predicted that ends there needs none behind it.
    """
    frames: list[tuple[int, int, tuple[Role, ...]]] = []
    at, size = 0, len(data)
    while at < size:
        if astray or not _may_begin(data, at):
            at = _next_sound(data, at if astray else at + 1, size, last=last)
            if at < size and not _is_whole(data, at):
                break
            astray = False
            continue
        end = at + _BEFORE + data[at + 5] if at + _BEFORE <= size else size + 1
        roles = sound_roles(data[at + MBAP : end]) if end <= size else ()
        paused = roles and end in pauses
        if end + _BEFORE > size and not last and not paused:
            break  # what follows may tell that it was cut
        if not paused and not (roles and _may_begin(data, end)):
            inner = _next_sound(data, at + 1, size, last=last)
            if inner < min(end, size) and not _is_whole(data, inner):
                break
            if inner < end:
                at = inner
                continue
        frames.append((at, end, roles))
        at = end
    behind = frames[-1][1] if frames else 0
    return frames, at if at == size else behind + (at - behind) // NOISE_MOST * NOISE_MOST


def _is_whole(data: bytes, at: int) -> bool:
    return at + _BEFORE <= len(data) and at + _BEFORE + data[at + 5] <= len(data)


def _may_begin(data: bytes, at: int) -> bool:
    """Whether a header may begin here, as far as the bytes reach."""
    head = data[at : at + _BEFORE]
    return not any(head[2:5]) and (len(head) < _BEFORE or head[5] in _LENGTHS)


def _next_sound(data: bytes, at: int, stop: int, *, last: bool) -> int:
    """Where, from `at` on and before `stop`, a frame begins whose function predicts its header's length; else `stop`.

    Unless these bytes are the last ones, where more of them might be one.
    """
    while at < stop:
        at = data.find(b"\0\0\0", at + 2, stop) - 2  # protocol, and the upper byte of the length
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
