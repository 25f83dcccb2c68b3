"""Rows on their way into a ledger: what one costs goes by the call more than by the row.

A ledger that one thread fills while another looks at it takes them when nobody looks: a look takes most of a second, and
rows wait for none.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

from captures.line import LineSettings

from ..options import Options
from ..tables.batch import Batch, join_batches
from ..tables.transactions import TransactionRows
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


class SharedLedger:
    """What comes waits, and goes in before the next look or once it is enough."""

    def __init__(self, line: LineSettings, options: Options = Options()) -> None:  # noqa: B008 - frozen
        self._options = options
        self._ledger = Ledger(line, options)
        self._waiting: deque[tuple[LineSettings, Batch, TransactionRows]] = deque()
        self._lock = threading.Lock()
        self._came = self._entered = 0  # rows

    def feed(self, line: LineSettings, batch: Batch, transactions: TransactionRows) -> None:
        """The next rows, of a line of these settings; waits for nobody."""
        self._waiting.append((line, batch, transactions))
        self._came += len(batch)
        if self._came - self._entered >= GATHERED and self._lock.acquire(blocking=False):
            try:
                self._enter()
            finally:
                self._lock.release()

    def close(self) -> None:
        """No more comes."""
        with self.looked_at() as ledger:
            ledger.close()

    @contextmanager
    def looked_at(self) -> Iterator[Ledger]:
        """The ledger with all that came; it stays as it is meanwhile."""
        with self._lock:
            self._enter()
            yield self._ledger

    def _enter(self) -> None:
        gathered = GatheredRows()
        while self._waiting:
            line, batch, transactions = self._waiting.popleft()
            if self._ledger.line != line:  # a tap found it out: what was counted before was of another one
                self._ledger, gathered = Ledger(line, self._options), GatheredRows()
            gathered.add(batch, transactions)
            self._entered += len(batch)
        gathered.enter(self._ledger)
