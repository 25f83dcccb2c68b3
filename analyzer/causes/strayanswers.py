"""Right answers that are not those to the request before them: late, double, or to nothing."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np

from ..tables.schema import Kind
from ..tables.transactions import ECHOED
from .exchanges import ANSWERED, Ending, Exchanges, Stretch
from .samples import asked_in_pieces
from .unitledger import UnitLedger

_BACK: Final = 2  # exchanges
_RESPONSE, _BROADCAST = int(Kind.RESPONSE), int(Ending.BROADCAST)


def count_others(part: Stretch, unit_of: Callable[[int], UnitLedger], *, timed: bool) -> None:
    """Count the right answers behind a request that are not its, for the unit that sent each (`unit_of`)."""
    exchanges = part.exchanges
    if not (exchanges.strays.any() or exchanges.late.any()):
        return
    for i in np.flatnonzero((exchanges.strays > 0) | (exchanges.late > 0)).tolist():
        rows, own = part.table.rows, int(exchanges.answer[i])
        to_all = exchanges.outcome[i] == _BROADCAST
        for row in part.rows_of(i):
            number = int(rows.unit[row])
            if row == own or rows.kind[row] != _RESPONSE or not rows.check[row] or not number:
                continue
            if not ANSWERED[rows.function[row]] or _is_asked_in_pieces(part, i, row):
                continue
            if ECHOED[rows.function[row]] and not rows.exception[row]:
                waited = timed and own < 0
                unit_of(number).add_echo(int(rows.t_start_ns[row] - exchanges.t_asked[i]) if waited else -1)
            if to_all and rows.request[row] < 0 and rows.function[row] == exchanges.function[i]:
                unit_of(number).called += 1
            elif 0 <= own < row and number == exchanges.unit[i]:
                unit_of(number).doubles += 1
            elif rows.request[row] >= 0:
                unit_of(number).late += 1
            elif number == exchanges.unit[i]:
                unit_of(number).unfit += own < 0
            elif _was_answered(exchanges, i, number):
                unit_of(number).doubles += 1
            else:
                unit_of(number).strays += 1


def _is_asked_in_pieces(part: Stretch, i: int, row: int) -> bool:
    """Whether the damaged rows right before an answer, behind the request of exchange i, are the request that it answers."""
    first, table = row, part.table
    while first - 1 in part.rows_of(i) and not table.rows.check[first - 1]:
        first -= 1
    return asked_in_pieces(b"".join(map(table.bytes_of, range(first, row))), table.bytes_of(row))


def _was_answered(exchanges: Exchanges, i: int, unit: int) -> bool:
    """Whether the newest request to a unit before exchange i was answered, not long before."""
    for before in range(i - 1, max(i - 1 - _BACK, -1), -1):
        if exchanges.unit[before] == unit:
            return bool(exchanges.answer[before] >= 0)
    return False
