"""modbus-connector's listener (`modbus-connector-cli sniff`): its parser on the reads, in the order in which they came.

The command prints frames without their places, so its class `RtuFrameParser` is asked, and told to say where it found
each. A response's request is the pending one that its own matcher takes away.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from rtubench.adapters.speaking import NotThereError, Row, frame, given, speak


def _parser() -> Any:
    try:
        from modbus_connector.sniffer_backend import RtuFrameParser
    except ImportError:
        raise NotThereError("modbus-connector is not installed: see `setup`") from None

    class Placed(RtuFrameParser):  # type: ignore[misc, unused-ignore]
        """The same, which keeps the place of each frame."""

        def __init__(self) -> None:
            super().__init__()
            self.places: list[tuple[int, int]] = []

        def _scan(self) -> Any:
            found = super()._scan()
            if found is not None:
                self.places.append((found[0], found[2]))
            return found

    return Placed()


def about() -> Row:
    from importlib.metadata import version

    _parser()
    claims = ["frames", "directions", "pairs", "speed"]
    return {"tool": "modbus-connector", "version": version("modbus-connector"), "input": "reads", "claims": claims}


def bus(path: Path) -> Iterator[Row]:
    parser, at = _parser(), 0
    pending: dict[tuple[int, int], int] = {}
    fed = 0
    for _, data in given(path).reads:
        fed += len(data)
        parser.places.clear()
        found = parser.feed(data)
        for one, (skipped, length) in zip(found, parser.places, strict=True):
            start = at + skipped
            key = one.unit, one.function_code
            response = one.direction == "rx"
            yield frame(start, length, True, "response" if response else "request",
                        pending.pop(key, None) if response else None)  # fmt: skip
            if not response:
                pending[key] = start
            at = start + length
        at = fed - len(parser._buffer)  # what it cut off as noise is gone


if __name__ == "__main__":
    sys.exit(speak(about, {"bus": bus}))
