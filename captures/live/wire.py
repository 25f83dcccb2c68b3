"""What the reader's process tells the one that listens, as bytes on a pipe.

A record is a head (kind, port, time, length) and so many bytes: reads as columns (`READS`), a time up to which nothing
more came (`TICK`), or something that happened (`EVENT`, JSON). Times never decrease over all ports.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..chunks import Block
from .records import COUNTS, EVENT, HEAD, READS, TICK


@dataclass(frozen=True, slots=True)
class Tick:
    """All that came up to `t_ns` has been told."""

    t_ns: int


@dataclass(frozen=True, slots=True)
class PortEvent:
    """Something that happened to a port: `opened`, `lost`, `waiting`, `settings`, `notice`, `failed`, `clock`, `ended`.

    `text` is one line for a person; `more` what a program wants.
    """

    t_ns: int
    port: int
    kind: str
    text: str
    more: dict[str, Any]


Item = Block | Tick | PortEvent


class Decoder:
    """Bytes of the pipe in, blocks, ticks and events out."""

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, data: bytes) -> list[Item]:
        """What is complete by now."""
        if self._rest:
            data = self._rest + data
        items: list[Item] = []
        at, size = 0, len(data)
        while at + HEAD.size <= size:
            kind, port, t_ns, length = HEAD.unpack_from(data, at)
            body = at + HEAD.size
            if body + length > size:
                break
            at = body + length
            if kind == READS:
                items.append(_block(data[body:at]))
            elif kind == TICK:
                items.append(Tick(t_ns))
            elif kind == EVENT:
                event = json.loads(data[body:at])
                items.append(PortEvent(t_ns, port, event.pop("kind"), event.pop("text"), event))
        self._rest = data[at:]
        return items


def _block(body: bytes) -> Block:
    """The columns of `reads_record`."""
    n, errors = COUNTS.unpack_from(body)
    sizes_at = COUNTS.size + 8 * n
    ports_at = sizes_at + 2 * n
    errors_at = ports_at + n
    offsets = np.zeros(n + 1, np.int64)
    np.frombuffer(body, "<u2", n, sizes_at).cumsum(out=offsets[1:])
    return Block(
        data=np.frombuffer(body, np.uint8, -1, errors_at + 4 * errors),
        offsets=offsets,
        t_ns=np.frombuffer(body, "<i8", n, COUNTS.size),
        port=np.frombuffer(body, np.uint8, n, ports_at),
        mark=np.zeros(n, np.uint8),
        errors=np.frombuffer(body, "<u4", errors, errors_at).astype(np.int64),
    )
