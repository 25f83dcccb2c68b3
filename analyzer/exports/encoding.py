"""Frames as JSON values, fast enough for millions: orjson, and the fields kept of what the bus says over and over.

Polls repeat: the same request, and often the same answer, comes again and again, so the fields of frames
seen are kept encoded, up to some 32 MB.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import orjson

from analyzer.frames import Batch, Direction, Frame, Kind

from .registers import values_of

_KEPT: Final = 32 << 20  # bytes of encoded fields


@dataclass(frozen=True, slots=True)
class Encoded:
    """What follows from a frame's bytes (and its request's) alone: its fields as JSON, and its values."""

    fields: bytes
    area: str | None = None
    values: bytes = b""


class Encoder:
    """Frames to JSON; with `values`, to the register values that they carry too."""

    def __init__(self, *, values: bool = False) -> None:
        self._values = values
        self._known: dict[tuple[bytes, bytes | None, int, int], Encoded] = {}
        self._size = 0

    def line(self, frame: Frame) -> dict[str, Any]:
        """The frame's JSON line as a mapping for orjson, its fields already encoded."""
        line = frame.to_json(fields=False)
        tail: dict[str, Any] = {key: line.pop(key) for key in ("confidence", "findings", "port") if key in line}
        line["fields"] = orjson.Fragment(self.encoded(frame).fields)
        line.update(tail)
        return line

    def encoded(self, frame: Frame) -> Encoded:
        """Fields and values, encoded."""
        key = (frame.captured, frame.request_bytes, frame.row.kind, frame.row.protocol)
        found = self._known.get(key)
        if found is None:
            found = self._encode(frame)
            self._size += len(found.fields) + len(found.values)
            if self._size > _KEPT:
                self._known.clear()
                self._size = len(found.fields) + len(found.values)
            self._known[key] = found
        return found

    def _encode(self, frame: Frame) -> Encoded:
        fields = frame.fields()
        encoded = orjson.dumps([item.to_json() for item in fields])
        values = values_of(frame, fields) if self._values else None
        return Encoded(encoded) if values is None else Encoded(encoded, values.area, orjson.dumps(values.numbers))


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
