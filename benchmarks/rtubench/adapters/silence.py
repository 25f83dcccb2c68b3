"""The specification's rule: 3.5 characters of silence end a frame, 1750 us above 19200 bit/s (serial line, 2.5.1.1).

What stands between two silences is a frame, whole or damaged, as its check value says. Silence is counted from the time
of a read to that of the next one less the time of its characters. Reads without times are one frame.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from rtubench.adapters.speaking import Row, crc_ok, frame, given, speak


def about() -> Row:
    return {"tool": "3.5-character rule", "version": "1", "input": "reads", "claims": ["frames", "damage"]}


def bus(path: Path) -> Iterator[Row]:
    told = given(path)
    silence = 3.5 * told.char_ns if told.head["baud"] <= 19200 else 1_750_000
    start, held, before = 0, b"", None
    for t_ns, data in told.reads:
        if held and t_ns is not None and before is not None and t_ns - len(data) * told.char_ns - before >= silence:
            yield frame(start, len(held), crc_ok(held))
            start, held = start + len(held), b""
        held += data
        before = t_ns
    if held:
        yield frame(start, len(held), crc_ok(held))


if __name__ == "__main__":
    sys.exit(speak(about, {"bus": bus}))
