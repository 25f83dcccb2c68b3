"""The view of the timeline: what its bands are counted of, and when."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

from ..model.activity import Band, bands
from ..model.rowstores import rows_of_causes
from .filterbar import kept_tests
from .places import OF_FIGURES, Place, SpanPlace
from .timeline import Timeline
from .view import View

if TYPE_CHECKING:
    from ..causes.registry import Cause
    from .screen import BusScreen


def _refresh(screen: BusScreen) -> None:
    """With what came since; the bands are counted in a thread."""
    timeline, desk = screen.query_one(Timeline), screen.desk
    timeline.grown()
    bus = desk.bus
    if not bus.count or not bus.timed:
        return
    screen.jobs.reckon(
        "causes of bands",
        (bus.found.count, bus.whole),
        lambda _: bus.causes(),
        lambda causes: _explained(screen, causes),
    )
    _band(screen)


def _explained(screen: BusScreen, causes: Sequence[Cause]) -> None:
    """Newer causes."""
    screen.query_one(Timeline).known = causes
    _band(screen)


def _band(screen: BusScreen) -> None:
    """Count the bands of causes, kept filters and units, where those in sight are others."""
    timeline, desk = screen.query_one(Timeline), screen.desk
    bus, filters, causes = desk.bus, list(kept_tests(desk)), timeline.known
    names, told = [name for name, _ in filters], [cause.text for cause in causes]
    wanted = (timeline.t_start, timeline.t_end, timeline.columns, desk.scope.words(), names, told)
    if wanted == timeline.banded:
        return
    timeline.banded = wanted
    tests, span, columns = desk.scope.tests(), (timeline.t_start, timeline.t_end), timeline.columns

    def show_counted(counted: list[Band]) -> None:
        if columns == timeline.columns:
            timeline.bands, timeline.causes = counted, causes
            timeline.refresh()

    screen.jobs.run(
        "bands", lambda stop: bands(bus, tests, span, columns, filters, rows_of_causes(bus, causes), stop), show_counted
    )


def _at(screen: BusScreen) -> Place:
    timeline = screen.query_one(Timeline)
    return None if timeline.is_empty else SpanPlace(*timeline.span_under_cursor)


VIEW: Final = View(
    name="timeline", key="6", title="Timeline", short="Time",
    make=lambda desk: Timeline(desk, id="timeline"), refresh=_refresh,
    at=_at, offers=OF_FIGURES - {"door"}, figures=True,
)  # fmt: skip
