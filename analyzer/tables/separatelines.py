"""Ports of one capture that are lines of their own: each carries requests and the answers to them at the same time.

Two taps of one line carry a direction each, connections that follow one another are one client that dials in again,
and Modbus TCP numbers its transactions: none of those is two lines.
"""

from __future__ import annotations

from itertools import combinations
from typing import Final

import numpy as np
from numpy.typing import NDArray

from .schema import Kind, Protocol, Rows

_FEW: Final = 3  # exchanges on a port: fewer are no line
_BESIDE: Final = 0.5  # of the shorter one's time, in which both are heard


class SeparateLines:
    """Takes rows as they come; `ports` are those of separate lines, none where all is one bus."""

    _span: dict[int, tuple[int, int]]
    _answered: NDArray[np.int64]

    def __init__(self) -> None:
        self._span = {}  # ns, of each port's requests
        self._answered = np.zeros(256, np.int64)  # by port

    def feed(self, rows: Rows) -> None:
        """Rows with their pairs."""
        ours = rows.check & (rows.protocol != Protocol.TCP)
        self._answered += np.bincount(rows.port[ours & (rows.request >= 0)], minlength=256)
        asked = ours & (rows.kind == Kind.REQUEST)
        ports, begins = rows.port[asked], rows.t_start_ns[asked]
        for port in np.bincount(ports).nonzero()[0].tolist():
            times = begins[ports == port]
            first, last = self._span.get(port, (int(times[0]), 0))
            self._span[port] = first, max(last, int(times.max()))

    @property
    def ports(self) -> tuple[int, ...]:
        """Ports of lines of their own, at least two, or none."""
        lines = [port for port in sorted(self._span) if self._answered[port] >= _FEW]
        beside = any(self._are_beside(one, other) for one, other in combinations(lines, 2))
        return tuple(lines) if beside else ()

    def _are_beside(self, one: int, other: int) -> bool:
        (first, last), (begin, end) = self._span[one], self._span[other]
        return min(last, end) - max(first, begin) > _BESIDE * min(last - first, end - begin)
