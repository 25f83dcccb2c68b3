"""From a capture to batches of rows."""

from __future__ import annotations

from collections.abc import Iterator

from captures.chunks import Capture

from .deframing.engine import Options as Options
from .deframing.stream import Deframer
from .frames import Batch

_BLOCK = 1 << 20  # bytes read at once


def deframe(capture: Capture, options: Options = Options()) -> Iterator[Batch]:  # noqa: B008 - frozen
    """Rows of a whole capture, batch after batch in wire order; memory stays flat whatever its size."""
    deframer = Deframer(capture.line, options)
    for block in capture.blocks(_BLOCK):
        batch = deframer.feed(block)
        if len(batch):
            yield batch
    batch = deframer.close()
    if len(batch):
        yield batch
