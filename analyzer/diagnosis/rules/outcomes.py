"""What is said of requests by what became of them, and of answers that answer nothing: second, wrong, unasked ones."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dissectors.lengths import expectation, relations
from dissectors.limits import RequestedByteCount
from dissectors.registry import function_class

from ...languages import phrase
from ...tables.batch import adu_of
from ...tables.findings import About, Findings, Rule, Severity, looks_for
from ...tables.schema import GLITCHES, Kind, Protocol
from ...tables.taps import TapKind
from ...tables.transactions import NEVER, Status, TransactionRows
from ..view import DiagnosisStep, EarlierRow

UNEXPECTED: Final = Rule(
    "unexpected-response",
    Severity.WARNING,
    About.FRAME,
    when="an answer has no request",
    clause="[2] 2.4.1",
    numbers=("unit", "function"),
    text="unit {unit:.0f} answers without a request",
    cause="a second client whose requests the tap does not see, or a device that sends on its own",
    remedy="tap the line where both directions pass; look for a second client",
)
DUPLICATE: Final = Rule(
    "duplicate-response",
    Severity.ERROR,
    About.FRAME,
    when="one request is answered twice",
    clause="[2] 2.2",
    numbers=("unit", "after_ms"),
    text="unit {unit:.0f} answers the same request twice",
    cause="two devices share an address",
    remedy="give each device its own address: disconnect one and see whether the unit still answers",
)
MISMATCH: Final = Rule(
    "response-mismatch",
    Severity.ERROR,
    About.FRAME,
    when="an answer disagrees with its request: byte count, address, quantity or echo",
    clause="[1] 6",
    numbers=("unit", "function"),
    loses=True,
    text="unit {unit:.0f}'s answer does not fit the request: byte count, quantity or echo differs",
    cause="an answer to an earlier request, or a device that answers a different request",
    remedy="compare with the previous request; read fewer registers; update the device's firmware",
)
BROADCAST_ANSWERED: Final = Rule(
    "broadcast-answered",
    Severity.ERROR,
    About.FRAME,
    when="a unit answers a request to unit 0",
    clause="[2] 2.1",
    numbers=("unit", "function"),
    text="unit {unit:.0f} answers a broadcast",
    cause="a device uses 0 as its own address or wrongly answers broadcasts; several such answers would collide",
    remedy="give the device an address from 1 to 247; do not send to unit 0",
)
BROADCAST_READ: Final = Rule(
    "broadcast-read",
    Severity.WARNING,
    About.FRAME,
    when="a read is sent to unit 0, which no unit may answer",
    clause="[2] 2.1",
    numbers=("function",),
    text="a read is sent to unit 0, which no unit may answer",
    cause="the unit's address is not set in the client, or it searches for a device; a gateway may also pass on unit 0 "
    "from Modbus TCP",
    remedy="set the unit's address in the client",
)


@looks_for(BROADCAST_READ)
def broadcast_reads(view: DiagnosisStep) -> Iterator[Findings]:
    """Requests to unit 0 of functions that read."""
    rows = view.rows
    sent = view.right(view.to_all)
    sent = sent[rows.kind[sent] == Kind.REQUEST]
    reads = sent[[_reads(function) for function in rows.function[sent].tolist()]]
    if len(reads):
        yield BROADCAST_READ.on(rows[reads], rows.function[reads])


def _reads(function: int) -> bool:
    declared = relations(function)
    return function_class(function) == "public" and (
        not declared or any(isinstance(r, RequestedByteCount) for r in declared)
    )


class _Before(NamedTuple):
    """The newest request before a row, the answer that it got, and whether nothing damaged stands between."""

    request: EarlierRow | None = None
    answered: EarlierRow | None = None
    clean: bool = True


@looks_for(UNEXPECTED, DUPLICATE, MISMATCH, BROADCAST_ANSWERED)
class Strangers:
    """Answers with a right check value that belong to no request."""

    _requested: bool
    _newest: tuple[int, _Before] | None
    _asking: set[int]

    def __init__(self) -> None:
        self._requested = False  # a request has been seen: before it, answers belong to what was before the capture
        self._newest = None  # the last row that was asked about, and what stood before it
        self._asking = set()  # ports on which requests over Modbus TCP were seen

    def __call__(self, view: DiagnosisStep) -> Iterator[Findings]:
        rows, asks = view.rows, view.requests
        answers = view.right(view.to_all)
        answers = answers[rows.kind[answers] == Kind.RESPONSE]
        if len(answers):
            yield BROADCAST_ANSWERED.on(rows[answers], 0, rows.function[answers])
        networked = view.rows.protocol == Protocol.TCP
        for number in view.strays.tolist():
            if networked[number]:
                yield from self._judge_tcp(view, number)
            elif rows.unit[number] and (self._requested or (len(asks) and number > asks[0])):
                yield from self._judge(view, number)
        self._requested = self._requested or len(asks) > 0
        self._asking.update(np.unique(view.rows.port[asks[networked[asks]]]).tolist())

    def _judge_tcp(self, view: DiagnosisStep, number: int) -> Iterator[Findings]:
        """A response over Modbus TCP whose transaction is not open, or asked for something else."""
        answer = EarlierRow.of(view.batch, number)
        stray, row = view.rows[number : number + 1], answer.row
        transaction = answer.captured[:2]
        for before in view.trail.back(view.batch, number):
            if (before.row.port, before.row.protocol) != (row.port, Protocol.TCP) or not before.is_frame:
                continue
            if before.captured[:2] != transaction:
                continue
            if before.row.kind == Kind.REQUEST:
                yield MISMATCH.on(stray, row.unit, row.function)
            else:
                waited = (row.t_start_ns - before.row.t_end_ns) / 1e6
                yield DUPLICATE.on(stray, row.unit, waited if view.timed else np.nan)
            return
        asks = view.requests
        if row.port in self._asking or (view.rows.port[asks[asks < number]] == row.port).any():
            yield UNEXPECTED.on(stray, row.unit, row.function)

    def _judge(self, view: DiagnosisStep, number: int) -> Iterator[Findings]:
        answer = EarlierRow.of(view.batch, number)
        request, answered, clean = self._request_before(view, number)
        stray = view.rows[number : number + 1]
        unit, function = answer.row.unit, answer.row.function
        if request is None or not clean:
            if clean:
                yield UNEXPECTED.on(stray, unit, function)
        elif request.row.unit == 0 and request.row.function == function:
            yield BROADCAST_ANSWERED.on(stray, unit, function)
        elif request.row.unit != unit or (answered is not None and not _fits(request, answer)):
            yield UNEXPECTED.on(stray, unit, function)
        elif answered is not None:
            waited = (answer.row.t_start_ns - answered.row.t_end_ns) / 1e6
            yield DUPLICATE.on(stray, unit, waited if view.timed else np.nan)
        elif _fits(request, answer):
            yield UNEXPECTED.on(stray, unit, function)
        else:
            yield MISMATCH.on(stray, unit, function)

    def _request_before(self, view: DiagnosisStep, number: int) -> _Before:
        """What stands before a row; where many strays follow each other none looks further back than to the last."""
        before = self._search_back(view, number)
        self._newest = int(view.rows.index[number]), before
        return before

    def _search_back(self, view: DiagnosisStep, number: int) -> _Before:
        newest, before_newest = self._newest or (-1, _Before())
        answered = None
        for before in view.trail.back(view.batch, number):
            if not before.is_frame:
                if not GLITCHES.issuperset(before.captured):
                    return _Before(clean=False)
            elif before.row.kind == Kind.REQUEST:
                return _Before(before, answered) if before.row.check else _Before(clean=False)
            elif not before.row.check:
                return _Before(clean=False)  # it may have held more than one answer
            elif before.row.request >= 0 and answered is None:
                answered = before
            if before.is_frame and before.row.index == newest:
                return before_newest._replace(answered=answered or before_newest.answered)
        return _Before()


def _fits(request: EarlierRow, answer: EarlierRow) -> bool:
    return expectation(adu_of(request.captured, request.row.protocol).data).fits(
        adu_of(answer.captured, answer.row.protocol).data
    )


_ANSWERED, _UNANSWERED, _DAMAGED = int(Status.ANSWERED), int(Status.UNANSWERED), int(Status.DAMAGED)


def _silent(numbers: Mapping[str, float]) -> str:
    if "waited_ms" in numbers:
        return phrase("unit {unit:.0f} did not answer in {waited_ms:ms}, until the next request", numbers)
    return phrase("unit {unit:.0f} did not answer", numbers)


class _NeverAnswers(NamedTuple):
    """Why a unit that has never answered may be mute, by how it was asked, and what to do then."""

    cause: str
    remedy: str


_BY_RTU: Final = _NeverAnswers(
    "it has not answered so far: the unit does not exist or has no power; otherwise wrong baud rate or parity, swapped "
    "A and B, or a damaged request",
    "check the unit's power, address, line settings and wiring; remove it from the poll list if it does not exist",
)
_BY_TCP: Final = _NeverAnswers(
    "no such unit behind this server, or one that its serial line does not reach",
    "check the unit's number and, behind a gateway, its line; remove it from the poll list if it does not exist",
)
_ITSELF: Final = _NeverAnswers(
    "unit 0 or FF is the server itself: where that is a gateway, no unit behind it is asked",
    "set the unit's number in the client, if a unit behind a gateway is meant",
)
_PASSED_ON: Final = _NeverAnswers(
    "units on a serial line read RTU: they do not understand Modbus TCP that a gateway passes on as it is",
    "set the gateway to convert Modbus TCP to RTU, or the client to RTU over TCP",
)
_BEHIND_GATEWAY: Final = _NeverAnswers(
    "the unit is absent or not configured in the gateway: others are answered over the same connection",
    "check the unit's number and power, and whether the gateway has it; remove it from the poll list if it does not "
    "exist",
)
_NETWORK, _SERIAL_LINE = 1.0, 2.0  # where a request of Modbus TCP was seen: number `over_tcp`
_SERVED: Final = 3.0  # the same on a serial line where something was answered before: whatever sends it is understood


def _why_mute(numbers: Mapping[str, float]) -> _NeverAnswers:
    match numbers.get("over_tcp"):
        case None:
            return _BY_RTU
        case number if number == _SERIAL_LINE:
            return _PASSED_ON
        case number if number == _SERVED:
            return _BEHIND_GATEWAY
        case _:  # [3] 4.4.2.2
            return _ITSELF if numbers["unit"] in (0, 255) else _BY_TCP


NO_RESPONSE: Final = Rule(
    "no-response",
    Severity.ERROR,
    About.TRANSACTION,
    when="a request gets no answer",
    clause="[2] 2.4.1",
    numbers=("unit", "waited_ms", "function", "answered_before", "over_tcp"),
    varies="answered_before",
    loses=True,
    wastes="waited_ms",
    text=_silent,
    cause=lambda numbers: phrase(
        "the request arrived damaged, the unit restarted or was busy, or a contact is loose (it answers at other times)"
        if numbers["answered_before"]
        else _why_mute(numbers).cause
    ),
    remedy=lambda numbers: phrase(
        "check when it falls silent: its power, its connector, and what the client asks at that moment"
        if numbers["answered_before"]
        else _why_mute(numbers).remedy
    ),
)
RETRY: Final = Rule(
    "retry",
    Severity.NOTE,
    About.TRANSACTION,
    when="a request is repeated after no answer or a damaged one",
    clause="[2] 2.4.1",
    numbers=("unit", "after_ms"),
    text=lambda numbers: (
        phrase("the client repeats its request")
        + (phrase(", {after_ms:ms} after the first try", numbers) if "after_ms" in numbers else "")
    ),
    cause="the first try got no answer, a damaged one, or a late one",
    remedy="check what happened to the previous request",
)


def _came_late(numbers: Mapping[str, float]) -> str:
    words = phrase("unit {unit:.0f} answers frame {request:.0f}", numbers)
    words += phrase(", {late_ms:ms} after it", numbers) if "late_ms" in numbers else ""
    words += phrase(", when the client has moved on; ")
    return words + phrase(
        "it also fits the client's newest request, so the client takes these values one poll late"
        if numbers["mistaken"]
        else "it does not fit the client's newest request, which can reject it"
    )


LATE: Final = Rule(
    "late-response",
    Severity.ERROR,
    About.TRANSACTION,
    when="an answer comes after the client has moved on to its next request",
    clause="[2] 2.4.1",
    numbers=("unit", "late_ms", "request", "mistaken", "waited_ms"),
    varies="mistaken",
    loses=True,
    wastes="waited_ms",
    text=_came_late,
    cause=lambda numbers: (
        phrase("the unit answers later than the client waits")
        + (
            phrase("; answers carry no register address, so the wrong values go unnoticed")
            if numbers["mistaken"]
            else ""
        )
    ),
    remedy=lambda numbers: (
        phrase("make the client's response timeout longer than the unit's longest response time")
        + (phrase("; do not trust this unit's values until then") if numbers["mistaken"] else "")
    ),
)
_ECHO_TEXTS: Final = (
    "the same frame once more",
    "the same frame once more but for {other:.0f} of its {sent:.0f} bytes",
    "the same frame once more but for {other:.0f} of its {sent:.0f} bytes, "
    "all those that need more than {data_bits:.0f} bits",
)
_ECHO_CAUSES: Final = (
    "the tap or a converter with local echo shows each sent frame twice",
    "a local echo, or the frame as the other end heard it: its settings, or the line, change or lose bytes",
    "one end is set to {data_bits:.0f} data bits, so the upper bits of a byte get lost",
)
_LOCAL_ECHO: Final = "switch the converter's local echo off, or tap the line behind it"
_ECHO_REMEDIES: Final = (_LOCAL_ECHO, _LOCAL_ECHO, "set both ends to 8 data bits")


def _told_of_echo(words: Sequence[str], numbers: Mapping[str, float]) -> str:
    """The words for an echo that is whole, one of which bytes changed, and one of which all wide bytes did."""
    return phrase(words[("other" in numbers) + ("data_bits" in numbers)], numbers)


ECHO: Final = Rule(
    "echo",
    Severity.NOTE,
    About.TRANSACTION,
    when="the tap shows each sent frame twice",
    numbers=("after_ms", "other", "sent", "data_bits", "unit"),
    text=lambda numbers: (
        _told_of_echo(_ECHO_TEXTS, numbers)
        + (phrase(", {after_ms:ms} later", numbers) if "after_ms" in numbers else "")
    ),
    cause=lambda numbers: _told_of_echo(_ECHO_CAUSES, numbers),
    remedy=lambda numbers: _told_of_echo(_ECHO_REMEDIES, numbers),
)


def said(
    rule: Rule,
    transactions: TransactionRows,
    which: NDArray[np.intp],
    timed: NDArray[np.bool_],
    served: NDArray[np.bool_],
    tap: TapKind,
) -> Findings:
    """What a rule says of some transactions; `timed`: whether their times mean anything, `served`: whether anything was
    answered before."""
    these, before = transactions[which], transactions[np.maximum(which - 1, 0)]
    columns = these.request, these.start, these.length, these.port, these.t_start_ns
    answers = (
        these.response, these.response_start, these.response_length, these.response_port, these.t_response_ns,
    )  # fmt: skip
    waited = np.where(timed & (these.t_next_ns != NEVER), (these.t_next_ns - these.t_request_ns) / 1e6, np.nan)
    if rule is LATE:
        behind = np.where(timed, (these.t_response_ns - these.t_request_ns) / 1e6, np.nan)
        return rule.at(*answers, these.unit, behind, these.request, these.mistaken, waited)
    if rule is DUPLICATE:
        own = these.status == _ANSWERED  # else what reads like a request is the second answer
        index = np.where(own, these.response, these.request)
        start, length = (
            np.where(own, answer, request)
            for answer, request in ((these.response_start, these.start), (these.response_length, these.length))
        )
        port, t_ns = (
            np.where(own, these.response_port, these.port),
            np.where(own, these.t_response_ns, these.t_start_ns),
        )
        first = np.where(own, these.t_start_ns, before.t_response_ns)
        later = np.where(timed, (t_ns - first) / 1e6, np.nan)
        return rule.at(index, start, length, port, t_ns, these.unit, later)
    if rule is NO_RESPONSE:
        where = _SERIAL_LINE if tap in (TapKind.SERIAL, TapKind.EDGES) else _NETWORK
        told = np.where((where == _SERIAL_LINE) & served, _SERVED, where)
        over_tcp = np.where(these.protocol == Protocol.TCP, told, np.nan)
        return rule.at(*columns, these.unit, waited, these.function, 0, over_tcp)
    if rule is RETRY:
        failed = (which > 0) & np.isin(before.status, (_UNANSWERED, _DAMAGED)) & timed
        return rule.at(*columns, these.unit, np.where(failed, (these.t_start_ns - before.t_start_ns) / 1e6, np.nan))
    if rule is ECHO:
        later = np.maximum(these.t_start_ns - before.t_request_ns, 0) / 1e6
        return rule.at(*columns, np.where(timed, later, np.nan), np.nan, np.nan, np.nan, these.unit)
    return rule.at(*columns, these.unit, these.function)
