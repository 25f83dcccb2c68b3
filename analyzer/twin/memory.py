"""One unit as it was recorded: what it said to each request, and what it holds.

A recorded request is answered as it was, the answers in their order, and round again. A register that was written since
is told as it was written, until the record has come to a time behind that same write. What was never asked so is
answered from the registers as they are by now.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from random import Random
from typing import Final

from dissectors.limits import EXCEPTION

ILLEGAL_FUNCTION: Final = 1  # exception codes ([1] 7)
ILLEGAL_ADDRESS: Final = 2
ILLEGAL_VALUE: Final = 3

_COILS, _DISCRETE, _HOLDING, _INPUT = "coils", "discrete inputs", "holding registers", "input registers"
_READS: Final = {1: _COILS, 2: _DISCRETE, 3: _HOLDING, 4: _INPUT}
_MOST: Final = {_COILS: 2000, _DISCRETE: 2000, _HOLDING: 125, _INPUT: 125}  # of a read ([1] 6.1 to 6.4)
_ON: Final = {0xFF00: 1, 0x0000: 0}  # of a single coil ([1] 6.5)
_HEAD: Final = 5  # bytes of a request: function, address, quantity or value
_AFTER: Final = 1 << 63  # behind all that is recorded

Place = tuple[str, int]  # area and address


@dataclass(frozen=True, slots=True)
class RecordedAnswer:
    """What came back: the PDU, after how long (ns; None: unknown from this tap), and when in the record (ns)."""

    pdu: bytes
    delay_ns: int | None
    t_ns: int


def unspoilt(adu: bytes) -> bytes:
    """A frame as it is."""
    return adu


@dataclass(frozen=True, slots=True)
class TwinAnswer:
    """What to answer, and after how long; `as_unit` in whose name, where that is not the unit asked, and `spoil` what
    the line makes of the frame."""

    pdu: bytes
    delay_ns: int
    as_unit: int | None = None
    spoil: Callable[[bytes], bytes] = unspoilt


@dataclass(slots=True)
class _KnownRequest:
    """A recorded request's answers, and which is next."""

    answers: list[RecordedAnswer] = field(default_factory=list)
    asked: int = 0  # in the record, whatever became of it
    next: int = 0

    def take_answer(self) -> RecordedAnswer:
        answer = self.answers[self.next]
        self.next = (self.next + 1) % len(self.answers)
        return answer


