"""The findings, in wire order; by code and by severity as asked."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, ClassVar, Final

import numpy as np
from textual.binding import Binding, BindingType

from ..model.selection import Selection
from ..tables.findings import Severity
from .lines import Lines
from .look import at_finding, finding_name
from .paint import StyledText, fitted
from .rows import LETTER, SEVERITY
from .view import View

if TYPE_CHECKING:
    from textual.widget import Widget

    from ..tables.findings import Finding
    from .desk import ViewState
    from .screen import BusScreen

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

    def __init__(self, desk: ViewState, *, id: str) -> None:
        super().__init__(id=id)
        self.desk = desk
        self.least = Severity.NOTE
        self.code: str | None = None
        self._numbers = np.zeros(0, np.int64)
        self.scope: Selection | None = None  # rows that findings are shown of; None: all, and the bus as a whole
        self._tested = 0
        self._seen, self._next = -1, 0.0

    @property
    def empty(self) -> str:
        return self.desk.emptied(self.EMPTY)

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
        tested = 0 if self.scope is None else self.scope.done
        if (found.count == self._seen and tested == self._tested) or (now < self._next and not self.desk.bus.whole):
            return
        self._next, self._tested = now + _PAUSE_S, tested
        self._choose()
        super().grown()

    def go(self, row: int) -> None:
        """Put the cursor on the first finding at or behind a row."""
        line = int(np.searchsorted(self.desk.bus.found.rows_of(self._numbers), row))  # they are in the order of rows
        if line < len(self._numbers):
            self.move_to(line, middle=True)

    def _choose(self) -> None:
        self._seen = self.desk.bus.found.count
        numbers = self.desk.bus.found.chosen(self.code, self.least)
        if self.scope is not None:
            rows = self.desk.bus.found.rows_of(numbers).astype(np.int64)
            numbers = numbers[np.isin(rows, self.scope.rows())]
        self._numbers = numbers

    def count(self) -> int:
        return len(self._numbers)

    def heads(self, y: int, width: int) -> Sequence[StyledText]:
        if y:
            return [StyledText(f"  {'time':>12} {'frame':>8}  {'code':<20} what was seen")]
        log = self.desk.bus.found
        counts = [
            f"{log.by_severity[level]:,} {level.name.lower()}{'' if log.by_severity[level] == 1 else 's'}"
            for level in sorted(Severity, reverse=True)
        ]
        which = f"showing {_LEAST[self.least]}" + (f", {self.code} only" if self.code else "")
        return fitted([StyledText(f"  {', '.join(counts)}   "), StyledText(f"{which}: {len(self._numbers):,}")], width)

    def pieces(self, line: int, width: int) -> Sequence[StyledText]:
        bus = self.desk.bus
        number = int(self._numbers[line])
        finding, row = bus.found.finding(number), bus.found.row(number)
        frame = "bus" if row < 0 else "noise" if bus.is_noise(row) else str(bus.table.value("frame", row))
        when = self.desk.time(row, None) if row >= 0 else ""
        kind = SEVERITY[finding.severity]
        return fitted(
            [
                StyledText(f"{LETTER[finding.severity]} ", kind),
                StyledText(f"{when:>12} "),
                StyledText(f"{frame:>8}  ", "dim"),
                StyledText(f"{finding.code:<20} ", kind),
                StyledText(finding.text),
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


def _chosen(screen: BusScreen, sender: Widget) -> None:
    """A finding is under study, and the row that it stands on."""
    assert isinstance(sender, FindingList)
    finding = sender.finding
    if sender.id != screen.view or finding is None:
        return
    to = (finding_name(finding),)
    if sender.row is not None:
        screen.study_row(sender.row, to=to)
    else:
        screen.detail.show(at_finding(finding), to=to)
        screen.say()


def _entered(screen: BusScreen, sender: Widget) -> None:
    assert isinstance(sender, FindingList)
    if sender.row is not None:
        screen.jumps.go(sender.row)


def _refresh(screen: BusScreen) -> None:
    """With what came since, of the rows that the scope leaves."""
    found = screen.query_one(FindingList)
    if found.scope is not screen.jobs.narrowed:
        found.scope, found._seen = screen.jobs.narrowed, -1
        found._next = 0.0
    found.grown()


def _shown(screen: BusScreen) -> None:
    if screen.studied is not None:
        found = screen.query_one(FindingList)
        found.grown()
        found.go(screen.studied)


def _at(screen: BusScreen) -> int | None:
    return screen.query_one(FindingList).row


VIEW: Final = View(
    name="findings", key="3", title="Findings",
    make=lambda desk: FindingList(desk, id="findings"), refresh=_refresh,
    chosen=_chosen, entered=_entered, shown=_shown, at=_at,
    detail=True, without=("find", "find_on", "select"),
)  # fmt: skip
