"""What the polled registers really hold: lines of `NAME.registers.jsonl`, keys as in `rtuscope registers --json`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from dissectors.maps.model import MapArea, MappedValue

_KINDS = {"bool": "bits", "bits": "bits", "enum": "enum", "text": "text", "time": "time"}


@dataclass(frozen=True, slots=True)
class TruthRegister:
    """One value of a map that a master asked for."""

    unit: int
    area: MapArea
    address: int
    words: int
    kind: str
    signed: bool
    order: str | None
    name: str
    scale: float
    unit_of_measure: str

    @classmethod
    def of(cls, unit: int, row: MappedValue) -> TruthRegister:
        """The truth about a row of a map."""
        kind = "float" if row.is_float else "bcd" if row.type.startswith("bcd") else _KINDS.get(row.type, "int")
        order = row.order if row.length > 1 and kind != "text" else None
        signed = row.is_signed
        return cls(unit, row.area, row.address, row.length, kind, signed, order, row.name, row.scale, row.unit)

    def to_json(self) -> dict[str, Any]:
        """The line."""
        return {name: getattr(self, name) for name in self.__slots__}
