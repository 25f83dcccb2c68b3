"""What the client asks, in its order, and which frames hold it: the first requests of a capture, in bounded memory."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from ...tables.batch import adu_of
from ...tables.schema import Kind

if TYPE_CHECKING:
    from ...core import Analysed
    from ...tables.batch import Batch

KEPT: Final = 20_000  # requests whose order is kept
_AREAS: Final = {1: "coil", 2: "discrete", 3: "holding", 4: "input", 23: "holding"}  # read by each function
_WRITTEN: Final = {5: "coil", 15: "coil", 6: "holding", 16: "holding", 22: "holding", 23: "holding"}
_ONE: Final = (5, 6, 22)  # functions that write to one address
_FRAMES: Final = 3  # that are named of a place
_TELLING: Final = (17, 43)  # functions by which a unit says what it is
_SAID: Final = 16  # of a unit


class AskedPoll(NamedTuple):
    """What a request asks for; address and quantity are None where its function has none."""

    unit: int
    function: int
    address: int | None
    quantity: int | None


@dataclass(slots=True)
class PollFrames:
    """How often something was asked for, the frame that asked first, and frames of answers, the first ones."""

    request: int
    count: int = 0
    answers: list[int] = field(default_factory=list)


class WrittenPlace(NamedTuple):
    """Registers that a client writes."""

    unit: int
    area: str
    address: int
    quantity: int
    function: int


class PollSequence:
    """Batches in; polls in order, writes, exceptions and what units say of themselves out."""

    def __init__(self) -> None:
        self.polls: dict[AskedPoll, PollFrames] = {}
        self.order: list[AskedPoll] = []  # repeated requests left out
        self.times: list[int] = []  # ns, of each in `order`
        self.more = 0  # requests behind those
        self.written: dict[WrittenPlace, PollFrames] = {}
        self.exceptions: dict[tuple[int, int, int], int] = {}  # unit, function, code: the first frame
        self.said: dict[int, dict[str, int]] = {}  # by unit: what it says of itself, and the frame that says it

    def feed(self, analysed: Analysed) -> None:
        """Take in a batch with its transactions."""
        batch, settled = analysed.batch, analysed.transactions
        self._listen(batch)
        raised = settled[settled.exception > 0]
        for unit, function, code, frame in zip(
            raised.unit.tolist(),
            raised.function.tolist(),
            raised.exception.tolist(),
            raised.response.tolist(),
            strict=True,
        ):
            self.exceptions.setdefault((unit, function, code), frame)
        requests = np.flatnonzero(batch.rows.kind == Kind.REQUEST)
        rows = dict(zip(batch.rows.index[requests].tolist(), requests.tolist(), strict=True))
        left = max(KEPT - len(self.order), 0)
        self.more += max(len(settled) - left, 0)
        some = settled[:left]
        for frame, answer, again, t_ns in zip(
            some.request.tolist(), some.response.tolist(), some.retry.tolist(), some.t_start_ns.tolist(), strict=True
        ):
            if frame in rows:
                self._ask(batch, rows[frame], frame, answer, None if again else t_ns)

    def answers_of(self, unit: int, area: str, address: int, words: int) -> list[int]:
        """Frames of answers that carry registers, the first few."""
        frames = [
            frame
            for poll, held in self.polls.items()
            if poll.unit == unit and _AREAS.get(poll.function) == area and poll.address is not None
            and poll.address < address + words and address < poll.address + (poll.quantity or 0)
            for frame in held.answers
        ]  # fmt: skip
        return sorted(frames)[:_FRAMES]

    def writes_of(self, unit: int, area: str, address: int, words: int) -> tuple[list[int], int, int | None]:
        """By which functions registers are written, how often, and the first frame that does."""
        found = [
            (place.function, held)
            for place, held in self.written.items()
            if (place.unit, place.area) == (unit, area)
            and place.address < address + words and address < place.address + place.quantity
        ]  # fmt: skip
        first = min((held.request for _, held in found), default=None)
        return sorted({function for function, _ in found}), sum(held.count for _, held in found), first

    def _ask(self, batch: Batch, row: int, frame: int, answer: int, t_ns: int | None) -> None:
        pdu = adu_of(batch.bytes_of(row), int(batch.rows.protocol[row])).pdu
        unit, function = int(batch.rows.unit[row]), int(batch.rows.function[row])
        poll, place = AskedPoll(unit, function, None, None), None
        if function in _AREAS or function in _WRITTEN:
            if len(pdu) < 5:
                return
            address, quantity = int.from_bytes(pdu[1:3]), 1 if function in _ONE else int.from_bytes(pdu[3:5])
            poll = AskedPoll(unit, function, address, quantity)
            if function in _WRITTEN and answer >= 0:
                at = slice(5, 9) if function == 23 else slice(1, 5)
                first, count = int.from_bytes(pdu[at][:2]), int.from_bytes(pdu[at][2:])
                place = WrittenPlace(unit, _WRITTEN[function], first, 1 if function in _ONE else count, function)
        held = self.polls.setdefault(poll, PollFrames(frame))
        held.count += 1
        if answer >= 0 and len(held.answers) < _FRAMES:
            held.answers.append(answer)
        if place is not None:
            self.written.setdefault(place, PollFrames(frame)).count += 1
        if t_ns is not None:
            self.order.append(poll)
            self.times.append(t_ns)

    def _listen(self, batch: Batch) -> None:
        rows = batch.rows
        telling = np.isin(rows.function, _TELLING) & (rows.kind == Kind.RESPONSE) & rows.check & (rows.exception == 0)
        for row in np.flatnonzero(telling).tolist():
            said = self.said.setdefault(int(rows.unit[row]), {})
            if len(said) >= _SAID:
                continue
            frame = batch.frame(row)
            objects = [part.text for top in frame.fields() if top.name == "objects" for part in top.fields]
            for text in objects or [frame.summary()]:
                said.setdefault(text, frame.index)
