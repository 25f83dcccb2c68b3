"""Frames annotated whole, one by one, and what is kept of that.

Polls repeat: the same request, and often the same answer, comes again and again, so the fields of frames
seen are kept as text.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from analyzer.frames import Batch, Direction, Frame, Kind

_KEPT: Final = 16 << 20  # bytes of text


class Whole:
    """What `make` says of a frame by its bytes (and its request's) alone, kept."""

    def __init__(self, make: Callable[[Frame], bytes]) -> None:
        self._make = make
        self._known: dict[tuple[bytes, bytes | None, int, int], bytes] = {}
        self._size = 0

    def text(self, frame: Frame) -> bytes:
        """The frame's text."""
        key = (frame.captured, frame.request_bytes, frame.row.kind, frame.row.protocol)
        found = self._known.get(key)
        if found is None:
            found = self._make(frame)
            self._size += len(found)
            if self._size > _KEPT:
                self._known.clear()
                self._size = len(found)
            self._known[key] = found
        return found


def noise_json(batch: Batch, row: int) -> dict[str, Any]:
    """A stretch of noise as a mapping."""
    values = batch.rows[row]
    line = {
        "kind": "noise",
        "start": int(values["start"]),
        "length": int(values["length"]),
        "t_start_ns": int(values["t_start"]),
        "t_end_ns": int(values["t_end"]),
        "hex": batch.bytes_of(row).hex(),
    }
    if values["port"]:
        line["port"] = int(values["port"])
    if said := batch.findings_of(row):
        line["findings"] = [finding.to_json() for finding in said]
    return line


def explain_json(frame: Frame) -> dict[str, Any] | None:
    """Why the frame's boundaries stand where they do, in bits, and what would stand there instead."""
    evidence = frame.evidence
    if evidence is None:
        return None
    weights: dict[str, Any] = {
        key: round(float(evidence[key]), 2) for key in ("length", "crc", "silence", "conversation", "margin")
    }
    kind = Kind(int(evidence["rival_kind"]))
    if evidence["rival_start"] < 0 or kind == Kind.NOISE:
        weights["runner_up"] = {"start": None, "length": None, "kind": "noise"}
    else:
        start, length = int(evidence["rival_start"]), int(evidence["rival_length"])
        weights["runner_up"] = {"start": start, "length": length, "kind": Direction(kind).name}
    return weights
