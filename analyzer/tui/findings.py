"""The findings, in wire order; by code and by severity as asked."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, ClassVar, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from textual.binding import Binding, BindingType

from ..languages import counted, grouped, tr
from ..model.rowstores import by_cause
from ..model.selection import Selection
from ..tables.findings import Severity
from .frames import LETTER, SEVERITY
from .items import NOTHING, of_cause
from .lines import Lines
from .look import at_finding, finding_name
from .paint import StyledText, fitted
from .places import OF_ROWS, CausePlace, Place, RowPlace
from .view import DoorCell, View, cells_of_row, cells_of_units

if TYPE_CHECKING:
    from textual.widget import Widget

    from ..causes.registry import Cause
    from ..tables.findings import Finding
    from .desk import ViewState
    from .screen import BusScreen

_LEAST: Final = {
    Severity.NOTE: "showing all", Severity.WARNING: "showing warnings and errors", Severity.ERROR: "showing errors",
}  # fmt: skip
_PAUSE_S: Final = 0.3  # between two countings while rows come
_ROOMY: Final = 60  # columns from which on codes stand below each other, with their frames


class _LineBlock(NamedTuple):
    """A stretch of lines: a heading over what a cause explains, or findings of one code under a line that counts them.

    `cause` is its number, None for findings that none explains.
    """

    cause: int | None
    code: str  # empty for a heading
    numbers: NDArray[np.int64]
    opened: bool

    @property
    def lines(self) -> int:
        return 1 + (len(self.numbers) if self.opened else 0)


class FindingList(Lines):
    """By cause, and below each by code, counted and unfolded; or a line a finding, in wire order."""

    HEAD = 2
    EMPTY = "no findings: all is well"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("right,l", "fold(True)", "Unfold", tooltip="The findings of this code, one by one"),
        Binding("left,h", "fold(False)", "Fold", show=False),
        Binding("b", "grouped", "By cause", tooltip="Grouped by cause, or all in wire order"),
        Binding("s", "severity", "Severity", tooltip="All findings, from warnings on, errors only"),
        Binding("o", "code(1)", "Code", tooltip="Findings of one code, the next one each time"),
        Binding("O", "code(-1)", "Code back", show=False),
    ]

    def __init__(self, desk: ViewState, *, id: str) -> None:
        super().__init__(id=id)
        self.desk = desk
        self.least = Severity.NOTE
        self.code: str | None = None
        self.causes: Sequence[Cause] = ()
        self._by_cause = True  # the user's wish
        self._numbers = np.zeros(0, np.int64)
        self._blocks: list[_LineBlock] = []
        self._opened: set[tuple[int | None, str]] = set()
        self.scope: Selection | None = None  # rows that findings are shown of; None: all, and the bus as a whole
        self._levels: Mapping[Severity, int] = desk.bus.found.by_severity  # of what the scope leaves
        self._tested = 0
        self._logged, self._next = -1, 0.0

    @property
    def empty(self) -> str:
        return self.desk.emptied(self.EMPTY if self.desk.bus.count else "nothing captured yet")

    @property
    def grouped(self) -> bool:
        """Whether they stand by cause: from the start where there are causes, until one code is asked for."""
        return bool(self.causes) and self.code is None and self._by_cause

    def _at(self, line: int) -> tuple[_LineBlock | None, int]:
        """The block that a line stands in, and the number of its finding; -1 on the line that counts them."""
        if not self.grouped:
            return None, int(self._numbers[line]) if line < len(self._numbers) else -1
        for block in self._blocks:
            if line < block.lines:
                return block, -1 if line == 0 else int(block.numbers[line - 1])
            line -= block.lines
        return None, -1

    @property
    def number(self) -> int:
        """The finding under the cursor, of a group its first; -1 for none."""
        block, number = self._at(self.cursor)
        return int(block.numbers[0]) if number < 0 and block is not None and len(block.numbers) else number

    @property
    def cause(self) -> Cause | None:
        """The cause whose heading the cursor is on."""
        block, _ = self._at(self.cursor)
        return None if block is None or block.code or block.cause is None else self.causes[block.cause]

    @property
    def row(self) -> int | None:
        """The row that the finding under the cursor stands on; None for none."""
        row = -1 if self.number < 0 else self.desk.bus.found.row(self.number)
        return None if row < 0 else row

    @property
    def finding(self) -> Finding | None:
        """The one under the cursor."""
        return None if self.number < 0 else self.desk.bus.found.finding(self.number)

    def use_causes(self, causes: Sequence[Cause]) -> None:
        """What explains them."""
        if causes != self.causes:
            _, single = self._at(self.cursor)
            # The first line stays the first: what concerns the whole bus stands there by rows, and last by causes.
            row = None if single < 0 or not self.cursor else self.desk.bus.found.row(single)
            self.causes = causes
            self._lay_out()
            self._announced = -1
            self.renewed(self.cursor if row is None else self._line_of(row))

    def grown(self) -> None:
        log = self.desk.bus.found
        now = time.monotonic()
        tested = 0 if self.scope is None else self.scope.done
        if (log.count == self._logged and tested == self._tested) or (now < self._next and not self.desk.bus.whole):
            return
        self._next, self._tested = now + _PAUSE_S, tested
        self._choose()
        super().grown()

    def go_to_row(self, row: int) -> None:
        """Put the cursor on the first finding at or behind a row, or on the group that holds it."""
        line = self._line_of(row)
        if line < self.count():
            self.move_to(line, middle=True)

    def _line_of(self, row: int) -> int:
        rows = self.desk.bus.found.rows_of
        if not self.grouped:
            return int(np.searchsorted(rows(self._numbers), row))  # they are in the order of rows
        line = 0
        for block in self._blocks:
            matches = np.flatnonzero(rows(block.numbers) == row) if block.code else np.zeros(0, np.intp)
            if len(matches):
                if not block.opened:  # what one comes for is in sight, not its group alone
                    self._opened.add((block.cause, block.code))
                    self._lay_out()
                return line + 1 + int(matches[0])
            line += block.lines
        return 0

    def _choose(self) -> None:
        log = self.desk.bus.found
        self._logged = log.count
        self._levels = log.by_severity
        numbers = log.chosen(self.code, self.least)
        if self.scope is not None:
            numbers = self._inside(numbers, self.scope)
            self._levels = log.levels_of(self._inside(log.chosen(None, Severity.NOTE), self.scope))
        self._numbers = numbers
        self._lay_out()

    def _inside(self, numbers: NDArray[np.int64], scope: Selection) -> NDArray[np.int64]:
        rows = self.desk.bus.found.rows_of(numbers).astype(np.int64)
        return numbers[np.isin(rows, scope.rows())]

    def _lay_out(self) -> None:
        """The blocks: causes, best first, then what none explains; under each its codes."""
        self._blocks = []
        if not self.grouped:
            return
        for which, by_code in by_cause(self.desk.bus, self._numbers, self.causes):
            if not by_code and (self.scope is not None or self.least > Severity.NOTE):
                continue  # it explains nothing of what is shown
            self._blocks.append(_LineBlock(which, "", np.zeros(0, np.int64), False))
            for code, numbers in by_code.items():
                self._blocks.append(_LineBlock(which, code, numbers, (which, code) in self._opened))

    def count(self) -> int:
        return sum(block.lines for block in self._blocks) if self.grouped else len(self._numbers)

    def heads(self, y: int, width: int) -> Sequence[StyledText]:
        roomy = width >= _ROOMY
        if y:
            frame, code = (f"{tr('frame'):>8}  ", f"{tr('code'):<20}") if roomy else ("", tr("code"))
            return fitted([StyledText(f"  {tr('time'):>12} {frame}{code} {tr('observed')}")], width)
        counts = [
            counted(self._levels[level], level.name.lower(), f"{level.name.lower()}s")
            if roomy
            else f"{grouped(self._levels[level])} {LETTER[level]}"
            for level in sorted(Severity, reverse=True)
        ]
        which = tr(_LEAST[self.least]) + (tr(", {code} only", code=self.code) if self.code else "")
        if self.grouped:
            which += tr(" by cause")
        return fitted(
            [StyledText(f"  {', '.join(counts)}   "), StyledText(f"{which}: {grouped(len(self._numbers))}")], width
        )

    def pieces(self, line: int, width: int) -> Sequence[StyledText]:
        block, number = self._at(line)
        if block is not None and number < 0:
            roomy = width >= _ROOMY
            return fitted(self._heading(block) if not block.code else self._counted(block, roomy=roomy), width)
        return fitted(self._finding_line(number, roomy=width >= _ROOMY), width)

    def _heading(self, block: _LineBlock) -> list[StyledText]:
        total = sum(len(each.numbers) for each in self._blocks if each.cause == block.cause)
        findings = counted(total, "finding", "findings")
        if block.cause is None:
            return [StyledText("· "), StyledText(tr("no cause explains {findings}", findings=findings), "strong")]
        cause = self.causes[block.cause]
        letter = cause.severity[:1].upper()
        kind = cause.severity
        return [StyledText(f"{letter} ", kind), StyledText(f"{findings}: ", "dim"), StyledText(cause.text, "strong")]

    def _counted(self, block: _LineBlock, *, roomy: bool) -> list[StyledText]:
        log = self.desk.bus.found
        finding = log.finding(int(block.numbers[0]))
        sign = "-" if block.opened else "+"
        return [
            StyledText(f"  {sign} ", "dim"),
            StyledText(f"{finding.code:<20} " if roomy else f"{finding.code} ", SEVERITY[finding.severity]),
            StyledText(f"{len(block.numbers):>{7 if roomy else 0},} ×  "),
            StyledText(f"{self._row_words(int(block.numbers[0]))}: {finding.text}", "dim"),
        ]

    def _row_words(self, number: int) -> str:
        bus = self.desk.bus
        row = bus.found.row(number)
        return tr("bus") if row < 0 else tr("noise") if bus.is_noise(row) else str(bus.table.value("frame", row))

    def _finding_line(self, number: int, *, roomy: bool) -> list[StyledText]:
        bus = self.desk.bus
        finding, row = bus.found.finding(number), bus.found.row(number)
        kind = SEVERITY[finding.severity]
        return [
            StyledText(f"{LETTER[finding.severity]} ", kind),
            StyledText(f"{self.desk.time(row, None) if row >= 0 else '':>12} "),
            StyledText(f"{self._row_words(number):>8}  " if roomy else "", "dim"),
            StyledText(f"{finding.code:<20} " if roomy else f"{finding.code} ", kind),
            StyledText(finding.text),
        ]

    def action_fold(self, wanted: bool) -> None:
        block, number = self._at(self.cursor)
        if block is None or not block.code or block.opened == wanted:
            return
        self._opened ^= {(block.cause, block.code)}
        line = self.cursor - (0 if number < 0 else 1 + int(np.flatnonzero(block.numbers == number)[0]))
        self._lay_out()
        self.renewed(line)

    def action_grouped(self) -> None:
        row, self._by_cause = self.row, self.code is not None or not self._by_cause
        self.code = None
        self._again(None, self.least)
        if row is not None:
            self.go_to_row(row)

    def action_severity(self) -> None:
        order = list(_LEAST)
        self._again(self.code, order[(order.index(self.least) + 1) % len(order)])

    def action_code(self, step: int) -> None:
        choices = [None, *sorted(self.desk.bus.found.by_code)]
        at = choices.index(self.code) if self.code in choices else 0
        self._again(choices[(at + step) % len(choices)], self.least)

    def _again(self, code: str | None, least: Severity) -> None:
        self.code, self.least = code, least
        self._choose()
        self._announced = -1
        self.renewed()


def _chosen(screen: BusScreen, sender: Widget) -> None:
    """A finding is under study, and the row that it stands on."""
    assert isinstance(sender, FindingList)
    if sender.id != screen.view:
        return
    if sender.cause is not None:
        screen.detail.show_frame(of_cause(screen.desk, sender.cause))
        return
    finding = sender.finding
    if finding is None:
        screen.detail.show_frame(NOTHING)
        return
    to = (finding_name(finding),)
    if sender.row is not None:
        screen.study_row(sender.row, to=to)
    else:
        screen.detail.show_frame(at_finding(finding), to=to)
        screen.write_status()


def _entered(screen: BusScreen, sender: Widget) -> None:
    assert isinstance(sender, FindingList)
    if sender.cause is not None:
        screen.jumps.walk(sender.cause)
    elif sender.row is not None:
        screen.jumps.go_to_row(sender.row)


def _refresh(screen: BusScreen) -> None:
    """With what came since, of the rows that the scope leaves."""
    listing = screen.query_one(FindingList)
    if listing.scope is not screen.jobs.narrowed:
        listing.scope, listing._logged = screen.jobs.narrowed, -1
        listing._next = 0.0
    listing.grown()
    bus = screen.desk.bus
    screen.jobs.reckon("explain", (bus.found.count, bus.whole), lambda _: bus.causes(), listing.use_causes)


def _shown(screen: BusScreen) -> None:
    if screen.studied is not None:
        listing = screen.query_one(FindingList)
        listing.grown()
        listing.go_to_row(screen.studied)


def _at(screen: BusScreen) -> Place:
    listing = screen.query_one(FindingList)
    if listing.cause is not None:
        return CausePlace(listing.cause)
    return None if listing.row is None else RowPlace(listing.row)


def _cells(screen: BusScreen) -> list[DoorCell]:
    """Of a finding its row and what was found; of a cause its units."""
    cause = screen.query_one(FindingList).cause
    return cells_of_row(screen) if cause is None else cells_of_units(cause.units)


VIEW: Final = View(
    name="findings", key="3", title="Findings",
    make=lambda desk: FindingList(desk, id="findings"), refresh=_refresh,
    chosen=_chosen, entered=_entered, shown=_shown, at=_at, cells=_cells,
    detail=True, offers=OF_ROWS - {"find", "find_on", "select", "columns", "follow"},
)  # fmt: skip
