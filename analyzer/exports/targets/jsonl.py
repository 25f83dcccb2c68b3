"""JSON lines: an object a frame, in wire order, with every field annotated. The keys are a contract with scripts."""

from __future__ import annotations

from typing import TYPE_CHECKING

from analyzer.exports.encoding import JsonLines
from analyzer.exports.output import Output
from analyzer.exports.sink import ExportOptions
from analyzer.frames import Batch

if TYPE_CHECKING:
    from analyzer.pipeline import Analysed
    from captures import Block, Capture


class _Lines:
    def __init__(self, out: Output, options: ExportOptions) -> None:
        self._out = out
        self._lines = JsonLines(explain=options.explain, noise=options.noise)

    def block(self, block: Block) -> None:
        """Raw chunks are not in this format."""

    def rows(self, batch: Batch, first: int, last: int) -> None:
        """A line a row."""
        for part in self._lines.text(batch, first, last):
            self._out.write(part)

    def batch(self, analysed: Analysed) -> None:
        """Nothing here hangs on a whole batch."""

    def close(self) -> None:
        """Nothing is left: lines are written as they come."""


def open_sink(out: Output, capture: Capture, options: ExportOptions) -> _Lines:  # noqa: ARG001
    """Lines onto `out`."""
    return _Lines(out, options)
