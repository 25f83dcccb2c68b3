"""What the registers of a bus mean, for every view, search and filter.

A register's meaning is the user's own word, else a map's, else what its values tell, else a plain number. What a poll
carries is read by it: `Meanings.readings` gives named values, each with what it was before.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from dissectors.maps.files import UnitMaps
from dissectors.maps.model import MapArea, MappedValue, RegisterMap, read_mapped
from dissectors.values import AREAS, Order, bits, characters, floating, hexadecimal, integer, logical

from ..languages import tr
from ..registers.hypotheses import numbers
from ..registers.readings import is_due, mapped_numbers
from .registers import AREA_WORDS, Spot, own_words

if TYPE_CHECKING:
    from ..registers.roles import RegisterValue
    from .bus import Bus
    from .polls import TransactionValues

ChartsOf = Callable[[Iterable[int]], Mapping[int, RegisterMap]]
BIT_AREAS: Final = 2  # coils and discrete inputs come first
_AREA_NAMES: Final = tuple(AREAS)
_UNITS: Final = 256
_MANY: Final = 1500  # registers
_BLOCKS: Final = 4096  # of which it is remembered whether they mean anything
_SHOWN_AS: Final = {"enum": "u", "time": "u", "bcd": "u", "text": "text", "bits": "bits", "bool": "u"}
_READ: Final = 1 << 20  # rows that types are told from
_ROW_TYPES: Final = {"hex": "u16"}  # what a map calls a choice of the user's


@dataclass(frozen=True, slots=True)
class Meaning:
    """How `words` registers from one on are read: `kind` and `order` as `dissectors.values.Reading` has them.

    `source` is who says so: yours, map, told (from the values), or plain. The number is raw * `scale` + `offset`.
    `row` is the map's, where it is the map that says so.
    """

    kind: str = "u16"
    order: str | None = None
    words: int = 1
    source: str = "plain"
    name: str = ""
    measure: str = ""
    scale: float = 1.0
    offset: float = 0.0
    row: MappedValue | None = None

    @property
    def type(self) -> str:
        """`f32 CDAB`."""
        return f"{self.kind} {self.order}" if self.order and self.words > 1 else self.kind

    @property
    def is_plain(self) -> bool:
        """Whether it says nothing beyond the register's own number."""
        return self.row is None and not self.name and self.kind == "u16"

    @property
    def is_number(self) -> bool:
        """Whether it can be plotted."""
        return self.kind not in ("text", "bits") and self.words in (1, 2, 4)

    def numbers(self, registers: NDArray[np.uint16]) -> NDArray[np.float64]:
        """Readings, one a line, as the numbers that they are."""
        if self.row is not None and self.row.scale_address is None:
            return mapped_numbers(self.row, registers)
        order = cast(Order, self.order or "ABCD")
        raw = numbers(registers, order, is_float=self.kind[0] == "f", signed=self.kind[0] == "s")
        return raw * self.scale + self.offset

    def number(self, values: Sequence[int]) -> float | None:
        """One reading as a number; None where it is none."""
        if not self.is_number or len(values) < self.words:
            return None
        number = float(self.numbers(np.array([values[: self.words]], np.uint16))[0])
        return number if math.isfinite(number) else None

    def typed(self, number: float) -> str:
        """A reading as one types it to find its equals: as many digits as tell it from others."""
        return f"{number:.7g}" if self.kind == "f32" else f"{number:.12g}"

    def text(self, values: Sequence[int], *, bit: bool = False, power: int | None = None) -> str:
        """A reading in words; a dash where a register of it was not seen. `power`: what its scale register holds."""
        if len(values) < self.words:
            return "-"
        own = tuple(values[: self.words])
        if self.row is not None:
            return read_mapped(self.row, own, power).text
        if bit:
            return tr("on" if own[0] else "off")
        order = cast(Order, self.order or "ABCD")
        match self.kind:
            case "text":
                return characters(own)
            case "hex":
                return hexadecimal(own[0])
            case "bits":
                return bits(own[0])
            case "f32":
                return f"{floating(own, order):.7g}"
            case "f64":
                return f"{floating(own, order):.16g}"
        return str(integer(own, order, signed=self.kind[0] == "s"))


PLAIN: Final = Meaning()
CHOICES: Final = (
    *(Meaning(kind, None, 1, "yours") for kind in ("u16", "s16", "hex", "bits")),
    Meaning("text", None, 2, "yours"),
    *(Meaning(kind, order, 2, "yours") for kind in ("f32", "u32", "s32") for order in ("ABCD", "CDAB", "BADC", "DCBA")),
    *(Meaning(kind, order, 4, "yours") for kind in ("f64", "u64", "s64") for order in ("ABCD", "CDAB", "BADC", "DCBA")),
)  # fmt: skip
_BY_TYPE: Final = {meaning.type: meaning for meaning in CHOICES}


