"""Whether what was heard is Modbus at all: asked before anything is said of causes, by reports and live views alike.

Two ways not to be. Frames have the CRC of Modbus, and few of them its contents: meters have such protocols of theirs.
Or frames are of another protocol that shows by its structure, and those of Modbus are no more than chance makes, whose
check value is right once in 65,536. Of bytes that are no frame of anything nothing is said.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from dissectors.declaration import USER_DEFINED
from dissectors.foreign import MERCURY_200, NAMES
from dissectors.length_rules import Role
from dissectors.lengths import revision, rule

from .schema import Kind, Protocol, Rows

_LEAST: Final = 24  # bytes of another protocol
_TIMES: Final = 2  # as many as those of Modbus, where both have its CRC
_SHARE: Final = 0.25  # of all bytes
_CHANCE: Final = 1 << 14  # bytes that make a right frame of a declared function by chance, about
_LAST_EXCEPTION: Final = 0x0B
_SAME: Final = NAMES.index(MERCURY_200)  # from here on names are of protocols with the CRC of Modbus


class ModbusVerdict:
    """Rows in; what else than Modbus they are."""

    _foreign: NDArray[np.int64]
    _odd: int
    _legal: int
    _frames: int
    _bytes: int

    def __init__(self) -> None:
        self._foreign = np.zeros(len(NAMES), np.int64)  # bytes
        self._odd = self._legal = self._frames = self._bytes = 0

    def feed(self, rows: Rows) -> None:
        """The next rows."""
        length, right = rows.length, (rows.kind != Kind.NOISE) & rows.check
        self._bytes += int(length.sum())
        if np.count_nonzero(rows.foreign):
            self._foreign += np.bincount(rows.foreign, length, len(NAMES)).astype(np.int64)
        of_modbus = _declared(revision()).take(rows.function) & (rows.exception <= _LAST_EXCEPTION)
        of_modbus |= rows.protocol == Protocol.TCP
        legal = right & of_modbus
        self._frames += int(np.count_nonzero(legal))
        self._legal += int(length[legal].sum())
        self._odd += int(length[right & ~of_modbus & ~_FREE.take(rows.function)].sum())

    @property
    def foreign(self) -> str:
        """The other protocol, where this is no Modbus; nothing where it is, or where nobody knows."""
        same, others = int(self._foreign[_SAME:].sum()), int(self._foreign[1:_SAME].sum())
        same += self._odd if same else 0  # without, the deframer took them for a vendor's own
        least = max(_LEAST, _SHARE * self._bytes)
        if others >= least and self._frames <= 1 + self._bytes // _CHANCE:
            return NAMES[1 + int(self._foreign[1:_SAME].argmax())]
        if same < max(least, _TIMES * self._legal):
            return ""
        return NAMES[_SAME + int(self._foreign[_SAME:].argmax())]


def _functions(codes: Iterable[int]) -> NDArray[np.bool_]:
    table = np.zeros(256, np.bool_)
    table[list(codes)] = True
    return table


_FREE: Final = _functions(USER_DEFINED)


@cache
def _declared(_revision: int) -> NDArray[np.bool_]:
    """Functions that somebody has declared."""
    return _functions(code for code in range(128) if rule(code, Role.REQUEST) is not None) & ~_FREE
