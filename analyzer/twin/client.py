"""The recorded client, played against a real unit: this transmits, and is told so by whoever runs it."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Final

from captures.chunks import Capture
from captures.live.pace import sleep_until
from dissectors.crc import crc_bytes
from dissectors.lengths import Role, adu_end
from dissectors.limits import BROADCAST

from ..options import Options
from .record import RecordedReply, RecordedRequest, recorded
from .serving import TwinLine

_PATIENCE_NS: Final = 1_000_000_000  # for an answer
_READS: Final = frozenset({1, 2, 3, 4})


@dataclass(slots=True)
class PlayedRequests:
    """What became of the requests: answered as recorded, otherwise, not at all; broadcasts are none of these."""

    sent: int = 0
    same: int = 0
    other: int = 0
    silent: int = 0


@dataclass(frozen=True, slots=True)
class Script:
    """What the client asked, and what it was answered."""

    requests: list[RecordedRequest]
    answers: dict[tuple[int, bytes], deque[bytes]]

    @property
    def writes(self) -> int:
        """Requests that are no plain reads."""
        return sum(each.pdu[0] not in _READS for each in self.requests)


def script_of(capture: Capture, units: Collection[int], options: Options = Options()) -> Script:  # noqa: B008
    """The requests to these units."""
    script = Script([], {})
    for each in recorded(capture, options):
        if each.unit not in units:
            continue
        if isinstance(each, RecordedReply):
            script.answers.setdefault((each.unit, each.request), deque()).append(each.answer.pdu)
        else:
            script.requests.append(each)
    return script


def play_client(script: Script, line: TwinLine, stop: Callable[[], bool]) -> PlayedRequests:
    """Ask in the recorded rhythm, no request before the one before it is answered or given up."""
    played = PlayedRequests()
    began = time.monotonic_ns()
    first = script.requests[0].t_ns if script.requests else 0
    for request in script.requests:
        sleep_until(began + request.t_ns - first, stop)
        if stop():
            break
        while line.read(0):
            pass  # what came too late belongs to nothing
        body = bytes((request.unit,)) + request.pdu
        line.write(body + crc_bytes(body))
        played.sent += 1
        if request.unit == BROADCAST:
            continue
        answer = _answer(line, request.unit, stop)
        expected = script.answers.get((request.unit, request.pdu))
        if answer is None:
            played.silent += 1
        elif expected and answer == expected.popleft():
            played.same += 1
        else:
            played.other += 1
    return played


def _answer(line: TwinLine, unit: int, stop: Callable[[], bool]) -> bytes | None:
    """The PDU that comes back in time."""
    held, until = b"", time.monotonic_ns() + _PATIENCE_NS
    while time.monotonic_ns() < until and not stop():
        held += line.read(0.05)
        end = adu_end(held, Role.RESPONSE)
        if end and held[0] == unit:
            return held[1 : end - 2]
    return None
