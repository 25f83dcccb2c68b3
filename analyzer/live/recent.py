"""The newest rows, kept for what is said of them later.

A finding may come frames after the row that it speaks of (no answer came, an answer came too late). So the last batches
are kept, and a row is looked up when more is said of it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from ..tables.batch import Batch
from ..tables.findings import Finding, describe
from .session import SessionStep

_ROWS: Final = 512  # kept at least


@dataclass(frozen=True, slots=True)
class ShownRow:
    """A row to be shown, with what is to be said of it now; `late` where the row itself came before."""

    batch: Batch
    row: int
    findings: tuple[Finding, ...]
    late: bool


class Recent:
    """Follows the steps of a session."""

    def __init__(self) -> None:
        self._batches: deque[Batch] = deque()
        self._rows = 0

    def feed(self, step: SessionStep) -> Iterator[ShownRow]:
        """What is to be said after this step: of earlier rows first, then the new rows."""
        findings = step.batch.findings
        if findings is not None and len(step.findings) > len(findings):
            yield from self._late(step)
        batch = step.batch
        silent = findings is None or not len(findings)
        for row in range(len(batch)):
            yield ShownRow(batch, row, () if silent else batch.findings_of(row), late=False)
        if len(batch):
            self._batches.append(batch)
            self._rows += len(batch)
            while self._rows - len(self._batches[0]) >= _ROWS:
                self._rows -= len(self._batches.popleft())

    def _late(self, step: SessionStep) -> Iterator[ShownRow]:
        """Rows of earlier batches of which something is said now."""
        for finding in step.findings:
            start, port = int(finding["start"]), int(finding["port"])
            if start < 0:
                continue
            for batch in self._batches:
                rows = np.flatnonzero((batch.rows["start"] == start) & (batch.rows["port"] == port))
                if len(rows):
                    one = np.array([finding])
                    yield ShownRow(replace(batch, findings=one), int(rows[0]), (describe(finding),), late=True)
                    break


def of_the_bus(step: SessionStep) -> list[Finding]:
    """Findings about the bus as a whole."""
    return [describe(finding) for finding in step.findings[step.findings["start"] < 0]]
