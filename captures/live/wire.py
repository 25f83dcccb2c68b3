"""What the reader's process tells the one that listens, as bytes on a pipe, and a tap its viewers over a network.

A record is a head (kind, port, time, length) and so many bytes: reads as columns (`READS`), a time up to which nothing
more came (`TICK`), or something that happened (`EVENT`, JSON). Times never decrease over all ports.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from ..chunks import Block
from ..errors import CaptureError
from ..limits import TIME_LIMIT
from .batching import COUNTS, EVENT, HEAD, READS, TICK, event_record, tick_record

MOST: Final = 1 << 22  # bytes of a record: a reader's own are some KB
_BLOCK_BYTES: Final = 1 << 18  # of a line in one record
_READ_BYTES: Final = 0xFFFF  # of one read: sizes are 16 bits
_NO_ERRORS: Final = np.empty(0, np.int64)


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


def heard_until(item: Item) -> int:
    """Until when was listened, ns, once an item came."""
    return int(item.t_ns[-1]) if isinstance(item, Block) else item.t_ns


class WireError(CaptureError):
    """Bytes that are no records, in one line: whoever sent them is not to be trusted any further."""


class Splitter:
    """Bytes in, records out: kind, port, time and body of each. WireError for one that nobody would send."""

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, data: bytes) -> Iterator[tuple[int, int, int, bytes]]:
        """What is complete by now."""
        if self._rest:
            data = self._rest + data
        at, size = 0, len(data)
        while at + HEAD.size <= size:
            kind, port, t_ns, length = HEAD.unpack_from(data, at)
            if length > MOST or not -TIME_LIMIT < t_ns < TIME_LIMIT:
                raise WireError(f"a record of {length:,} bytes at {t_ns} ns")
            body = at + HEAD.size
            if body + length > size:
                break
            at = body + length
            yield kind, port, t_ns, data[body:at]
        self._rest = data[at:]


class Decoder:
    """Bytes of the pipe in, blocks, ticks and events out."""

    def __init__(self) -> None:
        self._records = Splitter()

    def feed(self, data: bytes) -> list[Item]:
        """What is complete by now."""
        return [item for record in self._records.feed(data) if (item := item_of(*record)) is not None]


def item_of(kind: int, port: int, t_ns: int, body: bytes) -> Item | None:
    """What a record says; None for a kind that is of another version. WireError where it contradicts itself."""
    if kind == READS:
        return _block(body)
    if kind == TICK:
        return Tick(t_ns)
    if kind == EVENT:
        event = json_object(body)
        words = event.pop("kind", None), event.pop("text", None)
        if not all(isinstance(word, str) for word in words):
            raise WireError("an event without text")
        return PortEvent(t_ns, port, str(words[0]), str(words[1]), event)
    return None


def json_object(data: bytes) -> dict[str, Any]:
    """An object that came as JSON; WireError."""
    try:
        value = json.loads(data)
    except (ValueError, RecursionError):
        value = None
    if not isinstance(value, dict):
        raise WireError("no JSON object where one belongs")
    return value


def records_of(item: Item) -> Iterator[tuple[bytes, int]]:
    """An item as the records that `item_of` reads, each with how many bytes of the line are in it."""
    if isinstance(item, Tick):
        yield tick_record(item.t_ns), 0
    elif isinstance(item, PortEvent):
        yield event_record(item.t_ns, item.port, item.kind, item.text, **item.more), 0
    else:
        for block in item.split(_BLOCK_BYTES):
            yield _reads_of(block), len(block.data)


def _reads_of(block: Block) -> bytes:
    """As `batching.reads_record`, of columns."""
    sizes = np.diff(block.offsets)
    if sizes.max(initial=0) > _READ_BYTES:
        raise ValueError(f"a read of {sizes.max()} bytes")
    columns = (
        COUNTS.pack(len(block), len(block.errors)),
        *(column.astype(kind).tobytes() for column, kind in ((block.t_ns, "<i8"), (sizes, "<u2"), (block.port, "u1"))),
        block.errors.astype("<u4").tobytes(),
        block.data.tobytes(),
    )
    body = b"".join(columns)
    return HEAD.pack(READS, 0, int(block.t_ns[-1]), len(body)) + body


def _block(body: bytes) -> Block:
    """The columns of `reads_record`."""
    if len(body) < COUNTS.size:
        raise WireError("reads without a count")
    n, errors = COUNTS.unpack_from(body)
    sizes_at = COUNTS.size + 8 * n
    ports_at = sizes_at + 2 * n
    errors_at = ports_at + n
    data_at = errors_at + 4 * errors
    if not n or data_at > len(body):
        raise WireError(f"{n} reads in {len(body)} bytes")
    times = np.frombuffer(body, "<i8", n, COUNTS.size)
    offsets = np.zeros(n + 1, np.int64)
    np.frombuffer(body, "<u2", n, sizes_at).cumsum(out=offsets[1:])
    block = Block(
        data=np.frombuffer(body, np.uint8, -1, data_at),
        offsets=offsets,
        t_ns=times,
        port=np.frombuffer(body, np.uint8, n, ports_at),
        mark=np.zeros(n, np.uint8),
        errors=np.frombuffer(body, "<u4", errors, errors_at).astype(np.int64) if errors else _NO_ERRORS,
    )
    told, ends = times.tolist(), offsets.tolist()  # a live line's reads are few, and arrays of few are slow
    if (
        ends[-1] != len(block.data)
        or len(set(ends)) <= n
        or (errors and not (block.errors[1:] > block.errors[:-1]).all())
        or (errors and int(block.errors[-1]) >= len(block.data))
        or not -TIME_LIMIT < told[0] <= told[-1] < TIME_LIMIT
        or sorted(told) != told
    ):
        raise WireError("reads whose columns contradict each other")
    return block
