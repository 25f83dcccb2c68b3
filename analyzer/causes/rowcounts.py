"""What rows are counted for beside their own exchange: by port, by the unit that sent what answers nothing, by request."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from typing import Final

import numpy as np

from ..deframing.directions import either_way
from ..tables.batch import Batch
from ..tables.schema import Bools, Kind, Protocol
from ..tables.transactions import ECHOED
from .exchanges import ANSWERED, Ending, Exchanges, Stretch
from .samples import READ_REQUEST, asked_in_pieces
from .unitledger import UnitLedger

_OF_EIGHT: Final = np.isin(np.arange(256), (1, 2, 3, 4, 5, 6))  # whose requests have so many bytes
_COUNTED: Final = np.isin(np.arange(256), (1, 2, 3, 4))  # whose answers have a byte count,
_REGISTERS: Final = np.isin(np.arange(256), (3, 4))
_AROUND: Final = 5  # and so many bytes besides
BACK: Final = 2  # exchanges
_RESPONSE, _BROADCAST, _SILENT = int(Kind.RESPONSE), int(Ending.BROADCAST), int(Ending.SILENT)


def count_by_port(ports: Mapping[int, Counter[str]], table: Batch) -> None:
    """What comes in at each port of a tap: requests, responses, and frames that may as well be the other kind; `ports`
    makes a counter where there is none."""
    rows = table.rows
    asks, right = rows.kind == Kind.REQUEST, (rows.kind != Kind.NOISE) & rows.check
    counted = {"requests": right & asks, "responses": right & ~asks, "misshapen": _misshapen(table, right),
               "alike": either_way(rows)}  # fmt: skip
    for number in np.flatnonzero(np.bincount(rows.port)).tolist():
        here = rows.port == number
        ports[number].update({name: int(np.count_nonzero(here & which)) for name, which in counted.items()})


def _misshapen(table: Batch, right: Bools) -> Bools:
    """Right frames that are not as long as what they are said to be, and read like the other kind."""
    rows, asks = table.rows, table.rows.kind == Kind.REQUEST
    of_eight = right & (rows.protocol == Protocol.RTU) & _OF_EIGHT[rows.function]
    misshapen: Bools = of_eight & asks & (rows.length != READ_REQUEST)
    counted = (of_eight & ~asks & _COUNTED[rows.function] & (rows.length == READ_REQUEST)).nonzero()[0]
    odd = _REGISTERS[rows.function[counted]]  # three bytes of data are no registers, whatever the count says
    misshapen[counted] = odd | (table.data[rows.at[counted] + 2] + _AROUND != READ_REQUEST)
    return misshapen


def count_others(part: Stretch, before: Exchanges, unit_of: Callable[[int], UnitLedger], *, timed: bool) -> None:
    """Count the right answers behind a request that are not its (late, double, to nothing), for the unit that sent each
    (`unit_of`). `before`: the exchanges right before the stretch, `BACK` of them."""
    exchanges, rows = part.exchanges, part.table.rows
    for i in np.flatnonzero((exchanges.strays > 0) | (exchanges.late > 0)).tolist():
        own, first = int(exchanges.answer[i]), int(exchanges.row[i]) + 1
        mine = rows[first : exchanges.row_end[i]]
        right = (mine.kind == _RESPONSE) & mine.check & (mine.unit > 0) & ANSWERED[mine.function]
        senders = set[int]()
        for row in (first + right.nonzero()[0]).tolist():
            if row != own and not _is_asked_in_pieces(part.table, first, row):
                waited = int(rows.t_start_ns[row] - exchanges.t_asked[i]) if timed and own < 0 else -1
                unit = unit_of(int(rows.unit[row]))
                senders.add(unit.unit * (rows.request[row] < 0))
                if ECHOED[rows.function[row]] and not rows.exception[row]:
                    unit.add_echo(waited)
                _count_other(unit, part, i, row, _was_answered(before, exchanges, i, unit.unit))
        if exchanges.outcome[i] == _SILENT and (asked := int(exchanges.unit[i])) in senders:
            unit_of(asked).unfit_alone += 1


def _count_other(unit: UnitLedger, part: Stretch, i: int, row: int, was_answered: bool) -> None:
    exchanges, rows = part.exchanges, part.table.rows
    own, is_asked, is_late = int(exchanges.answer[i]), unit.unit == exchanges.unit[i], rows.request[row] >= 0
    if exchanges.outcome[i] == _BROADCAST and not is_late and rows.function[row] == exchanges.function[i]:
        unit.called += 1
    elif is_asked and 0 <= own < row:
        unit.doubles += 1
    elif is_late:
        unit.late += 1
    elif is_asked:
        unit.unfit += own < 0
    elif was_answered:
        unit.doubles += 1
    else:
        unit.strays += 1


def _is_asked_in_pieces(table: Batch, first: int, row: int) -> bool:
    """Whether the damaged rows right before an answer, from the first one behind its request on, are what it answers."""
    right = table.rows.check[first:row].nonzero()[0]
    begin = first + int(right[-1]) + 1 if len(right) else first
    return asked_in_pieces(b"".join(map(table.bytes_of, range(begin, row))), table.bytes_of(row))


def _was_answered(before: Exchanges, exchanges: Exchanges, i: int, unit: int) -> bool:
    """Whether the newest request to a unit before exchange i was answered, not long before."""
    newest = slice(max(i - BACK, 0), i)
    units = np.concatenate((before.unit, exchanges.unit[newest]))[-BACK:]
    answers = np.concatenate((before.answer, exchanges.answer[newest]))[-BACK:]
    return bool((answers[units == unit][-1:] >= 0).any())
