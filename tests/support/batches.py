"""Whole captures as one batch, and pieces of them: for tests that look at rows across batches."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from analyzer.core import Analysed, analyse
from analyzer.filters import BatchTable
from analyzer.tables.batch import Batch
from analyzer.tables.findings import Findings
from analyzer.tables.schema import Rows
from analyzer.tables.transactions import TransactionRows
from captures.chunks import Capture


def joined(batches: Iterable[Batch]) -> Batch:
    """All rows of a capture as one batch."""
    parts = list(batches)
    shifts = np.cumsum([0, *(len(part.data) for part in parts)])
    rows = Rows.joined([part.rows for part in parts])
    rows.at[:] += np.repeat(shifts[:-1], [len(part) for part in parts])
    found = [part.findings for part in parts if part.findings is not None]
    data = np.concatenate([part.data for part in parts])
    return Batch(rows, data, findings=Findings.joined(found) if found else None)


def whole(capture: Capture) -> Analysed:
    """A capture analysed, as one."""
    found = list(analyse(capture))
    batch = joined(each.batch for each in found)
    assert batch.findings is not None
    return Analysed(batch, TransactionRows.joined([each.transactions for each in found]), batch.findings)


def table(capture: Capture) -> BatchTable:
    """A capture as a filter sees it."""
    one = whole(capture)
    return BatchTable(one.batch, capture.line, transactions=one.transactions)


def piece(one: Analysed, capture: Capture, first: int, last: int) -> Analysed:
    """Rows `first` to `last` of it, with what is said of them, as the pipeline would give them."""
    batch = BatchTable(one.batch, capture.line).batch(first, last)
    rows, spots = batch.rows, one.findings
    mine = [
        bool(((rows.port == port) & (rows.start == start)).any())
        for port, start in zip(spots.port.tolist(), spots.start.tolist(), strict=True)
    ]
    findings = spots[np.array(mine, np.bool_)] if len(mine) else spots
    begun = one.transactions[np.isin(one.transactions.request, rows.index)]
    return Analysed(replace(batch, findings=findings), begun, findings)
