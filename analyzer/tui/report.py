"""The report: the page that `rtuscope report` prints."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from rich.text import Text
from textual.containers import VerticalScroll
from textual.widgets import Static

from .view import JUMPS, View

if TYPE_CHECKING:
    from textual.widget import Widget

    from ..reports.model import Report
    from .desk import ViewState
    from .screen import BusScreen


def _widget(desk: ViewState) -> Widget:  # noqa: ARG001
    return VerticalScroll(Static("", id="page", markup=False), id="report")


def _refresh(screen: BusScreen) -> None:
    page = screen.query_one("#page", Static)

    def show(report: Report) -> None:
        from ..reports import text

        page.update(Text(text(report).removesuffix("\n")))

    screen.jobs.count_report(VIEW.name, show, story=True)


VIEW: Final = View(
    name="report", key="7", title="Report",
    make=_widget, refresh=_refresh,
    without=(*JUMPS, "select"), figures=True,
)  # fmt: skip
