"""The findings, in wire order; by code and by severity as asked."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, ClassVar, Final

import numpy as np
from textual.binding import Binding, BindingType

from analyzer.findings.model import Severity

from .lines import Lines
from .paint import Piece, fitted
from .rows import LETTER, SEVERITY

if TYPE_CHECKING:
    from analyzer.findings.model import Finding

    from .desk import Desk

_LEAST: Final = {Severity.NOTE: "all", Severity.WARNING: "warnings and errors", Severity.ERROR: "errors"}
_PAUSE_S: Final = 0.3  # between two countings while rows come


class FindingList(Lines):
    """A line a finding; opening one goes to its frame."""

    HEAD = 2
    EMPTY = "nothing was found; that is good news"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("s", "severity", "Severity", tooltip="All findings, from warnings on, errors only"),
        Binding("o", "code(1)", "Code", tooltip="Findings of one code, the next one each time"),
        Binding("O", "code(-1)", "Code back", show=False),
    ]

    def __init__(self, desk: Desk, *, id: str) -> None:
        super().__init__(id=id)
        self.desk = desk
        self.least = Severity.NOTE
        self.code: str | None = None
        self._numbers = np.zeros(0, np.int64)
        self._seen, self._next = -1, 0.0

    @property
    def row(self) -> int | None:
        """The row that the finding under the cursor stands on; None for none."""
        if self.cursor >= len(self._numbers):
            return None
        row = self.desk.bus.found.row(int(self._numbers[self.cursor]))
        return None if row < 0 else row

    @property
    def finding(self) -> Finding | None:
        """The one under the cursor."""
        if self.cursor >= len(self._numbers):
            return None
        return self.desk.bus.found.finding(int(self._numbers[self.cursor]))

    def grown(self) -> None:
        found = self.desk.bus.found
        now = time.monotonic()
        if found.count == self._seen or (now < self._next and not self.desk.bus.whole):
            return
        self._next = now + _PAUSE_S
        self._choose()
        super().grown()

    def go(self, row: int) -> None:
        """Put the cursor on the first finding at or behind a row."""
        rows = [self.desk.bus.found.row(int(i)) for i in self._numbers[:4096]]
        later = [i for i, at in enumerate(rows) if at >= row]
        if later:
            self.move_to(later[0], middle=True)

    def _choose(self) -> None:
        self._seen = self.desk.bus.found.count
        self._numbers = self.desk.bus.found.chosen(self.code, self.least)

    def count(self) -> int:
        return len(self._numbers)

    def heads(self, y: int, width: int) -> Sequence[Piece]:
        if y:
            return [Piece(f"  {'time':>12} {'frame':>8}  {'code':<20} what was seen")]
        log = self.desk.bus.found
        counts = [
            f"{log.by_severity[level]:,} {level.name.lower()}{'' if log.by_severity[level] == 1 else 's'}"
            for level in sorted(Severity, reverse=True)
        ]
        which = f"showing {_LEAST[self.least]}" + (f", {self.code} only" if self.code else "")
        return fitted([Piece(f"  {', '.join(counts)}   "), Piece(f"{which}: {len(self._numbers):,}")], width)

    def pieces(self, line: int, width: int) -> Sequence[Piece]:
        bus = self.desk.bus
        number = int(self._numbers[line])
        finding, row = bus.found.finding(number), bus.found.row(number)
        frame = "bus" if row < 0 else "noise" if bus.is_noise(row) else str(bus.table.value("frame", row))
        when = self.desk.time(row, None) if row >= 0 else ""
        kind = SEVERITY[finding.severity]
        return fitted(
            [
                Piece(f"{LETTER[finding.severity]} ", kind),
                Piece(f"{when:>12} "),
                Piece(f"{frame:>8}  ", "dim"),
                Piece(f"{finding.code:<20} ", kind),
                Piece(finding.text),
            ],
            width,
        )

    def action_severity(self) -> None:
        order = list(_LEAST)
        self._again(self.code, order[(order.index(self.least) + 1) % len(order)])

    def action_code(self, step: int) -> None:
        codes = [None, *sorted(self.desk.bus.found.by_code)]
        at = codes.index(self.code) if self.code in codes else 0
        self._again(codes[(at + step) % len(codes)], self.least)

    def _again(self, code: str | None, least: Severity) -> None:
        self.code, self.least = code, least
        self._choose()
        self._told = -1
        self.renewed()
