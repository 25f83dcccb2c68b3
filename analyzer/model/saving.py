"""Rows of the model into an export file: the same targets as `rtuscope export`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from analyzer.findings.model import NOTHING
from analyzer.frames import Kind
from analyzer.pipeline import Analysed

from .bus import Bus
from .table import PIECE

if TYPE_CHECKING:
    from .source import Source

_AT_ONCE: Final = 1 << 12  # rows


def save(
    bus: Bus, source: Source, rows: NDArray[np.int64], path: Path, stop: Callable[[], bool] = lambda: False
) -> int:
    """Write these rows (ascending), noise among them if it is chosen; how many were written.

    By suffix: jsonl, csv, mcap. A transaction is written with its request or with its answer, whole, so that a request
    is never called unanswered because its answer was not chosen. The file appears whole or not at all, holding what
    came before `stop` said True. Raises ExportError and CaptureError.
    """
    from analyzer.exports import ExportOptions
    from analyzer.exports.output import output
    from analyzer.exports.sink import target
    from captures.chunks import Capture

    module = target(path)
    written = 0
    with output(path, source=source.path) as stream:
        capture = Capture.of(source.line, (), timed=source.timed)
        sink = module.open_sink(stream, capture, ExportOptions(noise=True))
        first = 0
        while first < len(rows) and not stop():
            last = int(np.searchsorted(rows, (rows[first] // PIECE + 1) * PIECE))
            part = rows[first : min(last, first + _AT_ONCE)]
            batch = bus.batch(part)
            sink.rows(batch, 0, len(batch))
            found = NOTHING if batch.findings is None else batch.findings
            sink.batch(Analysed(batch, bus.transactions(_asked(bus, part, rows)), found))
            first += len(part)
            written += len(part)
        sink.close()
    return written


def _asked(bus: Bus, part: NDArray[np.int64], chosen: NDArray[np.int64]) -> NDArray[np.int64]:
    """The requests in a part of the chosen rows, and those that its answers answer and that were not chosen."""
    partners = bus.table.take("partner", part).astype(np.int64)
    kinds = bus.table.take("kind", part)
    away = partners[(kinds == Kind.RESPONSE) & (partners >= 0)]
    return np.union1d(part[kinds == Kind.REQUEST], away[~np.isin(away, chosen)])
