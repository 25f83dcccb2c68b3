"""The records on the pipe from the reader's process, as that process writes them: without numpy, to be small."""

from __future__ import annotations

import json
import struct
from collections.abc import Sequence
from typing import Any, Final

HEAD: Final = struct.Struct("<BBqI")  # kind, port, t_ns, bytes that follow
READS: Final = 1
TICK: Final = 2
EVENT: Final = 3
COUNTS: Final = struct.Struct("<II")  # of READS: reads, bytes with an error; then the columns of `reads_record`

Read = tuple[int, int, bytes, Sequence[int]]  # t_ns, port, bytes (some), offsets of those with an error


def reads_record(reads: Sequence[Read]) -> bytes:
    """Some reads as columns: t_ns (int64), size (uint16) and port (uint8) of each, marked bytes (uint32), all bytes."""
    times, ports, parts, marks = zip(*reads, strict=True)
    errors: list[int] = []
    if any(marks):
        begin = 0
        for data, offsets in zip(parts, marks, strict=True):
            errors += [begin + offset for offset in offsets]
            begin += len(data)
    n = len(reads)
    columns = struct.pack(f"<{n}q{n}H{n}B{len(errors)}I", *times, *map(len, parts), *ports, *errors)
    body = COUNTS.pack(n, len(errors)) + columns + b"".join(parts)
    return HEAD.pack(READS, 0, times[-1], len(body)) + body


def tick_record(t_ns: int) -> bytes:
    """Nothing more came up to then."""
    return HEAD.pack(TICK, 0, t_ns, 0)


def event_record(t_ns: int, port: int, kind: str, text: str, **more: Any) -> bytes:
    """Something happened to a port."""
    said = json.dumps({"kind": kind, "text": text, **more}).encode()
    return HEAD.pack(EVENT, port, t_ns, len(said)) + said
