"""Rows of the model into an export file: the same targets as `rtuscope export`."""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from ..core import Analysed
from ..model.bus import Bus
from ..model.table import PIECE
from ..tables.findings import NOTHING
from ..tables.schema import Kind

if TYPE_CHECKING:
    from ..exports.sink import OutputStream
    from ..model.source import ViewSource

_AT_ONCE: Final = 1 << 12  # rows


Stop = Callable[[], bool]


def save(bus: Bus, source: ViewSource, rows: NDArray[np.int64], path: Path, stop: Stop = bool) -> int:
    """Write these rows (ascending), noise among them if it is chosen, to a file; how many were written.

    By suffix: jsonl, csv, mcap. A transaction is written with its request or with its answer, whole, so that a request
    is never called unanswered because its answer was not chosen. The file appears whole or not at all, holding what
    came before `stop` said True. Raises ExportError and CaptureError.
    """
    from ..exports.sink import output

    with output(path, source=source.path) as stream:
        return write(bus, source, rows, path, stream, stop)


def write(
    bus: Bus, source: ViewSource, rows: NDArray[np.int64], name: Path, stream: OutputStream, stop: Stop = bool
) -> int:
    """What `save` puts into a file called `name`, to an open stream."""
    from captures.chunks import Capture

    from ..exports import ExportOptions
    from ..exports.sink import target

    capture = Capture.of(source.line, (), timed=source.timed)
    sink = target(name).open_sink(stream, capture, ExportOptions(noise=True))
    off_ns = inf if bus.off_ns is None else bus.off_ns
    first = 0
    while first < len(rows) and not stop():
        last = int(np.searchsorted(rows, (rows[first] // PIECE + 1) * PIECE))
        part = rows[first : min(last, first + _AT_ONCE)]
        batch = bus.batch(part)
        sink.rows(batch, 0, len(batch))
        findings = NOTHING if batch.findings is None else batch.findings
        sink.batch(Analysed(batch, bus.transactions(_requests(bus, part, rows)), findings, off_ns=off_ns))
        first += len(part)
    sink.close()
    return first


def _requests(bus: Bus, part: NDArray[np.int64], chosen: NDArray[np.int64]) -> NDArray[np.int64]:
    """The requests in a part of the chosen rows, and those that its answers answer and that were not chosen."""
    partners = bus.table.take("partner", part).astype(np.int64)
    kinds = bus.table.take("kind", part)
    away = partners[(kinds == Kind.RESPONSE) & (partners >= 0)]
    return np.union1d(part[kinds == Kind.REQUEST], away[~np.isin(away, chosen)])
