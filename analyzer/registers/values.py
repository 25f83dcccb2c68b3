"""What is said of one value: its place, its reading, its role, how sure, and why."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from dissectors.maps.model import MapArea, json_number

Number = int | float | str | None


@dataclass(frozen=True, slots=True)
class OtherReading:
    """What else it may be: a reading that shares a register with the answer."""

    address: int
    words: int
    kind: str
    order: str | None
    confidence: float

    def to_json(self) -> dict[str, Any]:
        return {name: json_number(getattr(self, name)) for name in self.__slots__}


@dataclass(frozen=True, slots=True)
class RegisterValue:
    """A value of `words` registers from `address` on (zero-based).

    `kind` is int, float, bits, enum, text, time, bcd, constant or unknown; `order` None of one register; `confidence`
    from 0 to 1; `bits` the log2 odds over `runner_up`; `minimum`, `maximum` and `last` are numbers as the registers
    hold them, or a text. `name`, `scale` and `unit_of_measure` come from a map.
    """

    unit: int
    area: MapArea
    address: int
    words: int
    kind: str
    signed: bool
    order: str | None
    role: str | None
    confidence: float
    bits: float
    why: str
    readings: int
    changes: int
    minimum: Number
    maximum: Number
    last: Number
    runner_up: OtherReading | None = None
    name: str | None = None
    scale: float | None = None
    unit_of_measure: str | None = None

    @property
    def type(self) -> str:
        """The type as a map names it: u16, s32, f32, text ..."""
        width = 16 * self.words
        match self.kind:
            case "float":
                return f"f{width}"
            case "bcd":
                return f"bcd{width}"
            case "bits" if self.area in ("coil", "discrete"):
                return "bool"
            case "bits" | "enum" | "text" | "time":
                return self.kind
            case _:
                return f"{'s' if self.signed else 'u'}{width}"

    @property
    def key(self) -> tuple[int, str, int]:
        """Where it is: unit, area, address."""
        return self.unit, self.area, self.address

    def to_json(self) -> dict[str, Any]:
        """The line of `rtuscope registers --json`."""
        line: dict[str, Any] = {}
        for slot in self.__slots__:
            value = getattr(self, slot)
            if isinstance(value, OtherReading):
                value = value.to_json()
            line[{"minimum": "min", "maximum": "max"}.get(slot, slot)] = json_number(value)
        return line
