"""JSON lines: an object a frame, in wire order, with every field annotated. The keys are a contract with scripts."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from ...tables.batch import Batch
from ..chosen import ChosenKeys
from ..encoding import FrameJsonLines
from ..sink import ExportOptions, OutputStream

if TYPE_CHECKING:
    from captures import Block, Capture

    from ...core import Analysed


COLUMNAR: Final = True


class _JsonLinesSink:
    def __init__(self, out: OutputStream, options: ExportOptions) -> None:
        self._out = ChosenKeys(out, options.fields) if options.fields else out
        self._lines = FrameJsonLines(explain=options.explain, noise=options.noise)

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


def open_sink(out: OutputStream, capture: Capture, options: ExportOptions) -> _JsonLinesSink:  # noqa: ARG001
    """Lines onto `out`."""
    return _JsonLinesSink(out, options)
