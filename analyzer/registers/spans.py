"""The readings of one value's registers: what they were, taken for a number of some width and word order."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from captures.ragged import Ints
from dissectors.values import Order

from . import roles
from .hypotheses import HYPOTHESES, Hypothesis, numbers, patterns
from .readings import BlockReadings, Words
from .roles import Number
from .runs import Run


@dataclass(frozen=True, slots=True, eq=False)
class ReadSpan:
    """Some registers of a block under a hypothesis: `columns` of the block, and of its readings that are held `words`,
    (readings, registers); the first `beginning` of them follow each other without a gap."""

    hypothesis: Hypothesis
    block: BlockReadings
    columns: Ints
    words: Words
    beginning: int

    @classmethod
    def of(cls, run: Run, at: int, number: int) -> ReadSpan:
        """Those from a place of a run on, under the hypothesis of this number."""
        hypothesis = HYPOTHESES[number]
        block, columns = run.source_of(at, hypothesis.words, number)
        which = next(number for number, source in enumerate(run.blocks) if source is block)
        words, beginning = run.series[which]
        return cls(hypothesis, block, columns, words[:, columns[0] : columns[0] + hypothesis.words], beginning)

    @property
    def moved(self) -> bool:
        return bool((self.words != self.words[0]).any())

    @property
    def changes(self) -> int:
        """How often the value changed: exactly, where all its readings are held; else at least so often."""
        block = self.block
        if len(self.columns) == 1:
            return int(block.changes[self.columns].max())
        if block.stride == 1:
            return int((self.words[1:] != self.words[:-1]).any(axis=1).sum())
        return int(block.changes.max(initial=0, where=np.ones(len(block.changes), np.bool_)))

    def is_clock(self, order: Order) -> bool:
        """Whether it counts seconds since 1970 as fast as time passes."""
        if self.hypothesis.family != "i32":
            return False
        ends = patterns(np.stack((self.words[0], self.block.last[self.columns])), order)
        return roles.is_clock(ends, self.block.first_ns, self.block.last_ns)

    def patterns(self, order: Order) -> NDArray[np.uint64]:
        """Its readings as unsigned numbers."""
        return patterns(self.words, order)

    def numbers(self, order: Order, *, signed: bool) -> NDArray[np.float64]:
        """Its readings as numbers."""
        return numbers(self.words, order, is_float=self.hypothesis.is_float, signed=signed)

    def extremes(self, order: Order, *, signed: bool) -> tuple[Number, Number]:
        """The least and the greatest number of all readings; of those held where nothing more is known."""
        is_float, first = self.hypothesis.is_float, int(self.columns[0])
        known = _EXTREMES.get((len(self.columns), is_float, signed), "")
        if not known or order not in ("ABCD", "CDAB"):
            floats = self.numbers(order, signed=signed)
            least, greatest = float(np.fmin.reduce(floats)), float(np.fmax.reduce(floats))
            return (least, greatest) if is_float else (int(least), int(greatest))
        if known == "u16":
            return int(self.block.least[first]), int(self.block.greatest[first])
        low, high = self.block.extremes[known.format(order=order)]
        return float_as_read(low[first]), float_as_read(high[first])

    def last(self, order: Order, *, signed: bool) -> Number:
        """The newest number."""
        words = self.block.last[self.columns]
        if self.hypothesis.is_float:
            number = numbers(words[None], order, is_float=True, signed=signed)[0]
            return float_as_read(np.float32(number) if len(words) == 2 else number)
        pattern, width = int(patterns(words[None], order)[0]), 16 * len(words)
        return pattern - (1 << width) if signed and pattern >> (width - 1) else pattern


# how a block names its extremes: by registers, whether these are floats, whether they have a sign
_EXTREMES = {
    (1, False, False): "u16",
    (1, False, True): "s16",
    (2, False, False): "u32 {order}",
    (2, False, True): "s32 {order}",
    (2, True, True): "f32 {order}",
}


def float_as_read(number: Any) -> Number:
    """A number as people read it: of a float of 32 bits the digits that it has."""
    if isinstance(number, np.floating):
        return float(f"{float(number):.7g}") if math.isfinite(number) else None
    return int(number)
