"""What transactions carry, many at once: register, quantity, values, and which of these are others than last time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from dissectors.values import AREAS, logical

from ..tables.columns import Decoded, decode
from .table import PIECE

if TYPE_CHECKING:
    from .bus import Bus

_AREAS: Final = tuple(AREAS)  # by AreaCode, from 1 on


@dataclass(frozen=True, slots=True)
class TransactionValues:
    """One transaction: `row` begins it, `answer` is -1 for none.

    `register` is the logical number of the first that it speaks of, empty for none; `values` are those read, or else
    written; `changed` the places among them of which the last good answer to this poll said otherwise: `before`.
    """

    row: int
    answer: int
    register: str = ""
    quantity: int = -1
    values: tuple[int, ...] = ()
    changed: frozenset[int] = frozenset()
    before: tuple[int, ...] = ()


class _CarriedRows:
    """Some rows, decoded."""

    def __init__(self, bus: Bus, rows: Sequence[int]) -> None:
        self._decoded: dict[int, tuple[Decoded, int]] = {}
        wanted = np.unique(np.array([row for row in rows if row >= 0], np.int64))
        for number in np.unique(wanted // PIECE).tolist():
            own = wanted[wanted // PIECE == number]
            decoded = decode(bus.batch(own))
            self._decoded.update((int(row), (decoded, i)) for i, row in enumerate(own.tolist()))

    def address(self, row: int) -> tuple[int, int, int]:
        """Area, address and quantity; -1 for none."""
        decoded, i = self._decoded[row]
        return int(decoded.area[i]), int(decoded.address[i]), int(decoded.quantity[i])

    def values(self, row: int) -> tuple[int, ...]:
        """None where the row is not here."""
        if row not in self._decoded:
            return ()
        decoded, i = self._decoded[row]
        return tuple(decoded.values_of(i).tolist())


def poll_values(bus: Bus, rows: Sequence[int]) -> list[TransactionValues]:
    """What the transactions that these rows begin carry."""
    partners = bus.table.take("partner", np.array(rows, np.int64))
    partners = np.where(partners < bus.count, partners, -1).tolist()  # live: the answer's row may not be whole yet
    before = [-1 if answer < 0 else _before(bus, answer) for answer in partners]
    carried = _CarriedRows(bus, [*rows, *partners, *before])
    polls = []
    for row, answer, last in zip(rows, partners, before, strict=True):
        area, address, quantity = carried.address(row)
        values, old = carried.values(answer) or carried.values(row), carried.values(last)
        changed = {i for i, value in enumerate(values) if len(old) == len(values) and old[i] != value}
        register = logical(address, _AREAS[area - 1]) if area and address >= 0 else ""
        polls.append(TransactionValues(row, answer, register, quantity, values, frozenset(changed), old))
    return polls


def _before(bus: Bus, answer: int) -> int:
    last = bus.polls.before(answer)
    return -1 if last is None else last
