"""The bytes of some rows of a batch, read by arrays: as numbers, and as hex."""

from __future__ import annotations

from binascii import hexlify

import numpy as np

from analyzer.frames import Batch, Kind, Protocol, Rows
from analyzer.pdus import Pdus

from .pieces import Ints, Pieces, pieces
from .sheet import Sheet


class Source:
    """Bytes of a batch from `first` to `last` (excluded), which is as far as hex is asked for, for one sheet."""

    def __init__(self, pdus: Pdus, first: int, last: int) -> None:
        self.pdus = pdus
        self._first = first
        self._last = last
        self._hex: int | None = None  # where it begins among what the sheet was lent

    @classmethod
    def of(cls, pdus: Pdus, frames: Rows) -> Source:
        """The bytes of some RTU frames of a batch."""
        plain = frames["protocol"] == Protocol.RTU
        if not plain.any():
            return cls(pdus, 0, 0)
        begins = frames["at"][plain]
        return cls(pdus, int(begins.min()), int((begins + frames["length"][plain]).max()))

    def octets(self, at: Ints) -> Ints:
        """The byte at each place."""
        found: Ints = self.pdus.data.take(at).astype(np.int64)
        return found

    def words(self, at: Ints) -> Ints:
        """The two bytes at each place, as a number."""
        found: Ints = self.pdus.words.take(at).astype(np.int64)
        return found

    def hex(self, begins: Ints, lengths: Ints, sheet: Sheet) -> Pieces:
        """Stretches of bytes in hex."""
        if self._hex is None:
            self._hex = sheet.lend(hexlify(self._octets()))
        return pieces(self._hex + 2 * (begins - self._first), 2 * lengths)

    def spaced(self, begins: Ints, lengths: Ints, sheet: Sheet) -> Pieces:
        """Stretches of bytes in capital hex, spaces between the bytes."""
        begin = sheet.lend(hexlify(self._octets(), " ").upper())
        return pieces(begin + 3 * (begins - self._first), 3 * lengths - 1)

    def _octets(self) -> bytes:
        return self.pdus.data[self._first : self._last].tobytes()


def kept(batch: Batch, first: int, last: int, *, noise: bool) -> tuple[Ints, Rows]:
    """Of rows `first` to `last` (excluded) of a batch, their numbers and themselves; without `noise` only frames."""
    rows = batch.rows[first:last]
    if noise or (rows["kind"] != Kind.NOISE).all():
        return np.arange(first, last), rows
    here = first + np.flatnonzero(rows["kind"] != Kind.NOISE)
    return here, batch.rows[here]
