"""Rows on their way into a ledger: what one costs goes by the call more than by the row."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from ..tables.batch import Batch, join_batches
from ..tables.transactions import TransactionRows

if TYPE_CHECKING:
    from .ledger import Ledger

GATHERED: Final = 4096  # rows that wait at most


class GatheredRows:
    """Batches and the transactions that began among them, in their order; `rows` is how many of the former wait."""

    rows: int
    batches: list[Batch]
    _transactions: list[TransactionRows]

    def __init__(self) -> None:
        self.rows, self.batches, self._transactions = 0, [], []

    def add(self, batch: Batch, transactions: TransactionRows) -> None:
        """The next ones."""
        if len(batch) or len(transactions):
            self.batches.append(batch)
            self._transactions.append(transactions)
            self.rows += len(batch)

    def enter(self, ledger: Ledger) -> None:
        """All of them into a ledger, as one; none is left."""
        if self.batches:
            ledger.feed(join_batches(self.batches), TransactionRows.joined(self._transactions))
            self.rows, self.batches, self._transactions = 0, [], []
