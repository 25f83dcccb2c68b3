"""Requests without an answer, repeated ones, answers that come too late: what became of each request.

Rests on the transactions, in the order of their requests. Two things only look like silence and are told apart by
their haste: a frame that the tap shows twice, and a write whose echo differs, which reads like another request. No
master repeats itself or goes on so soon.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Final

import numpy as np

from dissectors.lengths import Echo, relations

from ...frames import Rows
from ...transactions import TRANSACTION, Status
from ..model import Findings, Severity
from ..registry import About, Rule, looks_for
from ..view import View
from .strangers import BROADCAST_ANSWERED, MISMATCH

_HASTE_NS: Final = 50_000_000  # sooner than any master gives up waiting
_STRAY: Final = 4  # bytes that may have been an answer
_SURE_ECHOES: Final = 3


def _silent(numbers: Mapping[str, float]) -> str:
    waited = f" in {numbers['waited_ms']:.4g} ms, until the next request" if "waited_ms" in numbers else ""
    return f"unit {numbers['unit']:.0f} did not answer{waited}"


NO_RESPONSE: Final = Rule(
    "no-response",
    Severity.ERROR,
    About.TRANSACTION,
    clause="[2] 2.4.1",
    numbers=("unit", "waited_ms", "function"),
    text=_silent,
    cause="likely no such unit, or without power; else a wrong baud rate or parity, swapped A and B, or a request that "
    "reached it damaged",
    remedy="check the unit's power, address, line settings and wiring; take it out of the poll list if it is not there",
)
RETRY: Final = Rule(
    "retry",
    Severity.NOTE,
    About.TRANSACTION,
    clause="[2] 2.4.1",
    numbers=("unit", "after_ms"),
    text=lambda numbers: (
        "the master repeats its request"
        + (f", {numbers['after_ms']:.4g} ms after the first try" if "after_ms" in numbers else "")
    ),
    cause="it got no answer, a damaged one or one too late",
    remedy="look at what became of the request before",
)
LATE: Final = Rule(
    "late-response",
    Severity.ERROR,
    About.TRANSACTION,
    clause="[2] 2.4.1",
    numbers=("unit", "late_ms", "request"),
    text=lambda numbers: (
        f"this answers frame {numbers['request']:.0f}"
        + (f", {numbers['late_ms']:.4g} ms after it" if "late_ms" in numbers else "")
        + "; the master has gone on since and takes it for the answer to its newest request"
    ),
    cause="the unit answers later than the master waits; answers carry no register address, so the values land in the "
    "wrong registers",
    remedy="make the master's response timeout longer than the unit's longest response time",
)
ECHO: Final = Rule(
    "echo",
    Severity.NOTE,
    About.TRANSACTION,
    numbers=("after_ms",),
    text="the same frame once more, {after_ms:.3g} ms after itself",
    cause="the tap or a converter with local echo shows each sent frame twice",
    remedy="switch the converter's local echo off, or tap the line behind it",
)


@looks_for(NO_RESPONSE, RETRY, LATE, ECHO, MISMATCH, BROADCAST_ANSWERED)
class Outcomes:
    """Transactions in order; the newest waits for the one that comes after it."""

    def __init__(self) -> None:
        self._held: Rows = np.zeros(0, TRANSACTION)
        self._judged = 0  # of them, 1 once there is one
        self._echoes = self._requests = 0

    @property
    def open_from(self) -> int | None:
        return int(self._held["request"][self._judged]) if len(self._held) > self._judged else None

    def __call__(self, view: View) -> Iterator[Findings]:
        self._held = np.concatenate((self._held, view.transactions))
        if view.clock.known:
            yield from self._go_on(view, len(self._held) - 1)

    def close(self, view: View) -> Iterator[Findings]:
        """No transaction comes after the newest."""
        yield from self._go_on(view, len(self._held))

    def _go_on(self, view: View, upto: int) -> Iterator[Findings]:
        """Judge those held, up to one, and keep the newest of them beside what is left."""
        known, first = self._held, self._judged
        asked = known["request"]
        at = first
        while at < upto:
            verdict = view.clock.verdict(int(asked[at]))
            last = min(upto, max(at + 1, int(np.searchsorted(asked, view.clock.changes_after(int(asked[at]))))))
            quick = view.timed and verdict is not None and verdict.wait_ns < _HASTE_NS / 2
            yield from self._judge(known, at, last, timed=view.timed, quick=quick)
            at = last
        if upto > first:
            self._held, self._judged = known[upto - 1 :].copy(), 1

    def _judge(self, known: Rows, first: int, last: int, *, timed: bool, quick: bool) -> Iterator[Findings]:
        """Say what is to be said of transactions first to last (excluded); their neighbours are looked at, too.

        `quick`: times are good enough to tell haste.
        """
        unanswered = known["status"] == Status.UNANSWERED
        late = np.flatnonzero(known["late"][first:last] & (known["response"][first:last] >= 0)) + first
        if len(late):
            yield _late(known, late, timed=timed)
        odd = np.flatnonzero(unanswered[first:last] | known["retry"][first:last]) + first
        silent, retried, echoed, wrong, shouted = [], [], [], [], []
        for i in odd.tolist():
            if self._echoed(known, i, quick=quick):
                echoed.append(i)
                continue
            if unanswered[i] and _answers_broadcast(known, i, quick=quick):
                shouted.append(i)
                continue
            hasty = _hasty(known, i - 1, i, quick=quick)
            if known["retry"][i] and not hasty:
                retried.append(i)
            if not unanswered[i]:
                continue
            if hasty and not known["retry"][i] and unanswered[i - 1] and _echoes(int(known["function"][i])):
                wrong.append(i)
            elif not self._excused(known, i, quick=quick):
                silent.append(i)
        self._requests += last - first
        self._echoes += len(echoed)
        waited = np.where(timed, (known["t_next"] - known["t_request"]) / 1e6, np.nan)
        since = np.full(len(known), np.nan)
        if timed:
            failed = np.isin(known["status"][:-1], (Status.UNANSWERED, Status.DAMAGED))
            since[1:] = np.where(failed, np.diff(known["t_start"]) / 1e6, np.nan)
        if silent:
            yield _on(NO_RESPONSE, known[silent], known["unit"][silent], waited[silent], known["function"][silent])
        if retried:
            yield _on(RETRY, known[retried], known["unit"][retried], since[retried])
        if wrong:
            yield _on(MISMATCH, known[wrong], known["unit"][wrong], known["function"][wrong])
        if shouted:
            yield _on(BROADCAST_ANSWERED, known[shouted], known["unit"][shouted], known["function"][shouted])
        if echoed:
            apart = known["t_start"][echoed] - known["t_request"][np.array(echoed) - 1]
            yield _on(ECHO, known[echoed], np.maximum(apart, 0) / 1e6)

    def _echoed(self, known: Rows, i: int, *, quick: bool) -> bool:
        """Whether this request is the one before, shown again."""
        if not known["retry"][i] or i == 0:
            return False
        if _hasty(known, i - 1, i, quick=quick):
            return bool(known["status"][i - 1] == Status.UNANSWERED)
        return False

    def _excused(self, known: Rows, i: int, *, quick: bool) -> bool:
        """Whether something else explains that this request has no answer."""
        if known["t_next"][i] < 0 or known["garbage"][i] >= _STRAY:
            return True
        if i + 1 < len(known) and _hasty(known, i, i + 1, quick=quick):
            following = known[i + 1]
            if following["retry"]:
                return True  # this one, shown again
            return bool(following["status"] == Status.UNANSWERED and _echoes(int(following["function"])))
        return self._shown_twice(known, i, quick=quick)

    def _shown_twice(self, known: Rows, i: int, *, quick: bool) -> bool:
        """Whether this is a write's true echo, on a bus where the tap's copy of the write was taken for it."""
        if self._echoes < _SURE_ECHOES or 2 * self._echoes < self._requests or i == 0 or not quick:
            return False
        before, this = known[i - 1], known[i]
        same = all(before[name] == this[name] for name in ("unit", "function", "length", "port"))
        return bool(same and before["response"] == this["request"] - 1 and _echoes(int(this["function"])))


def _hasty(known: Rows, i: int, after: int, *, quick: bool) -> bool:
    """Whether a request of the same shape came right behind an unanswered one, sooner than a master gives up."""
    if i < 0 or not quick:
        return False
    one, two = known[i], known[after]
    if one["status"] != Status.UNANSWERED or two["request"] != one["request"] + 1:
        return False
    if any(one[name] != two[name] for name in ("unit", "function", "length", "port")):
        return False
    return bool(two["t_start"] - one["t_request"] < _HASTE_NS)


def _answers_broadcast(known: Rows, i: int, *, quick: bool) -> bool:
    """Whether this is the answer of a device to the broadcast before, which reads like a request to that device."""
    if i == 0 or not quick:
        return False
    before, this = known[i - 1], known[i]
    same = all(before[name] == this[name] for name in ("function", "length", "port"))
    soon = this["t_start"] - before["t_request"] < _HASTE_NS
    follows = before["unit"] == 0 and this["request"] == before["request"] + 1
    return bool(same and soon and follows and _echoes(int(this["function"])))


def _echoes(function: int) -> bool:
    return any(isinstance(relation, Echo) for relation in relations(function))


def _on(rule: Rule, transactions: Rows, *numbers: object) -> Findings:
    columns = (transactions[name] for name in ("request", "start", "length", "port", "t_start"))
    return rule.at(*columns, *numbers)


def _late(known: Rows, late: np.ndarray, *, timed: bool) -> Findings:
    which = known[late]
    behind = (which["t_response"] - which["t_request"]) / 1e6 if timed else np.full(len(which), np.nan)
    columns = (which[name] for name in ("response", "response_start", "response_length", "port", "t_response"))
    return LATE.at(*columns, which["unit"], behind, which["request"])
