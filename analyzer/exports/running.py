"""One pass over a capture: its raw chunks and its frames into one target."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from analyzer.frames import Kind
from analyzer.passing import passing
from captures import Capture

from .output import output
from .sink import ExportOptions, target

_PLAIN = ExportOptions()
_ROWS = 8192  # written at once: how long Ctrl-C and progress wait


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
    then; once `stop` says True the file is completed with what came so far. Raises ExportError.
    """
    from analyzer.pipeline import Options, deframe

    module = target(out, name)
    frames = octets = 0

    def stopped() -> bool:
        return stop is not None and stop()

    with output(out, source=capture.path) as stream:
        sink = module.open_sink(stream, capture, options)
        for batch in deframe(passing(capture, look=sink.block, stop=stopped), Options(explain=options.explain)):
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
