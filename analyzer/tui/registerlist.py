"""The registers: the newest value of each that was seen, in the type that the user chose, and its history."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, ClassVar, Final

from textual.binding import Binding, BindingType
from textual.strip import Strip

from analyzer.model.clock import short
from analyzer.model.registers import Reading, Register
from dissectors.values import AREAS, logical, readings

from .lines import Lines
from .paint import Painted, Piece, fitted

if TYPE_CHECKING:
    from .desk import Desk

# kind and order of `dissectors.values.Reading`, and how many registers it takes
TYPES: Final = (
    ("u16", None, 1), ("s16", None, 1), ("hex", None, 1), ("bits", None, 1), ("text", None, 2),
    *((kind, order, 2) for kind in ("f32", "u32", "s32") for order in ("ABCD", "CDAB", "BADC", "DCBA")),
    *((kind, order, 4) for kind in ("f64", "u64", "s64") for order in ("ABCD", "CDAB", "BADC", "DCBA")),
)  # fmt: skip
_BIT_AREAS: Final = 2  # coils and discrete inputs come first
_AREA_NAMES: Final = tuple(AREAS)
_BLOCKS: Final = " ▁▂▃▄▅▆▇█"


class RegisterList(Lines):
    """A line a register, coil or input."""

    EMPTY = "no value was read or written yet"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("v", "type(1)", "Type", tooltip="The next way to read registers: signed, float, …"),
        Binding("V", "type(-1)", "Type back", show=False),
    ]

    def __init__(self, desk: Desk, *, id: str) -> None:
        super().__init__(id=id)
        self.desk = desk
        self.type = 0
        self._registers: list[Register] = []
        self._places: dict[tuple[int, int, int], int] = {}

    @property
    def register(self) -> Register | None:
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

    def head(self, width: int) -> Sequence[Piece]:
        kind, order, _ = TYPES[self.type]
        name = f"{kind} {order}" if order else kind
        return fitted([Piece(f" unit  register  what              {name:>22}   before        age")], width)

    def pieces(self, line: int, width: int) -> Sequence[Piece]:
        register = self._registers[line]
        bit = register.area < _BIT_AREAS
        text, _ = self.reading(self._followers(register), bit=bit)
        before = "" if register.before is None else str(register.before)
        if bit and before:
            before = "on" if register.before else "off"
        age = short(self.desk.bus.t_last - register.t_ns) if self.desk.bus.timed else "-"
        return fitted(
            [
                Piece(f"{register.unit:>5} "),
                Piece(f"{logical(register.address, _AREA_NAMES[register.area]):>9}  ", "accent"),
                Piece(f"{AREAS[_AREA_NAMES[register.area]]:<17} ", "dim"),
                Piece(f"{text:>22} ", "strong" if register.changed else ""),
                Piece("* " if register.changed else "  ", "warning"),
                Piece(f"{before if register.changed else '=':<8} ", "" if register.changed else "dim"),
                Piece(f"{age:>8}", "dim"),
            ],
            width,
        )

    def _followers(self, register: Register) -> list[int]:
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


def _number(number: float) -> str:
    return f"{number:.6g}"


class History(Painted):
    """What one number was over time, as bars, and its range."""

    def __init__(self, *, id: str, classes: str) -> None:
        super().__init__(id=id, classes=classes)
        self.title = ""
        self._written: Callable[[float], str] = _number
        self._points: list[tuple[int, float]] = []
        self._from_zero = False

    def show(
        self,
        title: str,
        points: Sequence[tuple[int, float]],
        written: Callable[[float], str] | None = None,
        *,
        from_zero: bool = False,
    ) -> None:
        """Times and numbers (NaN: none from then on), oldest first; `written` is how a number is put into words."""
        self.title = title
        self._written = written or _number
        self._from_zero = from_zero
        self._points = list(points)
        self.refresh()

    def render_line(self, y: int) -> Strip:
        width, height = self.content_size.width, self.content_size.height
        base = self.base
        if y == 0:
            return self.strip(fitted([Piece(self.title, "strong")], width), width, base)
        numbers = [number for _, number in self._points if not math.isnan(number)]
        if not numbers or height < 3:
            return self.strip([Piece(" no reading" if y == 1 else "", "dim")], width, base)
        low, high = 0.0 if self._from_zero else min(numbers), max(numbers)
        rows = height - 1
        label = self._written(high) if y == 1 else self._written(low) if y == rows and high > low else ""
        pieces = [
            Piece(f"{label:>11} ", "dim"),
            Piece(self._plot(y - 1, rows, max(1, width - 12), low, high), "accent"),
        ]
        return self.strip(pieces, width, base)

    def _plot(self, y: int, rows: int, width: int, low: float, high: float) -> str:
        """One line of the plot: bars in eighths of a line, each the newest number at its time."""
        first, last = self._points[0][0], self._points[-1][0]
        scale = (8 * rows - 1) / (high - low) if high > low else 0.0
        line, at = [], 0
        for column in range(width):
            until = first + (last - first) * (column + 1) / width
            while at + 1 < len(self._points) and self._points[at + 1][0] <= until:
                at += 1
            if math.isnan(self._points[at][1]):
                line.append(" ")
                continue
            level = 1 + round((self._points[at][1] - low) * scale) if high > low else 4 * rows
            line.append(_BLOCKS[max(0, min(8, level - 8 * (rows - 1 - y)))])
        return "".join(line)


def plotted(found: RegisterList, readings_of: Sequence[Reading], register: Register) -> list[tuple[int, float]]:
    """A register's history in the list's type, where that takes one register; else as it came."""
    _, _, size = TYPES[found.type]
    points = []
    for reading in readings_of:
        number = found.reading([reading.value], bit=register.area < _BIT_AREAS)[1] if size == 1 else reading.value
        if number is not None:
            points.append((reading.t_ns, float(number)))
    return points
