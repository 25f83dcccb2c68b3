"""What is seen while a declaration reads bytes: values by name so far, fields so far, and what the request said."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from .fields import Field, Value


@dataclass(slots=True)
class Recorder:
    """The state of one reading.

    `data` is the ADU, `offset` and `end` where in it the declared part begins and ends. `brief` asks for the
    short texts of a summary and no children of long blocks. `request` holds the numbers of the request that is
    answered, by name; `echoes` names those that the response must repeat.
    """

    data: bytes
    offset: int
    end: int
    brief: bool = False
    request: Mapping[str, int] = field(default_factory=dict)
    echoes: tuple[str, ...] = ()
    values: dict[str, object] = field(default_factory=dict)
    fields: list[Field] = field(default_factory=list)

    def number(self, name: str | None) -> int | None:
        """A number by name: of this PDU, else of the request."""
        if name is None:
            return None
        found = self.values.get(name)
        if found is None:
            found = self.request.get(name)
        return found if isinstance(found, int) else None

    def make(
        self,
        name: str,
        start: int,
        length: int,
        value: Value,
        text: str,
        fields: tuple[Field, ...] = (),
        problem: str | None = None,
    ) -> Field:
        """A field by its place in the declared part."""
        at = self.offset + start
        raw = self.data[at : at + length].hex()
        return Field(name, at, length, value, raw, text, None, None, fields, problem)
