"""What real stacks said over ptys (`recording.py`), laid on a line: bytes and order are theirs, times and damage drawn.

Faults keep the times of their recording too, for these are what tells them.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from random import Random

from ..items import Item, Row
from ..line import MS, Line, Sent, Spoil, add, cut, flip, lose, sometimes, whole, wire_of
from ..taps import TAPS
from .buses import heard

_KEPT = Path(__file__).resolve().parents[1] / "recorded"
_BAUD, _CHAR_BITS = 19200, 10


def kept(name: str) -> list[Row]:
    """The recordings of a kind."""
    return [json.loads(line) for line in (_KEPT / f"{name}.jsonl").read_text().splitlines()]


def _laid(
    recording: Row, random: Random, rest_ms: tuple[float, float] | None, spoil: Spoil = whole
) -> tuple[Line, list[Sent]]:
    """A recording on a line: as it was timed where `rest_ms` is None, else with such pauses; answers may be damaged."""
    line, asked = Line(random, _BAUD, _CHAR_BITS), None
    for role, micros, text in recording["sent"]:
        if rest_ms is None:
            begin = micros * 1000
        else:
            pause = random.uniform(2.0, 9.0) if role == "response" else random.uniform(*rest_ms)
            begin = line.free_ns + round(pause * MS)
        pair = asked if role == "response" else None
        made, _ = line.put(role, bytes.fromhex(text), begin, spoil if role == "response" else whole, pair)
        asked = made.id if role == "request" else None
    return line, line.sent


def buses(seed: int) -> Iterator[Item]:
    """Conversations as they were, and with one answer in five damaged."""
    spoil = sometimes(0.2, flip, flip, lose, add, cut)
    for recording in kept("conversations"):
        for name, way in ((recording["name"], whole), (f"{recording['name']}-damaged", spoil)):
            line, sent = _laid(recording, Random(f"{seed} {name}"), (4.0, 20.0), way)
            yield from heard(name, sent, line, seed, "recorded")


def faults(seed: int) -> Iterator[Item]:
    """Faults that stacks made, and healthy lines."""
    for at, recording in enumerate(kept("faults")):
        tap, random = ("fifo", "usb")[at % 2], Random(f"{seed} {recording['name']}")
        line, sent = _laid(recording, random, None)
        truth = {"causes": recording["causes"], "units": recording["units"]}
        yield _item(recording, "causes", truth, tap, line, sent, random)


def values(seed: int) -> Iterator[Item]:
    """Devices whose values a stack encoded."""
    for recording in kept("values"):
        random = Random(f"{seed} {recording['name']}")
        line, sent = _laid(recording, random, (900.0, 1000.0))
        yield _item(recording, "registers", {"values": recording["values"]}, "fifo", line, sent, random)


def _item(recording: Row, task: str, truth: Row, tap: str, line: Line, sent: list[Sent], random: Random) -> Item:
    wire = list(wire_of(sent, line.char_ns))
    return Item(recording["name"], task, "recorded", (task,), truth, line.baud, line.char_bits, tap,
                {"reads": list(TAPS[tap](wire, random, line.char_ns))})  # fmt: skip


def texts() -> Iterator[Item]:
    """What programs printed."""
    for row in kept("texts"):
        text = (_KEPT / "texts" / f"{row['name']}.txt").read_text(encoding="utf-8")
        yield Item(f"log-{row['name']}", "text", "recorded", ("texts",), {"frames": row["frames"]}, text=text)
