"""Frames as JSON values, fast enough for millions: orjson, and the fields kept of what the bus says over and over.

Polls repeat: the same request, and often the same answer, comes again and again, so the fields of the latest few
thousand different frames are kept encoded.
"""

from __future__ import annotations

from typing import Any, Final

import orjson

from analyzer.frames import Batch, Direction, Frame, Kind

_KEPT: Final = 8192  # frames; at some 3 kB each, 25 MB
_fields_of: dict[tuple[bytes, bytes | None, int, int], bytes] = {}


def frame_json(frame: Frame) -> dict[str, Any]:
    """The frame's JSON line as a mapping for orjson, its fields already encoded."""
    line = frame.to_json(fields=False)
    tail = {key: line.pop(key) for key in ("confidence", "findings", "port") if key in line}
    line["fields"] = orjson.Fragment(_fields(frame))
    line.update(tail)
    return line


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


def _fields(frame: Frame) -> bytes:
    key = (frame.captured, frame.request_bytes, int(frame.row["kind"]), int(frame.row["protocol"]))
    encoded = _fields_of.get(key)
    if encoded is None:
        if len(_fields_of) >= _KEPT:
            _fields_of.clear()
        encoded = _fields_of[key] = orjson.dumps([item.to_json() for item in frame.fields()])
    return encoded
