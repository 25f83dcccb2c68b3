"""A register map: what the addresses of a device hold, and what registers mean by it.

One row a value (`MappedValue`), a header about the device (`RegisterMap`). The columns are declared once, in
`COLUMNS`; the table and YAML forms, the JSON Schema and the errors follow from them. Addresses are zero-based here,
whatever the file counts from. A value of several registers has an order named as in `dissectors.values`.

A value is the number in its unit of measure, or the words for it. Of units of measure: what a number in one is in
another, where prefixes alone make the difference.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from types import MappingProxyType
from typing import Any, Final, Literal, cast

from ..values import Order, floating, integer, ordered

MapArea = Literal["coil", "discrete", "input", "holding"]
AREA_WORDS: Final[Mapping[str, MapArea]] = MappingProxyType(
    {
        **dict.fromkeys(("coil", "coils", "0x", "0", "co", "do", "output", "outputs"), "coil"),
        **dict.fromkeys(("discrete", "discrete input", "discrete inputs", "contact", "1x", "1", "di"), "discrete"),
        **dict.fromkeys(("input", "input register", "input registers", "inputs", "3x", "3", "ir", "ai"), "input"),
        **dict.fromkeys(("holding", "holding register", "holding registers", "4x", "4", "hr", "ao"), "holding"),
    }
)
"""Words that people write for an area."""
BIT_AREAS: Final = frozenset({"coil", "discrete"})
READ_ONLY_AREAS: Final = frozenset({"input", "discrete"})
"""What holds bits, and what nobody can write."""
READ_FUNCTIONS: Final[Mapping[MapArea, int]] = MappingProxyType({"coil": 1, "discrete": 2, "holding": 3, "input": 4})
DIGIT_OF_AREA: Final[Mapping[MapArea, str]] = MappingProxyType(
    {"coil": "0", "discrete": "1", "input": "3", "holding": "4"}
)
NO_DEFAULT: Final = 0

VALUE_TYPES: Final[Mapping[str, int]] = MappingProxyType(
    {
        "bool": 1, "u16": 1, "s16": 1, "u32": 2, "s32": 2, "u64": 4, "s64": 4, "f32": 2, "f64": 4,
        "bcd16": 1, "bcd32": 2, "bits": 1, "enum": 1, "text": NO_DEFAULT, "time": 2,
    }
)  # fmt: skip
"""Types and their length in registers; a text says its own."""
ANY_LENGTH: Final = frozenset({"bits", "enum", "text", "time"})


class MapError(ValueError):
    """A map that cannot be used; `str()` is one line: file, row, column, and what was expected."""


class MissingLibraryError(MapError):
    """A file of maps needs a `library` that is not installed, and that an `extra` of this package brings."""

    def __init__(self, what: str, library: str, extra: str) -> None:
        super().__init__(f"{what} needs {library}")
        self.what, self.library, self.extra = what, library, extra


@dataclass(frozen=True, slots=True)
class MappedValue:
    """One value of a device.

    `address` is zero-based, `length` counts registers (coils and inputs: 1). The number is raw * `scale` + `offset`,
    times ten to the power that register `scale_address` of the same area holds. `values` names the states of an enum
    or the bits of a register, `written_by` the functions that write it where not all do, `formula` how it follows
    from others (`formulas`), `minimum` and `maximum` bound the number, `other` keeps columns that nobody declared.
    """

    area: MapArea
    address: int
    name: str
    type: str
    order: str = "ABCD"
    length: int = 1
    scale: float = 1.0
    offset: float = 0.0
    scale_address: int | None = None
    unit: str = ""
    values: Mapping[int, str] = field(default_factory=dict)
    access: str = ""
    written_by: tuple[int, ...] = ()
    formula: str = ""
    minimum: float | None = None
    maximum: float | None = None
    description: str = ""
    group: str = ""
    other: Mapping[str, str] = field(default_factory=dict)

    @property
    def end(self) -> int:
        """The address behind its last."""
        return self.address + self.length

    @property
    def writable(self) -> bool:
        return "w" in self.access.lower()

    @property
    def is_float(self) -> bool:
        return self.type in ("f32", "f64")

    @property
    def is_signed(self) -> bool:
        return self.type in ("s16", "s32", "s64", "f32", "f64")


@dataclass(frozen=True, slots=True)
class DeviceSignature:
    """What tells that a device is the map's: any of these, the more the surer.

    `server_id` and `identification` are texts in the answers to functions 17 and 43; `registers` constants at
    addresses; `polls` the blocks (area, address, quantity) that its masters usually ask for.
    """

    server_id: tuple[str, ...] = ()
    identification: tuple[str, ...] = ()
    registers: tuple[tuple[MapArea, int, tuple[int, ...]], ...] = ()
    polls: tuple[tuple[MapArea, int, int], ...] = ()

    def __bool__(self) -> bool:
        return bool(self.server_id or self.identification or self.registers or self.polls)


@dataclass(frozen=True, slots=True)
class RegisterMap:
    """A device's values, in the order of the file, and what its header says."""

    device: str
    rows: tuple[MappedValue, ...]
    vendor: str = ""
    version: str = ""
    word_order: str = "ABCD"
    match: DeviceSignature = DeviceSignature()
    source: str = ""
    licence: str = ""
    other: Mapping[str, str] = field(default_factory=dict)

    @property
    def called(self) -> str:
        """Maker and device, the maker once."""
        if self.device.casefold().startswith(self.vendor.casefold()):
            return self.device
        return f"{self.vendor} {self.device}"

    def at(self, area: str, address: int) -> MappedValue | None:
        """The value that has this register, if any; of two the one that begins last."""
        there = [row for row in self.rows if row.area == area and row.address <= address < row.end]
        return max(there, key=lambda row: row.address, default=None)

    def within(self, area: str, address: int, quantity: int) -> list[MappedValue]:
        """The values that lie wholly in these addresses, by address."""
        end = address + quantity
        inside = (row for row in self.rows if row.area == area and address <= row.address and row.end <= end)
        return sorted(inside, key=lambda row: (row.address, row.length))


