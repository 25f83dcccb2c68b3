"""How much sense bytes make as Modbus: what a search for line settings goes by."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from analyzer.deframing.ascii import AsciiDeframer, looks_ascii
from analyzer.deframing.stream import Deframer
from analyzer.frames import Kind
from captures.chunks import Block
from captures.live.settings import PortSettings

_LONGEST: Final = 256


def explained(blocks: Sequence[Block], settings: PortSettings) -> int:
    """Bytes that are frames with a right check value, when these blocks were heard with these settings.

    Listening began and ended amid a frame, perhaps: what stands before the first frame or after the last one counts as
    explained too, as far as one frame goes, once two frames do.
    """
    block = Block.joined(blocks)
    ascii_mode = looks_ascii((block.data & 0x7F).tobytes())
    deframer = (AsciiDeframer if ascii_mode else Deframer)(settings.line())
    batches = [deframer.feed(block), deframer.close()]
    rows = np.concatenate([batch.rows for batch in batches])
    good = np.flatnonzero((rows["kind"] != Kind.NOISE) & rows["check"])
    total = int(rows["length"][good].sum())
    if len(good) < 2:
        return 0 if len(good) == 0 else total // 2  # one may be chance
    before = int(rows["length"][: good[0]].sum())
    after = int(rows["length"][good[-1] + 1 :].sum())
    return total + sum(part for part in (before, after) if part <= _LONGEST)