def chosen(type_words: str) -> Meaning | None:
    """The user's word as it is kept: `f32 CDAB`."""
    return _BY_TYPE.get(type_words)


class NamedReading(NamedTuple):
    """One value that a poll carries: its first register, how it is read, and what it says now and said before.

    `at` counts registers from the first of the poll. `before` is empty where nothing is known; `name` is the map's,
    else the register's logical number.
    """

    spot: Spot
    at: int
    meaning: Meaning
    text: str
    before: str
    changed: bool

    @property
    def register(self) -> str:
        """Its logical number."""
        return logical(self.spot[2], _AREA_NAMES[self.spot[1]])

    @property
    def name(self) -> str:
        return self.meaning.name or self.register


class Meanings:
    """The meanings of one bus. `version` is another one whenever any of them may be."""

    def __init__(self, bus: Bus, types: Callable[[], Mapping[Spot, str]], charts_of: Callable[[], ChartsOf]) -> None:
        """`types` are the user's own words, `charts_of` gives the maps of units; both as they are when asked."""
        self._bus, self._types, self._charts_of = bus, types, charts_of
        self._told: Mapping[Spot, Meaning] = {}
        self._mapped: dict[int, dict[tuple[int, int], Meaning]] = {}
        self._asked_at = -1  # rows of which types were told
        self._meant: dict[tuple[int, int, int, int], tuple[int, bool]] = {}  # blocks, by which version
        self._charts: tuple[int, UnitMaps] | None = None  # for which version
        self.version = 0

    def use_meanings(self, told: Mapping[Spot, Meaning]) -> None:
        """What the values tell."""
        if told != self._told:
            self._told = told
            self.version += 1

    def reworded(self) -> None:
        """The user's words, or the maps, are others."""
        self._mapped.clear()
        self.version += 1

    def is_due(self, *, often: bool) -> bool:
        """Whether values should be asked anew: at the end of a capture, and `often` while rows come as well. On a bus
        of very many registers that takes minutes: only `often`, and at the end."""
        count, asked = self._bus.count, self._asked_at
        if not count or (len(self._bus.registers) > _MANY and not (often and self._bus.whole)):
            return False
        return asked < count if self._bus.whole else often and is_due(max(asked, 0), count)

    def ask(self, stop: Callable[[], bool]) -> dict[Spot, Meaning]:
        """What the values so far tell, for `use`; takes a while."""
        self._asked_at = self._bus.count
        return meanings_of(self._bus, self._charts_of(), stop, dict(self._types()))

    def at(self, spot: Spot) -> Meaning:
        """How the register at a place is read."""
        types = self._types()
        own, mapped = chosen(types.get(spot, "")), self._of_map(spot)
        if own is not None:
            return replace(own, name=mapped.name) if mapped is not None and mapped.name else own
        unit, area, address = spot
        if mapped is not None:
            taken = types and any((unit, area, address + k) in types for k in range(1, mapped.words))
            return PLAIN if taken else mapped
        told = self._told.get(spot, PLAIN)
        behind = [(unit, area, address + k) for k in range(1, told.words)]
        return PLAIN if any(each in types or self._of_map(each) is not None for each in behind) else told

    def _of_map(self, spot: Spot) -> Meaning | None:
        unit, area, address = spot
        mapped = self._mapped.get(unit)
        if mapped is None:
            chart = self._charts_of()([unit]).get(unit)
            rows = () if chart is None else chart.rows
            mapped = {(AREA_WORDS.index(row.area), row.address): _of_row(row) for row in reversed(rows)}
            self._mapped[unit] = mapped
        return mapped.get((area, address))

    def readings(self, poll: TransactionValues) -> Iterator[NamedReading]:
        """What a poll carries, value by value. Registers that belong to no value whole are plain ones."""
        at, values, before = 0, poll.values, poll.before if len(poll.before) == len(poll.values) else ()
        while at < len(values):
            spot = poll.unit, poll.area, poll.address + at
            meaning, bit = self.at(spot), poll.area < BIT_AREAS
            if at + meaning.words > len(values):
                meaning = PLAIN
            own, old = values[at : at + meaning.words], before[at : at + meaning.words]
            text = meaning.text(own, bit=bit, power=_power(meaning, poll.address, values))
            was = meaning.text(old, bit=bit, power=_power(meaning, poll.address, before)) if old else ""
            yield NamedReading(spot, at, meaning, text, was, bool(old) and old != own)
            at += meaning.words

    def means(self, poll: TransactionValues) -> bool:
        """Whether anything but plain numbers is known of what a poll carries."""
        if poll.area < 0:
            return False
        block = poll.unit, poll.area, poll.address, len(poll.values)
        known = self._meant.get(block)
        if known is None or known[0] != self.version:
            places = range(len(poll.values))
            means = any(not self.at((poll.unit, poll.area, poll.address + at)).is_plain for at in places)
            if len(self._meant) >= _BLOCKS:
                self._meant.clear()
            known = self._meant[block] = self.version, means
        return known[1]

    @property
    def charts(self) -> UnitMaps:
        """The meanings as maps of units, for filters and searches: values without a name have their register's."""
        if self._charts is None or self._charts[0] != self.version:
            self._charts = self.version, UnitMaps(self._as_maps())
        return self._charts[1]

    def _as_maps(self) -> dict[int, RegisterMap]:
        charts = dict(self._charts_of()(range(_UNITS)))
        added: dict[int, dict[str, list[MappedValue]]] = {}
        for spot in {**self._told, **self._types()}:
            meaning = self.at(spot)
            if meaning.source in ("yours", "told"):
                added.setdefault(spot[0], {"yours": [], "told": []})[meaning.source].append(_row_of(spot, meaning))
        for unit, rows in added.items():
            chart = charts.get(unit, RegisterMap("", ()))
            kept = [*(row for row in chart.rows if not _meets(row, rows["yours"])), *rows["yours"]]
            charts[unit] = replace(chart, rows=(*kept, *(row for row in rows["told"] if not _meets(row, kept))))
        return charts


