"""Rows numbered on where an analysis had to begin anew: as if it had been there from the beginning."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from .batch import Batch
from .findings import Findings
from .schema import Kind, Rows
from .transactions import TransactionRows


@dataclass(frozen=True, slots=True)
class StreamOrigin:
    """Where a deframer began: frames, and bytes of each port, that came before it."""

    frames: int = 0
    starts: Mapping[int, int] = field(default_factory=dict)

    def __bool__(self) -> bool:
        return bool(self.frames or self.starts)

    def batch(self, batch: Batch) -> Batch:
        """Its rows, placed."""
        if not self or not len(batch):
            return batch
        rows = batch.rows.copy()
        answers = rows.request >= 0
        rows.index[rows.kind != Kind.NOISE] += self.frames
        rows.request[answers] += self.frames
        before = self._before(rows)
        rows.start[:] += before
        rows.request_start[answers] += before[answers]
        taken = rows.taken_for_start >= 0
        rows.taken_for_start[taken] += before[taken]
        earlier = {index + self.frames: adu for index, adu in batch.earlier.items()}
        return replace(batch, rows=rows, earlier=earlier)

    def transactions(self, transactions: TransactionRows) -> TransactionRows:
        """With the numbers of placed frames."""
        if self and len(transactions):
            for indices in (transactions.request, transactions.response):
                indices[indices >= 0] += self.frames
        return transactions

    def findings(self, findings: Findings) -> Findings:
        """About placed rows."""
        if self and len(findings):
            findings.index[findings.index >= 0] += self.frames
            findings.start[:] += np.where(findings.start >= 0, self._before(findings), 0)
        return findings

    def _before(self, rows: Rows | Findings) -> NDArray[np.int64]:
        """Bytes before, for each row's port."""
        before = np.zeros(256, np.int64)
        for port, start in self.starts.items():
            before[port] = start
        offsets: NDArray[np.int64] = before[rows.port]
        return offsets
