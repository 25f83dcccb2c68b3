"""The columns of rows: what a row of the bus is, and nothing of how it came to be; and what its times are worth.

Rows of all batches tile each port's byte stream: every byte once, in order.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum
from typing import Final, NamedTuple

import numpy as np

from .columnar import Bools, Columns, Float32s, Int32s, Int64s, UInt8s, UInt16s


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


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Rows(Columns):
    """Rows: frames and noise."""

    index: Int64s  # number of the frame, 0, 1, 2 ...; -1 for noise
    start: Int64s  # offset of its first byte in its port's stream
    length: Int64s  # bytes
    at: Int64s  # where its bytes begin in Batch.data
    t_start_ns: Int64s  # ns, best estimate of the first start bit
    t_end_ns: Int64s  # ns, best estimate of the last stop bit
    request: Int64s  # index of the request that a response answers, else -1
    request_start: Int64s  # `start` of that request, else -1
    response_ns: Int64s  # end of request to start of response; -1 where there is none or the tap can't tell
    confidence: Float32s  # 0 to 1
    kind: UInt8s  # Kind
    unit: UInt8s
    function: UInt8s  # without the exception bit
    exception: UInt8s  # exception code, 0 for none
    check: Bools  # CRC or LRC right; of Modbus TCP, which has none, True
    port: UInt8s
    protocol: UInt8s  # Protocol
    contested: Bools  # noise, or a frame in whose bytes another could end
    # What the reads say of it:
    gap_before_ns: Int64s  # ns, silence before it by the reads' times; NO_GAP where one read brought both
    gap_most_ns: Int64s  # longest and least silence between the reads that brought it; NO_GAP in one read
    gap_least_ns: Int64s  # negative where a read came late and the next one did not
    gap_at: Int32s  # byte before which the longest silence stands
    reads: Int32s  # how many reads brought it
    errors: UInt16s  # bytes that the UART marked, for parity or framing
    foreign: UInt8s  # noise that is another protocol's: its number in `dissectors.foreign.NAMES`, else 0

    def row(self, number: int) -> Row:
        """One of them."""
        return Row(*self.values(number))

    def __iter__(self) -> Iterator[Row]:
        return (Row(*values) for values in self.tolist())


@dataclass(slots=True)
class Row:
    """The values of one row of `Rows`, as Python's own. Not frozen: to make one would take eight times as long."""

    index: int
    start: int
    length: int
    at: int
    t_start_ns: int
    t_end_ns: int
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
    gap_before_ns: int
    gap_most_ns: int
    gap_least_ns: int
    gap_at: int
    reads: int
    errors: int
    foreign: int = 0


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class BoundaryEvidence(Columns):
    """Why rows stand where they do, in bits of evidence (log2 of a likelihood ratio); made when asked for."""

    length: Float32s  # the length that the header predicts, and the checks that could have failed
    crc: Float32s
    silence: Float32s  # gaps before, inside and after, by the trust that this tap has earned
    conversation: Float32s  # how it fits what was said before it
    margin: Float32s  # best explanation over the best one without this row
    rival_start: Int64s  # what would stand here instead: -1 and 0 for noise
    rival_length: Int64s
    rival_kind: UInt8s


EXACT: Final = 0.05  # of a time: what may be wrong by no more is not worth an interval


class DelayBounds(NamedTuple):
    """Columns of ns, -1 for none: what is exact, and between what each lies (twice the same where it is exact)."""

    exact: Int64s
    low: Int64s
    high: Int64s


def bounds_of(delay: int, off_ns: float | None) -> tuple[int, int] | None:
    """Between what a time (ns) lies that may be wrong by so much; None where that is not known (None or infinite)."""
    if off_ns is None or not np.isfinite(off_ns):
        return None
    return (delay, delay) if off_ns <= EXACT * delay else (max(round(delay - off_ns), 0), round(delay + off_ns))


def delay_bounds(delays: Int64s, off_ns: float) -> DelayBounds:
    """The same of a column of times (ns, -1 for none)."""
    none = np.full(len(delays), -1, np.int64)
    if not np.isfinite(off_ns):
        return DelayBounds(none, none, none)
    measured = (delays >= 0) & (off_ns <= EXACT * delays)
    present = delays >= 0
    low = np.where(present, np.where(measured, delays, np.maximum(delays - round(off_ns), 0)), -1)
    high = np.where(present, np.where(measured, delays, delays + round(off_ns)), -1)
    return DelayBounds(np.where(low == high, low, -1), low, high)
