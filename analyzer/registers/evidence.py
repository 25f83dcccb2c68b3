"""What the readings of a block say for each hypothesis at each register, as codes into small tables of log odds.

The heart is the description length: how many bits a series of readings takes when its changes are written down as those
of 16-bit words, or as those of one wider number. A wide number is known by its low word, whose changes look like chance
alone and are small once the high word stands before it. Where one word never moved there is nothing to compare; what it
holds (0, FFFF, a small number) and the shape of the moving one then say how often such a pair was one value.

Codes are small whole numbers: the tables that they index are learnt (`weights.json`), everything here is counting.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from .counting import Codes, Counting
from .readings import Words

_PORTION: Final = 1024  # registers that are counted at once


@dataclass(frozen=True, slots=True, eq=False)
class BlockEvidence:
    """The codes of one block: `codes[h]` of hypothesis h by table, an entry a register where it would begin; `moved`
    which registers moved; `absurd[h]` where hypothesis h cannot stand."""

    codes: list[Codes]
    moved: NDArray[np.bool_]
    absurd: list[NDArray[np.bool_]]


def block_evidence(series: Sequence[tuple[Words, int]]) -> list[BlockEvidence]:
    """The evidence of blocks: of each its readings (rows) of neighbouring registers (columns), and the row behind which
    time goes back once. Blocks of as many readings are counted together."""
    groups: dict[tuple[int, int], list[int]] = {}
    for number, (words, beginning) in enumerate(series):
        groups.setdefault((len(words), beginning), []).append(number)
    by_number: dict[int, BlockEvidence] = {}
    for (_, beginning), members in groups.items():
        for part in _portions(members, [series[number][0].shape[1] for number in members]):
            counting = Counting([series[number][0] for number in part], beginning)
            by_number.update(zip(part, (BlockEvidence(*mine) for mine in counting.blocks()), strict=True))
    return [by_number[number] for number in range(len(series))]


def _portions(members: Sequence[int], sizes: Sequence[int]) -> Iterator[list[int]]:
    """Blocks in portions of so many registers that the processor's memory holds them."""
    part: list[int] = []
    room = _PORTION
    for number, size in zip(members, sizes, strict=True):
        if part and size > room:
            yield part
            part, room = [], _PORTION
        part.append(number)
        room -= size
    if part:
        yield part
