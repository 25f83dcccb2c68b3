"""The report: the page that `rtuscope report` prints, as wide as there is room for."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from rich.text import Text
from textual.app import ComposeResult
from textual.containers import VerticalScroll
from textual.widgets import Static

from ..languages import tr
from .view import JUMPS, View

if TYPE_CHECKING:
    from ..reports.model import Report
    from .desk import ViewState
    from .screen import BusScreen

_NARROWEST: Final = 24  # columns: no page is told in fewer


class ReportPage(VerticalScroll):
    """The page; its tables scroll sideways where they do not fit."""

    _report: Report | None = None

    def __init__(self, desk: ViewState, *, id: str) -> None:
        super().__init__(id=id)
        self.desk = desk

    def compose(self) -> ComposeResult:
        yield Static(f"  {tr('reading …')}", id="page", markup=False)

    def show(self, report: Report) -> None:
        """A newer one."""
        from ..reports import text
        from ..reports.paragraphs import WIDTH

        self._report = report
        if self.desk.is_emptied:
            self.query_one("#page", Static).update(Text(f"  {self.desk.emptied()}"))
            return
        width = max(_NARROWEST, min(WIDTH, self.scrollable_content_region.width))
        self.query_one("#page", Static).update(Text(text(report, width).removesuffix("\n")))

    def on_resize(self) -> None:
        if self._report is not None:
            self.show(self._report)


def _refresh(screen: BusScreen) -> None:
    screen.jobs.count_report(VIEW.name, screen.query_one(ReportPage).show, story=True)


VIEW: Final = View(
    name="report", key="7", title="Report",
    make=lambda desk: ReportPage(desk, id="report"), refresh=_refresh,
    without=(*JUMPS, "select"), figures=True,
)  # fmt: skip
