"""A few exchanges with their bytes: those that went otherwise than they should, evenly over the time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from dissectors.crc import crc16
from dissectors.lengths import Role, pdu_length
from dissectors.limits import EXCEPTION, OVERHEAD

from ..tables.schema import Kind
from .exchanges import Ending, Stretch
from .rawbytes import is_in_ascii

_MOST: Final = 96  # of a unit
_PIECES: Final = 12  # of a sample
_BYTES: Final = 600
READ_REQUEST: Final = 8  # bytes of a request to read, or to write one value: the shortest


class SampleRow(NamedTuple):
    """A row behind a request: what the deframer took it for, and whether the exchange's good answer is it."""

    kind: int
    check: bool
    answers: bool
    unit: int
    t_start: int
    t_end: int
    marks: int
    data: bytes


@dataclass(frozen=True, slots=True)
class Sample:
    """One exchange. `index` is that of the request's frame, `usual` a good answer to the same poll from before, or None;
    `t_next` as in `Exchanges`."""

    unit: int
    function: int
    request: bytes
    outcome: Ending
    due: int
    index: int
    t_asked: int
    t_next: int
    pieces: tuple[SampleRow, ...]
    usual: bytes | None
    next_unit: int


@dataclass(slots=True)
class Samples:
    """Some of the exchanges offered, spread evenly; `offered` counts all of them."""

    kept: list[Sample] = field(default_factory=list)
    offered: int = 0
    _stride: int = 1

    def wants(self) -> bool:
        """Whether the next one offered is to be kept; counts it."""
        self.offered += 1
        return (self.offered - 1) % self._stride == 0

    def keep(self, sample: Sample) -> None:
        """Keep one that was wanted."""
        self.kept.append(sample)
        if len(self.kept) > _MOST:
            self.kept = self.kept[::2]
            self._stride *= 2

    @property
    def weight(self) -> float:
        """How many of those offered each kept one stands for."""
        return self.offered / len(self.kept) if self.kept else 0.0


def asked_in_pieces(between: bytes, answer: bytes) -> bool:
    """Whether the bytes between two answers end with a whole request that the second one may answer: a tap held a part
    of it back, and no silence that long is inside a frame."""
    if len(answer) < 2:  # a sample's bytes end here
        return False
    header = bytes((answer[0], answer[1] & ~EXCEPTION))
    at = between.find(header)
    while 0 <= at <= len(between) - READ_REQUEST:
        if crc16(between[at:]) == 0:
            return True
        at = between.find(header, at + 1)
    return False


def _told_length(request: bytes, usual: bytes | None, pieces: Sequence[SampleRow]) -> int:
    """The bytes of an answer whose length its request does not tell: those of a good one before, or by its own first
    bytes; 0 where nobody knows."""
    if is_in_ascii(request):
        return 0
    if usual is not None:
        return len(usual)
    data = b"".join(piece.data for piece in pieces)
    length = pdu_length(data[1:], Role.RESPONSE) if data[:2] == request[:2] else None
    return length + OVERHEAD if length is not None and length > 0 else 0


def sampled(stretch: Stretch, i: int, usual: bytes | None) -> Sample:
    """The sample of one exchange of a stretch."""
    exchanges, table = stretch.exchanges, stretch.table
    rows, pieces, room = table.rows, [], _BYTES
    for row in stretch.rows_of(i)[:_PIECES]:
        if room <= 0:
            break
        (one,), data = rows[row : row + 1], table.bytes_of(row)[:room]
        room -= len(data)
        right = one.check and one.kind != Kind.NOISE
        answers = row == exchanges.answer[i]
        pieces.append(SampleRow(one.kind, right, answers, one.unit, one.t_start_ns, one.t_end_ns, one.errors, data))
    (one,) = exchanges[i : i + 1]
    request = table.bytes_of(one.row)
    return Sample(
        one.unit, one.function, request, Ending(one.outcome), one.due or _told_length(request, usual, pieces),
        one.request, one.t_asked, one.t_next, tuple(pieces), usual, one.next_unit,
    )  # fmt: skip
