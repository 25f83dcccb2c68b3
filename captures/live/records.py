"""The records on the pipe from the reader's process, as that process writes them: without numpy, to be small."""

from __future__ import annotations

import json
import struct
from typing import Any, Final

HEAD: Final = struct.Struct("<BBqI")  # kind, port, t_ns, bytes that follow
DATA: Final = 1
MARKED: Final = 2
TICK: Final = 3
EVENT: Final = 4


def data_record(t_ns: int, port: int, data: bytes, errors: list[int]) -> bytes:
    """A read: its bytes, and the offsets of those with an error."""
    if not errors:
        return HEAD.pack(DATA, port, t_ns, len(data)) + data
    marks = struct.pack(f"<H{len(errors)}H", len(errors), *errors)
    return HEAD.pack(MARKED, port, t_ns, len(marks) + len(data)) + marks + data


def tick_record(t_ns: int) -> bytes:
    """Nothing more came up to then."""
    return HEAD.pack(TICK, 0, t_ns, 0)


def event_record(t_ns: int, port: int, kind: str, text: str, **more: Any) -> bytes:
    """Something happened to a port."""
    said = json.dumps({"kind": kind, "text": text, **more}).encode()
    return HEAD.pack(EVENT, port, t_ns, len(said)) + said
