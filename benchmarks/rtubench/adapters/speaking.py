"""The protocol of docs/rtubench.md for adapters in Python; one in another language needs nothing of this.

ADAPTER about           a line: tool, version, input, claims; exit 3 with a line why where the tool is not there
ADAPTER TASK FILE       a JSON line a frame, cause, value or pasted frame
ADAPTER speed FILE      a line: the command to be measured
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

Row = dict[str, Any]
NOT_THERE = 3


class Given(NamedTuple):
    """A file that an adapter was given: the line's settings, and reads of (time in ns or None, bytes)."""

    head: Row
    reads: list[tuple[int | None, bytes]]

    @property
    def char_ns(self) -> float:
        """The time of a character."""
        return float(self.head["char_bits"] * 1e9 / self.head["baud"])


class NotThereError(Exception):
    """A tool is not installed; the text says what is missing."""


def given(path: Path) -> Given:
    """Reads a file of the bench."""
    head, *rows = (json.loads(line) for line in path.read_text().splitlines())
    return Given(head, [(row["t_ns"], bytes.fromhex(row["hex"])) for row in rows])


def speak(about: Callable[[], Row], tasks: dict[str, Callable[[Path], Iterable[Row]]]) -> int:
    """Does what the command line asks for; a task that is not in `tasks` is a usage error."""
    wanted, *files = sys.argv[1:]
    try:
        rows: Iterator[Row] = iter([about()] if wanted == "about" else tasks[wanted](Path(files[0])))
        for row in rows:
            print(json.dumps(row))
    except NotThereError as error:
        print(error, file=sys.stderr)
        return NOT_THERE
    return 0


def frame(start: int, length: int, crc_ok: bool, direction: str | None = None, request_start: int | None = None) -> Row:
    """A row of the task `bus`."""
    return {
        "start": start, "length": length, "crc_ok": crc_ok, "direction": direction, "request_start": request_start,
    }  # fmt: skip


def crc_ok(data: bytes) -> bool:
    """Whether the last two bytes check those before them."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0xA001 if crc & 1 else 0)
    return crc == 0  # over a frame and its own check value the remainder is 0
