"""The columns of rows: what a row of the bus is, and nothing of how it came to be.

Rows of all batches tile each port's byte stream: every byte once, in order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray


class Kind(IntEnum):
    """What a row is."""

    NOISE = 0
    REQUEST = 1
    RESPONSE = 2


class Protocol(IntEnum):
    """The envelope of a frame."""

    RTU = 0
    ASCII = 1
    TCP = 2


class Direction(IntEnum):
    """The key `direction` of a frame, by kind."""

    request = Kind.REQUEST
    response = Kind.RESPONSE


NO_GAP = -(1 << 62)  # a silence of which nothing is known
ROW = np.dtype(
    [
        ("index", np.int64),  # number of the frame, 0, 1, 2 ...; -1 for noise
        ("start", np.int64),  # offset of its first byte in its port's stream
        ("length", np.int64),  # bytes
        ("at", np.int64),  # where its bytes begin in Batch.data
        ("t_start", np.int64),  # ns, best estimate of the first start bit
        ("t_end", np.int64),  # ns, best estimate of the last stop bit
        ("request", np.int64),  # index of the request that a response answers, else -1
        ("request_start", np.int64),  # `start` of that request, else -1
        ("response_ns", np.int64),  # end of request to start of response; -1 where there is none or the tap can't tell
        ("confidence", np.float32),  # 0 to 1
        ("kind", np.uint8),  # Kind
        ("unit", np.uint8),
        ("function", np.uint8),  # without the exception bit
        ("exception", np.uint8),  # exception code, 0 for none
        ("check", np.bool_),  # CRC or LRC right; of Modbus TCP, which has none, True
        ("port", np.uint8),
        ("protocol", np.uint8),  # Protocol
        ("contested", np.bool_),  # noise, or a frame in whose bytes another could end
        # What the reads say of it:
        ("gap_before", np.int64),  # ns, silence before it by the reads' times; NO_GAP where one read brought both
        ("gap_most", np.int64),  # longest and least silence between the reads that brought it; NO_GAP in one read
        ("gap_least", np.int64),  # negative where a read came late and the next one did not
        ("gap_at", np.int32),  # byte before which the longest silence stands
        ("reads", np.int32),  # how many reads brought it
        ("errors", np.uint16),  # bytes that the UART marked, for parity or framing
        ("foreign", np.uint8),  # noise that is another protocol's: its number in `dissectors.foreign.NAMES`, else 0
    ]
)


@dataclass(frozen=True, slots=True)
class Row:
    """The values of one row of `ROW`, as Python's own."""

    index: int
    start: int
    length: int
    at: int
    t_start: int
    t_end: int
    request: int
    request_start: int
    response_ns: int
    confidence: float
    kind: int
    unit: int
    function: int
    exception: int
    check: bool
    port: int
    protocol: int
    contested: bool
    gap_before: int
    gap_most: int
    gap_least: int
    gap_at: int
    reads: int
    errors: int
    foreign: int = 0


# Why a row's boundaries stand where they do, in bits of evidence (log2 of a likelihood ratio); made when asked for.
EVIDENCE = np.dtype(
    [
        ("length", np.float32),  # the length that the header predicts, and the checks that could have failed
        ("crc", np.float32),
        ("silence", np.float32),  # gaps before, inside and after, by the trust that this tap has earned
        ("conversation", np.float32),  # how it fits what was said before it
        ("margin", np.float32),  # best explanation over the best one without this row
        ("rival_start", np.int64),  # what would stand here instead: -1 and 0 for noise
        ("rival_length", np.int64),
        ("rival_kind", np.uint8),
    ]
)

Rows = NDArray[np.void]


# Rows of a structured array moved as what they are to the machine: so many bytes each.
#
# numpy copies a structured array field by field, some thirty times slower than the same bytes as one opaque value.


Records = NDArray[np.void]


def join_rows(parts: Sequence[Records]) -> Records:
    """Arrays of one dtype end to end, at least one: `np.concatenate`."""
    return np.concatenate([_opaque_rows(part) for part in parts]).view(parts[0].dtype)


def take_rows(rows: Records, which: NDArray[Any]) -> Records:
    """`rows[which]`, by places or by a mask: a copy."""
    chosen: Records = _opaque_rows(rows)[which].view(rows.dtype)
    return chosen


def _opaque_rows(rows: Records) -> Records:
    return rows.view(np.dtype((np.void, rows.dtype.itemsize)))
