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
_FULL: Final = 0.8  # of the line's time
_SECONDS_NS: Final = 8e9
_TOO_SOON: Final = 0.9  # of t3.5
_WHOLE: Final = 1.02  # of the line's time, by which a clock may be off
_LEAST: Final = 30  # exchanges


class _Rounds:
    """A line's load, and what of the rest of its time the client might do without."""

    def __init__(self, evidence: Evidence, load: float, due: float) -> None:
        self.load, self.due, ledger = load, due, evidence.ledger
        self.fine = evidence.verdict.fine
        self.mean = ledger.pauses.total / len(ledger.pauses)
        self.longest = ledger.pauses.quantile(0.97)
        self.shortest = ledger.request_gaps.quantile(0.5) or due
        self.share = ledger.exchanges / ledger.span_ns  # exchanges a ns
        self.idle = (1 - load) / self.share  # ns an exchange
        intervals = (
            float(np.median(poll.intervals)) for poll in evidence.polls if poll.unit and len(poll.intervals) > 2
        )
        self.intervals = sorted(intervals)

    @property
    def full(self) -> bool:
        """By the silences that are due: nobody rests, units neither."""
        return self.load + 2 * self.due * self.share >= _NO_MORE

    @property
    def long_list(self) -> bool:
        return len(self.intervals) >= _MANY_POLLS and self.round_ns >= _LONG_ROUND_NS

    @property
    def round_ns(self) -> float:
        return self.intervals[len(self.intervals) // 2] if self.intervals else 0.0

    # What else a full line may be.

    def is_of_short_answers(self) -> bool:
        """On slow lines with short answers the silences that are due take much of the time."""
        return self.load < _BUSY and not self.full

    def is_haste(self) -> bool:
        """One of the two silences of an exchange is not kept, whatever the clock tells; a client that does not even keep
        the pause that is due would never rest, whatever its list."""
        return self.idle < _TWICE * self.due or (self.fine and self.shortest < _TOO_SOON * self.due)

    def is_rested(self) -> bool:
        """The mean of the pauses is good on any clock that does not cut them off."""
        rests = self.mean > _HURRIED * self.due + _HURRIED_NS and (self.fine or not self.full)
        rested = (self.mean - self.due) * self.share
        return rests and (self.load < _FULL or rested > max(_RESTED, self.load - _CROWDED))

    def rests_at_times(self) -> bool:
        """As at the end of a round."""
        return self.fine and self.longest is not None and self.longest > 2 * _HURRIED * self.due + _HURRIED_NS

    def is_untold(self) -> bool:
        """A coarse clock does not tell whether a client keeps the pause that is due, but where all do."""
        return self.load < _FULL and not (self.long_list and (self.full or self.fine))


def _rounds(evidence: Evidence) -> _Rounds | None:
    """None where nobody knows how full the line is, or it is not."""
    ledger, load, due = evidence.ledger, evidence.load, evidence.t35_ns
    if load is None or due is None or not len(ledger.pauses) or not _BUSY_SILENT <= load <= _WHOLE:
        return None
    if len(ledger.ports) > 1 or ledger.span_ns < _SECONDS_NS or ledger.exchanges < _LEAST:
        return None
    if any(is_in_ascii(request) for request in ledger.polls.requests):
        return None  # no silence is due there
    return _Rounds(evidence, load, due)


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
    rounds = _rounds(evidence)
    if rounds is None or not rounds.intervals:
        return
    others = (
        rounds.is_of_short_answers,
        rounds.is_haste,
        rounds.is_rested,
        rounds.rests_at_times,
        rounds.is_untold,
    )
    if any(is_so() for is_so in others):
        return
    yield Suspicion(
        (),
        100 * max(rounds.load - _BUSY, 0.0) + 40,
        frozenset({(Symptom.REQUESTS, None)}),
        {"load": rounds.load, "polls": len(rounds.intervals), "cycle": rounds.intervals[-1] / 1e9},
        severity=None if rounds.round_ns >= _LONG_ROUND_NS else Severity.NOTE,  # nobody waits long for his values
    )
