"""How a unit is doing: what counts as bad, which one is the sickest, and what is told of one in full."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from ..languages import grouped, page_words, tr
from .items import Item

if TYPE_CHECKING:
    from ..causes.registry import Cause
    from ..reports.model import Counts, FindingRow, Report, Times, UnitRow


def facts_items(report: Report) -> tuple[Item, ...]:
    """What the report says of a capture in which no frame was found."""
    from ..reports.page import facts

    return tuple(
        Item(f"fact {i}", words, label=f"{page_words(label):<11}") for i, (label, words) in enumerate(facts(report))
    )


def is_due(counts: Counts) -> bool:
    """Whether an answer was ever due: to broadcasts none is."""
    return counts.requests > counts.broadcasts


def bad_count(counts: Counts) -> int:
    """Requests without a good answer."""
    return counts.unanswered + counts.exceptions + counts.damaged


def badness(unit: UnitRow) -> tuple[float, float]:
    """The sickest first: most requests without a good answer, most late answers."""
    counts = unit.counts
    asked = max(1, counts.requests)
    return -bad_count(counts) / asked, -counts.late / asked


def slow_units(report: Report) -> Mapping[int, FindingRow]:
    """Units that are found to be slow, which no answer of theirs shows by itself."""
    return {unit: row for row in report.findings if row.code == "slow-device" for unit in row.units}


def unit_items(unit: UnitRow, report: Report, causes: Sequence[Cause]) -> tuple[Item, ...]:
    """How a unit was asked and answered, what is wrong with it, and where to go on."""
    counts, times = unit.counts, unit.times
    none, bad = ("silent", "garbage") if report.cards else ("not answered", "damaged")
    ended = (
        (counts.answered, "answered"), (counts.exceptions, "refused"), (counts.unanswered, none),
        (counts.damaged, bad), (counts.late, "late"), (counts.retries, "asked again"),
    )  # fmt: skip
    items = [
        Item(
            "asked",
            f"{grouped(counts.requests)}: "
            + ", ".join(f"{tr(word)} {grouped(number)}" for number, word in ended if number),
            label=f"{tr('asked'):<11}",
        )
    ]
    if times.count:
        shares = tr(
            "p50 {half}, p95 {most}, max {all}",
            half=times.worded("p50"), most=times.worded("p95"), all=times.worded("max"),
        )  # fmt: skip
        items.append(Item("answers", shares, label=f"{tr('answers'):<11}"))
    slow = slow_units(report).get(unit.unit)
    if slow is not None:
        what = slow.text if len(slow.units) == 1 else slow.code
        items.append(Item("found", what, kind=slow.severity, label=f"{tr('found'):<11}"))
    mine = [cause for cause in causes if unit.unit in cause.units]
    items += [
        Item(f"cause {i}", cause.text, kind=cause.severity, label=f"{tr('cause'):<11}") for i, cause in enumerate(mine)
    ]
    items.append(Item("Enter", tr("its rows alone"), kind="dim", label=f"{'Enter':<11}"))
    if times.p95_ns:
        items.append(Item("slow", slow_words(times), kind="dim", label=f"{'= s 1':<11}"))
    return tuple(items)


def slow_words(times: Times) -> str:
    """What the filter of its slow answers is called."""
    return tr("its slow answers: {time} and more, one in twenty", time=times.worded("p95"))
