"""The registers: the newest value of each that was seen, in the type that the user chose, and its history."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, ClassVar, Final

from textual.binding import Binding, BindingType
from textual.containers import Vertical

from dissectors.values import AREAS, logical, readings

from ..model.registers import RegisterReading, WatchedRegister, history
from ..words import short
from .history import History
from .lines import Lines
from .paint import StyledText, fitted
from .view import JUMPS, View

if TYPE_CHECKING:
    from textual.widget import Widget

    from .desk import ViewState
    from .screen import BusScreen

# kind and order of `dissectors.values.Reading`, and how many registers it takes
TYPES: Final = (
    ("u16", None, 1), ("s16", None, 1), ("hex", None, 1), ("bits", None, 1), ("text", None, 2),
    *((kind, order, 2) for kind in ("f32", "u32", "s32") for order in ("ABCD", "CDAB", "BADC", "DCBA")),
    *((kind, order, 4) for kind in ("f64", "u64", "s64") for order in ("ABCD", "CDAB", "BADC", "DCBA")),
)  # fmt: skip
_BIT_AREAS: Final = 2  # coils and discrete inputs come first
_AREA_NAMES: Final = tuple(AREAS)


class RegisterList(Lines):
    """A line a register, coil or input."""

    EMPTY = "no value was read or written yet"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("v", "type(1)", "Type", tooltip="The next way to read registers: signed, float, …"),
        Binding("V", "type(-1)", "Type back", show=False),
    ]

    def __init__(self, desk: ViewState, *, id: str) -> None:
        super().__init__(id=id)
        self.desk = desk
        self.type = 0
        self._registers: list[WatchedRegister] = []
        self._places: dict[tuple[int, int, int], int] = {}

    @property
    def register(self) -> WatchedRegister | None:
        """The one under the cursor."""
        return self._registers[self.cursor] if self.cursor < len(self._registers) else None

    def grown(self) -> None:
        before = self.register
        self._registers = self.desk.bus.registers.all()
        self._places = {(r.unit, r.area, r.address): i for i, r in enumerate(self._registers)}
        if before is not None:
            self.cursor = self._places.get((before.unit, before.area, before.address), self.cursor)
        super().grown()

    def count(self) -> int:
        return len(self._registers)

    def reading(self, values: Sequence[int], *, bit: bool) -> tuple[str, float | None]:
        """Values of a register and its followers in the chosen type: as text, and as a number where it is one."""
        kind, order, size = TYPES[self.type]
        if bit:
            return ("on" if values[0] else "off"), float(values[0])
        if len(values) < size:
            return "-", None
        found = next((r for r in readings(values[:size]) if r.kind == kind and r.order == order), None)
        if found is None:
            return "-", None
        number = found.value if isinstance(found.value, int | float) else float(values[0])
        return found.text, float(number) if math.isfinite(number) else None

    def head(self, width: int) -> Sequence[StyledText]:
        kind, order, _ = TYPES[self.type]
        name = f"{kind} {order}" if order else kind
        return fitted([StyledText(f" unit  register  what              {name:>22}   before        age")], width)

    def pieces(self, line: int, width: int) -> Sequence[StyledText]:
        register = self._registers[line]
        bit = register.area < _BIT_AREAS
        text, _ = self.reading(self._followers(register), bit=bit)
        before = "" if register.before is None else str(register.before)
        if bit and before:
            before = "on" if register.before else "off"
        age = short(self.desk.bus.t_last - register.t_ns) if self.desk.bus.timed else "-"
        return fitted(
            [
                StyledText(f"{register.unit:>5} "),
                StyledText(f"{logical(register.address, _AREA_NAMES[register.area]):>9}  ", "accent"),
                StyledText(f"{AREAS[_AREA_NAMES[register.area]]:<17} ", "dim"),
                StyledText(f"{text:>22} ", "strong" if register.changed else ""),
                StyledText("* " if register.changed else "  ", "warning"),
                StyledText(f"{before if register.changed else '=':<8} ", "" if register.changed else "dim"),
                StyledText(f"{age:>8}", "dim"),
            ],
            width,
        )

    def _followers(self, register: WatchedRegister) -> list[int]:
        """Its value and those of the registers right behind it, as many as the type takes."""
        values = [register.value]
        for k in range(1, TYPES[self.type][2]):
            place = self._places.get((register.unit, register.area, register.address + k))
            if place is None:
                break
            values.append(self._registers[place].value)
        return values

    def action_type(self, step: int) -> None:
        self.type = (self.type + step) % len(TYPES)
        self._told = -1
        self.unpaint()
        self._tell()


def plotted(
    found: RegisterList, readings_of: Sequence[RegisterReading], register: WatchedRegister
) -> list[tuple[int, float]]:
    """A register's history in the list's type, where that takes one register; else as it came."""
    _, _, size = TYPES[found.type]
    points = []
    for reading in readings_of:
        number = found.reading([reading.value], bit=register.area < _BIT_AREAS)[1] if size == 1 else reading.value
        if number is not None:
            points.append((reading.t_ns, float(number)))
    return points


def _make(desk: ViewState) -> Widget:
    return Vertical(RegisterList(desk, id="register-list"), History(id="history", classes="history"), id="registers")


def _refresh(screen: BusScreen) -> None:
    screen.query_one(RegisterList).grown()


def _chosen(screen: BusScreen, sender: Widget) -> None:
    """Read what the register was, then show it."""
    assert isinstance(sender, RegisterList)
    register = sender.register
    if register is None:
        return
    plot, bus = screen.query_one("#history", History), screen.desk.bus

    def show(read: list[RegisterReading]) -> None:
        span = f" over {short(read[-1].t_ns - read[0].t_ns)}" if len(read) > 1 and bus.timed else ""
        where = logical(register.address, _AREA_NAMES[register.area])
        plot.show(f" unit {register.unit}, {where}: {len(read)} readings{span}", plotted(sender, read, register))

    plot.show(" reading …", ())
    screen.jobs.run("history", lambda stop: history(bus, register, stop=stop), show)


def _entered(screen: BusScreen, sender: Widget) -> None:
    """The frame that brought the value."""
    assert isinstance(sender, RegisterList)
    if sender.register is not None:
        screen.jumps.go(sender.register.row)


VIEW: Final = View(
    name="registers", key="5", title="Registers",
    make=_make, refresh=_refresh, chosen=_chosen, entered=_entered,
    without=(*JUMPS, "select"),
)  # fmt: skip
