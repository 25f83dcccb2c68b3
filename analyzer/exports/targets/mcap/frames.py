"""Frames and noise as lots of messages, a row of the batch each."""

from __future__ import annotations

from typing import Final

import numpy as np

from analyzer.columns import Decoded
from analyzer.exports.targets.mcap import schemas
from analyzer.frames import Batch, Kind, Protocol, Rows, adu_of
from captures.formats.mcap import packing
from captures.formats.mcap.packing import HEAD, Lot, Part, Tails
from captures.formats.mcap.protobuf import Message, packed_length
from captures.ragged import Ints

_RENAMED: Final = {"t_start_ns": "t_start", "direction": "kind", "crc_ok": "check"}
_PLAIN: Final = (
    "index", "start", "length", "t_start_ns", "protocol", "direction", "unit", "function", "crc_ok", "confidence"
)  # fmt: skip


def frame_lot(batch: Batch, decoded: Decoded, message: Message, channel: int, findings: Ints | None) -> Lot:
    """All frames of a batch; `findings` is how many there are on each row, None for none on any."""
    which = np.flatnonzero(batch.rows["kind"] != Kind.NOISE)
    every = len(which) == len(batch)
    rows = batch.rows if every else batch.rows.take(which)
    exceptions, ports = rows["exception"], rows["port"]
    without = {"exception"} if not exceptions.any() else set()
    without |= {"port"} if not ports.any() else set()
    without |= {"findings"} if findings is None else set()
    heads = packing.heads(message.layout(HEAD, without), len(rows))
    for name in _PLAIN:
        heads[name] = rows[_RENAMED.get(name, name)]
    optional = {
        "address": decoded.address if every else decoded.address[which],
        "quantity": decoded.quantity if every else decoded.quantity[which],
        "request_start": rows["request_start"],
        "response_time_ns": rows["response_ns"],
    }
    for name, values in optional.items():
        message.put(heads, name, values, present=values >= 0)
    if "exception" not in without:
        message.put(heads, "exception", exceptions, present=exceptions > 0)
    if "port" not in without:
        heads["port"] = ports
    if findings is not None:
        heads["findings"] = findings[which]
    if batch.evidence is not None:
        _explain(heads, message, batch.evidence.take(which))
    tails = _bytes(batch, which, rows)
    heads["data"] = packed_length(tails.sizes)
    return Lot.of(which, channel, rows["t_end"], [Part(None, heads)], tails)


def noise_lot(batch: Batch, channel: int) -> Lot:
    """All noise of a batch."""
    which = np.flatnonzero(batch.rows["kind"] == Kind.NOISE)
    rows = batch.rows.take(which)
    heads = packing.heads(schemas.NOISE.layout(HEAD), len(rows))
    for name in ("start", "length", "t_start_ns", "port"):
        heads[name] = rows[_RENAMED.get(name, name)]
    tails = Tails(batch.data, rows["at"], rows["length"])
    heads["data"] = packed_length(tails.sizes)
    return Lot.of(which, channel, rows["t_end"], [Part(None, heads)], tails)


def _explain(heads: Rows, message: Message, evidence: Rows) -> None:
    for name in schemas.EVIDENCE:
        heads[f"evidence_{name}"] = evidence[name]
    kind, start = evidence["rival_kind"], evidence["rival_start"]
    there = (start >= 0) & (kind != Kind.NOISE)
    heads["runner_up_kind"] = np.where(there, kind, Kind.NOISE)
    message.put(heads, "runner_up_start", start, present=there)
    message.put(heads, "runner_up_length", evidence["rival_length"], present=there)


def _bytes(batch: Batch, which: Ints, rows: Rows) -> Tails:
    """The frames' bytes; those of ASCII mode are what their digits stand for."""
    if not (rows["protocol"] == Protocol.ASCII).any():
        return Tails(batch.data, rows["at"], rows["length"])
    adus = [adu_of(batch.bytes_of(row), int(batch.rows["protocol"][row])).data for row in which.tolist()]
    sizes = np.array([len(adu) for adu in adus], np.int64)
    return Tails(np.frombuffer(b"".join(adus), np.uint8), np.cumsum(sizes) - sizes, sizes)
