"""Settled transactions as messages."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from captures.formats.mcap import packing
from captures.formats.mcap.packing import AT_ONCE, HEAD, Packed, PackedPart
from captures.formats.mcap.protobuf import Message
from captures.ragged import Ints

from ....tables.delays import delay_bounds
from ....tables.transactions import TransactionRows


def transaction_messages(settled: TransactionRows, off_ns: float, message: Message, channel: int) -> Iterator[Packed]:
    """All of them in the order of their times: the start of the answer, or the end of a request that got none."""
    times = np.where(settled.response >= 0, settled.t_response_ns, settled.t_request_ns)
    if np.any(times[1:] < times[:-1]):
        order = np.argsort(times, kind="stable")
        settled, times = settled[order], times[order]
    for first in range(0, len(settled), AT_ONCE):
        block = slice(first, first + AT_ONCE)
        yield _packed(settled[block], off_ns, times[block], message, channel)


def _packed(settled: TransactionRows, off_ns: float, times: Ints, message: Message, channel: int) -> Packed:
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
