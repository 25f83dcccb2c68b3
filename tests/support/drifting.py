"""A bus whose senders' clocks are off, as a logic analyser sees it."""

from __future__ import annotations

from pathlib import Path

from buses import adu
from wave_files import vcd
from wave_forms import edges_of, frames_on_line

import captures
from captures import Capture

BAUD = 19200
OFF = {None: 0.01, 17: -0.015, 3: 0.0}  # of the client and two units
"""By how much the clock of the client, and of two units, is off."""


def bus() -> list[tuple[int | None, list[int]]]:
    """Who sends, and the edges."""
    now, out = 0, list[tuple[int | None, list[int]]]()
    for turn in range(40):
        unit = (17, 3)[turn % 2]
        request = adu(f"{unit:02x}03006b0002")
        answer = adu(f"{unit:02x}0304{turn:02x}{200 - turn:02x}55{turn:02x}")
        for sender, frame in ((None, request), (unit, answer)):
            characters = frames_on_line([frame], BAUD * (1 + OFF[sender]), 10, 0, 4_000_000, now)
            edges = edges_of(characters, BAUD, off=OFF[sender])
            out.append((sender, edges))
            now = edges[-1] + 1_000_000
    return out


def drifting_bus(path: Path) -> Capture:
    """The same on one wire, as a VCD file."""
    path.write_bytes(vcd({"RO": [edge for _, edges in bus() for edge in edges]}))
    return captures.open(path)
