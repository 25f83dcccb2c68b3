"""Settled transactions as a lot of messages."""

from __future__ import annotations

import numpy as np

from analyzer.frames import Batch, Kind, Rows
from captures.formats.mcap import packing
from captures.formats.mcap.packing import HEAD, Lot, Part
from captures.formats.mcap.protobuf import Message


def transaction_lot(settled: Rows, batch: Batch, message: Message, channel: int) -> Lot:
    """Each stands before the frame that its time comes from: its answer, or the request that got none.

    Where that lies in an earlier batch it stands before the first frame.
    """
    answered = settled["response"] >= 0
    frames = np.where(answered, settled["response"], settled["request"])
    times = np.where(answered, settled["t_response"], settled["t_request"])
    which = np.flatnonzero(batch.rows["kind"] != Kind.NOISE)
    place = np.searchsorted(batch.rows["index"][which], frames)
    rows = np.append(which, max(len(batch) - 1, 0))[place]
    if np.any(rows[1:] < rows[:-1]):
        order = np.argsort(rows, kind="stable")
        settled, rows, times = settled.take(order), rows[order], times[order]
    heads = packing.heads(message.layout(HEAD), len(settled))
    for name in ("request", "unit", "function", "status", "retry", "late"):
        heads[name] = settled[name]
    message.put(heads, "response", settled["response"], present=settled["response"] >= 0)
    measured = settled["response_ns"]
    message.put(heads, "response_time_ms", measured / 1e6, present=measured >= 0)
    return Lot.of(rows, channel, times, [Part(None, heads)])
