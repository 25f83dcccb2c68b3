"""The truth about a simulated bus: what was really sent, what is wrong with it, and what polled registers really hold.

Lines of `NAME.truth.jsonl`, one a frame, then one a defect; and of `NAME.registers.jsonl`, keys as in `rtuscope
registers --json`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from dissectors.maps.model import MapArea, MappedValue


@dataclass(frozen=True, slots=True)
class TruthFrame:
    """A frame that a client or server sent, and what of it the tap could see.

    `adu` as sent, CRC included; `function` without the exception bit; `pair` the id of the request that this response
    answers, None in a request; `start` and `length` say where its bytes stand in the capture's stream, `length` less
    than what was sent where bytes were lost; `fault` what the wire did to it, None where nothing; `intact`: every byte
    stands in the capture, unchanged and contiguous.
    """

    id: int
    direction: str
    unit: int
    function: int
    adu: bytes
    pair: int | None
    start: int
    length: int
    fault: str | None = None

    @property
    def intact(self) -> bool:
        return self.fault is None

    def to_json(self) -> dict[str, Any]:
        """The frame as an object of a truth file."""
        line: dict[str, Any] = {
            "id": self.id,
            "dir": self.direction,
            "unit": self.unit,
            "fc": self.function,
            "hex": self.adu.hex(),
            "pair": self.pair,
            "sent": len(self.adu),
        }
        if self.fault is not None:
            line["fault"] = self.fault
        return {**line, "intact": self.intact, "start": self.start, "length": self.length}


@dataclass(frozen=True, slots=True)
class TruthFinding:
    """Something that is wrong, which an analyzer should find.

    `code` as in the findings' table; `start` and `length` the bytes in the capture's stream that it stands on, -1 and 0
    where it is about the bus as a whole. `detail` says the rest (byte, bit, value, places that are all the same, the
    name of a convention); `also` names codes that are as true of these bytes, but need not be found.
    """

    code: str
    start: int
    length: int
    detail: Mapping[str, Any] = field(default_factory=dict)
    also: tuple[str, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """The finding as an object of a truth file."""
        line: dict[str, Any] = {"finding": self.code, "start": self.start, "length": self.length, **self.detail}
        return {**line, "also": list(self.also)} if self.also else line


# What to simulate: a wire, a tap and perhaps a defect by name, how long, and the seed that fixes every draw.


@dataclass(frozen=True, slots=True)
class Scenario:
    """A bus to simulate.

    `wire` and `tap` name entries of `WIRES` and `TAPS`; without a wire a client polls its list in turn and all goes
    well. `transactions` counts requests, repeated ones included;
    `baud` (bit/s) and `units` (how many servers) are drawn where None; `char_bits` as in `captures.LineSettings`.
    `maps` name the register maps of the servers, MAP or MAP@UNIT: a file, or a map that is shipped.
    `defect` is the code of a finding: a healthy bus with that one thing wrong, again and again, on the wire `clean`.
    """

    wire: str | None
    tap: str
    transactions: int = 400
    seed: int = 0
    baud: int | None = None
    char_bits: int = 11
    units: int | None = None
    defect: str | None = None
    maps: tuple[str, ...] = ()


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
