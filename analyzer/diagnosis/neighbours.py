"""A transaction beside its neighbours: what only looks like silence or a repeat, told by its haste and shape."""

from __future__ import annotations

from typing import Final, NamedTuple

from dissectors.lengths import relations
from dissectors.limits import Echo

from ..tables.transactions import Status
from .damage.triage import HASTE_NS
from .view import DiagnosisStep

_ECHO_NS: Final = 5_000_000
_DEVICE_NS: Final = 1_000_000  # no device answers sooner
_UNANSWERED: Final = int(Status.UNANSWERED)


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
    number: int

    @property
    def shape(self) -> tuple[int, int, int, int]:
        return self.unit, self.function, self.length, self.port


def at_once(view: DiagnosisStep, before: TransactionColumns, this: TransactionColumns) -> bool:
    """Whether a request came right behind the one before, as an echo does."""
    return this.t_start_ns - before.t_request_ns < _ECHO_NS + view.clock.verdict(this.request).wait_ns


def by_tap(view: DiagnosisStep, index: int, after_ns: int) -> bool:
    """Whether a frame came again sooner than any device sends it, on a clock that shows so much."""
    return view.clock.verdict(index).fine and after_ns < _DEVICE_NS


def shown_twice(before: TransactionColumns | None, this: TransactionColumns) -> bool:
    """Whether this is a write's true echo, on a bus where the tap's copy of the write was taken for it."""
    same = before is not None and before.shape == this.shape and before.response == this.request - 1
    return same and echoes(this.function)


def again(before: TransactionColumns, this: TransactionColumns) -> bool:
    """Whether these are two frames in a row, of one shape."""
    return this.request == before.request + 1 and this.shape == before.shape


def hasty(before: TransactionColumns | None, this: TransactionColumns, *, quick: bool) -> bool:
    """Whether a request of the same shape came right behind an unanswered one, sooner than a master gives up."""
    if before is None or not quick or before.status != _UNANSWERED or not again(before, this):
        return False
    return this.t_start_ns - before.t_request_ns < HASTE_NS


def echoed(
    earlier: TransactionColumns | None,
    before: TransactionColumns,
    this: TransactionColumns,
    behind: TransactionColumns | None,
) -> bool:
    """Whether a broadcast that comes twice came the second time from a device: at once, and neither before nor behind.

    Clients repeat broadcasts, though after a pause, and those that make none send more than two.
    """
    if not (again(before, this) and this.t_start_ns - before.t_request_ns < HASTE_NS):
        return False
    if before.again and earlier is not None and before.t_start_ns - earlier.t_request_ns < HASTE_NS:
        return False
    return behind is None or not (behind.again and behind.t_start_ns - this.t_request_ns < HASTE_NS)


def answers_broadcast(before: TransactionColumns | None, this: TransactionColumns, *, quick: bool) -> bool:
    """Whether this is the answer of a device to the broadcast before, which reads like a request to that device."""
    if before is None or not quick or before.unit or before.shape[1:] != this.shape[1:]:
        return False
    soon = this.t_start_ns - before.t_request_ns < HASTE_NS
    return soon and this.request == before.request + 1 and echoes(this.function)


def echoes(function: int) -> bool:
    """Whether a right answer of a function is its request once more."""
    return any(isinstance(relation, Echo) for relation in relations(function))
