"""A field: a stretch of a frame with its name, its value and what to say of it.

Fields form a tree. Offsets are in the ADU's bytes (`Adu.data`). Top-level fields tile the ADU; children lie inside
their parent. Where bits are meant, `bit` is the lowest one, counted from the least significant bit of the field's
bytes read as one big-endian number, and `bits` says how many.
"""

from __future__ import annotations

from dataclasses import dataclass

Value = int | float | str | bool | None


@dataclass(frozen=True, slots=True)
class Field:
    """One field of a frame.

    `value` is a number, truth value or text as JSON has them (opaque bytes: their hex; fields that only hold other
    fields: None); `raw` is the hex of its bytes; `text` is for people; `problem` is what breaks the specification.
    `address` is the physical address of a register, coil or input, where it is known.
    """

    name: str
    start: int
    length: int
    value: Value
    raw: str
    text: str
    bit: int | None = None
    bits: int | None = None
    fields: tuple[Field, ...] = ()
    problem: str | None = None
    address: int | None = None

    def to_json(self) -> dict[str, object]:
        """The field as the JSON object that exports write; keys that say nothing are left out."""
        line: dict[str, object] = {
            "name": self.name,
            "start": self.start,
            "length": self.length,
            "value": self.value,
            "raw": self.raw,
            "text": self.text,
        }
        if self.bit is not None:
            line["bit"] = self.bit
            line["bits"] = self.bits
        if self.address is not None:
            line["address"] = self.address
        if self.problem is not None:
            line["problem"] = self.problem
        if self.fields:
            line["fields"] = [field.to_json() for field in self.fields]
        return line
