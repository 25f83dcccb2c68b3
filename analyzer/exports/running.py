"""One pass over a capture: its raw chunks and its frames into one target, or to where it is to be cut.

Captures are cut by the numbers of frames, or around those that pass a filter.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from captures import Capture
from captures.editing import cut_to_spans, cut_to_times
from captures.files import Unfinished

from ..core import analyse, deframe, observed
from ..options import Options
from ..tables.findings import Severity, rules
from ..tables.schema import Kind
from .sink import ExportError, ExportOptions, OutputStream, Sink, format_name, output, target

if TYPE_CHECKING:
    from ..core import Analysed
    from ..filters import Filter
    from ..tables.batch import Batch

_PLAIN = ExportOptions()
REFUSED: Final[Mapping[str, str]] = {  # what is said where a target has no use for an option
    "fields": "--fields works with csv, jsonl and parquet: other formats store whole frames",
    "delimiter": "--delimiter works with csv: other formats have no separator",
    "bom": "--bom works with csv: other formats need no byte-order mark",
    "noise": "--noise works with --table frames: other tables hold no bytes between frames",
    "explain": "--explain works with --table frames: other tables hold no boundaries",
}
_OF_FRAMES: Final = frozenset({"noise", "explain"})  # options that no other table has a use for
_ROWS = 8192  # written at once: how long Ctrl-C and progress wait


@dataclass(frozen=True, slots=True)
class Exported:
    """What was written."""

    frames: int
    bytes: int  # of the line, in frames and noise
    partial: bool  # stopped before the capture's end
    errors: int = 0  # findings of that severity, on the rows written and on the bus as a whole
    nothing: bool = False  # the filter let nothing through, or bytes outside frames alone, which were not asked for
    aside: Path | None = None  # where a part is, as the file that has the name stays


def export(
    capture: Capture,
    out: str | Path,
    *,
    name: str | None = None,
    options: ExportOptions = _PLAIN,
    limits: Options = Options(),  # noqa: B008 - frozen
    progress: Callable[[int, int], None] = lambda frames, octets: None,  # noqa: ARG005
    stop: Callable[[], bool] = bool,
) -> Exported:
    """Write a capture's frames to a file (`-` is standard output), by suffix or by format `name`.

    `limits` are how to deframe and diagnose; `explain` in them is that of `options`. A filter that nothing passes
    writes no file, and leaves one that is there as it is.

    The capture's own file is never written over. `progress` is told (frames, bytes) now and then; once `stop` says True
    the file is completed with what came so far, beside one that is there. Raises ExportError and FilterError.
    """
    from ..core import analyse

    options = _possible(options, out, name)
    frames = octets = errors = 0
    grave = _errors()
    most = options.count if options.table == "frames" else sys.maxsize  # records of other tables their sink counts

    kept = suppress(_NothingPassesError)  # then what had the name stays
    unfinished = Unfinished(stop)
    with kept, output(out, source=capture.path, unfinished=unfinished) as written:
        sink = open_sink(written, capture, options, name or format_name(out))
        stream = analyse(observed(capture, look=sink.block, stop=stop), replace(limits, explain=options.explain))
        stream = _begun(stream, sink)
        if options.filter is not None:
            from ..filters.evaluation import filtered

            stream = filtered(stream, options.filter, capture.line)
        for analysed in stream:
            batch, last = analysed.batch, 0
            end = _end(batch, most, frames)
            errors += int(np.count_nonzero(grave[analysed.findings.rule]))
            while last < end and not stop():
                first, last = last, min(last + _ROWS, end)
                rows = batch.rows[first:last]
                sink.rows(batch, first, last)
                frames += int(np.count_nonzero(rows.kind != Kind.NOISE))
                octets += int(rows.length.sum())
                progress(frames, octets)
            sink.batch(analysed.until(last))
            if frames == most or sink.full:
                break
        kept_rows = octets if options.noise or options.table != "frames" else frames
        nothing = options.filter is not None and not kept_rows
        sink.close()
        if nothing and str(out) != "-":
            raise _NothingPassesError
    return Exported(frames, octets, stop(), errors, nothing, unfinished.path)


class _NothingPassesError(Exception):
    """No row passes the filter."""


def open_sink(out: OutputStream, capture: Capture, options: ExportOptions, name: str) -> Sink:
    """What writes the frames, or another table, in the format of that name. Raises ExportError."""
    if options.table == "frames":
        return target("", name).open_sink(out, capture, options)
    from .recordfiles import open_records

    return open_records(out, capture, options, name)


def _begun(stream: Iterator[Analysed], sink: Sink) -> Iterator[Analysed]:
    """The same; the sink is told when rows begin, of which a filter may leave out the first."""
    for analysed in stream:
        if len(analysed.batch):
            sink.begins(int(analysed.batch.rows.t_start_ns[0]))
        yield analysed


def _possible(options: ExportOptions, out: str | Path, name: str | None) -> ExportOptions:
    """The options, with what follows from them. Raises ExportError where the format cannot have them."""
    module = target(out, name)
    if str(out) == "-" and sys.stdout.isatty() and getattr(module, "BINARY", False):
        raise ExportError(f"{name} is binary and cannot be shown on a terminal: name a file with -o, or pipe it")
    why = getattr(module, "WHOLE", "")
    if why and not options.whole:
        raise ExportError(f"{out}: cannot store a part of a capture: {why}")
    takes = module.TAKES if options.table == "frames" else module.TAKES - _OF_FRAMES
    for option, refusal in REFUSED.items():
        if option not in takes and getattr(options, option) != getattr(_PLAIN, option):
            raise ExportError(f"{out}: {refusal}")
    return replace(options, noise=options.noise or "noise" in getattr(options.filter, "fields", ()))


def _end(batch: Batch, count: int, frames: int) -> int:
    """The row behind the last one to be written, where so many frames are wanted and some are written already."""
    ends = np.append(np.flatnonzero(batch.rows.kind != Kind.NOISE) + 1, len(batch))
    return int(ends[min(count - frames, len(ends)) - 1])


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
    stop: Callable[[], bool] = bool,
) -> tuple[Capture, int]:
    """The reads within so many seconds of any frame that passes, before and after it, and how many frames pass."""
    from ..filters.evaluation import filtered

    margin = round(seconds * 1e9)
    times: list[tuple[int, int]] = []
    count = 0
    for analysed in filtered(analyse(capture, limits), wanted, capture.line):
        if stop():
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
