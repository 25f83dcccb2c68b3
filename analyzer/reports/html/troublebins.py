"""Octets and findings over the time of a capture, for the chart on a report's page."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from ...tables.bins import TimeBins
from ...tables.findings import Findings, Severity, rules
from ...tables.schema import Rows

TROUBLE_BINS: Final = 240
_FIRST_TROUBLE_BIN_NS: Final = 1_000_000


class TroubleBins:
    """Octets and findings by severity, a bin each, over the whole capture.

    Bytes spread evenly over the time that their row took, so that a long frame does not stand in one narrow bin;
    findings count where their bytes begin.
    """

    def __init__(self) -> None:
        self._bins = TimeBins(TROUBLE_BINS, _FIRST_TROUBLE_BIN_NS)
        self._bins.tables.update(octets=np.zeros(TROUBLE_BINS))
        self._bins.tables.update({severity: np.zeros(TROUBLE_BINS, np.int64) for severity in Severity})

    @property
    def origin_ns(self) -> int | None:
        """The start of the first bin, None before any row."""
        return self._bins.begin_ns

    @property
    def width_ns(self) -> int:
        """Of a bin."""
        return self._bins.width_ns

    @property
    def octets(self) -> NDArray[np.float64]:
        """Bytes of each bin."""
        return self._bins.tables["octets"]

    @property
    def errors(self) -> NDArray[np.int64]:
        """Findings of each bin that are errors."""
        return self._bins.tables[Severity.ERROR]

    @property
    def warnings(self) -> NDArray[np.int64]:
        """Findings of each bin that are warnings."""
        return self._bins.tables[Severity.WARNING]

    def add(self, rows: Rows, findings: Findings) -> None:
        """Count rows in, nearly in order of time, and what was found on them."""
        if len(rows):
            self._spread(rows, self._bins.reach(int(rows.t_start_ns.min()), int(rows.t_end_ns.max())))
        placed = findings[findings.start >= 0]
        if self.origin_ns is None or not len(placed):
            return
        bins = self._bins.bins(placed.t_ns)
        severities = np.array([rule.severity for rule in rules()])[placed.rule]
        for severity in Severity:
            self._bins.tables[severity] += np.bincount(bins[severities == severity], minlength=TROUBLE_BINS)

    def used(self, span_ns: int) -> int:
        """How many bins a capture of that length fills."""
        return min(TROUBLE_BINS, max(1, -(-span_ns // self.width_ns)))

    def _spread(self, rows: Rows, origin_ns: int) -> None:
        passed = np.cumsum(rows.length)
        times = np.column_stack((rows.t_start_ns, rows.t_end_ns)).ravel() - origin_ns
        sums = np.column_stack((passed - rows.length, passed)).ravel()
        edges = np.arange(TROUBLE_BINS + 1) * float(self.width_ns)
        below = np.interp(edges, np.maximum.accumulate(times), sums)
        below[0], below[-1] = 0.0, passed[-1]  # nothing is lost before the first bin or on the last edge
        self._bins.tables["octets"] += np.diff(below)
