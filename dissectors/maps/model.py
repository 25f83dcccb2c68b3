"""A register map: what the addresses of a device hold.

One row a value (`MappedValue`), a header about the device (`RegisterMap`). The columns are declared once, in
`COLUMNS`; the table and YAML forms, the JSON Schema and the errors follow from them. Addresses are zero-based here,
whatever the file counts from. A value of several registers has an order named as in `dissectors.values`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Final, Literal

MapArea = Literal["coil", "discrete", "input", "holding"]
AREA_WORDS: Final[Mapping[str, MapArea]] = MappingProxyType(
    {
        **dict.fromkeys(("coil", "coils", "0x", "0", "do", "output", "outputs"), "coil"),
        **dict.fromkeys(("discrete", "discrete input", "discrete inputs", "contact", "1x", "1", "di"), "discrete"),
        **dict.fromkeys(("input", "input register", "input registers", "inputs", "3x", "3", "ir", "ai"), "input"),
        **dict.fromkeys(("holding", "holding register", "holding registers", "4x", "4", "hr", "ao"), "holding"),
    }
)
"""Words that people write for an area."""
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
    or the bits of a register, `minimum` and `maximum` bound the number, `other` keeps columns that nobody declared.
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
        best = None
        for row in self.rows:
            if row.area == area and row.address <= address < row.end and (best is None or row.address > best.address):
                best = row
        return best

    def within(self, area: str, address: int, quantity: int) -> list[MappedValue]:
        """The values that lie wholly in these addresses, by address."""
        end = address + quantity
        inside = (row for row in self.rows if row.area == area and address <= row.address and row.end <= end)
        return sorted(inside, key=lambda row: (row.address, row.length))
