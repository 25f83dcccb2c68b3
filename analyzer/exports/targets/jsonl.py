"""JSON lines: an object a frame, in wire order, with every field annotated. The keys are a contract with scripts."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from ...tables.batch import Batch
from ..chosen import ChosenKeys
from ..encoding import FrameJsonLines
from ..sink import ExportOptions, OutputStream, Sink

if TYPE_CHECKING:
    from captures import Capture


TAKES: Final = frozenset({"noise", "explain", "fields"})


class _JsonLinesSink(Sink):
    def __init__(self, out: OutputStream, options: ExportOptions) -> None:
        self._out: ChosenKeys | OutputStream = ChosenKeys(out, options.fields) if options.fields else out
        self._lines = FrameJsonLines(explain=options.explain, noise=options.noise)

    def begins(self, t_ns: int) -> None:
        """From when the seconds count, where they are asked for."""
        if isinstance(self._out, ChosenKeys):
            self._out.begins(t_ns)

    def rows(self, batch: Batch, first: int, last: int) -> None:
        """A line a row."""
        for part in self._lines.text(batch, first, last):
            self._out.write(part)


def open_sink(out: OutputStream, capture: Capture, options: ExportOptions) -> _JsonLinesSink:  # noqa: ARG001
    """Lines onto `out`."""
    return _JsonLinesSink(out, options)
