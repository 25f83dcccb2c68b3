"""What the corpus is made of: an item is a question put to a tool, with the truth beside it.

A bus item holds the same bytes in three forms, and a tool is given the one that it reads: `reads` as the tap gave them,
`wire` (each byte at its own time, as a logic analyser on the line has it), `frames` (already split where frames end).
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from .line import Sent
from .taps import Read, Wire

Row = dict[str, Any]
INPUTS = ("reads", "wire", "frames")


@dataclass(frozen=True)
class Item:
    """One question: `task` is bus, causes, registers or text; `source` is made, recorded or real."""

    name: str
    task: str
    source: str
    tracks: tuple[str, ...]
    truth: Row
    baud: int = 19200
    char_bits: int = 11
    tap: str = ""
    inputs: Mapping[str, Sequence[Read]] = field(default_factory=dict)
    text: str = ""

    def write(self, folder: Path) -> None:
        """Writes what tools are given, a file an input, and the truth."""
        if self.task == "text":
            (folder / f"{self.name}.text").write_text(self.text, encoding="utf-8")
        for given, reads in self.inputs.items():
            head = {"task": self.task, "input": given, "baud": self.baud, "char_bits": self.char_bits, "tap": self.tap}
            rows = ({"t_ns": one.t_ns, "hex": one.data.hex()} for one in reads)
            write_rows(folder / f"{self.name}.{given}", (head, *rows))
        (folder / f"{self.name}.truth").write_text(json.dumps(self.truth) + "\n")

    def path(self, folder: Path, given: str) -> Path:
        """The file that a tool reads which takes the input `given`; reads where an item has no other."""
        if self.task == "text":
            return folder / f"{self.name}.text"
        return folder / f"{self.name}.{given if given in self.inputs else 'reads'}"


def write_rows(path: Path, rows: Iterable[Row]) -> None:
    """JSON lines."""
    path.write_text("".join(json.dumps(row) + "\n" for row in rows))


def bus_truth(sent: Sequence[Sent]) -> list[Row]:
    """Where each frame stands in the byte stream: id, role, start, length, hex, intact, pair (an id), fault."""
    rows, at = [], 0
    for one in sent:
        if one.role != "stray" and one.line:
            rows.append(
                {
                    "id": one.id, "role": one.role, "start": at, "length": len(one.line), "hex": one.whole.hex(),
                    "intact": one.intact, "pair": one.pair, "fault": one.fault or None,
                }
            )  # fmt: skip
        at += len(one.line)
    return rows


def split_frames(sent: Sequence[Sent], wire: Wire) -> list[Read]:
    """What was sent, a read each, at the time of its last byte: boundaries as nobody hears them."""
    reads, at = [], 0
    for one in sent:
        at += len(one.line)
        if one.line:
            reads.append(Read(wire[at - 1][0], one.line))
    return reads
