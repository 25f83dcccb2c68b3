"""What the engine has decided: segments of the stream as columns, before they are numbered and paired."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..tables.schema import BoundaryEvidence, Protocol
from .buffer import SegmentReads
from .rules import Bytes, Index

NOISE: Final = 2  # the role of a segment that is no frame
NOISE_MOST: Final = 1 << 12  # bytes of one, where frames say themselves where they begin


class DecidedSegments(NamedTuple):
    """Segments of the buffer, end to end, just decided."""

    start: Index  # index in the buffer
    end: Index
    role: NDArray[np.uint8]  # Role, or NOISE
    check: NDArray[np.bool_]  # CRC right
    margin: NDArray[np.float32]  # bits over the next best explanation
    contested: NDArray[np.bool_]  # decided by the lattice
    why: BoundaryEvidence | None = None  # where it is wanted


class StreamSegments(NamedTuple):
    """Decided segments of the stream, end to end, with all that is known of them."""

    offset: int  # where the first begins in the stream
    data: Bytes  # all their bytes
    decided: DecidedSegments  # indices are those of `data`
    reads: SegmentReads
    protocol: int = Protocol.RTU
    heads: Bytes | None = None  # (n, 3): unit, function and the byte behind it; None: the first bytes of each segment


def join_segments(parts: Sequence[DecidedSegments]) -> DecidedSegments:
    """Segments that follow each other, at least one part of them."""
    if len(parts) == 1:
        return parts[0]
    start, end, role, check, margin, contested = (np.concatenate([part[i] for part in parts]) for i in range(6))
    whys = [part.why for part in parts if part.why is not None]
    return DecidedSegments(start, end, role, check, margin, contested, BoundaryEvidence.joined(whys) if whys else None)


def whole_segments(
    start: Index, end: Index, role: NDArray[np.uint8], check: NDArray[np.bool_], *, explain: bool
) -> DecidedSegments:
    """Segments of a protocol whose frames say themselves where they end: no rival, no doubt."""
    margin = np.full(len(start), np.inf, np.float32)
    why = evidence_rows(len(start)) if explain else None
    return DecidedSegments(start, end, role, check, margin, np.zeros(len(start), np.bool_), why)


def noise_parts(start: int, end: int) -> list[tuple[int, int]]:
    """Bytes in no frame, `start` to `end`, as stretches: cut from the first on, so that more may follow the last."""
    return [(cut, min(cut + NOISE_MOST, end)) for cut in range(start, end, NOISE_MOST)]


def evidence_rows(n: int) -> BoundaryEvidence:
    """Evidence of n segments, to be filled in."""
    why = BoundaryEvidence.zeros(n)
    why.rival_start[:] = -1
    return why
