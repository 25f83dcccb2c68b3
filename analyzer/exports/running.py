"""One pass over a capture: its raw chunks and its frames into one target."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from analyzer.frames import Kind
from captures import Block, Capture, LineSettings

from .output import output
from .sink import ExportOptions, Sink, target

_PLAIN = ExportOptions()


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

    The capture's own file is never written over. `progress` is told (frames, bytes) after each
    batch; once `stop` says True the file is completed with what came so far. Raises ExportError.
    """
    from analyzer.pipeline import Options, deframe

    module = target(out, name)
    frames = octets = 0
    partial = False
    with output(out, source=capture.path) as stream:
        sink = module.open_sink(stream, capture, options)
        passing = Capture(_Passing(capture, sink), path=capture.path, format=capture.format)
        for batch in deframe(passing, Options(explain=options.explain)):
            sink.batch(batch)
            frames += int(np.count_nonzero(batch.rows["kind"] != Kind.NOISE))
            octets += int(batch.rows["length"].sum())
            if progress is not None:
                progress(frames, octets)
            if stop is not None and stop():
                partial = True
                break
        sink.close()
    return Exported(frames, octets, partial)


@dataclass(frozen=True, slots=True)
class _Passing:
    """A source whose blocks pass by a sink on their way to the deframer."""

    capture: Capture
    sink: Sink

    @property
    def line(self) -> LineSettings:
        return self.capture.line

    @property
    def timed(self) -> bool:
        return self.capture.timed

    def blocks(self, max_bytes: int, note: Callable[[str, str], None]) -> Iterator[Block]:  # noqa: ARG002
        """The capture's blocks; it keeps its damage itself."""
        for block in self.capture.blocks(max_bytes):
            self.sink.block(block)
            yield block
