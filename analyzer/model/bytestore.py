"""The bytes of all rows, kept once, in row order."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

_BYTES: Final = 1 << 20


class ByteStore:
    """Bytes end to end, in blocks of 1 MiB."""

    def __init__(self) -> None:
        self._blocks: list[NDArray[np.uint8]] = []
        self.size = 0

    def append(self, data: NDArray[np.uint8]) -> int:
        """Add bytes; where they begin."""
        begin, written = self.size, 0
        while written < len(data):
            offset = (begin + written) % _BYTES
            if offset == 0:
                self._blocks.append(np.empty(_BYTES, np.uint8))
            size = min(_BYTES - offset, len(data) - written)
            self._blocks[-1][offset : offset + size] = data[written : written + size]
            written += size
        self.size = begin + len(data)
        return begin

    def get(self, at: int, length: int) -> NDArray[np.uint8]:
        """`length` bytes from `at`; a view where they lie in one block."""
        number, offset = divmod(at, _BYTES)
        if offset + length <= _BYTES:
            return self._blocks[number][offset : offset + length] if length else np.empty(0, np.uint8)
        parts = []
        while length > 0:
            size = min(_BYTES - offset, length)
            parts.append(self._blocks[number][offset : offset + size])
            length, number, offset = length - size, number + 1, 0
        return np.concatenate(parts)

    @property
    def nbytes(self) -> int:
        """Memory of the blocks."""
        return len(self._blocks) * _BYTES
