"""JSON lines: an object a frame, in wire order, with every field annotated. The keys are a contract with scripts."""

from __future__ import annotations

from typing import TYPE_CHECKING

import orjson

from analyzer.exports.encoding import Encoder, explain_json, noise_json
from analyzer.exports.output import Output
from analyzer.exports.sink import ExportOptions
from analyzer.frames import Batch, Kind

if TYPE_CHECKING:
    from captures import Block, Capture


class _Lines:
    def __init__(self, out: Output, options: ExportOptions) -> None:
        self._out = out
        self._options = options
        self._encoder = Encoder()

    def block(self, block: Block) -> None:
        """Raw chunks are not in this format."""

    def rows(self, batch: Batch, first: int, last: int) -> None:
        """A line a row."""
        noise = (batch.rows["kind"][first:last] == Kind.NOISE).tolist()
        rows = ((first + i, silent) for i, silent in enumerate(noise) if self._options.noise or not silent)
        self._out.write(b"".join(self._line(batch, row, silent) for row, silent in rows))

    def batch(self, batch: Batch) -> None:
        """Nothing here hangs on a whole batch."""

    def close(self) -> None:
        """Nothing is left: lines are written as they come."""

    def _line(self, batch: Batch, row: int, noise: bool) -> bytes:
        if noise:
            line = noise_json(batch, row)
        else:
            frame = batch.frame(row)
            line = self._encoder.line(frame)
            if self._options.explain:
                line["explain"] = explain_json(frame)
        return orjson.dumps(line, option=orjson.OPT_APPEND_NEWLINE)


def open_sink(out: Output, capture: Capture, options: ExportOptions) -> _Lines:  # noqa: ARG001
    """Lines onto `out`."""
    return _Lines(out, options)
