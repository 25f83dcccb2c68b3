"""What a capture tells of its units: requests with their answers, in order."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass

from captures.chunks import Capture
from dissectors.limits import BROADCAST

from ..core import deframe
from ..options import Options
from ..tables.batch import adu_of
from ..tables.schema import Kind
from .memory import RecordedAnswer, TwinUnit


@dataclass(frozen=True, slots=True)
class RecordedRequest:
    """A request as it was asked: unit, PDU, when it began (ns)."""

    unit: int
    pdu: bytes
    t_ns: int


@dataclass(frozen=True, slots=True)
class RecordedReply:
    """A request, and what came back."""

    unit: int
    request: bytes
    answer: RecordedAnswer


def recorded(capture: Capture, options: Options = Options()) -> Iterator[RecordedRequest | RecordedReply]:  # noqa: B008
    """Requests, and answers to them, in the order of the wire; frames with a wrong check value left out."""
    for batch in deframe(capture, options):
        rows = batch.rows
        for row in ((rows.kind != Kind.NOISE) & rows.check).nonzero()[0].tolist():
            adu = adu_of(batch.bytes_of(row), int(rows.protocol[row]))
            if adu.unit is None or not adu.pdu:
                continue
            if rows.kind[row] == Kind.REQUEST:
                yield RecordedRequest(adu.unit, adu.pdu, int(rows.t_start_ns[row]))
            elif (index := int(rows.request[row])) >= 0 and (asked := batch.request_of(row, index)) is not None:
                request = adu_of(asked, int(rows.protocol[row])).pdu
                delay = int(rows.response_ns[row])
                answer = RecordedAnswer(adu.pdu, delay if delay >= 0 else None, int(rows.t_end_ns[row]))
                yield RecordedReply(adu.unit, request, answer)


def twins(
    capture: Capture,
    units: Collection[int] = (),
    *,
    unknown: int | None = None,
    options: Options = Options(),  # noqa: B008 - frozen
) -> dict[int, TwinUnit]:
    """The units that answered in a capture, or those of them that are wanted, by number. `unknown`: see `TwinUnit`."""
    made: dict[int, TwinUnit] = {}
    for each in recorded(capture, options):
        if each.unit == BROADCAST or (units and each.unit not in units):
            continue
        twin = made.setdefault(each.unit, TwinUnit(each.unit, unknown=unknown))
        if isinstance(each, RecordedReply):
            twin.learn(each.request, each.answer)
        else:
            twin.ask(each.pdu)
    return {number: made[number] for number in sorted(made) if made[number].requests}
