"""Which rows hold a wanted value, told from the bytes as they stand: no value is copied out of its frame.

At every second byte begins a number; those that pass are counted along the bytes once, from the first byte and from the
second. A row holds one where that count grows between its first register and its last. Where few numbers pass, only the
rows that they stand in are fetched, and looked up among the places found.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ..tables.batch import Batch
from ..tables.columns import AreaCode, HeldValues, ValueSpans, unplaced_keys, words_of
from .slices import Mask, TableSlice, ValueSlice
from .table import RowOctets
from .tree import Wanted

Passes = Callable[[NDArray[np.uint16]], Mask]
_WORTH: Final = 1.0  # numbers that pass, a row: from there on all rows are read


@dataclass(frozen=True, slots=True, eq=False)
class HeldSlice:
    """The values of some rows; `signed`: of registers alone, as signed numbers. `left_out` are areas without.

    `requested` are the rows that are asked for (None: all); what is said of others means nothing.
    """

    section: TableSlice
    requested: Mask | None
    signed: bool = False
    left_out: frozenset[AreaCode] = frozenset()

    def valid(self) -> Mask:
        mask = np.zeros(len(self.section), np.bool_)
        for span in self._spans(self.section.held, None):
            mask[span.rows[span.counts > 0]] = True
        return mask

    def passing(self, wanted: Wanted) -> Mask:
        def passes(values: NDArray[np.uint16]) -> Mask:
            return ValueSlice(values.view(np.int16) if self.signed else values).passing(wanted)

        bits_pass = bool(passes(np.arange(2, dtype=np.uint16)).any())
        octets = None if bits_pass else self.section.octets
        hits = None if octets is None else np.flatnonzero(passes(words_of(octets.data)))
        if octets is None or hits is None or len(hits) > len(self.section) * _WORTH:
            return self._of(self.section.held, len(self.section), passes, bits_pass=bits_pass)
        mask = np.zeros(len(self.section), np.bool_)
        candidates = self._candidates(octets, hits)
        if len(candidates):
            batch, rows = octets.some(candidates)
            rows = rows[self._at(HeldValues(batch), hits + _behind(octets, batch, rows), passes)]
            mask[rows[rows >= 0]] = True
        return mask

    def _candidates(self, octets: RowOctets, hits: NDArray[np.intp]) -> NDArray[np.intp]:
        """Rows in whose bytes a number passes, whatever it is, and those whose values have no fixed place."""
        kinds, functions = (self.section.column(name) for name in ("kind", "function"))
        chosen: Mask = unplaced_keys()[kinds.astype(np.uint16) << 8 | functions]
        rows = np.searchsorted(octets.begins, hits, side="right") - 1
        chosen[rows[(rows >= 0) & (hits + 2 <= octets.ends[rows])]] = True
        return np.flatnonzero(chosen if self.requested is None else chosen & self.requested)

    def _at(self, held: HeldValues, hits: NDArray[np.intp], passes: Passes) -> Mask:
        """Which rows of a batch of few pass, where it is known at which bytes a number begins that does."""
        mask = np.zeros(len(held.pdus.begins), np.bool_)
        by_side = hits[hits & 1 == 0], hits[hits & 1 == 1]
        for span in self._spans(held, None):
            if span.read is None:
                ends = span.begins + 2 * span.counts
                for odd, places in enumerate(by_side):
                    own = (span.begins & 1 == odd) & (span.counts > 0)
                    first, last = (np.searchsorted(places, bounds[own]) for bounds in (span.begins, ends))
                    mask[span.rows[own][last > first]] = True
            elif not span.is_bits:
                of, _, values = span.each(held.pdus)
                mask[span.rows[of[passes(values)]]] = True
        return mask

    def _of(self, held: HeldValues, count: int, passes: Passes, *, bits_pass: bool) -> Mask:
        """Which rows of a batch pass."""
        mask = np.zeros(count, np.bool_)
        before, size = _passing_before(held.pdus.data, passes)
        spans = self._spans(held, None if bits_pass else _touched(held, before, size))
        registers = [span for span in spans if span.read is None]
        if registers:
            _in_registers(registers, before, size, mask)
        for span in spans:
            if span.read is not None and (bits_pass or not span.is_bits):
                of, _, values = span.each(held.pdus)
                mask[span.rows[of[passes(values)]]] = True
        return mask

    def _spans(self, held: HeldValues, among: Mask | None) -> list[ValueSpans]:
        return [span for span in held.spans(among) if span.area not in self.left_out]


def _behind(octets: RowOctets, batch: Batch, rows: NDArray[np.intp]) -> int:
    """How far behind its place in the rows' bytes a byte stands in those of a batch of some of them."""
    known = int(np.argmax(rows >= 0))
    return int(batch.rows.at[known] + 1 - octets.begins[rows[known]])


def _touched(held: HeldValues, before: NDArray[np.int32], size: int) -> Mask:
    """Rows in whose PDUs stands a number that passes, whatever it is: of most filters few, so that few are read."""
    begins, ends = held.pdus.begins, held.pdus.ends
    touched = np.zeros(len(begins), np.bool_)
    for odd in (0, 1):
        counts = before[odd * size : (odd + 1) * size]
        first, behind = (begins - odd + 1) >> 1, (ends - odd) >> 1
        touched |= counts.take(behind, mode="clip") > counts.take(first, mode="clip")
    return touched


def _in_registers(spans: list[ValueSpans], before: NDArray[np.int32], size: int, mask: Mask) -> None:
    """Mark the rows whose registers pass."""
    rows, begins, counts = (
        np.concatenate([getattr(span, name) for span in spans]) for name in ("rows", "begins", "counts")
    )
    first = (begins & 1) * size + (begins >> 1)
    first[counts == 0] = 0  # what a cut frame does not reach may lie behind the bytes
    mask[rows[before[first + counts] > before[first]]] = True


def _passing_before(data: NDArray[np.uint8], passes: Passes) -> tuple[NDArray[np.int32], int]:
    """How many numbers pass before each: first of those at even places, `size` figures, then of those at odd ones."""
    size = len(data) // 2 + 1
    before = np.zeros(2 * size, np.int32)
    for odd in (0, 1):
        words = (len(data) - odd) // 2
        if words > 0:
            numbers = data[odd : odd + 2 * words].view(">u2").astype(np.uint16)
            np.cumsum(passes(numbers), out=before[odd * size + 1 : odd * size + 1 + words])
    return before, size
