"""The newest rows, kept for what is said of them later.

A finding may come frames after the row that it speaks of (no answer came, an answer came too late). So the last batches
are kept, and a row is looked up when more is said of it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np

from ..tables.batch import Batch, rows_of_findings
from ..tables.findings import Finding, describe, described
from ..tables.frame import Frame
from ..tables.schema import Row
from .session import SessionStep

_ROWS: Final = 512  # kept at least


class ShownRow(NamedTuple):
    """A row to be shown, with what is to be said of it now; `late` where the row itself came before."""

    batch: Batch
    row: int
    values: Row  # of that row
    captured: bytes
    request_bytes: bytes | None  # of the request that it answers
    findings: tuple[Finding, ...]
    late: bool

    def frame(self) -> Frame:
        """A view of it, if it is a frame."""
        return self.batch.view(self.row, self.values)


class Recent:
    """Follows the steps of a session."""

    def __init__(self) -> None:
        self._batches: deque[Batch] = deque()
        self._rows = 0

    def feed(self, step: SessionStep) -> Iterator[ShownRow]:
        """What is to be said after this step: of earlier rows first, then the new rows."""
        batch = step.batch
        own = batch.findings  # None where the step brought no row: all that it says is of earlier ones
        if len(step.findings) > (0 if own is None else len(own)):
            yield from self._late(step)
        silent = own is None or not len(own)
        octets = batch.data.tobytes()
        asked = dict(batch.earlier)  # bytes of frames by their index: each may be a request that one behind it answers
        for row, values in enumerate(batch.rows):
            captured = octets[values.at : values.at + values.length]
            request = asked.get(values.request)
            if values.index >= 0:
                asked[values.index] = captured
            said = () if silent else batch.findings_of(row)
            yield ShownRow(batch, row, values, captured, request, said, late=False)
        if len(batch):
            self._batches.append(batch)
            self._rows += len(batch)
            while self._rows - len(self._batches[0]) >= _ROWS:
                self._rows -= len(self._batches.popleft())

    def _late(self, step: SessionStep) -> Iterator[ShownRow]:
        """Rows of earlier batches of which something is said now."""
        late = np.flatnonzero((rows_of_findings(step.batch.rows, step.findings) < 0) & (step.findings.start >= 0))
        stands: dict[int, tuple[Batch, int]] = {}
        for batch in reversed(self._batches):  # nearly all of them stand in the newest ones
            rows = rows_of_findings(batch.rows, step.findings[late])
            stands.update(
                (number, (batch, row)) for number, row in zip(late.tolist(), rows.tolist(), strict=True) if row >= 0
            )
            late = late[rows < 0]
            if not len(late):
                break
        for number in sorted(stands):
            batch, row = stands[number]
            one = step.findings[number : number + 1]
            values = batch.rows.row(row)
            request = batch.request_of(row, values.request) if values.request >= 0 else None
            said = (describe(one, 0),)
            yield ShownRow(batch.said(one), row, values, batch.bytes_of(row), request, said, True)


def of_the_bus(step: SessionStep) -> list[Finding]:
    """Findings about the bus as a whole."""
    return list(described(step.findings[step.findings.start < 0])) if len(step.findings) else []
