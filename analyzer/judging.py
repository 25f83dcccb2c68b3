"""Rows in; what became of requests, and what is wrong, out: the same for a capture, the interface and a live line."""

from __future__ import annotations

from collections.abc import Sequence

from captures.line import LineSettings

from .deframing.options import Options
from .findings.diagnosis import Diagnosis
from .findings.model import Findings
from .frames import Batch, Rows
from .recorded import Deaf, excused, marked
from .transactions import Transactions


class Judging:
    """Settled transactions and findings of batches in wire order; both may speak of batches before."""

    def __init__(self, line: LineSettings, options: Options, deaf: Sequence[Deaf] = ()) -> None:
        """`deaf`: times in which nothing was heard; nobody is blamed for what is missing then."""
        self._transactions = Transactions()
        self._diagnosis = Diagnosis(line, options)
        self.deaf = deaf

    @property
    def open_from(self) -> int | None:
        """The index of the first frame of which more may be said; None where there is none."""
        bounds = (self._transactions.open_from, self._diagnosis.open_from)
        return min((bound for bound in bounds if bound is not None), default=None)

    def feed(self, batch: Batch) -> tuple[Rows, Findings]:
        """What is to be said once these rows are known."""
        settled = marked(self._transactions.feed(batch), self.deaf)
        return settled, excused(self._diagnosis.feed(batch, settled), self.deaf)

    def close(self) -> tuple[Rows, Findings]:
        """No more rows come: the rest, and what concerns the bus as a whole."""
        settled = marked(self._transactions.close(), self.deaf)
        return settled, excused(self._diagnosis.close(settled), self.deaf)
