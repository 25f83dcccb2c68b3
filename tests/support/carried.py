"""What registers, coils and inputs were, as far as one frame of a transaction says: numbers by address.

An answer to a read carries values; an answer to a write says that the values of its request were taken. Fields know
their addresses (`dissectors`), so nothing is known here of functions but that.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Final

from analyzer.tables.batch import Frame
from dissectors.annotation import annotate
from dissectors.fields import Field
from dissectors.functions import function
from dissectors.length_rules import Role

# Area: its name in topics, and the letter before an address.
_AREAS: Final = {"0x": ("coils", "b"), "1x": ("discrete", "b"), "3x": ("input", "r"), "4x": ("holding", "r")}


@dataclass(frozen=True, slots=True)
class Values:
    """Values of one area, by name: `r107` a register's unsigned number, `b19` a coil or input, 0 or 1."""

    area: str  # coils, discrete, input or holding
    numbers: dict[str, int]


def values_of(frame: Frame, fields: Iterable[Field]) -> Values | None:
    """The values that an answer carries or confirms; None for a frame that does neither.

    `fields` are the frame's. Only an answer to a known request, with a right check value and no exception, tells any.
    """
    declared = function(frame.function)
    if declared is None or declared.area is None or frame.request_bytes is None:
        return None
    if frame.role is not Role.RESPONSE or not frame.crc_ok or frame.exception is not None:
        return None
    area, letter = _AREAS[declared.area]
    asked = annotate(Frame(frame.row, frame.request_bytes).adu, Role.REQUEST)
    numbers = {f"{letter}{address}": value for address, value in (*_placed(asked), *_placed(fields))}
    return Values(area, numbers) if numbers else None


def _placed(fields: Iterable[Field]) -> Iterator[tuple[int, int]]:
    """(address, value) of each field that has both; a single write has them in two fields, one after the other."""
    before: int | None = None
    for field in fields:
        if isinstance(field.value, int) and field.address is not None:
            yield field.address, int(field.value)
        elif isinstance(field.value, int) and field.name == "register_value" and before is not None:
            yield before, field.value
        elif isinstance(field.value, int) and field.name == "output_value" and before is not None:
            yield before, int(field.value != 0)
        before = field.value if isinstance(field.value, int) and field.name.endswith("_address") else None
        yield from _placed(field.fields)
