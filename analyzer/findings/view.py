"""What a rule gets to see: rows as they came, transactions that were settled by them, and what is known of the line."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from captures.line import LineSettings

from ..deframing.options import Options
from ..frames import Batch, Kind, Rows


@dataclass(frozen=True)
class View:
    """One batch, seen by the rules; the columns that several rules need are made once."""

    batch: Batch
    transactions: Rows  # TRANSACTION, settled by this batch
    line: LineSettings
    options: Options

    @property
    def rows(self) -> Rows:
        return self.batch.rows

    @property
    def data(self) -> NDArray[np.uint8]:
        return self.batch.data

    @cached_property
    def frames(self) -> NDArray[np.intp]:
        """Rows that are frames."""
        return np.flatnonzero(self.rows["kind"] != Kind.NOISE)

    @cached_property
    def good(self) -> NDArray[np.intp]:
        """Rows that are frames with a right check value."""
        return np.flatnonzero((self.rows["kind"] != Kind.NOISE) & self.rows["check"])

    def bytes_of(self, row: int) -> bytes:
        """The captured bytes of a row."""
        return self.batch.bytes_of(row)
