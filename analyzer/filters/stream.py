"""A filter over an analysis as it streams by: exports and reports see only what passes.

A row passes or not by itself. A transaction passes with its request or with its answer, whole, so that a request is
never called unanswered because its answer was filtered away. Findings pass with the row that they stand on; those about
the bus as a whole stay.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from captures.line import LineSettings

from ..tables.transactions import TransactionRows
from .evaluation import Filter
from .table import BatchTable, narrowed

if TYPE_CHECKING:
    from ..core import Analysed
    from ..tables.schema import Rows


def filtered(analysed: Iterable[Analysed], wanted: Filter, line: LineSettings) -> Iterator[Analysed]:
    """What passes of each batch, as batches of its own, some of them empty. Raises FilterError."""
    passing = _FilteredPairs(wanted, line)
    return (passing.of(each) for each in analysed)


class _FilteredPairs:
    """Holds what spans two batches: transactions whose answer is still to come."""

    def __init__(self, wanted: Filter, line: LineSettings) -> None:
        self._wanted = wanted
        self._line = line
        self._origin_ns: int | None = None
        self._open: TransactionRows = TransactionRows.zeros(0)
        self._request_passed = np.zeros(0, np.bool_)  # of those: whether the request passed
        self._behind = 0

    def of(self, analysed: Analysed) -> Analysed:
        batch, rows = analysed.batch, analysed.batch.rows
        if self._origin_ns is None and len(rows):
            self._origin_ns = int(rows.t_start_ns[0])
        self._behind = max(self._behind, int(rows.index.max(initial=-1)) + 1)
        pairs = TransactionRows.joined((self._open, analysed.transactions))
        mask = self._wanted.mask(BatchTable(batch, self._line, transactions=pairs, origin_ns=self._origin_ns))
        part = narrowed(batch, mask)
        passed = np.concatenate((self._request_passed, np.zeros(len(analysed.transactions), np.bool_)))
        passed |= _among(pairs.request, part.rows) | _among(pairs.response, part.rows)
        settled = pairs.response < self._behind
        self._open, self._request_passed = pairs[~settled], passed[~settled]
        findings = analysed.findings if part.findings is None else part.findings
        return replace(analysed, batch=part, transactions=pairs[settled & passed], findings=findings)


def _among(indices: NDArray[np.int64], rows: Rows) -> NDArray[np.bool_]:
    """Which frames, by index, are among rows."""
    among: NDArray[np.bool_] = (indices >= 0) & np.isin(indices, rows.index)
    return among
