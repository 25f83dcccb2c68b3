"""How fast each sender's clock is: its rate against that of the line's settings, where edges were captured."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from ..tables.schema import Kind, Rows
from .model import RateRow

if TYPE_CHECKING:
    from captures.edges.source import BitSpans

_CLIENT: Final = 256  # behind the units
_LEAST: Final = 200  # bits that a rate is told of: each edge is seen a sample late at the most


def bit_times(spans: BitSpans, rows: Rows) -> NDArray[np.int64]:
    """(2, n): in how many ns so many bits of each of these rows came; rows of a port must be given in order."""
    taken = np.zeros((2, len(rows)), np.int64)
    for port in np.bincount(rows.port).nonzero()[0].tolist():
        of_port = rows.port == port
        taken[:, of_port] = spans.take(port, rows.start[of_port], rows.length[of_port])
    return taken


class RateTable:
    """Time and bits of all frames with a right check value, by who sent them: the client, or a unit."""

    def __init__(self, bauds: Mapping[int, float]) -> None:
        """`bauds`: the rate of each port by its settings, bit/s."""
        self._bauds = bauds
        self._took, self._due, self._bits = (np.zeros(_CLIENT + 1) for _ in range(3))  # ns, ns, bits

    def feed(self, rows: Rows, taken: NDArray[np.int64]) -> None:
        """Frames and noise, and what `bit_times` has of them."""
        for port in np.bincount(rows.port).nonzero()[0].tolist():
            good = (rows.port == port) & rows.check & (rows.kind != Kind.NOISE)
            sender = np.where(rows.kind == Kind.REQUEST, _CLIENT, rows.unit.astype(np.int64))[good]
            ns, bits = taken[:, good]
            self._took += self._by(sender, ns)
            self._due += self._by(sender, bits) * 1e9 / self._bauds[port]
            self._bits += self._by(sender, bits)

    def rows(self) -> tuple[RateRow, ...]:
        """Each sender of which enough was seen: the client first, then the units."""
        senders = [_CLIENT, *range(_CLIENT)]
        return tuple(
            RateRow(
                None if sender == _CLIENT else sender,
                float(self._bits[sender] * 1e9 / self._took[sender]),
                float(self._due[sender] / self._took[sender]) - 1,
            )
            for sender in senders
            if self._bits[sender] >= _LEAST
        )

    @staticmethod
    def _by(senders: NDArray[np.int64], numbers: NDArray[np.int64]) -> NDArray[np.float64]:
        return np.bincount(senders, numbers, _CLIENT + 1).astype(np.float64)
