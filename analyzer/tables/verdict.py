"""Whether what was heard is Modbus at all: asked before anything is said of causes, by reports and live views alike.

Weighed in bytes: frames of other protocols that were known by their structure, frames whose CRC is right and whose
contents nobody has declared, and frames of Modbus. Of bytes that are no frame of anything nothing is said.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from dissectors.declaration import USER_DEFINED
from dissectors.foreign import NAMES, SAME_CRC
from dissectors.length_rules import Role
from dissectors.lengths import rule
from dissectors.limits import EXCEPTION

from .schema import Kind, Protocol, Rows

_LEAST: Final = 24  # bytes of another protocol
_TIMES: Final = 4  # as many as of Modbus: one check value in 65,536 is right by chance
_SHARE: Final = 0.25  # of all bytes


class ModbusVerdict:
    """Rows in; what else than Modbus they are."""

    def __init__(self) -> None:
        self._foreign = np.zeros(len(NAMES), np.int64)  # bytes
        self._odd = self._legal = self._bytes = 0

    def feed(self, rows: Rows) -> None:
        """The next rows."""
        length = rows.length
        self._bytes += int(length.sum())
        if np.count_nonzero(rows.foreign):
            self._foreign += np.bincount(rows.foreign, length, len(NAMES)).astype(np.int64)
        right = (rows.kind != Kind.NOISE) & rows.check
        by_function = np.bincount(rows.function[right], length[right], 256)
        odd = by_function[_undeclared()].sum()
        if odd:
            of_network = right & (rows.protocol == Protocol.TCP) & np.isin(rows.function, _undeclared())
            odd -= length[of_network].sum()
        self._odd += int(odd)
        self._legal += int(by_function.sum() - odd)

    @property
    def foreign(self) -> str:
        """The other protocol, where this is no Modbus; nothing where it is, or where nobody knows."""
        named = int(self._foreign[1:].sum())
        if named + self._odd < max(_LEAST, _TIMES * self._legal, _SHARE * self._bytes):
            return ""
        return NAMES[1 + int(self._foreign[1:].argmax())] if named else SAME_CRC


def _undeclared() -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """Functions that nobody has declared and that are not free for users."""
    return np.array(
        [code for code in range(256) if code not in USER_DEFINED and rule(code & ~EXCEPTION, Role.REQUEST) is None]
    )
