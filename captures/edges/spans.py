"""How long the bits of each byte took on the line, kept until somebody asks for those of a frame."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]
_NONE = np.zeros((2, 1), np.int64)


class BitSpans:
    """By port: sums, over the bytes that were given so far, of time and of the bits that took it.

    Kept of the one pass over the bytes that begins after `want`, for what is kept grows until it is taken. `bauds`: the
    rate of each port by its settings, bit/s.
    """

    def __init__(self, bauds: Mapping[int, float]) -> None:
        self.bauds = dict(bauds)
        self._armed, self._pass = False, 0
        self._clear()

    def want(self) -> None:
        """Somebody will take what the next pass brings."""
        self._armed = True

    def begin(self) -> int:
        """A pass over the bytes begins; its number, 0 where nobody wants it."""
        if not self._armed:
            return 0
        self._armed, self._pass = False, self._pass + 1
        self._clear()
        return self._pass

    def _clear(self) -> None:
        self._sums: dict[int, Ints] = {}  # by port, (2, n + 1): ns and bits before each byte that is kept, from 0 on
        self._gone: dict[int, int] = {}  # bytes before those

    def add(self, number: int, ports: NDArray[np.uint8], spans: Ints) -> None:
        """Bytes that come next in a pass: the port of each, and (2, n) its ns and bits, 0 and 0 where unknown."""
        for port in np.bincount(ports).nonzero()[0].tolist() if number and number == self._pass else ():
            sums = self._sums.get(port, _NONE)
            more = sums[:, -1:] + np.cumsum(spans[:, ports == port], axis=1)
            self._sums[port] = np.concatenate((sums, more), axis=1)

    def take(self, port: int, starts: Ints, lengths: Ints) -> tuple[Ints, Ints]:
        """Time in ns and bits of stretches of a port's stream, in order; bytes before the last one are forgotten."""
        sums, gone = self._sums.get(port, _NONE), self._gone.get(port, 0)
        most = sums.shape[1] - 1
        first, last = (np.clip(edges - gone, 0, most) for edges in (starts, starts + lengths))
        ns, bits = sums[:, last] - sums[:, first]
        done = int(first.max(initial=0))
        self._sums[port], self._gone[port] = sums[:, done:] - sums[:, done : done + 1], gone + done
        return ns, bits
