"""What the reader's process tells the one that listens, as bytes on a pipe.

A record is a head (kind, port, time, length) and so many bytes: a read (`DATA`, or `MARKED` with error offsets before
the bytes), a time up to which nothing more came (`TICK`), or something that happened (`EVENT`, JSON). Times never
decrease over all ports.
"""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from captures.chunks import Block, columns

from .records import DATA, EVENT, HEAD, MARKED, TICK

_COUNT: Final = struct.Struct("<H")


@dataclass(frozen=True, slots=True)
class Tick:
    """All that came up to `t_ns` has been told."""

    t_ns: int


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened to a port: `opened`, `lost`, `waiting`, `settings`, `notice`, `failed`, `clock`, `ended`.

    `text` is one line for a person; `more` what a program wants.
    """

    t_ns: int
    port: int
    kind: str
    text: str
    more: dict[str, Any]


Item = Block | Tick | Event


class Decoder:
    """Bytes of the pipe in, blocks, ticks and events out."""

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, data: bytes) -> list[Item]:
        """What is complete by now; reads that follow each other are one block."""
        if self._rest:
            data = self._rest + data
        items: list[Item] = []
        reads = _Reads()
        at, size = 0, len(data)
        while at + HEAD.size <= size:
            kind, port, t_ns, length = HEAD.unpack_from(data, at)
            body = at + HEAD.size
            if body + length > size:
                break
            at = body + length
            if kind == DATA:
                reads.add(t_ns, port, data[body:at])
            elif kind == MARKED:
                count = _COUNT.unpack_from(data, body)[0]
                first = body + _COUNT.size
                offsets = np.frombuffer(data, np.dtype("<u2"), count, first).tolist()
                reads.add(t_ns, port, data[first + 2 * count : at], offsets)
            else:
                reads.into(items)
                if kind == TICK:
                    items.append(Tick(t_ns))
                elif kind == EVENT:
                    said = json.loads(data[body:at])
                    items.append(Event(t_ns, port, said.pop("kind"), said.pop("text"), said))
        reads.into(items)
        self._rest = data[at:]
        return items


class _Reads:
    """Reads that become one block."""

    def __init__(self) -> None:
        self._clear()

    def _clear(self) -> None:
        self._t: list[int] = []
        self._port: list[int] = []
        self._data: list[bytes] = []
        self._errors: list[int] = []
        self._size = 0

    def add(self, t_ns: int, port: int, data: bytes, errors: list[int] | None = None) -> None:
        if errors:
            self._errors += [self._size + error for error in errors]
        self._t.append(t_ns)
        self._port.append(port)
        self._data.append(data)
        self._size += len(data)

    def into(self, items: list[Item]) -> None:
        if not self._t:
            return
        extras: dict[str, np.ndarray[Any, Any]] = {
            "port": np.array(self._port, np.uint8),
            "errors": np.array(self._errors, np.int64),
        }
        sizes = [len(data) for data in self._data]
        items.append(columns(b"".join(self._data), sizes, self._t, timed=True, extras=extras))
        self._clear()
