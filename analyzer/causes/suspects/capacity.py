"""More than a line can carry."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from ...tables.findings import Severity
from ..evidence import Evidence
from ..rawbytes import is_in_ascii
from ..registry import Suspicion, Symptom, suspect

_BUSY: Final = 0.75  # of the line's time
_BUSY_SILENT: Final = 0.6  # where the silences that are due take the rest,
_NO_MORE: Final = 0.97  # so much of it together
_TWICE: Final = 1.95
_HURRIED: Final = 1.1  # of t3.5: the mean pause of a master that never rests
_HURRIED_NS: Final = 3e5
_RESTED: Final = 0.02  # of the time, beyond t3.5: without these rests a round would be no shorter to speak of
_CROWDED: Final = 0.87  # of the line's time: over it, short pauses are no rest
_MANY_POLLS: Final = 8
_LONG_ROUND_NS: Final = 0.9e9
_FEW_POLLS: Final = 3
_FULL: Final = 0.8  # of the line's time
_SECONDS_NS: Final = 8e9
_TOO_SOON: Final = 0.9  # of t3.5


@suspect(
    "overload",
    Severity.WARNING,
    blame="master",
    text="The client polls more than the line can carry: bytes are on it {load:.0%} of the time and the client never "
    "rests; a round of its {polls:,} polls takes {cycle:sec}",
    share="{load:.0%} of the line's time",
    deciding_test="Work out the time of a round from the list: the bytes of all requests and answers at this baud "
    "rate, and the silences between them",
    remedy="Raise the baud rate, join polls of adjacent registers into one, poll slow values less often, or use two "
    "lines",
)
def overload(evidence: Evidence) -> Iterator[Suspicion]:
    """A full line, and a master without a pause."""
    ledger, load = evidence.ledger, evidence.load
    if (
        load is None
        or len(ledger.ports) > 1
        or ledger.span_ns < _SECONDS_NS
        or not _BUSY_SILENT <= load <= 1.02
        or ledger.exchanges < 30
        or any(is_in_ascii(request) for request in ledger.polls.requests)  # no silence is due in ASCII
    ):
        return
    due = evidence.t35_ns
    if due is None or not len(ledger.pauses):
        return
    full = (
        load + 2 * due * ledger.exchanges / ledger.span_ns >= _NO_MORE
    )  # by its silences: nobody rests, units neither
    if load < _BUSY and not full:
        return  # on slow lines with short answers the silences that are due take much of the time
    if (1 - load) * ledger.span_ns < _TWICE * due * ledger.exchanges:
        return  # one of the two silences of an exchange is not kept: a matter of haste, whatever the clock tells
    mean = ledger.pauses.total / len(ledger.pauses)
    rested = (mean - due) * ledger.exchanges / ledger.span_ns
    rests = mean > _HURRIED * due + _HURRIED_NS and (evidence.verdict.fine or not full)
    if rests and (load < _FULL or rested > max(_RESTED, load - _CROWDED)):
        return  # it rests: the mean of the pauses is good on any clock that does not cut them off
    long = ledger.pauses.quantile(0.97) if evidence.verdict.fine else None
    if long is not None and long > 2 * _HURRIED * due + _HURRIED_NS:
        return
    intervals = sorted(
        float(np.median(poll.intervals)) for poll in evidence.polls if poll.unit and len(poll.intervals) > 2
    )
    round_ns = intervals[len(intervals) // 2] if intervals else 0.0
    long_list = len(intervals) >= _MANY_POLLS and round_ns >= _LONG_ROUND_NS
    if load < _FULL and not (long_list and (full or evidence.verdict.fine)):
        return  # a coarse clock does not tell whether a master keeps the pause that is due, but where all do
    if not long_list and (len(intervals) < _FEW_POLLS or round_ns < _LONG_ROUND_NS):
        return  # a master that goes through a short list without a pause does what it is told
    if evidence.verdict.fine and (ledger.request_gaps.quantile(0.5) or due) < _TOO_SOON * due:
        return  # one that does not even keep the pause that is due would never rest, whatever its list
    yield Suspicion(
        (),
        100 * max(load - _BUSY, 0.0) + 40,
        frozenset({(Symptom.REQUESTS, None)}),
        {"load": load, "polls": len(intervals), "cycle": intervals[-1] / 1e9},
    )
