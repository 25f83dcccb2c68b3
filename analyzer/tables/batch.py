"""Rows with the bytes that they speak of: the one shape between the deframer and every view."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .findings import Finding, Findings, describe
from .frame import Frame
from .schema import BoundaryEvidence, DelayBounds, Kind, Row, Rows, delay_bounds

_NEAR = 16  # rows back: where nearly all requests stand


def rows_of_findings(rows: Rows, findings: Findings) -> NDArray[np.int64]:
    """The row that each finding stands on: the one that holds the first byte it speaks of, frame or noise.

    -1 for what concerns the bus as a whole, and for findings on other rows than these.
    """
    return rows_of_bytes(BytePlaces(rows.port, rows.start, rows.length), findings.port, findings.start)


class BytePlaces(NamedTuple):
    """Of rows, which bytes of their ports' streams each holds: columns."""

    port: NDArray[np.uint8]
    start: NDArray[np.int64]
    length: NDArray[np.integer[Any]]


def rows_of_bytes(rows: BytePlaces, ports: NDArray[np.uint8], starts: NDArray[np.int64]) -> NDArray[np.int64]:
    """The row that holds each byte of a port's stream; -1 for none."""
    holders = np.full(len(ports), -1, np.int64)
    for port in np.flatnonzero(np.bincount(ports)).tolist() if len(rows.port) else ():
        own = np.flatnonzero(rows.port == port)
        if not len(own):
            continue
        order = own[np.argsort(rows.start[own], kind="stable")]
        begins = rows.start[order]
        meant = np.flatnonzero((ports == port) & (starts >= 0))
        first = starts[meant]
        holder = np.searchsorted(begins, first, side="right") - 1
        inside = (holder >= 0) & (first < begins[holder] + rows.length[order[holder]])
        holders[meant[inside]] = order[holder[inside]]
    return holders


FrameTeller = Callable[["Batch", int], dict[str, Any] | None]


@dataclass(frozen=True)
class Batch:
    """Rows in wire order, with their bytes.

    `earlier` holds the bytes of those requests (by index) that rows here answer and that lie in a batch before.
    `findings` are what a diagnosis said of these rows; None where there was none. `off_ns`: by how much response times
    may be wrong, as far as is known by now; 0 where they are measured, infinite where this tap cannot tell them.
    """

    rows: Rows
    data: NDArray[np.uint8]
    earlier: Mapping[int, bytes] = field(default_factory=dict)
    evidence: BoundaryEvidence | None = None
    findings: Findings | None = None
    off_ns: float = 0.0

    @classmethod
    def empty(cls) -> Batch:
        """No rows."""
        return cls(Rows.zeros(0), np.zeros(0, np.uint8))

    def __len__(self) -> int:
        return len(self.rows)

    def said(self, findings: Findings) -> Batch:
        """The same rows, with what was said of them."""
        return Batch(self.rows, self.data, self.earlier, self.evidence, findings, self.off_ns)

    def bytes_of(self, row: int) -> bytes:
        """The captured bytes of one row."""
        at = int(self.rows.at[row])
        return self.data[at : at + int(self.rows.length[row])].tobytes()

    def frames(self, told: FrameTeller | None = None) -> Iterator[Frame]:
        """A view of each frame, noise left out; `told` as in `frame`."""
        framed = np.flatnonzero(self.rows.kind != Kind.NOISE)
        return (self.view(row, values, told) for row, values in zip(framed.tolist(), self.rows[framed], strict=True))

    def frame(self, row: int, told: FrameTeller | None = None) -> Frame:
        """A view of one row that is a frame; `told` makes its JSON object, or says None."""
        return self.view(row, self.rows.row(row), told)

    def view(self, row: int, values: Row, told: FrameTeller | None = None) -> Frame:
        """The same where the row's values are at hand."""
        captured = self.data[values.at : values.at + values.length].tobytes()
        request = self.request_of(row, values.request) if values.request >= 0 else None
        evidence = None if self.evidence is None else self.evidence[row : row + 1]
        ready = None if told is None else partial(told, self, row)
        return Frame(values, captured, request, evidence, self.findings_of(row), ready, self.off_ns)

    def findings_of(self, row: int) -> tuple[Finding, ...]:
        """What the diagnosis said of one row, frame or noise."""
        if self.findings is None or not len(self.findings):
            return ()
        return tuple(describe(self.findings, number) for number in self._findings_by_row.get(row, ()))

    @cached_property
    def response_times(self) -> DelayBounds:
        """How long each answer took, as far as the tap's clock carries it."""
        return delay_bounds(np.where(self.rows.request_start >= 0, self.rows.response_ns, -1), self.off_ns)

    @cached_property
    def finding_rows(self) -> NDArray[np.int64]:
        """The row that each of `findings` stands on (`rows_of_findings`)."""
        return np.zeros(0, np.int64) if self.findings is None else rows_of_findings(self.rows, self.findings)

    @cached_property
    def finding_counts(self) -> NDArray[np.int64]:
        """How many findings stand on each row."""
        return np.bincount(self.finding_rows[self.finding_rows >= 0], minlength=len(self))

    @cached_property
    def _findings_by_row(self) -> dict[int, list[int]]:
        numbers: dict[int, list[int]] = {}
        for number, row in enumerate(self.finding_rows.tolist()):
            numbers.setdefault(row, []).append(number)
        return numbers

    def request_of(self, row: int, index: int) -> bytes | None:
        """The bytes of the request with this index, which the frame at `row` answers."""
        if index in self.earlier:
            return self.earlier[index]
        indices = self.rows.index
        for before in range(row - 1, max(row - _NEAR, 0) - 1, -1):
            if indices[before] == index:
                return self.bytes_of(before)
        matches = np.flatnonzero(indices[:row] == index)
        return self.bytes_of(int(matches[0])) if len(matches) else None


def join_batches(batches: Sequence[Batch]) -> Batch:
    """Batches end to end as one, at least one; without evidence and findings."""
    if len(batches) == 1:
        return batches[0]
    rows = Rows.joined([batch.rows for batch in batches])
    sizes = np.cumsum([0, *(len(batch.data) for batch in batches)])
    rows.at[:] += np.repeat(sizes[:-1], [len(batch) for batch in batches])
    earlier = {index: adu for batch in batches for index, adu in batch.earlier.items()}
    return Batch(rows, np.concatenate([batch.data for batch in batches]), earlier, off_ns=batches[-1].off_ns)
