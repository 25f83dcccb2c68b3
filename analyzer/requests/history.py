"""Which requests of a unit got what, in order: a bounded record of visits.

A visit is a request with the retries behind it, and ends as the last of them does. Of a long capture whole stretches
stay, spread evenly, so that what stands beside a visit is what stood beside it on the bus.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum
from typing import Final

import numpy as np
from numpy.typing import NDArray

_BLOCK: Final = 64  # visits of a unit that stay together
_BLOCKS: Final = 64


class Got(IntEnum):
    """What a request got; below 256 it is an exception code."""

    ANSWER = 0
    SILENCE = 256
    DAMAGE = 257  # something came, or nobody knows
    HALF = 258  # an answer whose byte count is the quantity asked for


@dataclass(slots=True)
class _UnitVisits:
    blocks: list[NDArray[np.int64]] = field(default_factory=list)  # of shape (visits, 2): poll, got
    newest: list[NDArray[np.int64]] = field(default_factory=list)
    held: int = 0  # visits in `newest`
    number: int = 0  # of the block that `newest` becomes
    stride: int = 1

    def add(self, visits: NDArray[np.int64]) -> None:
        """Further visits."""
        self.newest.append(visits)
        self.held += len(visits)
        if self.held < _BLOCK:
            return
        whole = np.concatenate(self.newest)
        for begin in range(0, len(whole) - _BLOCK + 1, _BLOCK):
            if self.number % self.stride == 0:
                self.blocks.append(whole[begin : begin + _BLOCK].copy())
            self.number += 1
        rest = whole[len(whole) // _BLOCK * _BLOCK :]
        self.newest, self.held = [rest.copy()], len(rest)
        while len(self.blocks) > _BLOCKS:
            self.blocks, self.stride = self.blocks[::2], 2 * self.stride


class RequestHistory:
    """Requests in the order of the bus; visits by unit."""

    _records: dict[int, _UnitVisits]
    _waiting: NDArray[np.int64]

    def __init__(self) -> None:
        self._records = {}
        self._waiting = np.zeros((0, 3), np.int64)  # the newest request, which a retry may follow: unit, poll, got

    def feed(
        self, unit: NDArray[np.uint8], poll: NDArray[np.int64], got: NDArray[np.int64], again: NDArray[np.bool_]
    ) -> None:
        """The next requests: their units, a number for what each asks, what it got, and whether it repeats the bytes of
        the one before."""
        if not len(unit):
            return
        rows = np.concatenate((self._waiting, np.stack((unit.astype(np.int64), poll, got), axis=1)))
        again = np.concatenate((np.zeros(len(self._waiting), np.bool_), again))
        lost = (rows[:-1, 2] == Got.SILENCE) | (rows[:-1, 2] == Got.DAMAGE)
        same = (rows[1:, :2] == rows[:-1, :2]).all(axis=1)  # of bytes with one check value as well
        settled = rows[:-1][~(again[1:] & same & lost)]
        self._waiting = rows[-1:].copy()
        self._enter(settled)

    def _enter(self, rows: NDArray[np.int64]) -> None:
        if not len(rows):
            return
        order = np.argsort(rows[:, 0], kind="stable")
        ordered = rows[order]
        begins = np.flatnonzero(np.diff(ordered[:, 0], prepend=-1))
        for begin, end in zip(begins.tolist(), [*begins[1:].tolist(), len(ordered)], strict=True):
            record = self._records.setdefault(int(ordered[begin, 0]), _UnitVisits())
            record.add(ordered[begin:end, 1:])

    def visits(self, unit: int) -> list[NDArray[np.int64]]:
        """Stretches of visits of a unit, each of shape (visits, 2): the number of what was asked, what it got."""
        record = self._records.get(unit)
        parts = [*record.blocks, np.concatenate(record.newest)] if record is not None else []
        if len(self._waiting) and self._waiting[0, 0] == unit:
            last = self._waiting[:, 1:]
            parts = [*parts[:-1], np.concatenate((parts[-1], last))] if parts else [last]
        return [part for part in parts if len(part)]