class TwinUnit:
    """A unit. `learn` what was recorded in order, then `answer`."""

    def __init__(self, unit: int, *, unknown: int | None = None, random: Random | None = None) -> None:
        """`unknown`: what registers hold that the record does not tell of; None: they are refused by exception 02."""
        self.unit = unit
        self._unknown = unknown
        self._random = random or Random()
        self._asked: dict[bytes, _KnownRequest] = {}
        self._held: dict[Place, int] = {}
        self._written: dict[Place, tuple[int, int]] = {}  # value, and when in the record it was written
        self._delays: dict[int, list[int]] = {}  # by function, ns

    @property
    def requests(self) -> int:
        """Different requests that it knows answers to."""
        return sum(bool(each.answers) for each in self._asked.values())

    @property
    def registers(self) -> int:
        """Registers, coils and inputs of which the record tells."""
        return len(self._held)

    def ask(self, request: bytes) -> None:
        """A request PDU of the record, whatever became of it."""
        self._asked.setdefault(request, _KnownRequest()).asked += 1

    def learn(self, request: bytes, answer: RecordedAnswer) -> None:
        """What came back to a request of the record; in order of time."""
        self._asked.setdefault(request, _KnownRequest()).answers.append(answer)
        if answer.delay_ns is not None:
            self._delays.setdefault(request[0], []).append(answer.delay_ns)
        for place, value in [*read_values(request, answer.pdu), *written_values(request, answer.pdu)]:
            self._held.setdefault(place, value)

    def answer(self, request: bytes) -> TwinAnswer | None:
        """What it says to a request PDU; None where it keeps silent, as it always did to this one."""
        known = self._asked.get(request)
        if known is not None and known.answers:
            recorded = known.take_answer()
            self._keep(written_values(request, recorded.pdu), recorded.t_ns)
            delay = recorded.delay_ns
            return TwinAnswer(self._retold(request, recorded), self._drawn(request[0]) if delay is None else delay)
        if known is not None and known.asked > 1:
            return None
        return TwinAnswer(self._own(request), self._drawn(request[0] if request else 0))

    def refusal(self, pdu: bytes) -> TwinAnswer:
        """An answer that says so, after a time as it takes."""
        return TwinAnswer(pdu, self._drawn(pdu[0] & ~EXCEPTION))

    def broadcast(self, request: bytes) -> None:
        """A request to all units: done, never answered."""
        self._keep(_requested_values(request), _AFTER)

    def _keep(self, values: Iterator[tuple[Place, int]], t_ns: int) -> None:
        for place, value in values:
            self._held[place] = value
            self._written[place] = (value, t_ns)

    def _retold(self, request: bytes, recorded: RecordedAnswer) -> bytes:
        """A recorded answer, with what was written since."""
        values = dict(read_values(request, recorded.pdu))
        newer = False
        for place in values:
            written = self._written.get(place)
            if written is not None and recorded.t_ns < written[1]:
                newer = newer or values[place] != written[0]
                values[place] = written[0]
            elif written is not None:
                del self._written[place]  # the record knows better from here on
            self._held[place] = values[place]
        return self._read_answer(request[0], list(values.values())) if newer else recorded.pdu

    def _own(self, request: bytes) -> bytes:
        """An answer from what it holds."""
        function = request[0] if request else 0
        if function in _READS:
            return self._read(request)
        try:
            places = dict(_requested_values(request))
        except ValueError:
            return _exception(function, ILLEGAL_VALUE)
        if not places:
            return _exception(function, ILLEGAL_FUNCTION)
        if self._unknown is None and not places.keys() <= self._held.keys():
            return _exception(function, ILLEGAL_ADDRESS)
        self._keep(iter(places.items()), _AFTER)
        return request[:_HEAD]

    def _read(self, request: bytes) -> bytes:
        area = _READS[request[0]]
        if len(request) != _HEAD:
            return _exception(request[0], ILLEGAL_VALUE)
        address, quantity = _word(request, 1), _word(request, 3)
        if not 0 < quantity <= _MOST[area]:
            return _exception(request[0], ILLEGAL_VALUE)
        held = [self._held.get((area, at), self._unknown) for at in range(address, address + quantity)]
        values = [value for value in held if value is not None]
        if len(values) < quantity or address + quantity > 1 << 16:
            return _exception(request[0], ILLEGAL_ADDRESS)
        return self._read_answer(request[0], values)

    def _read_answer(self, function: int, values: list[int]) -> bytes:
        if function in (1, 2):
            octets = bytearray((len(values) + 7) // 8)
            for at, value in enumerate(values):
                octets[at // 8] |= value << at % 8
            return bytes((function, len(octets))) + octets
        return bytes((function, 2 * len(values))) + b"".join(value.to_bytes(2, "big") for value in values)

    def _drawn(self, function: int) -> int:
        """A delay of those of this function, else of any; ns."""
        delays = self._delays.get(function) or [each for some in self._delays.values() for each in some]
        return self._random.choice(delays) if delays else 0


def read_values(request: bytes, answer: bytes) -> Iterator[tuple[Place, int]]:
    """What an answer to a read tells of registers, coils and inputs."""
    area = _READS.get(request[0]) if request else None
    if area is None or len(request) != _HEAD or len(answer) < 2 or answer[0] != request[0]:
        return
    address, quantity, data = _word(request, 1), _word(request, 3), answer[2:]
    for at in range(quantity):
        if area in (_COILS, _DISCRETE):
            if at // 8 < len(data):
                yield (area, address + at), data[at // 8] >> at % 8 & 1
        elif 2 * at + 2 <= len(data):
            yield (area, address + at), _word(data, 2 * at)


def written_values(request: bytes, answer: bytes) -> Iterator[tuple[Place, int]]:
    """What an answer confirms to be written."""
    if request and answer and answer[0] == request[0]:
        try:
            yield from _requested_values(request)
        except ValueError:
            return


def _requested_values(request: bytes) -> Iterator[tuple[Place, int]]:
    """What a request of functions 05, 06, 15, 16 wants written; ValueError where that is no value."""
    function = request[0] if request else 0
    if function in (5, 6):
        if len(request) != _HEAD or (function == 5 and _word(request, 3) not in _ON):
            raise ValueError("no value of a coil")
        value = _word(request, 3)
        yield (_COILS if function == 5 else _HOLDING, _word(request, 1)), _ON[value] if function == 5 else value
    elif function in (15, 16):
        if len(request) < _HEAD + 1:
            raise ValueError("no values")
        address, quantity, data = _word(request, 1), _word(request, 3), request[6:]
        needed = (quantity + 7) // 8 if function == 15 else 2 * quantity
        if not quantity or request[5] != needed or len(data) != needed or address + quantity > 1 << 16:
            raise ValueError("values that are not as many as was said")
        for at in range(quantity):
            if function == 15:
                yield (_COILS, address + at), data[at // 8] >> at % 8 & 1
            else:
                yield (_HOLDING, address + at), _word(data, 2 * at)


def _exception(function: int, code: int) -> bytes:
    return bytes((function | EXCEPTION, code))


def _word(data: bytes, at: int) -> int:
    return int.from_bytes(data[at : at + 2], "big")
