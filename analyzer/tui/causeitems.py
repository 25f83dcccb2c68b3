"""A cause in full, as the pane below shows it: what was seen, how to be certain, what to do."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..languages import counted, grouped, tr
from ..words import duration
from .items import FrameDetail, Item

if TYPE_CHECKING:
    from ..causes.model import Cause


def of_cause(cause: Cause) -> FrameDetail:
    """The cause as something to look at."""
    return FrameDetail(tr("cause: {name}", name=cause.cause), b"", _cause_items(cause))


def whose(cause: Cause) -> str:
    """Whose fault it is, in words."""
    if cause.blame == "unit" and cause.units:
        units = ", ".join(str(unit) for unit in cause.units[:3]) + (" …" if len(cause.units) > 3 else "")
        return tr("unit {unit}", unit=units)
    whom = {"master": "the client", "line": "the line", "tap": "the tap", "nobody": "nobody"}
    return tr(whom.get(cause.blame, cause.blame))


def _cause_items(cause: Cause) -> tuple[Item, ...]:
    fault = f"{whose(cause)}, {tr('{share:.0%} sure', share=cause.confidence)}"
    if cause.runner_up:
        fault += tr("; else {name}", name=cause.runner_up)
    lost = "" if not cause.lost_answers else counted(cause.lost_answers, "answer", "answers")
    if cause.lost_ms:
        lost += f"{', ' if lost else ''}{duration(round(cause.lost_ms * 1e6))}"
    again = "" if cause.period_s is None else tr("every {time}", time=duration(round(cause.period_s * 1e9)))
    facts = (
        ("what", cause.text), ("fault", fault), ("seen", cause.share), ("again", again), ("lost", lost),
        ("to be sure", cause.deciding_test), ("do", cause.remedy),
        ("frames", ", ".join(grouped(index) for index in cause.frames) + tr("   Enter goes there") if cause.frames
         else ""),
    )  # fmt: skip
    kinds = {"what": "strong", "do": "good"}
    return tuple(Item(name, text, kind=kinds.get(name, ""), label=f"{tr(name):<11}") for name, text in facts if text)
