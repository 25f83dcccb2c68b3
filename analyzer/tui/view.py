"""A view of the bus: one record, from which the screen makes its tab, its key, its widget, and what happens in it.

A new view is a file with such a record and a line in `views`. Its functions get the screen, and of a list the widget
whose cursor moved; what they need of the view itself they ask the screen for by the widget's class. What stands on a
line of a list is told as filters that mean it: the cells that doors lead through.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from dissectors.functions import function_code
from dissectors.values import AREAS, harmless, logical

from ..languages import tr
from ..model.polls import carried_by, poll_values
from .paint import Painted
from .places import Place

if TYPE_CHECKING:
    from textual.widget import Widget

    from ..model.meanings import Meaning
    from ..model.registers import Spot
    from .desk import ViewState
    from .screen import BusScreen

_BIT_AREAS: Final = "01"


@dataclass(frozen=True, slots=True)
class DoorCell:
    """Something that stands on a line: a key to choose it by, its words, and the filter that means it."""

    key: str
    words: str
    text: str


def register_text(unit: int, number: str) -> str:
    """The filter for a register or a bit of a unit, by its logical number."""
    return f"unit == {unit} and {'bit' if number[0] in _BIT_AREAS else 'register'} == {number}"


def cells_of_row(screen: BusScreen) -> list[DoorCell]:
    """What the row under the cursor speaks of, the field under the cursor below first."""
    row, bus = screen.jumps.here, screen.desk.bus
    if row < 0 or not bus.count:
        return []
    if bus.is_noise(row):
        return [DoorCell("n", tr("noise"), "noise")]
    frame = bus.frame(row)
    cells = list(_value_cell(screen, row))
    item = screen.detail.fields.item
    place = "" if item is None else item.text.partition(":")[0]
    if screen.detail.fields.has_focus and item is not None and item.length and place.isdecimal() and len(place) > 4:
        words = tr("register {register} of unit {unit}", register=place, unit=frame.unit)
        cells.append(DoorCell("v", words, register_text(frame.unit, place)))
    cells += [
        DoorCell("u", tr("unit {unit}", unit=frame.unit), f"unit == {frame.unit}"),
        DoorCell("f", f"{function_code(frame.function)} {frame.name}", f"function == {frame.function}"),
    ]
    partner = bus.partner(row)
    asked = partner if partner is not None and frame.direction == "response" else row
    poll = poll_values(bus, [asked])[0]
    if poll.register:
        register = register_text(frame.unit, poll.register)
        words = tr("register {register} of unit {unit}", register=poll.register, unit=frame.unit)
        cells.append(DoorCell("r", words, register))
        whole = f"{register} and function == {frame.function} and quantity == {poll.quantity}"
        cells.append(DoorCell("p", tr("this poll: {words}", words=f"×{poll.quantity}, {words}"), whole))
    if frame.exception:
        cells.append(DoorCell("x", tr("exception {code}", code=frame.exception), f"exception == {frame.exception}"))
    codes = dict.fromkeys(finding.code for each in {row, asked, partner} - {None} for finding in bus.findings(each))  # type: ignore[arg-type]
    cells += [DoorCell("cdeghij"[i], code, f'finding == "{code}"') for i, code in enumerate(list(codes)[:7])]
    return cells


def _value_cell(screen: BusScreen, row: int) -> Iterator[DoorCell]:
    """The value under the cursor of the fields, as what it means."""
    item, desk = screen.detail.fields.item, screen.desk
    poll = carried_by(desk.bus, row) if item is not None and screen.detail.fields.has_focus else None
    if poll is None or item is None:
        return
    for reading in desk.meanings.readings(poll):
        if item.name == value_name(reading.spot):
            words = poll.values[reading.at : reading.at + reading.meaning.words]
            yield from named_cells(reading.meaning, reading.spot, reading.meaning.number(words))


def value_name(spot: Spot) -> str:
    """The name of a value's item below."""
    return f"value {spot[1]} {spot[2]}"


def named_cells(meaning: Meaning, spot: Spot, number: float | None) -> Iterator[DoorCell]:
    """The value of a register that means something, by its name."""
    name = meaning.name or logical(spot[2], tuple(AREAS)[spot[1]])
    if meaning.source == "plain" or number is None or '"' in name:
        return
    told = meaning.typed(number)
    words = tr("{name} is {number}", name=harmless(name), number=f"{told} {meaning.measure}".rstrip())
    yield DoorCell("v", words, f'unit == {spot[0]} and value("{name}") == {told}')


LISTS: Final = ("transactions", "frames")  # the views whose lines are rows of the bus


def cells_of_units(units: Sequence[int]) -> list[DoorCell]:
    """The units that something concerns."""
    return [
        DoorCell("ubcdefgh"[i], tr("unit {unit}", unit=unit), f"unit == {unit}") for i, unit in enumerate(units[:8])
    ]


def no_cells(screen: BusScreen) -> list[DoorCell]:  # noqa: ARG001
    """Nothing stands under its cursor that a filter could mean."""
    return []


def nothing(screen: BusScreen) -> None:
    """Nothing is to be done."""


def ignored(screen: BusScreen, sender: Widget) -> None:
    """What was chosen means nothing to others."""


def grown(screen: BusScreen) -> None:
    """The view's one widget paints what came."""
    screen.query_one(f"#{screen.view}", Painted).grown()


def nowhere(screen: BusScreen) -> Place:  # noqa: ARG001
    """Its cursor stands on nothing."""
    return None


@dataclass(frozen=True, slots=True)
class View:
    """A tab of the main screen."""

    name: str  # the widget's id, and what commands call it
    key: str
    title: str
    make: Callable[[ViewState], Widget]
    refresh: Callable[[BusScreen], None] = nothing  # it is shown, or rows came since
    chosen: Callable[[BusScreen, Widget], None] = ignored  # the cursor of one of its lists moved
    entered: Callable[[BusScreen, Widget], None] = ignored  # a line of one of its lists was opened
    shown: Callable[[BusScreen], None] = nothing  # it has just come up
    at: Callable[[BusScreen], Place] = nowhere  # what its cursor stands on
    cells: Callable[[BusScreen], list[DoorCell]] = no_cells  # what under its cursor can be filtered by
    copied: Callable[[BusScreen], str] | None = None  # the text that a copy is, where it is not bytes of a row
    export: Callable[[BusScreen], Awaitable[None]] | None = None  # where it writes something else than rows
    short: str = ""  # title on narrow terminals
    tab: bool = True  # stands among the tabs, not only while it is in sight
    detail: bool = False  # with the frame under the cursor below
    filtered: bool = True  # obeys the scope, whose line stands above
    figures: bool = False  # shows figures of the rows that the scope leaves, which take a while to count
    offers: frozenset[str] = frozenset()  # of the screen's actions in `places.OFFERED` those that it has
