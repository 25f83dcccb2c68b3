"""Whether a capture shows what type a register has, however sure its readings alone make it.

Confidence weighs what moved. What never moved, or moved once with all the rest, may be a part of its neighbour or have
nothing to do with it: there the capture shows less than the odds say, and nothing is told.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from ...registers.readings import BlockReadings, Words
from ...registers.roles import RegisterValue

_STILL_SURE: Final = 0.97  # confidence, where a word that never moved may belong to a number or not
_TORN: Final = 2  # moves of a high word alone, which no number of two words makes


class Shown:
    """The readings of a bus, asked about values of it."""

    def __init__(self, blocks: Iterable[BlockReadings]) -> None:
        self._blocks: dict[tuple[int, str], list[BlockReadings]] = {}
        for block in blocks:
            self._blocks.setdefault((block.unit, block.area), []).append(block)

    def __call__(self, value: RegisterValue) -> bool:
        """Whether the type of a value that moved is shown."""
        if value.kind == "text":
            return True
        whole = [
            block
            for block in self._blocks[value.unit, value.area]
            if block.address <= value.address and value.address + value.words <= block.address + block.quantity
        ]
        if not whole:
            return False
        block = max(whole, key=lambda each: (each.count, each.quantity))
        rows, beginning = block.series
        at, rows = value.address - block.address, rows[:beginning]
        if value.words == 1 and not _moved_by_itself(rows, at):
            return False
        if value.words == 2 and value.kind != "float" and _is_torn(rows, at, value.order):
            return False
        return value.number_confidence >= _STILL_SURE or not _has_still_word(rows, at, value, block.address)


def _moved_by_itself(rows: Words, at: int) -> bool:
    """Whether a register moved other than from or to 0 together with a register beside it."""
    moved = rows[1:] != rows[:-1]
    turned = (rows[1:] == 0) != (rows[:-1] == 0)
    beside = turned[:, [n for n in (at - 1, at + 1) if 0 <= n < rows.shape[1]]].any(axis=1)
    return bool((moved[:, at] & ~(turned[:, at] & beside)).any())


def _is_torn(rows: Words, at: int, order: str | None) -> bool:
    """Whether the high word of two moved while the low one stood."""
    high, low = (at, at + 1) if order in ("ABCD", "BADC") else (at + 1, at)
    moved = rows[1:] != rows[:-1]
    return int((moved[:, high] & ~moved[:, low]).sum()) >= _TORN


def _has_still_word(rows: Words, at: int, value: RegisterValue, begin: int) -> bool:
    """Whether a word of a value, or of what else it may be, has been the same all the time, and not 0; readings of
    nothing but 0 aside."""
    columns = set(range(at, at + value.words))
    if value.runner_up is not None:
        first = value.runner_up.address - begin
        columns |= set(range(max(first, 0), min(first + value.runner_up.words, rows.shape[1])))
    words = rows[:, sorted(columns)]
    words = words[words.any(axis=1)]
    return bool(((words == words[:1]).all(axis=0) & words.any(axis=0)).any())