def _power(meaning: Meaning, first: int, values: Sequence[int]) -> int | None:
    """What the scale register of a value holds, where it is among these values; 0 where it has none."""
    if meaning.row is None or meaning.row.scale_address is None:
        return 0
    at = meaning.row.scale_address - first
    return values[at] if 0 <= at < len(values) else None


def _of_row(row: MappedValue) -> Meaning:
    order = row.order if row.length > 1 and row.type != "text" else None
    return Meaning(row.type, order, row.length, "map", row.name, row.unit, row.scale, row.offset, row)


def _row_of(spot: Spot, meaning: Meaning) -> MappedValue:
    area: MapArea = AREA_WORDS[spot[1]]
    name = meaning.name or logical(spot[2], _AREA_NAMES[spot[1]])
    kind = "bool" if spot[1] < BIT_AREAS else _ROW_TYPES.get(meaning.kind, meaning.kind)
    return MappedValue(
        area, spot[2], name, kind, meaning.order or "ABCD", meaning.words, meaning.scale, meaning.offset,
        unit=meaning.measure,
    )  # fmt: skip


def _meets(one: MappedValue, others: Sequence[MappedValue]) -> bool:
    """Whether a value has a register in common with others."""
    return any(one.area == each.area and one.address < each.end and each.address < one.end for each in others)


def meanings_of(
    bus: Bus,
    charts_of: ChartsOf,
    stop: Callable[[], bool] = bool,
    types: Mapping[Spot, str] | None = None,
) -> dict[Spot, Meaning]:
    """What the values themselves say, by place; of a long capture its first million rows. Takes a while.
    `types` are the user's own words: they teach what is told of the rest, as maps do."""
    from ..registers.drafting import with_own_words
    from ..registers.inference import infer
    from ..registers.readings import RegisterReadings

    registers = RegisterReadings()
    for _, batch in bus.batches(0, min(bus.count, _READ)):
        if stop():
            return {}
        registers.feed(batch)
    charts = with_own_words(charts_of({block.unit for block in registers}), own_words(types or {}))
    return dict(_told(infer(registers, charts=charts)))


def _told(values: Iterable[RegisterValue]) -> Iterable[tuple[Spot, Meaning]]:
    for value in values:
        spot = value.unit, AREA_WORDS.index(value.area), value.address
        kind = value.type
        if spot[1] < BIT_AREAS:
            kind = "u16"
        elif kind.rstrip("0123456789") in _SHOWN_AS:
            shown = _SHOWN_AS[kind.rstrip("0123456789")]
            kind = shown if shown != "u" else f"u{16 * value.words}"
        words = value.words
        if kind == "bits" or (kind == "text" and words not in (1, 2, 4)):
            words = 1 if kind == "bits" else 2
        if words not in (1, 2, 4):
            kind, words = "u16", 1
        order = (value.order or "ABCD") if words > 1 and kind != "text" else None
        yield spot, Meaning(kind, order, words, "told")
