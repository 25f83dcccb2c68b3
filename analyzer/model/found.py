"""Findings in the order in which they were made, each with the row that it stands on."""

from __future__ import annotations

from collections import Counter

import numpy as np
from numpy.typing import NDArray

from analyzer.findings.model import FINDING, Finding, Severity, describe
from analyzer.findings.registry import codes, rules

from .table import Table

_ROOM = 64


class FindingLog:
    """All findings; `rows` says where each stands, -1 for the bus as a whole."""

    def __init__(self) -> None:
        self._findings = np.zeros(_ROOM, FINDING)
        self._rows = np.zeros(_ROOM, np.int32)
        self.count = 0
        self.by_code: Counter[str] = Counter()
        self.by_severity: Counter[Severity] = Counter()
        self._severity = np.array([rule.severity for rule in rules()], np.uint8)

    def add(self, findings: NDArray[np.void], table: Table) -> None:
        """Take in some more, and mark their rows."""
        n = len(findings)
        if not n:
            return
        if self.count + n > len(self._findings):
            room = max(len(self._findings) * 5 // 4, self.count + n)
            self._findings = np.concatenate((self._findings, np.zeros(room - len(self._findings), FINDING)))
            self._rows = np.concatenate((self._rows, np.zeros(room - len(self._rows), np.int32)))
        rows = table.rows_of_frames(findings["index"])
        for i in np.flatnonzero((findings["index"] < 0) & (findings["start"] >= 0)).tolist():
            rows[i] = table.row_of_bytes(int(findings["port"][i]), int(findings["start"][i]))
        self._findings[self.count : self.count + n] = findings
        self._rows[self.count : self.count + n] = rows
        grave = self._severity[findings["rule"]]
        order = np.argsort(grave, kind="stable")  # the gravest is written last
        order = order[rows[order] >= 0]
        marks = np.maximum(table.take("mark", rows[order]), grave[order])
        table.put("mark", rows[order], marks)
        for level in Severity:
            self.by_severity[level] += int((grave == level).sum())
        names = codes()
        for rule, count in zip(*np.unique(findings["rule"], return_counts=True), strict=True):
            self.by_code[names[rule]] += int(count)
        self.count += n

    def row(self, i: int) -> int:
        """The row on which finding `i` stands, -1 for none."""
        return int(self._rows[i])

    def finding(self, i: int) -> Finding:
        """Finding `i` in words."""
        return describe(self._findings[i])

    def of_row(self, row: int) -> tuple[Finding, ...]:
        """What stands on a row, the gravest first."""
        here = np.flatnonzero(self._rows[: self.count] == row)
        return tuple(sorted((self.finding(i) for i in here.tolist()), key=lambda f: -f.severity))

    def next_row(self, row: int, step: int) -> int | None:
        """The nearest row behind `row` with a finding, or before it where `step` is negative."""
        rows = self._rows[: self.count]
        rows = rows[rows > row] if step > 0 else rows[(rows < row) & (rows >= 0)]
        if not len(rows):
            return None
        return int(rows.min() if step > 0 else rows.max())

    def rules(self, first: int, last: int) -> tuple[NDArray[np.int64], NDArray[np.int16]]:
        """Rows from `first` to `last` (excluded) that findings stand on, ascending, and the rule of each."""
        rows = self._rows[: self.count]
        here = np.flatnonzero((rows >= first) & (rows < last))
        here = here[np.argsort(rows[here], kind="stable")]
        return rows[here].astype(np.int64), self._findings["rule"][here]

    def on(self, wanted: NDArray[np.int64]) -> NDArray[np.void]:
        """Those on the wanted rows (ascending, at least one), in the order of their rows."""
        rows = self._rows[: self.count]
        here = np.flatnonzero((rows >= wanted[0]) & (rows <= wanted[-1]))
        here = here[np.isin(rows[here], wanted)]
        return self._findings[here[np.argsort(rows[here], kind="stable")]]

    def chosen(self, code: str | None, least: Severity) -> NDArray[np.int64]:
        """Numbers of the findings of a code (None: any) and of at least that severity, in the order of their rows."""
        findings = self._findings[: self.count]
        good = self._severity[findings["rule"]] >= least
        if code is not None:
            good &= findings["rule"] == codes().index(code)
        here = np.flatnonzero(good)
        return here[np.argsort(self._rows[here], kind="stable")]

    @property
    def nbytes(self) -> int:
        return int(self._findings.nbytes + self._rows.nbytes)
