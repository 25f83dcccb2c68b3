"""pymodbus's RTU framer as a listener would put it up: one for a server, which reads requests, and one for a client.

pymodbus claims no listening; its framer expects one frame of one direction at a time and drops what is behind it. So
both are asked, the earlier frame counts, and what stands behind it is put to them again. What neither can use is
dropped, as its own transports do, and so is what 50 ms of silence end (of none, 3.5 characters and 50 ms the best).
Where both read the same bytes, the response to what was asked last is taken.
"""

from __future__ import annotations

import struct
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from rtubench.adapters.speaking import NotThereError, Row, frame, given, speak

_SILENCE_NS = 50_000_000


def _framers() -> dict[str, Any]:
    try:
        from pymodbus.framer import FramerRTU
        from pymodbus.pdu import DecodePDU
    except ImportError:
        raise NotThereError("pymodbus 3.8 or newer is not installed") from None
    return {"request": FramerRTU(DecodePDU(True)), "response": FramerRTU(DecodePDU(False))}


def about() -> Row:
    from importlib.metadata import version

    _framers()
    claims = ["frames", "directions", "speed"]
    return {"tool": "pymodbus framer", "version": version("pymodbus"), "input": "reads", "claims": claims}


def _decoded(framer: Any, data: bytes) -> tuple[int, bytes]:
    """Bytes used, 0 for more are needed, and the frame or nothing."""
    try:
        used, unit, _, pdu = framer.decode(data)
    except (ValueError, IndexError, TypeError, struct.error):
        return len(data), b""
    return used, bytes((unit,)) + pdu if pdu else b""


def bus(path: Path) -> Iterator[Row]:
    lines, framers, held, at, asked = given(path), _framers(), b"", 0, b""
    before: int | None = None
    for t_ns, data in lines.reads:
        if t_ns is not None and before is not None and t_ns - len(data) * lines.char_ns - before >= _SILENCE_NS:
            at, held = at + len(held), b""
        before = t_ns
        held += data
        while held:
            told = {side: _decoded(framer, held) for side, framer in framers.items()}
            found = {side: (held.find(body), len(body) + 2) for side, (_, body) in told.items() if body}
            if not found:
                if all(used for used, _ in told.values()):
                    at, held = at + len(held), b""
                break
            first = min(found.values())
            sides = [side for side, place in found.items() if place == first]
            start, length = first
            answers = held[start : start + 2] == asked[:2]
            side = sides[0] if len(sides) == 1 else "response" if answers else "request"
            asked = held[start : start + length] if side == "request" else b""
            yield frame(at + start, length, True, side)
            at, held = at + start + length, held[start + length :]


if __name__ == "__main__":
    sys.exit(speak(about, {"bus": bus}))
