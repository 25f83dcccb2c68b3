"""Messages of MCAP chunks packed as arrays: no Python object a message.

Messages come in lots. A lot is many messages that each belong to a row (a frame of the bus, say), rows ascending; the
messages of all lots that belong to one row stand together, in the order of the lots. A message's bytes are a head,
which is its record's head and whatever is of constant width, and maybe a tail of any length out of one buffer. So
sizes give offsets by one cumulative sum, and bytes go to their places in groups of one width.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from captures.ragged import Ints, copy_pieces, scatter, sums

_RECORD: Final = 9  # bytes of an opcode and a length

# What every message record begins with. The log time is the publish time too.
HEAD: Final = np.dtype(
    [
        ("opcode", "u1"),
        ("length", "<u8"),
        ("channel", "<u2"),
        ("sequence", "<u4"),
        ("log_time", "<u8"),
        ("publish_time", "<u8"),
    ]
)
_INDEX_HEAD: Final = np.dtype([("opcode", "u1"), ("length", "<u8"), ("channel", "<u2"), ("bytes", "<u4")])
_INDEX_ENTRY: Final = np.dtype([("log_time", "<u8"), ("offset", "<u8")])


@dataclass(frozen=True, slots=True, eq=False)
class Tails:
    """What follows each head: `sizes` bytes of `data` from `begins` on."""

    data: NDArray[np.uint8]
    begins: Ints
    sizes: Ints


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """Messages of a lot that have a head of one width: their numbers in the lot (all for None) and their heads."""

    which: Ints | None
    heads: NDArray[np.void]  # as `heads` makes them


@dataclass(frozen=True, slots=True, eq=False)
class Lot:
    """m messages: `rows` (m, ascending) that they belong to, `channels` and `log_times` (m), and their bytes."""

    rows: Ints
    channels: NDArray[np.uint16]
    log_times: NDArray[np.uint64]
    parts: Sequence[Part]
    tails: Tails | None = None

    @classmethod
    def of(cls, rows: Ints, channels: Any, times: Ints, parts: Sequence[Part], tails: Tails | None = None) -> Lot:
        """A lot whose heads get their record's head here; times before 0, which the format has not, become 0."""
        count = len(rows)
        channel = np.broadcast_to(np.asarray(channels, np.uint16), count)
        log_times = np.maximum(times, 0).astype(np.uint64)
        for part in parts:
            pick = slice(None) if part.which is None else part.which
            record = part.heads["record"]
            if tails is not None:
                record["length"] = part.heads.dtype.itemsize - _RECORD + tails.sizes[pick]
            record["channel"] = channel[pick]
            record["log_time"] = record["publish_time"] = log_times[pick]
        return cls(rows, channel, log_times, parts, tails)

    def sizes(self) -> Ints:
        """Bytes of each message's record."""
        sizes = np.zeros(len(self.rows), np.int64)
        for part in self.parts:
            sizes[slice(None) if part.which is None else part.which] = part.heads.dtype.itemsize
        return sizes if self.tails is None else sizes + self.tails.sizes


@dataclass(frozen=True, slots=True, eq=False)
class Packed:
    """Message records end to end, those of `row_offsets[r]` up to `row_offsets[r + 1]` belonging to row r."""

    data: NDArray[np.uint8]
    row_offsets: Ints
    lots: Sequence[Lot]
    offsets: Sequence[Ints]  # of each lot's messages, in data


def heads(layout: NDArray[np.void], count: int) -> NDArray[np.void]:
    """So many copies of a one-row layout that begins with `record`, of type HEAD, as heads of messages."""
    row = layout.copy()
    row["record"]["opcode"], row["record"]["length"] = Opcode.MESSAGE, row.dtype.itemsize - _RECORD
    return np.repeat(row, count)


def packed(lots: Sequence[Lot], count: int) -> Packed:
    """The records of these lots, which belong to `count` rows."""
    sizes = [lot.sizes() for lot in lots]
    within = [sums(size) for size in sizes]  # of a lot: bytes before each message
    firsts = [sums(np.bincount(lot.rows, minlength=count)) for lot in lots]
    before = [ends[first] for ends, first in zip(within, firsts, strict=True)]  # of a lot: bytes before each row
    row_offsets = np.zeros(count + 1, np.int64)
    for ahead in before:
        row_offsets += ahead
    data = np.empty(int(row_offsets[-1]), np.uint8)
    start = row_offsets[:-1].copy()
    offsets = []
    for lot, ends, ahead in zip(lots, within, before, strict=True):
        at = start[lot.rows] + ends[:-1] - ahead[lot.rows]
        start += np.diff(ahead)
        offsets.append(at)
        _place(data, lot, at)
    return Packed(data, row_offsets, lots, offsets)


def index_records(channels: NDArray[np.uint16], log_times: NDArray[np.uint64], offsets: Ints) -> tuple[bytes, Any]:
    """The message index records of one chunk, and the offset of each channel's among them as (channel, offset)."""
    order = np.argsort(channels, kind="stable")
    channels = channels[order]
    firsts = np.flatnonzero(np.append(True, channels[1:] != channels[:-1])) if len(channels) else np.zeros(0, np.int64)
    counts = np.diff(np.append(firsts, len(channels)))
    heads = np.zeros(len(firsts), _INDEX_HEAD)
    heads["opcode"] = Opcode.MESSAGE_INDEX
    heads["channel"] = channels[firsts]
    heads["bytes"] = counts * _INDEX_ENTRY.itemsize
    heads["length"] = heads["bytes"] + np.uint64(_INDEX_HEAD.itemsize - _RECORD)
    entries = np.empty(len(channels), _INDEX_ENTRY)
    entries["log_time"], entries["offset"] = log_times[order], offsets[order]
    head_at = firsts * _INDEX_ENTRY.itemsize + np.arange(len(firsts)) * _INDEX_HEAD.itemsize
    entry_at = np.arange(len(channels)) * _INDEX_ENTRY.itemsize
    entry_at += np.repeat(np.arange(1, len(firsts) + 1) * _INDEX_HEAD.itemsize, counts)
    out = np.empty(len(heads) * _INDEX_HEAD.itemsize + len(entries) * _INDEX_ENTRY.itemsize, np.uint8)
    scatter(out, head_at, heads)
    scatter(out, entry_at, entries)
    places = np.empty(len(firsts), [("channel", "<u2"), ("offset", "<u8")])
    places["channel"], places["offset"] = heads["channel"], head_at
    return out.tobytes(), places


def _place(data: NDArray[np.uint8], lot: Lot, at: Ints) -> None:
    for part in lot.parts:
        here = at if part.which is None else at[part.which]
        scatter(data, here, part.heads)
        if lot.tails is not None:
            pick = slice(None) if part.which is None else part.which
            tails = lot.tails
            copy_pieces(data, here + part.heads.dtype.itemsize, tails.data, tails.begins[pick], tails.sizes[pick])
