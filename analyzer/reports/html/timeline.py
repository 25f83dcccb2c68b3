"""The bus over time in a fixed number of bins: when time runs past the last one, pairs merge and all are twice as wide.

Bytes spread evenly over the time that their row took, so that a long frame does not stand in one narrow bin; findings
count where their bytes begin, by severity.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from analyzer.findings.model import Findings, Severity
from analyzer.findings.registry import rules
from analyzer.frames import Rows

BINS: Final = 240
_FIRST_WIDTH_NS: Final = 1_000_000


class Timeline:
    """Octets and troubles a bin. `origin_ns` is the start of the first bin, None before any row."""

    def __init__(self) -> None:
        self.origin_ns: int | None = None
        self.width_ns = _FIRST_WIDTH_NS
        self.octets: NDArray[Any] = np.zeros(BINS)
        self.errors = np.zeros(BINS, np.int64)
        self.warnings = np.zeros(BINS, np.int64)

    def add(self, rows: Rows, findings: Findings) -> None:
        """Count rows in, nearly in order of time, and what was found on them."""
        if len(rows):
            if self.origin_ns is None:
                self.origin_ns = int(rows["t_start"].min())
            self._reach(int(rows["t_end"].max()) - self.origin_ns)
            self._spread(rows, self.origin_ns)
        placed = findings[findings["start"] >= 0]
        if self.origin_ns is None or not len(placed):
            return
        bins = np.clip((placed["t"] - self.origin_ns) // self.width_ns, 0, BINS - 1)
        severity = np.array([rule.severity for rule in rules()])[placed["rule"]]
        self.errors += np.bincount(bins[severity == Severity.ERROR], minlength=BINS)
        self.warnings += np.bincount(bins[severity == Severity.WARNING], minlength=BINS)

    def used(self, span_ns: int) -> int:
        """How many bins a capture of that length fills."""
        return min(BINS, max(1, -(-span_ns // self.width_ns)))

    def _reach(self, end_ns: int) -> None:
        """Make room for rows that end so long after the first one began."""
        while end_ns > BINS * self.width_ns:
            self.width_ns *= 2
            for name in ("octets", "errors", "warnings"):
                pairs = getattr(self, name).reshape(-1, 2).sum(axis=1)
                setattr(self, name, np.append(pairs, np.zeros_like(pairs)))

    def _spread(self, rows: Rows, origin_ns: int) -> None:
        passed = np.cumsum(rows["length"])
        times = np.column_stack((rows["t_start"], rows["t_end"])).ravel() - origin_ns
        sums = np.column_stack((passed - rows["length"], passed)).ravel()
        edges = np.arange(BINS + 1) * float(self.width_ns)
        below = np.interp(edges, np.maximum.accumulate(times), sums)
        below[0], below[-1] = 0.0, passed[-1]  # nothing is lost before the first bin or on the last edge
        self.octets += np.diff(below)