Meaning = int | float | str | None


@dataclass(frozen=True, slots=True)
class MappedReading:
    """A value of a map as it was read: `raw` as the registers hold it, `value` in the unit of measure (None: no number,
    or a scale that is not known), `text` for people."""

    row: MappedValue
    raw: int | float | str
    value: Meaning
    text: str

    def to_json(self) -> dict[str, Any]:
        """The object that JSON lines carry."""
        row = self.row
        return {
            "area": row.area,
            "address": row.address,
            "name": row.name,
            "raw": json_number(self.raw),
            "value": json_number(self.value),
            "unit_of_measure": row.unit,
            "text": self.text,
        }


Registers = Mapping[tuple[str, int], int]
"""Registers and bits of one device by area and address."""


def readings_by_map(
    chart: RegisterMap, area: str, words: Mapping[int, int], known: Registers | None = None
) -> list[MappedReading]:
    """The values of a map that registers (by address) hold whole, by address; `known` are other registers of the device
    that are known, from which values may be computed."""
    registers = {**(known or {}), **{(area, address): word for address, word in words.items()}}
    rows = [row for row in chart.rows if row.area == area and words.keys() >= set(range(row.address, row.end))]
    return [_reading(chart, row, registers) for row in sorted(rows, key=lambda row: row.address)]


def _reading(chart: RegisterMap, row: MappedValue, registers: Registers, depth: int = 0) -> MappedReading:
    """One value, computed from others where its map says how."""
    words = [registers[row.area, address] for address in range(row.address, row.end)]
    power = registers.get((row.area, row.scale_address)) if row.scale_address is not None else 0
    reading = read_mapped(row, words, power)
    if not row.formula or isinstance(reading.raw, str):
        return reading
    from .formulas import formula_of

    def value_of(name: str) -> float | None:
        other = next((one for one in chart.rows if one.name == name), None)
        there = other is not None and all((other.area, at) in registers for at in range(other.address, other.end))
        value = _reading(chart, other, registers, depth + 1).value if other and there and depth < _DEEPEST else None
        return value if isinstance(value, int | float) else None

    formula = formula_of(row.formula)
    value = formula.value(reading.raw, value_of)
    if value is None:
        missing = ", ".join(name for name in dict.fromkeys(formula.names) if value_of(name) is None)
        return MappedReading(row, reading.raw, None, f"{reading.raw} (needs {missing or 'another state'})")
    shown = replace(row, unit=formula.unit)
    return MappedReading(shown, reading.raw, value, f"{_digits(value)} {formula.unit}".rstrip())


_DEEPEST: Final = 3  # values computed from computed ones


def read_mapped(row: MappedValue, words: Sequence[int], power: int | None = 0) -> MappedReading:
    """One value from its registers; `power` is what its scale register holds, None where that is not known."""
    kind = "bool" if row.area in BIT_AREAS else row.type
    raw = _RAW.get(kind, _whole)(row, words)
    if kind in _SHOWN:
        return MappedReading(row, raw, raw, _SHOWN[kind](row, raw))
    assert not isinstance(raw, str)
    if kind in ("bcd16", "bcd32"):
        digits = f"{raw:x}"
        if not digits.isdigit():
            return MappedReading(row, raw, None, f"0x{raw:X} (no BCD)")
        raw = int(digits)
    factor = _factor(row, power)
    if factor is None:
        return MappedReading(row, raw, None, f"{raw} (its scale, register {row.scale_address}, is not known)")
    value = _scaled(raw, factor, row.offset)
    known = _FLOAT_DIGITS if row.type == "f32" else _EXACT_DIGITS
    return MappedReading(row, raw, value, f"{_digits(value, known)} {row.unit}".rstrip())


