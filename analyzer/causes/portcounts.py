"""What comes in at each port of a tap: requests, responses, and frames that may as well be the other kind."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ..deframing.directions import either_way
from ..tables.schema import Kind, Protocol
from .rowcolumns import RowColumns
from .samples import READ_REQUEST

_OF_EIGHT: Final = np.isin(np.arange(256), (1, 2, 3, 4, 5, 6))  # whose requests have so many bytes
_COUNTED: Final = np.isin(np.arange(256), (1, 2, 3, 4))  # whose answers have a byte count,
_REGISTERS: Final = np.isin(np.arange(256), (3, 4))
_AROUND: Final = 5  # and so many bytes besides


def count_by_port(ports: Mapping[int, Counter[str]], table: RowColumns) -> None:
    """Count these rows by their ports; `ports` makes a counter where there is none."""
    rows = table.rows
    asks = rows.kind == Kind.REQUEST
    right = (rows.kind != Kind.NOISE) & rows.check
    port = rows.port
    misshapen, alike = _misshapen(table, right), either_way(rows)
    for number in np.flatnonzero(np.bincount(port)).tolist():
        here = port == number
        tally = ports[number]
        tally["requests"] += int(np.count_nonzero(here & right & asks))
        tally["responses"] += int(np.count_nonzero(here & right & ~asks))
        tally["misshapen"] += int(np.count_nonzero(here & misshapen))
        tally["alike"] += int(np.count_nonzero(here & alike))


def _misshapen(table: RowColumns, right: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Right frames that are not as long as what they are said to be, and read like the other kind."""
    rows, asks = table.rows, table.rows.kind == Kind.REQUEST
    of_eight = right & (rows.protocol == Protocol.RTU) & _OF_EIGHT[rows.function]
    misshapen: NDArray[np.bool_] = of_eight & asks & (rows.length != READ_REQUEST)
    counted = (of_eight & ~asks & _COUNTED[rows.function] & (rows.length == READ_REQUEST)).nonzero()[0]
    odd = _REGISTERS[rows.function[counted]]  # three bytes of data are no registers, whatever the count says
    misshapen[counted] = odd | (table.data[rows.at[counted] + 2] + _AROUND != READ_REQUEST)
    return misshapen
