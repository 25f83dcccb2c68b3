"""Runs the rules over rows as they come: the same on files and live, in bounded memory.

What is found does not hang on how the rows were cut into batches. A finding may speak of a row before the batch that
brought it to light; `open_from` says from which frame on more may still be said.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from captures.line import LineSettings

from ..options import Options
from ..tables.batch import Batch
from ..tables.findings import NOTHING, Findings, fresh_looks
from ..tables.transactions import TransactionRows
from .damage.triage import Triage
from .tap_clock import UNKNOWN, TapClock
from .view import DiagnosisStep, LookBack


class Diagnosis:
    """Rows and settled transactions in, findings out."""

    def __init__(self, line: LineSettings, options: Options = Options()) -> None:  # noqa: B008 - frozen
        self._line = line
        self._options = options
        self._looks = fresh_looks()
        self._clock = TapClock(line)
        self._trail = LookBack()
        self._examiner = Triage(self._trail)
        self._timed = False
        self._now = 0

    @property
    def open_from(self) -> int | None:
        """Index of the first frame of which more may be said by what comes; None if there is none."""
        bounds = [look.open_from for look in self._looks if hasattr(look, "open_from")]
        return min((bound for bound in bounds if bound is not None), default=None)

    @property
    def off_ns(self) -> float:
        """By how much response times may be wrong, as far as is known: 0 before the first verdict on the clock."""
        off = self._clock.off_ns if self._clock.known else 0.0
        return UNKNOWN if off is None else off

    def feed(self, batch: Batch, transactions: TransactionRows) -> Findings:
        """What this batch, and the transactions that it settles, bring to light."""
        self._timed = self._timed or bool(batch.rows.t_end_ns.any())
        view = self._view(batch, transactions)
        self._clock.feed(view.rows)
        findings = _ordered(part for look in self._looks for part in look(view))
        self._trail.go_on(batch)
        return findings

    def close(self, transactions: TransactionRows | None = None) -> Findings:
        """What the end brings to light: the last transactions, and what concerns the bus as a whole."""
        settled = TransactionRows.zeros(0) if transactions is None else transactions
        self._clock.close()
        view = self._view(Batch.empty(), settled)
        last = [part for look in self._looks for part in look(view)]
        last += [part for look in self._looks if hasattr(look, "close") for part in look.close(view)]
        return _ordered(last)

    def _view(self, batch: Batch, transactions: TransactionRows) -> DiagnosisStep:
        if len(batch):
            self._now = int(batch.rows.t_end_ns[-1])
        view = DiagnosisStep(
            batch,
            transactions,
            self._line,
            self._options,
            self._timed,
            self._clock,
            self._trail,
            self._examiner.explained,
            self._now,
        )
        view.verdicts.update(self._examiner.examine(view))
        return view


def _of(column: NDArray[Any], rows: NDArray[np.intp]) -> NDArray[Any]:
    return column if len(rows) == len(column) else column[rows]


def _ordered(parts: Iterable[Findings]) -> Findings:
    """Findings in wire order, those about the whole bus last."""
    tables = list(parts)
    if not tables:
        return NOTHING
    every = Findings.joined(tables)
    return every[np.lexsort((every.rule, every.start, every.t_ns, every.start < 0))]
