"""The reader process's side of its pipes: records that it writes without waiting, commands that it reads.

Apart from `wire`, the listener's side, since that one needs numpy, and a process that only reads and stamps is small.
"""

from __future__ import annotations

import json
import os
import struct
from collections.abc import Sequence
from typing import Any, Final

HEAD: Final = struct.Struct("<BBqI")  # kind, port, t_ns, bytes that follow
READS: Final = 1
TICK: Final = 2
EVENT: Final = 3
POSITION: Final = 4  # over a network: which record comes next, JSON
COUNTS: Final = struct.Struct("<II")  # of READS: reads, bytes with an error; then the columns of `reads_record`

_BACKLOG: Final = 64 << 20  # bytes kept for a listener that does not take them

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


def position_record(t_ns: int, position: dict[str, Any]) -> bytes:
    """From here on another place in the stream: see `tapstream`."""
    said = json.dumps(position).encode()
    return HEAD.pack(POSITION, 0, t_ns, len(said)) + said


class Commands:
    """Lines of standard input, as they come."""

    def __init__(self) -> None:
        self._rest = b""

    def take(self) -> list[dict[str, Any]] | None:
        """The commands that came; None at the end."""
        data = os.read(0, 1 << 16)
        if not data:
            return None
        *lines, self._rest = (self._rest + data).split(b"\n")
        return [json.loads(line) for line in lines if line]


class Pipe:
    """Standard output; what it does not take at once is kept, up to a limit."""

    def __init__(self, *, blocking: bool) -> None:
        self._kept = bytearray()
        if not blocking:
            os.set_blocking(1, False)

    @property
    def waiting(self) -> bool:
        return bool(self._kept)

    def send(self, data: bytes) -> None:
        """Write, or keep; a listener that is stuck for good ends this process, which must not eat all memory."""
        self._kept += data
        if len(self._kept) > _BACKLOG:
            raise SystemExit("the listener takes nothing")
        self.push()

    def push(self) -> None:
        """Write what is kept, as far as it goes."""
        while self._kept:
            try:
                written = os.write(1, self._kept)
            except BlockingIOError:
                return
            except OSError:  # the listener is gone
                raise SystemExit(0) from None
            del self._kept[:written]

    def drain(self) -> None:
        """Write all of it, waiting for the listener."""
        if self._kept:
            os.set_blocking(1, True)
            self.push()
