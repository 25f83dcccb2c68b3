"""The answer to the same poll before an answer: what changed from one to the next."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from ..tables.schema import Kind
from .table import PIECE

if TYPE_CHECKING:
    from dissectors.fields import Field

    from .bus import Bus

_TRIED: Final = 512  # answers of the same unit and function, before it is given up
_LOOKED: Final = 1 << 18  # rows


def answer_before(bus: Bus, row: int) -> int | None:
    """The row of the newest good answer before `row` that answers the same request; None where none is near."""
    table = bus.table
    asked = bus.partner(row)
    if table.value("kind", row) != Kind.RESPONSE or asked is None:
        return None
    question = bus.captured(asked)
    unit, function, length = (table.value(name, row) for name in ("unit", "function", "length"))
    tried = 0
    for number, low, high in reversed(list(table.slices(max(0, row - _LOOKED), row))):
        columns = {name: table.column(number, name)[low:high] for name in ("kind", "unit", "function", "length")}
        alike: NDArray[np.bool_] = columns["kind"] == Kind.RESPONSE
        for name, value in (("unit", unit), ("function", function), ("length", length)):
            alike &= columns[name] == value
        alike &= table.column(number, "check")[low:high]
        for place in np.flatnonzero(alike)[::-1].tolist():
            other = number * PIECE + low + place
            partner = bus.partner(other)
            if partner is not None and bus.captured(partner) == question:
                return int(other)
            tried += 1
            if tried >= _TRIED:
                return None
    return None


def changed(before: tuple[Field, ...], now: tuple[Field, ...]) -> Iterator[tuple[Field, Field]]:
    """Fields of two frames of one shape that say something else, the innermost: as it was, as it is. No check value."""
    for old, new in zip(before, now, strict=False):
        if new.fields and len(old.fields) == len(new.fields):
            yield from changed(old.fields, new.fields)
        elif old.text != new.text and new.name != "crc":
            yield old, new
