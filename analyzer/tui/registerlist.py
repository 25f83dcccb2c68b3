"""The registers: the newest value of each that was seen, read as what it is, and what it was over time below."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, ClassVar, Final

import numpy as np
from textual.binding import Binding, BindingType

from captures import CaptureError
from dissectors.values import AREAS, harmless, logical

from ..languages import error_words, tr
from ..model.meanings import BIT_AREAS, CHOICES, Meaning
from ..model.registers import AREA_WORDS
from ..words import short, shortened
from .keyqueue import put_question
from .lines import Lines
from .paint import StyledText, fitted
from .plot import Plot, trend
from .prompts import Ask
from .view import DoorCell, named_cells

if TYPE_CHECKING:
    from ..model.registers import RegisterLog, Spot, WatchedRegister
    from .desk import ViewState

AREA_NAMES: Final = tuple(AREAS)
_PINS: Final = 4
_NAME: Final = 12  # columns that a name always has, where there is room
_TYPED: Final = 52  # columns from which on there is room for a value's type
_ROOMY: Final = 70  # and for what it was before, and how old it is
_TREND: Final = 8  # columns that a trend needs to tell anything
_SOURCES: Final = {"yours": "!", "map": "=", "told": "~", "plain": " "}


class RegisterList(Lines):
    """A line a register, coil or input."""

    EMPTY = "no values read or written yet"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("v", "type(1)", "Type", tooltip="The next way to read this register: signed, float, …"),
        Binding("V", "type(-1)", "Type back", show=False),
        Binding("x", "told", "As told", tooltip="Read it as its map or its values tell", show=False),
        Binding("space", "pin", "Pin", tooltip="Keep this register in the plot, or take it out"),
        Binding("plus", "zoom(False)", "Zoom in", tooltip="A shorter time in the plot: around its cursor or newest"),
        Binding("a", "zoom(True)", "All", show=False, tooltip="The whole time in the plot again"),
        Binding("g,ctrl+g", "place", "Go to", tooltip="A register by its number"),
        Binding("left", "cursor(-1)", "Earlier", show=False),
        Binding("right", "cursor(1)", "Later", show=False),
    ]

    def __init__(self, desk: ViewState, *, id: str) -> None:
        super().__init__(id=id)
        self.desk = desk
        self.pins: list[Spot] = []
        self._spots: list[Spot] = []
        self._line_of: dict[Spot, int] = {}
        self._parts: dict[Spot, Spot] = {}  # registers that are part of the value of one before them
        self._laid_out: tuple[object, int, int] | None = None  # of what log, how many registers, which meanings
        self._longest = 0  # characters of a name

    @property
    def empty(self) -> str:
        return self.desk.emptied(self.EMPTY)

    @property
    def _log(self) -> RegisterLog:
        return self.desk.figures.registers

    @property
    def spot(self) -> Spot | None:
        """The place under the cursor."""
        return self._spots[self.cursor] if self.cursor < len(self._spots) else None

    @property
    def register(self) -> WatchedRegister | None:
        """The one under the cursor."""
        return None if self.spot is None else self._log.at(self.spot)

    def grown(self) -> None:
        before, empty = self.spot, not self._spots
        self._lay_out()
        if before is not None:
            self.cursor = self._line_of.get(before, self.cursor)
        super().grown()
        if empty and self._spots:
            self._tell()

    def _lay_out(self) -> None:
        """The lines: others only where a register is new, or means something else."""
        log = self._log
        now = log, len(log), self.desk.meanings.version
        if now == self._laid_out:
            return
        self._laid_out = now
        self._spots = sorted(log.spots(), key=_in_order)
        self._line_of = {spot: i for i, spot in enumerate(self._spots)}
        self._parts = {}
        self._longest = max((len(self._called(spot)) for spot in self._spots), default=0)
        for spot in self._spots:
            if spot not in self._parts:
                for k in range(1, self.meaning(spot).words):
                    self._parts[spot[0], spot[1], spot[2] + k] = spot

    def meaning(self, spot: Spot) -> Meaning:
        """How a register is read."""
        return self.desk.meanings.at(spot)

    def _called(self, spot: Spot) -> str:
        """What it is called, or else where it is."""
        return self.meaning(spot).name or tr(AREA_WORDS[spot[1]])

    def count(self) -> int:
        return len(self._spots)

    def head(self, width: int) -> Sequence[StyledText]:
        name = _name_width(width, self._longest)
        place = f"{tr('unit'):>6} {tr('register'):>8} {tr('what'):<{name}}"
        value = f"{tr('value'):>{_value_width(width)}}  "
        if width >= _ROOMY:
            value += f"{tr('before'):>12} {tr('age'):>6} "
        room = _trend_width(width, name)
        value += f"{tr('trend'):<{room}} " if room else ""
        value += tr("type") if width >= _TYPED else ""
        return fitted([StyledText(f"{place} {value}")], width)

    def pieces(self, line: int, width: int) -> Sequence[StyledText]:
        spot = self._spots[line]
        register, meaning = self._log.at(spot), self.meaning(spot)
        assert register is not None
        bit = register.area < BIT_AREAS
        members = self._members(register, meaning)
        room = _name_width(width, self._longest)
        name = shortened(self._called(spot), room)
        parts = [
            StyledText("•" if spot in self.pins else " ", "accent"),
            StyledText(f"{register.unit:>5} "),
            StyledText(f"{logical(register.address, AREA_NAMES[register.area]):>8} ", "place"),
            StyledText(f"{name:<{room}} ", "" if meaning.name else "dim"),
        ]
        if spot in self._parts:
            owner = self._parts[spot]
            of = logical(owner[2], AREA_NAMES[owner[1]])
            return fitted(
                [*parts, StyledText(f"{tr('└ of {register}', register=of):>{_value_width(width)}}", "dim")], width
            )
        changed, power = any(member.changed for member in members), self._power(spot, meaning)
        before = ""
        if all(member.before is not None for member in members):
            before = meaning.text([member.before or 0 for member in members], bit=bit, power=power) if changed else "="
        age = short(self.desk.bus.t_last - register.t_ns) if self.desk.bus.timed else "-"
        value = meaning.text([member.value for member in members], bit=bit, power=power)
        parts += [
            StyledText(f"{value:>{_value_width(width)}}", "moved" if changed else ""),
            StyledText("* " if changed else "  ", "moved"),
        ]
        if width >= _ROOMY:
            parts += [
                StyledText(f"{before:>12} ", "dim"),
                StyledText(f"{age:>6} ", "dim"),
                *self._trend(spot, meaning, _trend_width(width, room)),
            ]
        if width >= _TYPED:
            parts += [
                StyledText(tr("bit") if bit else meaning.type),
                StyledText(f" {_SOURCES[meaning.source]}", "dim"),
            ]
        return fitted(parts, width)

    def _trend(self, spot: Spot, meaning: Meaning, width: int) -> list[StyledText]:
        """How the value went over the capture, from its least to its most."""
        if not width:
            return []
        bit, log = spot[1] < BIT_AREAS, self.desk.figures.registers
        numbers = np.full(0, np.nan)
        if meaning.is_number or bit:
            begin, samples = log.samples(*spot, meaning.words)
            numbers = np.full(max(log.stretches, begin + len(samples)), np.nan)
            numbers[begin : begin + len(samples)] = samples[:, 0] if bit else meaning.numbers(samples)
            numbers[~np.isfinite(numbers)] = np.nan
        return [trend(numbers, width), StyledText(" ")]

    def _members(self, register: WatchedRegister, meaning: Meaning) -> list[WatchedRegister]:
        """It and the registers right behind it, as many as its type takes and were seen."""
        members = [register]
        for k in range(1, meaning.words):
            member = self._log.at((register.unit, register.area, register.address + k))
            if member is None:
                break
            members.append(member)
        return members

    def _power(self, spot: Spot, meaning: Meaning) -> int | None:
        """What the register holds that scales a value, 0 where none does."""
        if meaning.row is None or meaning.row.scale_address is None:
            return 0
        scale = self._log.at((spot[0], spot[1], meaning.row.scale_address))
        return None if scale is None else scale.value

    def owner(self, register: WatchedRegister) -> Spot:
        """Where the value begins that a register is part of."""
        return self._parts.get(register.spot, register.spot)

    def label(self, spot: Spot) -> str:
        """A value in words: place, name, type."""
        meaning = self.meaning(spot)
        name = f" {meaning.name}" if meaning.name else ""
        kind = "" if spot[1] < BIT_AREAS else f", {meaning.type}"
        return f"{tr('unit {unit}', unit=spot[0])}, {logical(spot[2], AREA_NAMES[spot[1]])}{name}{kind}"

    def value_cells(self, register: WatchedRegister) -> Iterator[DoorCell]:
        """What its value is now, by its name."""
        spot = self.owner(register)
        meaning, first = self.meaning(spot), self._log.at(spot)
        if first is not None:
            members = self._members(first, meaning)
            yield from named_cells(meaning, spot, meaning.number([member.value for member in members]))

    def worded(self, spot: Spot) -> str:
        """A value with its newest reading: `unit 1, 30001 Voltage L1, f32 ABCD: 230.1 V`."""
        meaning, first = self.meaning(spot), self._log.at(spot)
        values = [] if first is None else [member.value for member in self._members(first, meaning)]
        text = meaning.text(values, bit=spot[1] < BIT_AREAS, power=self._power(spot, meaning))
        return harmless(f"{self.label(spot)}: {text}")

    def action_type(self, step: int) -> None:
        register = self.register
        if register is None or register.area < BIT_AREAS:
            return
        spot = self.owner(register)
        names = [choice.type for choice in CHOICES]
        now = self.meaning(spot).type
        at = names.index(now) if now in names else -step if step > 0 else 0
        self._choose(spot, names[(at + step) % len(names)])

    def action_told(self) -> None:
        if self.register is not None:
            self._choose(self.owner(self.register), "")

    def _choose(self, spot: Spot, type_words: str) -> None:
        try:
            self.desk.notes.choose_type(spot, type_words)
        except CaptureError as error:
            self.app.notify(tr("saved only until you quit: {error}", error=error_words(error)), markup=False)
        self.desk.meanings.reworded()
        self._lay_out()
        self.move_to(self._line_of.get(spot, self.cursor))
        self.unpaint()
        self._tell()

    def action_pin(self) -> None:
        register = self.register
        if register is None:
            return
        spot = self.owner(register)
        if spot in self.pins:
            self.pins.remove(spot)
        elif len(self.pins) < _PINS:
            self.pins.append(spot)
        else:
            self.app.notify(tr("{count} are pinned already: press Space on one to unpin it", count=_PINS))
        self.unpaint()
        self._tell()

    def action_place(self) -> None:
        put_question(self.screen, self._ask_place)

    async def _ask_place(self) -> None:
        """Go to the next register of a number, of any unit; `17 40108` says of which."""
        hint = tr("a register such as 40108; 17 40108: of unit 17")
        text = await self.app.push_screen_wait(Ask(tr("Go to"), hint, wrong=self._no_register))
        if text is not None:
            self.move_to(self._numbered(text)[0], middle=True)

    def _numbered(self, text: str) -> list[int]:
        """Lines of the registers of a number, those behind the cursor first."""
        unit, _, number = text.strip().rpartition(" ")
        lines = [
            i for i, (own, area, address) in enumerate(self._spots)
            if logical(address, AREA_NAMES[area]) == number and unit in ("", str(own))
        ]  # fmt: skip
        return sorted(lines, key=lambda line: (line <= self.cursor, line))

    def _no_register(self, text: str) -> str:
        if self._numbered(text):
            return ""
        return tr("register {number} was not seen here", number=text.strip()[:20])

    def go_to_spot(self, spot: Spot) -> None:
        """Put the cursor on a register, where it was seen."""
        self._lay_out()
        self.move_to(self._line_of.get(spot, self.cursor), middle=True)

    def action_zoom(self, whole: bool) -> None:
        if self.desk.bus.timed:
            self.screen.query_one(Plot).zoom(whole=whole)

    def action_cursor(self, step: int) -> None:
        self.screen.query_one(Plot).move(step)


def _name_width(width: int, longest: int) -> int:
    """Columns of a register's name, of which the longest has so many characters: the rest is the trend's."""
    return max(8, min(width - 68, 40, max(longest, _NAME)))


def _value_width(width: int) -> int:
    """Columns of a value: on the narrowest terminals all that place and name leave."""
    return max(8, min(18, width - 27))


def _trend_width(width: int, name: int) -> int:
    """Columns of how a value went, beside a name of so many; none where terminals are narrow."""
    room = min(width - 70 - name, 48)
    return room if room >= _TREND else 0


def _in_order(spot: Spot) -> tuple[int, bool, int, int]:
    """By unit, registers before single bits."""
    unit, area, address = spot
    return unit, area < BIT_AREAS, -area, address


def spot_text(spot: Spot) -> str:
    """`17 40108`, as one goes there."""
    return f"{spot[0]} {logical(spot[2], AREA_NAMES[spot[1]])}"
