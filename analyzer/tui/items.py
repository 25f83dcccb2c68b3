"""What is looked at below the views: a tree of items over some bytes; of a cause, all that is said of it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Final

from ..languages import counted, grouped, tr
from ..model.causestory import told_row
from ..words import duration

if TYPE_CHECKING:
    from dissectors.fields import Field

    from ..causes.registry import Cause
    from .desk import ViewState


@dataclass(frozen=True, slots=True)
class Item:
    """A line of the tree.

    `name` tells it from its siblings, `text` is what it says; `start` and `length` are the bytes meant (0 bytes: none).
    `ready` is whether it begins open; `values` that it holds a register's interpretations.
    """

    name: str
    text: str
    start: int = 0
    length: int = 0
    kind: str = ""  # of text: `paint.INKS`
    label: str = ""  # shown before the text instead of the name
    children: Sequence[Item] = ()
    ready: bool = True
    values: bool = False


class UnopenedItems(Sequence[Item]):
    """At least one item, made once somebody opens what holds them: most frames are only passed by."""

    def __init__(self, make: Callable[[], Iterable[Item]]) -> None:
        self._make = make

    @cached_property
    def _made(self) -> tuple[Item, ...]:
        return tuple(self._make())

    def __bool__(self) -> bool:
        return True

    def __len__(self) -> int:
        return len(self._made)

    def __getitem__(self, index: Any) -> Any:
        return self._made[index]


@dataclass(frozen=True, slots=True)
class FrameDetail:
    """What is looked at: its bytes and what they mean."""

    title: str
    data: bytes
    items: tuple[Item, ...]
    fields: tuple[Field, ...] = ()

    def spot(self, start: int, length: int) -> str:
        """Bytes in words: `bytes 3-4 of 11`."""
        if not length:
            return counted(len(self.data), "byte", "bytes")
        if length == 1:
            return tr("byte {at} of {all}", at=start, all=len(self.data))
        return tr("bytes {at}-{to} of {all}", at=start, to=start + length - 1, all=len(self.data))


NOTHING: Final = FrameDetail("", b"", ())


def chosen(detail: FrameDetail, path: Sequence[str]) -> Item | None:
    """The item at a path of names."""
    items: Sequence[Item] = detail.items
    match = None
    for name in path:
        match = next((item for item in items if item.name == name), None)
        if match is None:
            return None
        items = match.children
    return match


def of_cause(desk: ViewState, cause: Cause) -> FrameDetail:
    """The cause as something to look at, with the first of what shows it."""
    rows = [(index, desk.bus.table.row_of_frame(index)) for index in cause.frames]
    shown = [
        Item(f"frame {index}", told_row(desk.bus, row, desk.zone), kind="dim", label=f"{'':<11}")
        for index, row in rows
        if row >= 0
    ]
    return FrameDetail(tr("cause: {name}", name=cause.cause), b"", (*_cause_items(cause), *shown))


def whose(cause: Cause) -> str:
    """Whose fault it is, in words."""
    if cause.blame == "unit" and cause.units:
        units = ", ".join(str(unit) for unit in cause.units[:3]) + (" …" if len(cause.units) > 3 else "")
        return tr("unit {unit}", unit=units)
    whom = {"master": "the client", "line": "the line", "tap": "the tap", "nobody": "nobody"}
    return tr(whom.get(cause.blame, cause.blame))


def cause_facts(cause: Cause) -> dict[str, str]:
    """What is known of a cause, by what that is called in English."""
    fault = f"{whose(cause)}, {cause.sure}"
    if cause.runner_up:
        fault += tr("; else {name}", name=cause.runner_up)
    lost = "" if not cause.lost_answers else counted(cause.lost_answers, "answer", "answers")
    if cause.lost_ms:
        lost += f"{', ' if lost else ''}{duration(round(cause.lost_ms * 1e6))}"
    again = "" if cause.period_s is None else tr("every {time}", time=duration(round(cause.period_s * 1e9)))
    facts = {
        "what": cause.text, "fault": fault, "seen": cause.share, "again": again, "lost": lost,
        "to confirm": cause.deciding_test, "do": cause.remedy,
    }  # fmt: skip
    return {name: words for name, words in facts.items() if words}


def _cause_items(cause: Cause) -> tuple[Item, ...]:
    facts, kinds = cause_facts(cause), {"what": "strong", "do": "good"}
    if cause.frames:
        facts["frames"] = ", ".join(grouped(index) for index in cause.frames) + tr("   Enter goes there")
    return tuple(Item(name, text, kind=kinds.get(name, ""), label=f"{tr(name):<11}") for name, text in facts.items())