def _whole(row: MappedValue, words: Sequence[int]) -> int:
    return integer(words, cast(Order, row.order), signed=row.is_signed)


def _float(row: MappedValue, words: Sequence[int]) -> float:
    number = floating(words, cast(Order, row.order))
    return float(f"{number:.8g}") if row.type == "f32" and math.isfinite(number) else number


def _text(row: MappedValue, words: Sequence[int]) -> str:
    data = ordered(words, "BADC" if row.order in ("BADC", "DCBA") else "ABCD")
    return data.split(b"\0")[0].decode("latin-1").strip()


def _moment(_: MappedValue, raw: Any) -> str:
    return datetime.fromtimestamp(raw, UTC).isoformat() if 0 < raw < _LAST_MOMENT else str(raw)


_LAST_MOMENT: Final = 1e11  # seconds: those of later years are no times
_RAW: Final[Mapping[str, Callable[[MappedValue, Sequence[int]], int | float | str]]] = {
    "bool": lambda _, words: words[0],
    "text": _text,
    "f32": _float,
    "f64": _float,
}
_SHOWN: Final[Mapping[str, Callable[[MappedValue, Any], str]]] = {
    "bool": lambda row, raw: row.values.get(raw, ("off", "on")[raw != 0]),
    "text": lambda _, raw: str(raw),
    "enum": lambda row, raw: row.values.get(raw, f"{raw} (a state without a name)"),
    "bits": lambda row, raw: _bit_names(row, raw),
    "time": _moment,
}


def _factor(row: MappedValue, power: int | None) -> float | None:
    """What the raw number is multiplied by; None where its scale register is not known, or holds no power of ten."""
    if row.scale_address is None:
        return row.scale
    signed = _MOST_POWER + 1 if power is None else (power ^ 0x8000) - 0x8000
    return row.scale * 10.0**signed if abs(signed) <= _MOST_POWER else None


_MOST_POWER: Final = 10


def _scaled(raw: float, scale: float, offset: float) -> int | float:
    if scale == 1 and offset == 0:
        return raw
    value = raw * scale + offset
    return float(f"{value:.{_EXACT_DIGITS}g}") if math.isfinite(value) else value


_FLOAT_DIGITS: Final = 7  # that a float of 32 bits has, and formulas of such
_EXACT_DIGITS: Final = 12  # that a scale leaves exact


def _digits(value: float, digits: int = _FLOAT_DIGITS) -> str:
    return f"{value:.{digits}g}" if isinstance(value, float) else str(value)


def _bit_names(row: MappedValue, raw: int) -> str:
    names = [row.values.get(bit, f"bit {bit}") for bit in range(16 * row.length) if raw >> bit & 1]
    return ", ".join(names) if names else "none"


def json_number(value: Any) -> Any:
    """JSON has no infinity and no NaN: those are null."""
    return None if isinstance(value, float) and not math.isfinite(value) else value


_PREFIXES: Final = {"": 1.0, "n": 1e-9, "u": 1e-6, "µ": 1e-6, "μ": 1e-6, "m": 1e-3, "k": 1e3, "M": 1e6, "G": 1e9}
_BASES: Final = (
    "V", "A", "W", "Wh", "VA", "VAh", "var", "VAr", "varh", "VArh", "Hz", "Ohm", "Ω", "F", "Pa", "bar", "g", "m", "l",
    "L", "s", "J", "N", "C", "Ah",
)  # fmt: skip
_SAME: Final = {"degc": "°c", "celsius": "°c", "degf": "°f", "percent": "%", "ohms": "ohm", "ω": "ohm", "pct": "%"}


def factor_between(one: str, other: str) -> float | None:
    """What a number in unit `one` is multiplied by to be in `other`; None where they do not measure the same."""
    left, right = _split(one), _split(other)
    if left and right:
        return left[0] / right[0] if left[1] == right[1] else None
    return 1.0 if _spelled(one) == _spelled(other) else None


def _spelled(unit: str) -> str:
    word = unit.strip().casefold()
    return _SAME.get(word, word)


def _split(unit: str) -> tuple[float, str] | None:
    """The prefix's factor and the unit without it: 1000 and W of kW."""
    return _MEASURES.get(unit.strip()) or _TYPED.get(unit.strip().casefold())


_MEASURES: Final = {
    f"{prefix}{base}": (factor, _spelled(base) if base in ("Ω", "Ohm") else base.replace("VAr", "var"))
    for base in sorted(_BASES, key=len)
    for prefix, factor in _PREFIXES.items()
}
_TYPED: Final = {  # kw, KWH: as people type; prefixes m and M are told apart by their case alone
    f"{prefix}{base.casefold()}": (factor, base)
    for prefix, factor in (("k", 1e3), ("", 1.0))
    for base in reversed(_BASES)
}
