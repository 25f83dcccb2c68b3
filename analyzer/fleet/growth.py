"""A slice that has grown since it was taken: chunks that the lake has are passed over, what is behind them is new."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from captures import Block


class NotGrownError(Exception):
    """The slice does not begin with the chunks that were taken."""


class ChunkDigest:
    """What chunks come to, however divided into blocks: how many, and a digest of bytes, lengths, times, ports."""

    def __init__(self) -> None:
        self.count = 0
        self._columns = [hashlib.sha256() for _ in range(4)]

    def add(self, block: Block) -> None:
        """Chunks behind those so far."""
        self.count += len(block)
        columns = (block.data, np.diff(block.offsets), block.t_ns, block.port)
        for digest, column in zip(self._columns, columns, strict=True):
            digest.update(np.ascontiguousarray(column).tobytes())

    def text(self) -> str:
        """The digest."""
        return hashlib.sha256(b"".join(each.digest() for each in self._columns)).hexdigest()[:32]


def behind(blocks: Iterable[Block], count: int, digest: str, seen: ChunkDigest) -> Iterator[Block]:
    """What stands behind the first `count` chunks, which have this digest; all are `seen`. Raises NotGrownError."""
    left = count
    for block in blocks:
        at = min(left, len(block))
        if at:
            seen.add(block.slice(0, at))
            left -= at
            if not left and seen.text() != digest:
                raise NotGrownError
        if at < len(block):
            rest = block.slice(at, len(block))
            seen.add(rest)
            yield rest
    if left:
        raise NotGrownError
