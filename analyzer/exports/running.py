"""One pass over a capture: its raw chunks and its frames into one target, or to where it is to be cut.

Captures are cut by the numbers of frames, or around those that pass a filter.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from captures import Capture
from captures.editing import cut_to_spans, cut_to_times

from ..core import analyse, deframe, observed
from ..options import Options
from ..tables.findings import Severity, rules
from ..tables.schema import Kind
from .sink import ExportError, ExportOptions, format_name, output, target

if TYPE_CHECKING:
    from ..filters import Filter

_PLAIN = ExportOptions()
_ROWS = 8192  # written at once: how long Ctrl-C and progress wait


@dataclass(frozen=True, slots=True)
class Exported:
    """What was written."""

    frames: int
    bytes: int  # of the line, in frames and noise
    partial: bool  # stopped before the capture's end
    errors: int = 0  # findings of that severity, on the rows written and on the bus as a whole


def export(
    capture: Capture,
    out: str | Path,
    *,
    name: str | None = None,
    options: ExportOptions = _PLAIN,
    limits: Options = Options(),  # noqa: B008 - frozen
    progress: Callable[[int, int], None] | None = None,
    stop: Callable[[], bool] | None = None,
) -> Exported:
    """Write a capture's frames to a file (`-` is standard output), by suffix or by format `name`.

    `limits` are how to deframe and diagnose; `explain` in them is that of `options`.

    The capture's own file is never written over. `progress` is told (frames, bytes) now and
    then; once `stop` says True the file is completed with what came so far. Raises ExportError and FilterError.
    """
    from ..core import analyse

    module = target(out, name)
    if str(out) == "-" and sys.stdout.isatty() and getattr(module, "BINARY", False):
        raise ExportError(f"{name} is no text to show on a terminal: name a file with -o, or put it into a pipe")
    if options.filter is not None:
        if why := getattr(module, "WHOLE", ""):
            raise ExportError(f"{out}: cannot be filtered: {why}")
        options = replace(options, noise=options.noise or "noise" in options.filter.fields)
    frames = octets = errors = 0
    grave = _errors()

    def stopped() -> bool:
        return stop is not None and stop()

    with output(out, source=capture.path) as written:
        if options.table == "frames":
            sink = module.open_sink(written, capture, options)
        else:
            from .records import open_records

            sink = open_records(written, capture, options, format_name(out, name))
        stream = analyse(observed(capture, look=sink.block, stop=stopped), replace(limits, explain=options.explain))
        if options.filter is not None:
            from ..filters.evaluation import filtered

            stream = filtered(stream, options.filter, capture.line)
        for analysed in stream:
            batch, last = analysed.batch, 0
            errors += int(np.count_nonzero(grave[analysed.findings.rule]))
            while last < len(batch) and not stopped():
                first, last = last, min(last + _ROWS, len(batch))
                rows = batch.rows[first:last]
                sink.rows(batch, first, last)
                frames += int(np.count_nonzero(rows.kind != Kind.NOISE))
                octets += int(rows.length.sum())
                if progress is not None:
                    progress(frames, octets)
            sink.batch(analysed.until(last))
        sink.close()
    return Exported(frames, octets, stopped(), errors)


def _errors() -> NDArray[np.bool_]:
    """Which rules, by number, find errors."""
    return np.array([rule.severity >= Severity.ERROR for rule in rules()])


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
