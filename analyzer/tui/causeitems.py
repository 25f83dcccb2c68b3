"""A cause in full, as the pane below shows it: what was seen, how to be certain, what to do."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..words import duration
from .items import FrameDetail, Item

if TYPE_CHECKING:
    from ..causes.model import Cause


def of_cause(cause: Cause) -> FrameDetail:
    """The cause as something to look at."""
    return FrameDetail(f"cause: {cause.cause}", b"", _cause_items(cause))


def whose(cause: Cause) -> str:
    """Whose fault it is, in words."""
    if cause.blame == "unit" and cause.units:
        return "unit " + ", ".join(str(unit) for unit in cause.units[:3]) + (" …" if len(cause.units) > 3 else "")
    return {"master": "the master", "line": "the line", "tap": "the tap"}.get(cause.blame, cause.blame)


def _cause_items(cause: Cause) -> tuple[Item, ...]:
    fault = f"{whose(cause)}, {cause.confidence:.0%} sure"
    if cause.runner_up:
        fault += f"; else {cause.runner_up}"
    lost = "" if not cause.lost_answers else f"{cause.lost_answers:,} answers"
    if cause.lost_ms:
        lost += f"{', ' if lost else ''}{duration(round(cause.lost_ms * 1e6))}"
    again = "" if cause.period_s is None else f"every {cause.period_s:.4g} s"
    facts = (
        ("what", cause.text), ("fault", fault), ("seen", cause.share), ("again", again), ("lost", lost),
        ("to be sure", cause.deciding_test), ("do", cause.remedy),
        ("frames", ", ".join(f"{index:,}" for index in cause.frames) + "   Enter goes there" if cause.frames else ""),
    )  # fmt: skip
    kinds = {"what": "strong", "do": "good"}
    return tuple(Item(name, text, kind=kinds.get(name, ""), label=f"{name:<11}") for name, text in facts if text)
