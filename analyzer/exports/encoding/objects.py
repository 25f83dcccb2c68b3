"""Frames as JSON objects for who asks frame by frame: in order, they are set as lines many at once and read back.

Who asks here and there, or once, gets each frame annotated by itself: None says so.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import orjson

from ...tables.batch import Batch
from ...tables.schema import Kind
from .lines import FrameJsonLines

_IN_ORDER: Final = 4  # frames asked for in order, after which the next ones are made ready
_STEP: Final = 8  # rows from one to the next that still are in order
_FEWEST, _MOST = 16, 1024  # rows made ready at once


class FramesAhead:
    """The JSON objects of frames, batch after batch."""

    def __init__(self) -> None:
        self._lines = FrameJsonLines()
        self._batch: Batch | None = None
        self._ready: dict[int, bytes] = {}  # by row
        self._before = 0  # the row asked for last
        self._in_order = 0
        self._more = _FEWEST

    def of(self, batch: Batch, row: int) -> dict[str, Any] | None:
        """That of a row that is a frame; None where it is not worth while to make more than this one."""
        if batch is not self._batch:
            self._batch, self._ready, self._before, self._in_order = batch, {}, -1, self._in_order and _IN_ORDER
        follows = 0 <= row - self._before <= _STEP
        self._before = row
        line = self._ready.get(row)
        if line is None:
            self._in_order = self._in_order + 1 if follows else 0
            if self._in_order <= _IN_ORDER:
                self._more = _FEWEST
                return None
            line = self._line_of(batch, row, min(row + self._more, len(batch)))
            self._more = min(2 * self._more, _MOST)
        decoded: dict[str, Any] = orjson.loads(line)
        return decoded

    def _line_of(self, batch: Batch, first: int, last: int) -> bytes:
        """The line of row `first`; those up to `last` (excluded) are ready."""
        text = b"".join(self._lines.text(batch, first, last))
        rows = first + np.flatnonzero(batch.rows.kind[first:last] != Kind.NOISE)
        self._ready = dict(zip(rows.tolist(), text.splitlines(), strict=True))
        return self._ready[first]
