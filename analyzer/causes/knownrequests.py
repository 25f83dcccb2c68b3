"""The requests of a bus, by which one that collides with something, or comes in pieces, is known again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from dissectors.adu import OVERHEAD
from dissectors.crc import crc16
from dissectors.lengths import Role, pdu_length

_HEAD: Final = 3  # bytes
ENDING: Final = 3  # bytes by which a damaged request is known again
_INSIDE: Final = 4  # and within other bytes
_MOST_REQUESTS: Final = 256


@dataclass(frozen=True, slots=True)
class KnownRequests:
    """Requests of a bus, by their last bytes and their first ones."""

    endings: frozenset[bytes] = frozenset()
    heads: frozenset[bytes] = frozenset()
    within: tuple[bytes, ...] = ()

    @classmethod
    def of(cls, requests: Sequence[bytes]) -> KnownRequests:
        """A request of each poll."""
        endings = frozenset(request[-ENDING:] for request in requests)
        heads = frozenset(request[:_HEAD] for request in requests)
        return cls(endings, heads, tuple({request[-_INSIDE:] for request in requests[:_MOST_REQUESTS]}))

    def end(self, data: bytes) -> bool:
        """Whether these bytes end like one of them."""
        return data[-ENDING:] in self.endings

    def begin(self, data: bytes, unit: int) -> bool:
        """Whether these bytes begin like one of them to another unit than this one."""
        return data[:_HEAD] in self.heads and data[0] != unit

    def asks_and_gets(self, data: bytes) -> bool:
        """Whether these bytes are one of them and its answer, both whole: what a tap held up and handed over in pieces."""
        length = pdu_length(data[1:], Role.REQUEST) or 0
        request, answer = data[: length + OVERHEAD], data[length + OVERHEAD :]
        return (
            data[:_HEAD] in self.heads
            and length > 0
            and crc16(request) == 0
            and crc16(answer) == 0
            and answer[:2] == data[:2]
        )

    def are_in(self, data: bytes, but: bytes = b"") -> bool:
        """Whether one of them ends within these bytes or at their end; `but`: one that may."""
        own = but[-ENDING:]
        return (self.end(data) and data[-ENDING:] != own) or any(
            ending in data for ending in self.within if ending != but[-_INSIDE:]
        )
