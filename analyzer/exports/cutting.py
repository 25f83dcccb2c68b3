"""Where a capture is to be cut: by the numbers of frames, or around those that pass a filter."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from captures import Capture
from captures.editing import cut_to_spans, cut_to_times

from ..core import analyse, deframe
from ..options import Options
from ..tables.schema import Kind

if TYPE_CHECKING:
    from ..filters import Filter


def frames_only(capture: Capture, first: int, last: int, limits: Options = Options()) -> Capture:  # noqa: B008
    """From frame number `first` to number `last`: on each port, all bytes from the first one's to the last one's."""
    spans: dict[int, tuple[int, int]] = {}
    for batch in deframe(capture, limits):
        rows = batch.rows
        rows = rows[(rows.index >= first) & (rows.index <= last)]
        for port in np.unique(rows.port).tolist():
            mine = rows[rows.port == port]
            begin, end = int(mine.start[0]), int(mine.start[-1] + mine.length[-1])
            spans[port] = (min(begin, spans.get(port, (begin, end))[0]), end)
        if len(batch.rows) and batch.rows.index.max() > last:
            break
    return cut_to_spans(capture, {port: [span] for port, span in spans.items()})


def around(
    capture: Capture,
    wanted: Filter,
    seconds: float,
    limits: Options = Options(),  # noqa: B008 - frozen
    stop: Callable[[], bool] | None = None,
) -> tuple[Capture, int]:
    """The reads within so many seconds of any frame that passes, before and after it, and how many frames pass."""
    from ..filters.evaluation import filtered

    margin = round(seconds * 1e9)
    times: list[tuple[int, int]] = []
    count = 0
    for analysed in filtered(analyse(capture, limits), wanted, capture.line):
        if stop is not None and stop():
            break
        rows = analysed.batch.rows
        rows = rows[rows.kind != Kind.NOISE] if "noise" not in wanted.fields else rows
        count += len(rows)
        for begin, end in zip(rows.t_start_ns.tolist(), rows.t_end_ns.tolist(), strict=True):
            if times and begin - margin <= times[-1][1]:
                times[-1] = times[-1][0], max(times[-1][1], end + margin)
            else:
                times.append((begin - margin, end + margin))
    return cut_to_times(capture, times), count
