"""How fast each sender's clock is: its rate against that of the line's settings, where edges were captured."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from ..tables.schema import Kind, Rows
from .model import RateRow

if TYPE_CHECKING:
    from captures.edges.spans import BitSpans

_CLIENT: Final = 256  # behind the units
_LEAST: Final = 200  # bits that a rate is told of: each edge is seen a sample late at the most


class RateTable:
    """Time and bits of all frames with a right check value, by who sent them: the client, or a unit."""

    def __init__(self, spans: BitSpans) -> None:
        self._spans = spans
        spans.want()
        self._took, self._due, self._bits = (np.zeros(_CLIENT + 1) for _ in range(3))  # ns, ns, bits

    def feed(self, rows: Rows) -> None:
        """Frames and noise, those of a port in order."""
        for port in np.bincount(rows.port).nonzero()[0].tolist():
            part = rows[rows.port == port]
            ns, bits = self._spans.take(port, part.start, part.length)
            sender = np.where(part.kind == Kind.REQUEST, _CLIENT, part.unit.astype(np.int64))
            good = part.check & (part.kind != Kind.NOISE)
            self._took += self._by(sender[good], ns[good])
            self._due += self._by(sender[good], bits[good]) * 1e9 / self._spans.bauds[port]
            self._bits += self._by(sender[good], bits[good])

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
