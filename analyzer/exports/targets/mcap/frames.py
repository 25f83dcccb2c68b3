"""Frames, noise and transactions as messages, one each.

Rows of a batch come in the order of their ends, transactions once they are settled.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from analyzer.exports.targets.mcap import schemas
from captures.formats.mcap import packing
from captures.formats.mcap.packing import AT_ONCE, HEAD, Packed, PackedPart, Tails
from captures.formats.mcap.protobuf import Message, packed_length
from captures.ragged import Ints

from ....tables.batch import Batch
from ....tables.columns import Decoded
from ....tables.frame import adu_of
from ....tables.schema import BoundaryEvidence, Kind, Protocol, Rows
from ....tables.transactions import TransactionRows, delay_bounds

_RENAMED: Final = {"direction": "kind", "crc_ok": "check"}
_PLAIN: Final = ("index", "start", "length", "t_start_ns", "direction", "unit", "function", "crc_ok", "confidence")
_RARE: Final = ("protocol", "exception", "port")  # left out where they are 0 on all rows

_Columns = dict[str, NDArray[Any]]


def frame_messages(
    batch: Batch, decoded: Decoded, message: Message, channel: int, findings: Ints | None
) -> Iterator[Packed]:
    """All frames of a batch; `findings` is how many there are on each row, None for none on any."""
    frames = np.flatnonzero(batch.rows.kind != Kind.NOISE)
    for first in range(0, len(frames), AT_ONCE):
        which = frames[first : first + AT_ONCE]
        gapless = int(which[-1]) - int(which[0]) == len(which) - 1  # no noise between: no need to pick
        pick: Any = slice(int(which[0]), int(which[-1]) + 1) if gapless else which
        rows = batch.rows[pick]
        columns: _Columns = {name: rows.column(_RENAMED.get(name, name)) for name in (*_PLAIN, *_RARE)}
        columns |= {
            "findings": np.zeros(1, np.int64) if findings is None else findings[pick],
            "address": decoded.address[pick],
            "quantity": decoded.quantity[pick],
            "request_start": rows.request_start,
            "response_time_ns": rows.response_ns,
        }
        evidence = None if batch.evidence is None else batch.evidence[pick]
        yield _packed(columns, evidence, rows.t_end_ns, _bytes(batch, which, rows), message, channel)


def _packed(
    columns: _Columns, evidence: BoundaryEvidence | None, times: Ints, tails: Tails, message: Message, channel: int
) -> Packed:
    without = {name for name in (*_RARE, "findings") if not columns[name].any()}
    heads = packing.heads(message.layout(HEAD, without), len(times))
    for name in (*_PLAIN, *_RARE, "findings"):
        if name not in without and name != "exception":
            heads[name] = columns[name]
    for name in ("address", "quantity", "request_start", "response_time_ns"):
        message.put(heads, name, columns[name], present=columns[name] >= 0)
    if "exception" not in without:
        message.put(heads, "exception", columns["exception"], present=columns["exception"] > 0)
    if evidence is not None:
        _explain(heads, message, evidence)
    heads["data"] = packed_length(tails.sizes)
    return packing.packed(channel, times, [PackedPart(None, heads)], tails)


def noise_messages(batch: Batch, channel: int) -> Packed:
    """All noise of a batch."""
    rows = batch.rows[batch.rows.kind == Kind.NOISE]
    heads = packing.heads(schemas.NOISE.layout(HEAD), len(rows))
    for name in ("start", "length", "t_start_ns", "port"):
        heads[name] = rows.column(_RENAMED.get(name, name))
    tails = Tails(batch.data, rows.at, rows.length)
    heads["data"] = packed_length(tails.sizes)
    return packing.packed(channel, rows.t_end_ns, [PackedPart(None, heads)], tails)


def _explain(heads: NDArray[np.void], message: Message, evidence: BoundaryEvidence) -> None:
    for name in schemas.EVIDENCE:
        heads[f"evidence_{name}"] = evidence.column(name)
    kind, start = evidence.rival_kind, evidence.rival_start
    rival = (start >= 0) & (kind != Kind.NOISE)
    heads["runner_up_kind"] = np.where(rival, kind, Kind.NOISE)
    message.put(heads, "runner_up_start", start, present=rival)
    message.put(heads, "runner_up_length", evidence.rival_length, present=rival)


def _bytes(batch: Batch, which: Ints, rows: Rows) -> Tails:
    """The frames' bytes; those of ASCII mode are what their digits stand for."""
    if not (rows.protocol == Protocol.ASCII).any():
        return Tails(batch.data, rows.at, rows.length)
    adus = [adu_of(batch.bytes_of(row), int(batch.rows.protocol[row])).data for row in which.tolist()]
    sizes = np.array([len(adu) for adu in adus], np.int64)
    return Tails(np.frombuffer(b"".join(adus), np.uint8), np.cumsum(sizes) - sizes, sizes)


def transaction_messages(settled: TransactionRows, off_ns: float, message: Message, channel: int) -> Iterator[Packed]:
    """All of them in the order of their times: the start of the answer, or the end of a request that got none."""
    times = np.where(settled.response >= 0, settled.t_response_ns, settled.t_request_ns)
    if np.any(times[1:] < times[:-1]):
        order = np.argsort(times, kind="stable")
        settled, times = settled[order], times[order]
    for first in range(0, len(settled), AT_ONCE):
        block = slice(first, first + AT_ONCE)
        yield _packed_transactions(settled[block], off_ns, times[block], message, channel)


def _packed_transactions(
    settled: TransactionRows, off_ns: float, times: Ints, message: Message, channel: int
) -> Packed:
    flags = [name for name in ("retry", "late") if settled.column(name).any()]
    heads = packing.heads(message.layout(HEAD, {"retry", "late"} - {*flags}), len(settled))
    for name in ("request", "unit", "function", "status", *flags):
        heads[name] = settled.column(name)
    message.put(heads, "response", settled.response, present=settled.response >= 0)
    exact, low, high = delay_bounds(np.where(settled.response >= 0, settled.response_ns, -1), off_ns)
    message.put(heads, "response_time_ms", exact / 1e6, present=exact >= 0)
    message.put(heads, "response_time_low_ms", low / 1e6, present=low >= 0)
    message.put(heads, "response_time_high_ms", high / 1e6, present=low >= 0)
    return packing.packed(channel, times, [PackedPart(None, heads)])
