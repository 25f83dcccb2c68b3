"""Requests without an answer, repeated ones, answers that come too late: what became of each request.

Rests on the transactions, in the order of their requests, each beside its neighbours. What only looks like silence or a
repeat is told by its haste and shape: a frame that the tap shows twice, and a write whose echo differs, which reads
like another request. No master repeats itself or goes on so soon.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from captures import Mark

from ...deframing.tap_clock import FIRST, UNKNOWN
from ...tables.findings import Findings, Rule, looks_for
from ...tables.schema import Protocol
from ...tables.taps import tap_kind
from ...tables.transactions import NEVER, Status, TransactionRows
from ..damage.triage import HASTE_NS, answered_alike
from ..view import DiagnosisStep, where
from .outcomes import BROADCAST_ANSWERED, DUPLICATE, ECHO, LATE, MISMATCH, NO_RESPONSE, RETRY, said

_ECHO_NS: Final = 5_000_000
_DEVICE_NS: Final = 1_000_000  # no device answers sooner


class TransactionColumns(NamedTuple):
    """A row of `TransactionRows`, and how many came before it."""

    request: int
    response: int
    start: int
    length: int
    response_start: int
    response_length: int
    t_start_ns: int
    t_request_ns: int
    t_response_ns: int
    response_ns: int
    t_next_ns: int
    garbage: int
    unit: int
    function: int
    exception: int
    status: int
    retry: bool
    again: bool
    late: bool
    mistaken: bool
    port: int
    response_port: int
    protocol: int
    unsure: bool
    mark: int
    number: int

    @property
    def shape(self) -> tuple[int, int, int, int]:
        return self.unit, self.function, self.length, self.port


_ANSWERED, _UNANSWERED = int(Status.ANSWERED), int(Status.UNANSWERED)
_NOBODY: Final = TransactionColumns._make([0] * len(TransactionColumns._fields))._replace(
    request=-2, response=-2, unit=-1, t_request_ns=NEVER, status=_ANSWERED
)  # stands where no request came before, or none behind: of no shape, at no time


class RequestInTurn(NamedTuple):
    """A request beside its neighbours."""

    view: DiagnosisStep
    earlier: TransactionColumns  # the one before `before`
    before: TransactionColumns
    this: TransactionColumns
    behind: TransactionColumns
    quick: bool  # whether the clock shows what is sooner than any master repeats itself


def at_once(view: DiagnosisStep, before: TransactionColumns, this: TransactionColumns) -> bool:
    """Whether a request came right behind the one before, as an echo does."""
    return this.t_start_ns - before.t_request_ns < _ECHO_NS + view.clock.verdict(this.request).wait_ns


def by_tap(view: DiagnosisStep, index: int, after_ns: int) -> bool:
    """Whether a frame came again sooner than any device sends it, on a clock that shows so much."""
    return view.clock.verdict(index).fine and after_ns < _DEVICE_NS


def shown_twice(before: TransactionColumns, this: TransactionColumns) -> bool:
    """Whether this is a write's true echo, on a bus where the tap's copy of the write was taken for it."""
    return before.shape == this.shape and before.response == this.request - 1 and answered_alike(this.function)


def heard_back(before: TransactionColumns, this: TransactionColumns) -> bool:
    """Whether a log marks the first of two requests as sent, and the second as received."""
    return (before.mark, this.mark) == (Mark.TX, Mark.RX)


def asks_again(before: TransactionColumns, this: TransactionColumns) -> bool:
    """Whether these are two frames in a row, of one shape."""
    return this.request == before.request + 1 and this.shape == before.shape


def soon_behind(before: TransactionColumns, this: TransactionColumns) -> bool:
    """Whether a request came sooner behind another than any master gives up."""
    return this.t_start_ns - before.t_request_ns < HASTE_NS


def is_hasty(before: TransactionColumns, this: TransactionColumns) -> bool:
    """Whether a request of the same shape came right behind an unanswered one, sooner than a master gives up."""
    return before.status == _UNANSWERED and asks_again(before, this) and soon_behind(before, this)


def sent_in_haste(transactions: TransactionRows) -> NDArray[np.bool_]:
    """Which are broadcasts that no device sent, though right behind another: their client pauses between none."""
    behind, before = transactions[1:], transactions[:-1]
    sent = (transactions.unit == 0) & ~transactions.again & (transactions.protocol != Protocol.TCP)
    follows = (behind.request == before.request + 1) & (behind.port == before.port)
    return np.append(False, sent[1:] & sent[:-1] & follows & (behind.t_start_ns - before.t_request_ns < HASTE_NS))


def is_echoed_broadcast(turn: RequestInTurn) -> bool:
    """Whether a broadcast that comes twice came the second time from a device: at once, and neither before nor behind.

    Clients repeat broadcasts, though after a pause, and those that make none send more than two, or other ones so soon
    (`sent_in_haste`).
    """
    _, earlier, before, this, behind, quick = turn
    others = (before.again and soon_behind(earlier, before)) or (behind.again and soon_behind(this, behind))
    return quick and asks_again(before, this) and soon_behind(before, this) and not others


def answers_broadcast(turn: RequestInTurn) -> bool:
    """Whether this is the answer of a device to the broadcast before, which reads like a request to that device."""
    before, this = turn.before, turn.this
    alike = before.unit == 0 and before.shape[1:] == this.shape[1:] and this.request == before.request + 1
    return turn.quick and alike and soon_behind(before, this) and answered_alike(this.function)


_STRAY: Final = 4  # bytes that may have been an answer
_SURE_ECHOES: Final = 3
_ECHOING: Final = 0.3  # of all requests

_RULES: Final = (NO_RESPONSE, RETRY, LATE, ECHO, MISMATCH, BROADCAST_ANSWERED, DUPLICATE)


@looks_for(*_RULES)
class Outcomes:
    """Transactions in order; the newest waits for the one that comes after it.

    Nearly all went well: of these only those beside an odd one are looked at.
    """

    _suspects: TransactionRows
    _numbers: NDArray[np.int64]
    _judged: int
    _odd: int
    _requests: int
    _first_ones: int
    _echoes: int
    _echoes_at: list[int]
    _rewritten: set[int]
    _answering: dict[int, int]
    _hasty_from: float

    def __init__(self) -> None:
        self._suspects = TransactionRows.zeros(0)  # odd ones, their neighbours, and the newest
        self._numbers = np.zeros(0, np.int64)  # and how many came before each
        self._judged = 0  # of them, 1 once there is one
        self._odd = -1  # the number of the newest odd one
        self._requests = 0  # so far
        self._first_ones = 0  # of them, among the first frames: what those show counts for them, too
        self._echoes = 0  # requests that were answered when they came a second time, as far as all are judged
        self._echoes_at = []  # the numbers of further ones
        self._rewritten = set()  # units to which the same write went twice in a row, answered each time
        self._answering = {}  # units, and the number of the first request that each answered
        self._hasty_from = np.inf  # the number of the first broadcast that the client sent right behind another

    @property
    def open_from(self) -> int | None:
        return int(self._suspects.request[self._judged]) if len(self._suspects) > self._judged else None

    def __call__(self, view: DiagnosisStep) -> Iterator[Findings]:
        if len(view.transactions):
            self._gather(view)
        if view.clock.known and len(self._suspects) and self._suspects.request[-1] >= FIRST:
            yield from self._go_on(view, len(self._suspects) - 1)

    def close(self, view: DiagnosisStep) -> Iterator[Findings]:
        """No transaction comes after the newest."""
        yield from self._go_on(view, len(self._suspects))

    def _gather(self, view: DiagnosisStep) -> None:
        """Count new transactions, and hold those that may have to be looked at."""
        status, again, units = view.transactions.status, view.transactions.retry, view.transactions.unit
        odd = where((status == _UNANSWERED) | again | view.transactions.again | view.transactions.late)
        if len(odd):
            self._odd = self._requests + int(odd[-1])
        near = np.zeros(len(status) + 2, np.bool_)  # one before and one behind them
        near[odd] = near[odd + 1] = near[odd + 2] = True
        near[[1, -3, -2]] = True
        chosen = where(near[1:-1])
        if self._first_ones == self._requests:
            self._first_ones += int(view.transactions.request.searchsorted(FIRST))
        self._echoes_at += [self._requests + i for i in odd.tolist() if again[i] and status[i] != _UNANSWERED]
        answered = status == _ANSWERED
        for unit in where(np.bincount(units[answered])).tolist():
            if unit not in self._answering:
                self._answering[unit] = self._requests + int(np.argmax(answered & (units == unit)))
        if self._hasty_from == np.inf and not units.all():  # some are broadcasts
            known = TransactionRows.joined((self._suspects[-1:], view.transactions))
            hasty = where(sent_in_haste(known)) + self._requests - min(len(self._suspects), 1)
            self._hasty_from = min([self._hasty_from, *hasty[:1]])
        self._suspects = TransactionRows.joined((self._suspects, view.transactions[chosen]))
        self._numbers = np.concatenate((self._numbers, chosen + self._requests))
        self._requests += len(status)

    def _go_on(self, view: DiagnosisStep, upto: int) -> Iterator[Findings]:
        """Judge those held, up to one, and keep the newest of them beside what is left."""
        if upto <= self._judged:
            return
        if self._odd >= self._numbers[self._judged]:
            yield from self._judge(view, self._judged, upto)
        passed = bisect_left(self._echoes_at, int(self._numbers[upto - 1]))
        self._echoes += passed
        del self._echoes_at[:passed]
        self._suspects, self._numbers, self._judged = self._suspects[upto - 1 :], self._numbers[upto - 1 :], 1

    def _judge(self, view: DiagnosisStep, first: int, upto: int) -> Iterator[Findings]:
        """Say what is to be said of those held from `first` to `upto` (excluded)."""
        transactions = [
            TransactionColumns._make((*row, number))
            for row, number in zip(self._suspects.tolist(), self._numbers.tolist(), strict=True)
        ]
        by_rule: dict[Rule, list[int]] = {rule: [] for rule in _RULES}
        around = [_NOBODY, _NOBODY, *transactions, _NOBODY]
        for i in range(first, upto):
            earlier, before, this, behind = around[i : i + 4]
            if this.late and this.response >= 0 and this.unit:
                by_rule[LATE].append(i)
            if this.status != _UNANSWERED and not this.retry and not this.again:
                continue
            quick = view.timed and view.clock.verdict(this.request).wait_ns < HASTE_NS / 2
            rule = self._outcome(RequestInTurn(view, earlier, before, this, behind, quick))
            if rule is not None:
                by_rule[rule].append(i)
            if this.retry and rule is not ECHO and rule is not DUPLICATE:
                by_rule[RETRY].append(i)
        for rule, which in by_rule.items():
            if which:
                spoken = self._suspects.response if rule is LATE else self._suspects.request
                clocked = [view.clock.verdict(index).wait_ns < UNKNOWN for index in spoken[which].tolist()]
                served = self._served(which)
                timed = np.array(clocked) & view.timed
                findings = said(rule, self._suspects, np.array(which), timed, served, tap_kind(view.line))
                if rule is NO_RESPONSE:
                    began = [
                        self._answering.get(transactions[i].unit, self._requests) < transactions[i].number
                        for i in which
                    ]
                    findings.numbers[:, rule.numbers.index("answered_before")] = began
                yield findings

    def _served(self, which: list[int]) -> NDArray[np.bool_]:
        """Whether any unit had answered before these requests."""
        served: NDArray[np.bool_] = self._numbers[which] > min(self._answering.values(), default=self._requests)
        return served

    def _echoing(self, number: int) -> bool:
        """Whether nearly every request before this one came twice: that is the tap's doing."""
        requests = max(number, self._first_ones)
        echoes = self._echoes + bisect_left(self._echoes_at, requests)
        return echoes >= _SURE_ECHOES and echoes >= _ECHOING * requests

    def _outcome(self, turn: RequestInTurn) -> Rule | None:
        """What became of a request without an answer, or of one that repeats the one before."""
        this = turn.this
        if this.protocol == Protocol.TCP:  # no echoes, no broadcasts
            return NO_RESPONSE if this.status == _UNANSWERED else None
        if this.again and this.unit == 0:
            hasty = self._hasty_from <= this.number + 1  # as far as it is known wherever batches end
            return BROADCAST_ANSWERED if is_echoed_broadcast(turn) and not hasty else None
        if this.again and this.status != _UNANSWERED:
            self._rewritten.add(this.unit)
        elif this.again and self._second_echo(turn):
            return DUPLICATE if self._no_second_write(turn) else self._silence(turn)
        if this.retry and self._shown_again(turn):
            return DUPLICATE if self._answered_twice(turn) else ECHO
        if this.status != _UNANSWERED:
            return None
        if answers_broadcast(turn):
            return BROADCAST_ANSWERED
        return MISMATCH if self._echo_differs(turn) else self._silence(turn)

    def _repeats_all(self, before: TransactionColumns, this: TransactionColumns, *, quick: bool) -> bool:
        """Whether it is the tap that shows a request again: its log says so, or it does so with nearly all."""
        return asks_again(before, this) and (heard_back(before, this) or (not quick and self._echoing(this.number)))

    def _shown_again(self, turn: RequestInTurn) -> bool:
        """Whether a repeat is the request before, shown twice by the tap."""
        view, _, before, this, _, quick = turn
        hasty = quick and is_hasty(before, this) and at_once(view, before, this)
        return hasty or self._repeats_all(before, this, quick=quick)

    def _answered_twice(self, turn: RequestInTurn) -> bool:
        """Whether what comes thrice the same at once is a write and two echoes of it."""
        this = turn.this
        if this.status != _ANSWERED or not answered_alike(this.function) or self._echoing(this.number):
            return False
        return not by_tap(turn.view, this.request, this.t_start_ns - turn.before.t_request_ns)

    def _second_echo(self, turn: RequestInTurn) -> bool:
        """Whether what reads like a write that nobody answers may be a second echo of the write before."""
        view, _, before, this, behind, _ = turn
        if this.request != before.response + 1 or self._echoing(this.number):
            return False
        if behind.retry and at_once(view, this, behind):
            return False  # a request, which the tap shows twice
        return not by_tap(view, before.request, before.t_response_ns - before.t_request_ns)

    def _no_second_write(self, turn: RequestInTurn) -> bool:
        """Whether no client writes the same again so: at once, or, where times tell nothing, never on this bus."""
        if turn.quick:
            return turn.this.t_start_ns - turn.before.t_response_ns < HASTE_NS
        return turn.this.unit not in self._rewritten

    def _echo_differs(self, turn: RequestInTurn) -> bool:
        """Whether this is the echo of the write before, with other bytes: it reads like another request."""
        before, this = turn.before, turn.this
        differs = is_hasty(before, this) if turn.quick else self._differs(before, this)
        return differs and not this.retry and answered_alike(this.function)

    def _silence(self, turn: RequestInTurn) -> Rule | None:
        return None if self._excused(turn) else NO_RESPONSE

    def _excused(self, turn: RequestInTurn) -> bool:
        """Whether something else explains that this request has no answer."""
        view, _, before, this, behind, quick = turn
        if this.garbage >= _STRAY or this.request in view.explained:
            return True
        if this.t_next_ns == NEVER:  # it was waited out, to the end of what was heard
            return self._echoing(this.number) and shown_twice(before, this)
        if quick and is_hasty(this, behind):
            if behind.retry:
                return at_once(view, this, behind)  # this one, shown again
            return behind.status == _UNANSWERED and answered_alike(behind.function)
        echoing = self._echoing(this.number)
        if behind.retry and asks_again(this, behind) and (echoing or heard_back(this, behind)):
            return True
        if not quick and self._differs(this, behind):
            return answered_alike(this.function)
        return echoing and shown_twice(before, this)

    def _differs(self, before: TransactionColumns, this: TransactionColumns) -> bool:
        """Whether two unlike requests of one shape in a row, none answered, went to a unit that answers otherwise."""
        if not asks_again(before, this) or this.retry:
            return False
        if self._answering.get(this.unit, self._requests) >= max(this.number, self._first_ones):
            return False
        return before.status == _UNANSWERED == this.status
