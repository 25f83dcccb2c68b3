"""The map that an import makes: rows of one device as they are found, those of one value joined.

What cannot be a row becomes a note. A value of which a file speaks twice, as once of reading and once of writing, is
one row; so are two that are named as the words of one value, and the bits of a register.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import PurePath
from typing import Final

from ..cells import CellError, one_line, value_of
from ..model import BIT_AREAS, READ_ONLY_AREAS, MappedValue, RegisterMap
from ..vocabulary import form

_MOST_NOTES: Final = 20
_MOST_ROWS: Final = 20_000
_MOST_TWINS: Final = 64
_TOLD: Final = tuple(part.name for part in fields(MappedValue) if part.name not in ("access", "group"))
_OF_ONE_REGISTER: Final = {("u16", 1), ("s16", 1), ("bits", 1)}  # whose bits may have names
_WIDER: Final = {"s": "s32", "f": "f32"}
_LENGTH: Final = ("length",)
_FACTOR: Final = ("scale", "offset")
_UNFIT: Final = {"bool": (*_LENGTH, *_FACTOR, "unit"), "text": _FACTOR, "bits": _FACTOR, "enum": _FACTOR}
"""What a type cannot have: a coil is a bool, a text has no factor, others have the length that they have."""


@dataclass(frozen=True, slots=True)
class ImportedMap:
    """A map, and what of the file it does not carry."""

    chart: RegisterMap
    notes: tuple[str, ...] = ()

    @property
    def facts(self) -> int:
        """How much it tells: of each row the name, and what it says beside; nothing where signs of a source or of a
        layout were left in it."""
        return sum(map(_facts_of, self.chart.rows))


def _facts_of(row: MappedValue) -> int:
    """What a row tells: nothing without a name of its own."""
    is_named = form("clean", row.name) != {} == form("nameless", row.name)
    told = (form("clean", row.unit), row.access, row.scale != 1, row.type != "u16")
    return is_named * (1 + sum(map(bool, told)))


@dataclass(slots=True)
class MapBuilder:
    """Rows of one device as they are found; what cannot be a row becomes a note."""

    file: str
    device: str = ""
    vendor: str = ""
    order: str = "ABCD"
    rows: list[MappedValue] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    bits: dict[tuple[str, int], dict[int, str]] = field(default_factory=dict)
    _at: dict[tuple[str, int], dict[str, int]] = field(
        default_factory=dict
    )  # where the rows of a register are, by name

    def add(self, area: str, address: int, cells: Mapping[str, object], what: object) -> None:
        """A row of these cells, at a zero-based address; `what` names it in a note. Nobody writes inputs ([1] 4.3)."""
        if self.is_full:
            return
        kind = "bool" if area in BIT_AREAS else str(cells["type"])
        fitting = {key: cell for key, cell in cells.items() if key not in _UNFIT.get(kind, _LENGTH)}
        usual = {"access": fitting.get("access") or "r"} if area in READ_ONLY_AREAS else {}
        try:
            row = value_of({**fitting, **usual, "area": area, "address": address, "type": kind}, order=self.order)
        except CellError as error:
            self.note(f"{what}: {error}")
            return
        self._take(row, what)

    def _take(self, row: MappedValue, what: object) -> None:
        """Put a row to the others: as one with what has its name there, or by a name that nothing has there."""
        twins = self._at.setdefault((row.area, row.address), {})
        if row.name in twins and (both := _together(self.rows[twins[row.name]], row)):
            self.rows[twins[row.name]] = both
        elif len(twins) >= _MOST_TWINS:
            self.note(f"{what}: over {_MOST_TWINS} values at {row.area} {row.address}")
        else:
            names = (row.name, *(f"{row.name} {number}" for number in range(2, len(twins) + 3)))
            name = next(name for name in names if name not in twins)
            twins[name] = len(self.rows)
            self.rows.append(replace(row, name=name))

    def add_bits(self, area: str, address: int, first: int, width: int, name: str) -> None:
        """A part of a register: bits `first` to `first + width - 1`."""
        names = self.bits.setdefault((area, address), {})
        for bit in range(max(first, 0), min(first + width, 16)):
            label = f"{name} bit {bit - first}" * (width > 1) or name
            names[bit] = " / ".join(filter(None, (names.get(bit), label)))

    @property
    def is_full(self) -> bool:
        """Whether there are more values than the map of a device has; said once."""
        full = len(self.rows) >= _MOST_ROWS
        said = f"over {_MOST_ROWS:,} values are not the map of one device"
        if full and said not in self.notes:
            self.notes.insert(0, said)
        return full

    def note(self, text: str) -> None:
        self.notes.append(one_line(text[:400])[:300])

    def built(self) -> ImportedMap:
        """The map; registers of which bits have names are one value each, the one that has the register itself."""
        for spot, names in self.bits.items():
            self._name_bits(*spot, dict(sorted(names.items())))
        notes = self.notes[:_MOST_NOTES]
        if len(self.notes) > _MOST_NOTES:
            notes.append(f"and {len(self.notes) - _MOST_NOTES} more such")
        chart = RegisterMap(
            one_line(self.device[:200]) or PurePath(self.file).stem,
            tuple(_without_halves(self.rows)),
            vendor=one_line(self.vendor[:200]),
            word_order=self.order,
            source=f"imported from {PurePath(self.file).name}",
        )
        return ImportedMap(chart, tuple(notes))

    def _name_bits(self, area: str, address: int, names: dict[int, str]) -> None:
        """Give the only row of a register the names of its bits; a row of their own where there is none, or another."""
        twins = [*self._at.get((area, address), {}).values()]
        if [(self.rows[at].type, self.rows[at].length) in _OF_ONE_REGISTER for at in twins] == [True]:
            self.rows[twins[0]] = replace(self.rows[twins[0]], type="bits", values=names, scale=1.0)
            return
        cells = {"name": f"Bits of {address}", "type": "bits", "values": names}
        self.add(area, address, cells, f"register {address}")


def _together(one: MappedValue, other: MappedValue) -> MappedValue | None:
    """Two values of a name as one, where they say the same or one of them more, as once of reading and once of writing;
    None where they say different things."""
    plain = MappedValue(one.area, one.address, one.name, one.type, one.order, one.length)
    rows = [(row, [part for part in _TOLD if getattr(row, part) != getattr(plain, part)]) for row in (one, other)]
    first, second = ({part: getattr(row, part) for part in parts} for row, parts in rows)
    access = "".join(sorted({*one.access, *other.access, *"r" * (one.access != other.access)}))
    return replace(one, **first | second, access=access) if first | second == second | first else None


def _without_halves(rows: Sequence[MappedValue]) -> Sequence[MappedValue]:
    """The rows; two neighbours that are named as the words of one value are that value."""
    done = [*rows[:1]]
    for row in rows[1:]:
        last = done[-1]
        first, second = form("half", last.name), form("half", row.name)
        marks = {first.get("low", "low") == "", second.get("low", "low") == ""}  # whether it is the high one
        if len(marks) > 1 and first.get("name", "") == second.get("name") and row.address == last.address + 1:
            order = "CDAB" if first["low"] else "ABCD"
            done[-1] = replace(last, name=first["name"], type=_WIDER.get(last.type[0], "u32"), length=2, order=order)
        else:
            done.append(row)
    return done


def scaled(scale: float, offset: float = 0.0) -> dict[str, object]:
    """Cells of value = raw * scale + offset, without the noise of binary fractions."""
    return {"scale": f"{scale:.10g}", "offset": f"{offset:.10g}" if offset else None}
