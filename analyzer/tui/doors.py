"""Every cell is a door: what stands under the cursor is filtered to, filtered out, added to the filter, followed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from dissectors.functions import function_code

from ..model.filtering import compiled
from ..model.pollvalues import poll_values
from ..model.search import for_test
from .filterbar import FilterBar
from .prompts import Choose

if TYPE_CHECKING:
    from .screen import BusScreen

_BIT_AREAS: Final = "01"
_ASKS: Final = {"=": "Filter to", "!": "Filter out", "&": "Add with and", "|": "Add with or", ".": "Go to the next of"}


@dataclass(frozen=True, slots=True)
class DoorCell:
    """Something that stands on a line: a key to choose it by, its words, and the filter that means it."""

    key: str
    words: str
    text: str


def register_text(unit: int, logical: str) -> str:
    """The filter for a register or a bit of a unit."""
    return f"unit == {unit} and {'bit' if logical[0] in _BIT_AREAS else 'register'} == {logical}"


def cells_of_row(screen: BusScreen) -> list[DoorCell]:
    """What the row under the cursor speaks of, the field under the cursor below first."""
    row, bus = screen.jumps.here, screen.desk.bus
    if row < 0 or not bus.count:
        return []
    if bus.is_noise(row):
        return [DoorCell("n", "noise", "noise")]
    frame = bus.frame(row)
    cells = []
    item = screen.detail.fields.item
    address = "" if item is None else item.text.partition(":")[0]
    if screen.detail.fields.has_focus and item is not None and item.length and address.isdecimal() and len(address) > 4:
        cells.append(DoorCell("v", f"register {address} of unit {frame.unit}", register_text(frame.unit, address)))
    cells += [
        DoorCell("u", f"unit {frame.unit}", f"unit == {frame.unit}"),
        DoorCell("f", f"{function_code(frame.function)} {frame.name}", f"function == {frame.function}"),
    ]
    partner = bus.partner(row)
    request = partner if partner is not None and frame.direction == "response" else row
    poll = poll_values(bus, [request])[0]
    if poll.register:
        register = register_text(frame.unit, poll.register)
        cells.append(DoorCell("r", f"register {poll.register} of unit {frame.unit}", register))
        poll_text = f"{register} and function == {frame.function} and quantity == {poll.quantity}"
        cells.append(DoorCell("p", f"this poll: {poll.register} ×{poll.quantity} of unit {frame.unit}", poll_text))
    if frame.exception:
        cells.append(DoorCell("x", f"exception {frame.exception}", f"exception == {frame.exception}"))
    codes = dict.fromkeys(finding.code for each in {row, request, partner} - {None} for finding in bus.findings(each))  # type: ignore[arg-type]
    cells += [DoorCell("cdeghij"[i], code, f'finding == "{code}"') for i, code in enumerate(list(codes)[:7])]
    return cells


class Doors:
    """The main screen's doors."""

    def __init__(self, screen: BusScreen) -> None:
        self._screen = screen

    async def go(self, sign: str) -> None:
        """Ask for a cell of the line where there are several, and go through it."""
        from .views import BY_NAME

        screen = self._screen
        cells = BY_NAME[screen.view].cells(screen)
        if not cells:
            screen.tell("nothing under the cursor to filter by")
            return
        which: int | None = 0
        if len(cells) > 1:
            which = await screen.app.push_screen_wait(Choose(_ASKS[sign], [(cell.key, cell.words) for cell in cells]))
        if which is not None:
            self._through(sign, cells[which])

    def _through(self, sign: str, cell: DoorCell) -> None:
        screen = self._screen
        bar = screen.query_one(FilterBar)
        old, text = bar.text, cell.text
        if sign == ".":
            screen.jumps.find_by(cell.words, for_test(compiled(text, screen.desk.bus.line).test))
        elif sign == "=":
            bar.use(text)
        elif sign == "!":
            bar.use(f"{_grouped(old)} and not ({text})" if old else f"not ({text})")
        else:
            word = "and" if sign == "&" else "or"
            bar.prepare(f"{_grouped(old)} {word} {_grouped(text)}" if old else text)


def _grouped(text: str) -> str:
    """A filter that can be joined to another."""
    return f"({text})" if " and " in text or " or " in text else text
