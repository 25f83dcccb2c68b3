"""From a capture to batches of rows."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from captures.chunks import Block, Capture

from .deframing.ascii import AsciiDeframer, looks_ascii
from .deframing.options import Options as Options
from .deframing.stream import Deframer
from .frames import Batch

_BLOCK = 1 << 20  # bytes read at once
_LOOK = 1 << 16  # bytes that tell RTU from ASCII mode


def deframe(capture: Capture, options: Options = Options()) -> Iterator[Batch]:  # noqa: B008 - frozen
    """Rows of a whole capture, batch after batch in wire order; memory stays flat whatever its size."""
    deframer: Deframer | AsciiDeframer | None = None
    for block in _evenly(capture.blocks(_BLOCK)):
        if deframer is None:
            ascii_mode = options.protocol == "ascii" or (
                options.protocol == "auto" and looks_ascii(block.data[:_LOOK].tobytes())
            )
            deframer = (AsciiDeframer if ascii_mode else Deframer)(capture.line, options)
        batch = deframer.feed(block)
        if len(batch):
            yield batch
    if deframer is not None and len(batch := deframer.close()):
        yield batch


def _evenly(blocks: Iterable[Block]) -> Iterator[Block]:
    """The same chunks in blocks whose ends hang on the chunks alone, so that a capture reads alike from any format."""
    held: list[Block] = []
    room = _BLOCK
    for block in blocks:
        first = 0
        while first < len(block):
            last = int(np.searchsorted(block.offsets, block.offsets[first] + room))
            part = block.slice(first, min(max(last, first + 1), len(block)))
            held.append(part)
            room -= len(part.data)
            first += len(part)
            if room <= 0:
                yield Block.joined(held)
                held, room = [], _BLOCK
    if held:
        yield Block.joined(held)
