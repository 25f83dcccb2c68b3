"""Messages of MCAP chunks packed as arrays: no Python object a message.

A message's bytes are a head, which is its record's head and whatever is of constant width, and maybe a tail of any
length out of one buffer. So sizes give offsets by one cumulative sum, and bytes go to their places in groups of one
width. Where all messages have one head and no tail, the array of their heads is the records as they stand.

What is worked on at once should stay in the processor's cache: whoever has many messages packs them `AT_ONCE`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from ...ragged import Bytes, Ints, copy_spilling, scatter, sums

AT_ONCE: Final = 1 << 12  # messages: their heads and what they are made of are some hundred KiB
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
_PLACE: Final = np.dtype([("channel", "<u2"), ("offset", "<u8")])


@dataclass(frozen=True, slots=True, eq=False)
class Tails:
    """What follows each head: `sizes` bytes of `data` from `begins` on."""

    data: Bytes
    begins: Ints
    sizes: Ints


@dataclass(frozen=True, slots=True, eq=False)
class PackedPart:
    """Messages that have a head of one width: their numbers among all (None for all of them) and their heads."""

    which: Ints | None
    heads: NDArray[np.void]  # as `heads` makes them


@dataclass(frozen=True, slots=True, eq=False)
class Packed:
    """n message records end to end in `data`; of each its channel, its log time, and where it begins."""

    data: Bytes
    channels: NDArray[np.uint16]
    log_times: NDArray[np.uint64]
    offsets: Ints

    def __len__(self) -> int:
        return len(self.offsets)


def heads(layout: NDArray[np.void], count: int) -> NDArray[np.void]:
    """So many copies of a one-row layout that begins with `record`, of type HEAD, as heads of messages."""
    row = layout.copy()
    row["record"]["opcode"], row["record"]["length"] = Opcode.MESSAGE, row.dtype.itemsize - _RECORD
    return np.repeat(row, count)


def packed(channels: Any, times: Ints, parts: Sequence[PackedPart], tails: Tails | None = None) -> Packed:
    """Messages as records, in this order; their heads get what the record says here.

    `channels` (n, or one for all) and `times` (n, ns); times before 0, which the format has not, become 0.
    """
    channels = np.broadcast_to(np.asarray(channels, np.uint16), len(times))
    log_times = np.maximum(times, 0).astype(np.uint64)
    sizes = np.zeros(len(times), np.int64)
    for part in parts:
        pick = slice(None) if part.which is None else part.which
        sizes[pick] = part.heads.dtype.itemsize
        record = part.heads["record"]
        record["channel"] = channels[pick]
        record["log_time"] = record["publish_time"] = log_times[pick]
    if tails is not None:
        sizes += tails.sizes
        for part in parts:
            part.heads["record"]["length"] = sizes[slice(None) if part.which is None else part.which] - _RECORD
    ends = sums(sizes)
    return Packed(_records(parts, tails, ends), channels, log_times, ends[:-1])


def _records(parts: Sequence[PackedPart], tails: Tails | None, ends: Ints) -> Bytes:
    if tails is None and len(parts) == 1 and parts[0].which is None:
        return parts[0].heads.view(np.uint8)
    data = np.empty(int(ends[-1]), np.uint8)
    if tails is not None:  # before the heads: what is copied beyond a tail is put right by the next head
        copy_spilling(data, ends[1:] - tails.sizes, tails.data, tails.begins, tails.sizes)
    for part in parts:
        scatter(data, ends[:-1] if part.which is None else ends[part.which], part.heads)
    return data


def index_records(channels: NDArray[np.uint16], log_times: NDArray[np.uint64], offsets: Ints) -> tuple[bytes, Any]:
    """The message index records of one chunk, and the offset of each channel's among them as (channel, offset)."""
    if (channels[1:] < channels[:-1]).any():
        order = np.argsort(channels, kind="stable")
        channels, log_times, offsets = channels[order], log_times[order], offsets[order]
    firsts = np.flatnonzero(np.diff(channels.astype(np.int64), prepend=-1))
    counts = np.diff(firsts, append=len(channels))
    heads = np.zeros(len(firsts), _INDEX_HEAD)
    heads["opcode"] = Opcode.MESSAGE_INDEX
    heads["channel"] = channels[firsts]
    heads["bytes"] = counts * _INDEX_ENTRY.itemsize
    heads["length"] = heads["bytes"] + np.uint64(_INDEX_HEAD.itemsize - _RECORD)
    entries = np.empty(len(channels), _INDEX_ENTRY)
    entries["log_time"], entries["offset"] = log_times, offsets
    places = np.empty(len(firsts), _PLACE)
    places["channel"] = heads["channel"]
    places["offset"] = firsts * _INDEX_ENTRY.itemsize + np.arange(len(firsts)) * _INDEX_HEAD.itemsize
    return _interleaved(heads.tobytes(), _INDEX_HEAD.itemsize, entries.tobytes(), heads["bytes"].tolist()), places


def _interleaved(heads: bytes, width: int, bodies: bytes, sizes: Sequence[int]) -> bytes:
    """Each head, of one width, with the body behind it."""
    parts: list[bytes] = []
    at = 0
    for i, size in enumerate(sizes):
        parts += (heads[i * width : (i + 1) * width], bodies[at : at + size])
        at += size
    return b"".join(parts)
