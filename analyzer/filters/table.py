"""What a filter is asked about: n rows in wire order, as columns. A batch is one; a view with a model of its own, too.

Only what a filter needs is asked for: columns one by one, bytes and words of few rows at a time.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from captures.line import LineSettings

from ..tables.batch import Batch
from ..tables.findings import NOTHING
from ..tables.transactions import Status, TransactionRows

# The columns that `Table.column` is asked for: those of `Rows` by their names and types, and what became of requests.
PLAIN: Final = (
    "index", "start", "length", "t_start_ns", "response_ns", "gap_before_ns", "gap_most_ns", "confidence",
    "kind", "unit", "function", "exception", "check", "port", "protocol", "errors", "taken_for_start",
    "unsure",
)  # fmt: skip
OUTCOMES: Final = ("retry", "late", "unanswered")  # bool; retry and unanswered of a request, late of an answer


@dataclass(frozen=True, slots=True, eq=False)
class RowOctets:
    """Rows by their bytes alone, end to end: the PDU of row i is `data[begins[i] : ends[i]]`."""

    data: NDArray[np.uint8]
    begins: NDArray[np.int64]
    ends: NDArray[np.int64]
    some: Callable[[NDArray[np.intp]], tuple[Batch, NDArray[np.intp]]]
    """Rows by their numbers, and requests that they answer: as a batch, and the number of each in it."""


class FilterTable(Protocol):
    """Rows in wire order.

    `origin_ns` is `t_start` of the capture's first row, which times count from.
    """

    @property
    def line(self) -> LineSettings: ...

    @property
    def origin_ns(self) -> int: ...

    def __len__(self) -> int: ...

    def column(self, name: str) -> NDArray[Any]:
        """One of PLAIN or OUTCOMES, a value a row."""
        ...

    def findings(self) -> tuple[NDArray[np.integer[Any]], NDArray[np.integer[Any]]]:
        """Rows that findings stand on, ascending, and the rule of each (`Findings.rule`)."""
        ...

    def batch(self, first: int, last: int) -> Batch:
        """Rows `first` to `last` (excluded) with their bytes, and in `earlier` the requests that stand before them."""
        ...

    def octets(self, first: int, last: int) -> RowOctets | None:
        """Their bytes, by which few of them may be chosen; None where it is as quick to take them all."""
        ...


class BatchTable:
    """The rows of a batch.

    What became of requests is told by `transactions` , and what was found by `batch.findings`; without
    them nothing is late, repeated or unanswered, and no row has findings.
    """

    def __init__(
        self,
        batch: Batch,
        line: LineSettings,
        *,
        transactions: TransactionRows | None = None,
        origin_ns: int | None = None,
    ) -> None:
        self.whole = batch
        self.line = line
        self._transactions = TransactionRows.zeros(0) if transactions is None else transactions
        first = int(batch.rows.t_start_ns[0]) if len(batch) else 0
        self.origin_ns = first if origin_ns is None else origin_ns

    def __len__(self) -> int:
        return len(self.whole)

    def column(self, name: str) -> NDArray[Any]:
        """See `Table`."""
        return self._outcomes[name] if name in OUTCOMES else self.whole.rows.column(name)

    @cached_property
    def _outcomes(self) -> Mapping[str, NDArray[np.bool_]]:
        transactions = self._transactions
        marks = {name: np.zeros(len(self), np.bool_) for name in OUTCOMES}
        for name, of, which in (
            ("retry", "request", transactions.retry),
            ("unanswered", "request", transactions.status == Status.UNANSWERED),
            ("late", "response", transactions.late),
        ):
            marks[name][self._rows_of(transactions.column(of)[which])] = True
        return marks

    def _rows_of(self, indices: NDArray[np.int64]) -> NDArray[np.intp]:
        """The rows of frames by their indices, those that are here."""
        frames = np.flatnonzero(self.whole.rows.index >= 0)
        numbers = self.whole.rows.index[frames]
        indices = indices[np.isin(indices, numbers)]
        return frames[np.searchsorted(numbers, indices)]

    def findings(self) -> tuple[NDArray[np.integer[Any]], NDArray[np.integer[Any]]]:
        """See `Table`."""
        return self._finding_pairs

    @cached_property
    def _finding_pairs(self) -> tuple[NDArray[np.integer[Any]], NDArray[np.integer[Any]]]:
        findings = NOTHING if self.whole.findings is None else self.whole.findings
        rows = self.whole.finding_rows
        order = np.argsort(rows, kind="stable")
        order = order[rows[order] >= 0]  # the others speak of the bus as a whole
        return rows[order], findings.rule[order]

    def batch(self, first: int, last: int) -> Batch:
        """See `Table`."""
        if first <= 0 and last >= len(self):
            return self.whole
        rows = self.whole.rows[first:last].copy()
        if not len(rows):
            return Batch.empty()
        low, high = int(rows.at.min()), int((rows.at + rows.length).max())
        earlier = requests_of(self.whole, np.arange(first, last))
        rows.at[:] -= low
        return Batch(rows, self.whole.data[low:high], earlier, off_ns=self.whole.off_ns)

    def octets(self, first: int, last: int) -> RowOctets | None:  # noqa: ARG002 - all are there already
        """See `Table`."""
        return None


def requests_of(batch: Batch, chosen: NDArray[np.intp]) -> Mapping[int, bytes]:
    """The bytes of the requests that some rows of a batch answer and that are not among those rows, by index."""
    rows = batch.rows
    requests = rows.request[chosen]
    outside = np.flatnonzero((requests >= 0) & ~np.isin(requests, rows.index[chosen]))
    by_index = {}
    for position in outside.tolist():
        index = int(requests[position])
        captured = batch.request_of(int(chosen[position]), index)
        if captured is not None:
            by_index[index] = captured
    return by_index


def narrowed(batch: Batch, passed: NDArray[np.bool_]) -> Batch:
    """A batch of those rows alone that passed, readable as before: requests that did not are in `earlier`."""
    chosen = np.flatnonzero(passed)
    if len(chosen) == len(batch):
        return batch
    findings = batch.findings
    if findings is not None and len(findings):
        findings = findings[(findings.start < 0) | np.append(passed, False)[batch.finding_rows]]
    evidence = None if batch.evidence is None else batch.evidence[chosen]
    return Batch(batch.rows[chosen], batch.data, requests_of(batch, chosen), evidence, findings, batch.off_ns)
