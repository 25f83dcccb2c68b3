"""One pass over a capture: its raw chunks and its frames into one target."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from analyzer.frames import Kind
from analyzer.passing import passing
from captures import Capture

from .output import ExportError, output
from .sink import ExportOptions, target

_PLAIN = ExportOptions()
_ROWS = 2048  # written at once: how long Ctrl-C and progress wait


@dataclass(frozen=True, slots=True)
class Exported:
    """What was written."""

    frames: int
    bytes: int  # of the line, in frames and noise
    partial: bool  # stopped before the capture's end


def export(
    capture: Capture,
    out: str | Path,
    *,
    name: str | None = None,
    options: ExportOptions = _PLAIN,
    progress: Callable[[int, int], None] | None = None,
    stop: Callable[[], bool] | None = None,
) -> Exported:
    """Write a capture's frames to a file (`-` is standard output), by suffix or by format `name`.

    The capture's own file is never written over. `progress` is told (frames, bytes) now and
    then; once `stop` says True the file is completed with what came so far. Raises ExportError and FilterError.
    """
    from analyzer.pipeline import Options, analyse

    module = target(out, name)
    if options.filter is not None:
        if why := getattr(module, "WHOLE", ""):
            raise ExportError(f"{out}: cannot be filtered: {why}")
        options = replace(options, noise=options.noise or "noise" in options.filter.fields)
    frames = octets = 0

    def stopped() -> bool:
        return stop is not None and stop()

    with output(out, source=capture.path) as written:
        sink = module.open_sink(written, capture, options)
        stream = analyse(passing(capture, look=sink.block, stop=stopped), Options(explain=options.explain))
        if options.filter is not None:
            from analyzer.filters.stream import filtered

            stream = filtered(stream, options.filter, capture.line)
        for analysed in stream:
            batch = analysed.batch
            for first in range(0, len(batch), _ROWS):
                if stopped():
                    break
                rows = batch.rows[first : first + _ROWS]
                sink.rows(batch, first, first + len(rows))
                frames += int(np.count_nonzero(rows["kind"] != Kind.NOISE))
                octets += int(rows["length"].sum())
                if progress is not None:
                    progress(frames, octets)
            else:
                sink.batch(batch)
        sink.close()
    return Exported(frames, octets, stopped())
