"""Rows that are no Modbus but another protocol, named: noise that is its frames, and frames that only look like RTU.

What a row is hangs on it and on the rows before it on its port, never on how they were read.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from dissectors.adu import EXCEPTION
from dissectors.foreign import NAMES, MeterTalk, foreign_bytes
from dissectors.length_rules import Role
from dissectors.lengths import rule, sound_roles
from dissectors.registry import function_class

from ..tables.schema import Kind, Protocol, Rows
from .rules import Bytes

_LEAST: Final = 4  # bytes of noise that may be a frame of something
_PART: Final = 0.5  # of a row's bytes that must be
_NUMBER: Final = {name: number for number, name in enumerate(NAMES)}
_READS: Final = (1, 2, 3, 4)
_WRITES: Final = (5, 6)
_BLOCKS: Final = (15, 16)
_DIAGNOSTICS: Final = 8


class ForeignTalk:
    """Marks such rows, batch after batch in wire order: `foreign` is set, and a frame becomes noise."""

    def __init__(self) -> None:
        self._talks: dict[int, MeterTalk] = {}  # by port

    def mark(self, rows: Rows, data: Bytes) -> None:
        """Mark them in place, before frames are numbered."""
        kind = rows["kind"].copy()
        plain = rows["protocol"] == Protocol.RTU
        noise = (kind == Kind.NOISE) & plain & (rows["length"] >= _LEAST)
        odd = (kind != Kind.NOISE) & plain & rows["check"]
        odd[odd] = _unusual(rows, data, np.flatnonzero(odd))
        for row in np.flatnonzero(noise | odd).tolist():
            adu = _bytes(rows, data, row)
            if noise[row]:
                rows["foreign"][row] = self._of_noise(adu, int(rows["port"][row]))
                continue
            if sound_roles(adu[1:-2]) and adu[1] != _DIAGNOSTICS:  # which is of any length
                continue
            talk = self._talks.setdefault(int(rows["port"][row]), MeterTalk())
            undeclared = function_class(adu[1] & ~EXCEPTION) != "user-defined" and (
                adu[1] > EXCEPTION or rule(adu[1], Role.REQUEST) is None
            )
            if name := talk.name(adu, undeclared=undeclared):
                rows["foreign"][row], rows["kind"][row] = _NUMBER[name], Kind.NOISE
                for column in ("unit", "function", "exception", "check"):
                    rows[column][row] = 0

    def _of_noise(self, octets: bytes, port: int) -> int:
        name, _, covered = foreign_bytes(octets)
        if covered < _PART * len(octets) and port in self._talks:
            name, covered = self._talks[port].in_noise(octets)
        return _NUMBER[name] if covered >= _PART * len(octets) else 0


def _bytes(rows: Rows, data: Bytes, row: int) -> bytes:
    at = int(rows["at"][row])
    return data[at : at + int(rows["length"][row])].tobytes()


def _unusual(rows: Rows, data: Bytes, which: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Which of these frames are not as long as the commonest functions are: a look that costs little."""
    at, length = rows["at"][which], rows["length"][which].astype(np.int64)
    function = data.take(at + 1)
    last = at + length - 1
    usual = (length == 8) & np.isin(function, (*_READS, *_WRITES, *_BLOCKS, _DIAGNOSTICS))
    usual |= np.isin(function, _READS) & (length == 5 + data.take(np.minimum(at + 2, last)).astype(np.int64))
    usual |= np.isin(function, _BLOCKS) & (length == 9 + data.take(np.minimum(at + 6, last)).astype(np.int64))
    usual |= (function > EXCEPTION) & (length == 5)
    unusual: NDArray[np.bool_] = ~usual
    return unusual
