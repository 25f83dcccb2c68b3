"""The report: the page that `rtuscope report` prints, as wide as there is room for, with the user's notes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
from rich.text import Text
from textual.app import ComposeResult
from textual.containers import VerticalScroll
from textual.widgets import Static

from ..core import Analysed
from ..languages import tr
from ..reports.model import BookmarkRow
from ..tables.findings import NOTHING
from ..tables.schema import Kind
from ..terminal_text import READABLE
from .pagefiles import PageFile, write_page
from .view import View

if TYPE_CHECKING:
    from ..model.bus import Bus
    from ..reports.model import Report
    from .desk import ViewState
    from .screen import BusScreen
    from .threads import Stop

_NARROWEST: Final = 24  # columns: no page is told in fewer
_SUFFIXES: Final = (".html", ".txt")


class ReportPage(VerticalScroll):
    """The page; its tables scroll sideways where they do not fit."""

    report: Report | None = None

    def __init__(self, desk: ViewState, *, id: str) -> None:
        super().__init__(id=id)
        self.desk = desk

    def compose(self) -> ComposeResult:
        yield Static(f"  {tr('reading …')}", id="page", markup=False)

    def show_failed(self) -> None:
        """There is none, because that failed."""
        if self.report is None:
            self.query_one("#page", Static).update(Text(f"  {self.desk.failed_words()}"))

    def show_report(self, report: Report) -> None:
        """A newer one."""
        self.report = replace(report, bookmarks=tuple(_bookmarks(self.desk)))
        self._lay_out()

    def _lay_out(self) -> None:
        if self.desk.is_emptied:
            self.query_one("#page", Static).update(Text(f"  {self.desk.emptied()}"))
            return
        self.query_one("#page", Static).update(Text(self.text().removesuffix("\n")))

    def text(self) -> str:
        """The page as it stands."""
        from ..reports import text

        width = max(_NARROWEST, min(READABLE, self.scrollable_content_region.width))
        return "" if self.report is None else text(self.report, width)

    def on_resize(self) -> None:
        if self.report is not None:
            self._lay_out()


def _bookmarks(desk: ViewState) -> list[BookmarkRow]:
    """The user's notes as rows of the report."""
    table = desk.bus.table
    return [
        BookmarkRow(
            -1 if desk.bus.is_noise(row) else table.value("frame", row), table.value("port", row),
            table.value("start", row), table.value("t_end_ns", row), table.value("unit", row),
            table.value("function", row), comment,
        )
        for row, comment in desk.notes_by_row.items()
    ]  # fmt: skip


async def _export(screen: BusScreen) -> None:
    """Ask for a file, and write the report to it as a page: HTML or text."""
    report, bus = screen.query_one(ReportPage).report, screen.desk.bus
    if report is None:
        screen.notify_of(tr("nothing captured yet"))
        return
    kind = PageFile(tr("Write the report to"), tr("Download the report as"), "report.html", _SUFFIXES)
    await write_page(screen, kind, lambda path, stop: _page(bus, report, path, stop))


def _page(bus: Bus, report: Report, path: Path, stop: Stop) -> bytes:
    """The report in the form that a file's suffix names."""
    if path.suffix.lower() == ".txt":
        from ..reports import text

        return text(report).encode()
    from ..reports.html import Sights, page

    sights = Sights()
    for first, batch in bus.batches(0, bus.count):
        if stop():
            break
        requests = np.flatnonzero(batch.rows.kind == Kind.REQUEST) + first
        sights.feed(Analysed(batch, bus.transactions(requests), batch.findings or NOTHING))
    return page(report, sights).encode()


def _refresh(screen: BusScreen) -> None:
    page = screen.query_one(ReportPage)
    screen.jobs.count_report(VIEW.name, page.show_report, story=True, failed=page.show_failed)


def _shown(screen: BusScreen) -> None:
    """Notes may have been made since."""
    page = screen.query_one(ReportPage)
    if page.report is not None:
        page.show_report(page.report)


VIEW: Final = View(
    name="report", key="7", title="Report",
    make=lambda desk: ReportPage(desk, id="report"), refresh=_refresh, shown=_shown,
    copied=lambda screen: screen.query_one(ReportPage).text(), export=_export,
    offers=frozenset({"copy", "export"}), figures=True,
)  # fmt: skip
