"""What the engine has decided, as columns: segments of the stream, and the rows of a port that they become.

Such rows are not numbered yet, nor in one order with those of other ports."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from captures.ragged import copy_pieces, sums

from ..tables.schema import BoundaryEvidence, Float32s, Kind, Protocol, Rows, UInt8s
from .buffer import SegmentReads, Times
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


def cut_segments(part: StreamSegments, count: int) -> tuple[StreamSegments, StreamSegments]:
    """The first `count` segments and the others; neither of them none."""
    at = int(part.decided.start[count])
    start, end, role, check, margin, contested, why = part.decided
    heads = part.heads
    first = part._replace(
        data=part.data[:at],
        decided=DecidedSegments(
            start[:count],
            end[:count],
            role[:count],
            check[:count],
            margin[:count],
            contested[:count],
            None if why is None else why[:count],
        ),
        reads=SegmentReads._make(column[:count] for column in part.reads),
        heads=None if heads is None else heads[:count],
    )
    rest = part._replace(
        offset=part.offset + at,
        data=part.data[at:],
        decided=DecidedSegments(
            start[count:] - at,
            end[count:] - at,
            role[count:],
            check[count:],
            margin[count:],
            contested[count:],
            None if why is None else why[count:],
        ),
        reads=SegmentReads._make(column[count:] for column in part.reads),
        heads=None if heads is None else heads[count:],
    )
    return first, rest


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


_KIND_OF_ROLE = np.array([Kind.REQUEST, Kind.RESPONSE, Kind.NOISE], np.uint8)
_KINDS = _KIND_OF_ROLE.tobytes()
_FEW = 48  # segments
_READS_BITS = 48  # of the numbers of reads
_SURE = 25.0  # bits: one less a share of 2 to the power of -25 is one, in 32 bits


def _confidence(margin: Float32s) -> Float32s:
    """How sure a margin of so many bits is, 0.5 to 1."""
    if 0 < len(margin) <= _FEW and min(margin.tolist()) >= _SURE:
        return np.ones(len(margin), np.float32)
    return (1.0 / (1.0 + np.exp2(-np.maximum(margin, 0.0)))).astype(np.float32)


def _heads(segments: StreamSegments) -> tuple[UInt8s, UInt8s, UInt8s, UInt8s]:
    """Kind, unit, function and exception code of segments."""
    data, (start, end, role, *_) = segments.data, segments.decided
    kind = _KIND_OF_ROLE.take(role)
    framed = kind != 0  # NOISE
    if segments.heads is None:
        last = len(data) - 1
        unit, function, code = (data.take(np.minimum(start + i, last)) for i in range(3))
    else:
        unit, function, code = segments.heads.T
    failed = framed & (function > 0x7F) & (end - start >= 3)
    return kind, unit * framed, (function & 0x7F) * framed, code * failed


def _heads_of_few(segments: StreamSegments) -> tuple[UInt8s, UInt8s, UInt8s, UInt8s]:
    """The same of a few segments, one by one: arrays of so few take longer."""
    octets, heads = segments.data.tobytes(), []
    for start, end, role in zip(*(column.tolist() for column in segments.decided[:3]), strict=True):
        unit, function, code = 0, 0, 0
        if role != NOISE:
            unit, function, code = (*octets[start : start + 3], 0, 0)[:3]
            if function <= 0x7F or end - start < 3:
                code = 0
        heads.append((_KINDS[role], unit, function & 0x7F, code))
    kinds, units, functions, codes = np.array(list(zip(*heads, strict=True)), np.uint8)
    return kinds, units, functions, codes


class UnorderedRows:
    """Such rows, with what belongs to them.

    `head` and `tail` number the reads that brought the first and last byte of each; `heard` is when that first read
    returned (ns), which never runs back on a port.
    """

    rows: Rows
    data: Bytes
    head: Times
    tail: Times
    heard: Times
    why: BoundaryEvidence

    def __init__(self, rows: Rows, data: Bytes, head: Times, tail: Times, heard: Times, why: BoundaryEvidence) -> None:
        self.rows, self.data, self.head, self.tail, self.heard, self.why = rows, data, head, tail, heard, why

    @classmethod
    @cache
    def nothing(cls) -> UnorderedRows:
        """No rows."""
        none = np.empty(0, np.int64)
        return cls(Rows.zeros(0), np.empty(0, np.uint8), none, none, none, evidence_rows(0))

    @classmethod
    def of(cls, port: int, segments: StreamSegments) -> UnorderedRows:
        """Rows of decided segments."""
        data, decided, reads = segments.data, segments.decided, segments.reads
        at, length = decided.start, decided.end - decided.start
        few = segments.heads is None and len(at) <= _FEW
        kind, unit, function, exception = (_heads_of_few if few else _heads)(segments)
        unknown, octets = np.empty((5, len(at)), np.int64), np.zeros((3, len(at)), np.uint8)
        unknown.fill(-1)
        octets[0], octets[1] = port, segments.protocol
        rows = Rows(
            index=unknown[0],
            start=at + segments.offset,
            length=length,
            at=at.copy(),
            t_start_ns=reads.t_start_ns,
            t_end_ns=reads.t_end_ns,
            request=unknown[1],
            request_start=unknown[2],
            response_ns=unknown[3],
            confidence=_confidence(decided.margin),
            kind=kind,
            unit=unit,
            function=function,
            exception=exception,
            check=decided.check.copy(),
            port=octets[0],
            protocol=octets[1],
            contested=decided.contested.copy(),
            gap_before_ns=reads.gap_before_ns,
            gap_most_ns=reads.gap_most_ns,
            gap_least_ns=reads.gap_least_ns,
            gap_at=reads.gap_at,
            reads=reads.reads.astype(np.int32),
            errors=reads.errors,
            foreign=octets[2],
            taken_for_start=unknown[4],
            unsure=np.zeros(len(at), np.bool_),
            mark=reads.mark,
        )
        why = evidence_rows(0) if decided.why is None else decided.why
        first = port << _READS_BITS  # each port counts its own reads, and one of two ports is never the same
        return cls(rows, data, reads.head + first, reads.tail + first, reads.heard, why)

    @classmethod
    def joined(cls, parts: Sequence[UnorderedRows]) -> UnorderedRows:
        """All of these, one behind the other. Of one that alone has rows, the arrays are that one's own."""
        parts = [part for part in parts if len(part.data)]
        if len(parts) < 2:
            return parts[0] if parts else cls.nothing()
        shift = 0
        for part in parts:
            part.rows.at[:] += shift
            shift += len(part.data)
        return cls(
            Rows.joined([p.rows for p in parts]),
            np.concatenate([p.data for p in parts]),
            np.concatenate([p.head for p in parts]),
            np.concatenate([p.tail for p in parts]),
            np.concatenate([p.heard for p in parts]),
            BoundaryEvidence.joined([p.why for p in parts]),
        )

    def placed_anew(self) -> UnorderedRows:
        """The same rows, of which `at` may be moved without moving these."""
        rows = replace(self.rows, at=self.rows.at.copy())
        return UnorderedRows(rows, self.data, self.head, self.tail, self.heard, self.why)

    def bytes_of(self, i: int) -> bytes:
        """The captured bytes of a row."""
        at = self.rows.at.item(i)
        return self.data[at : at + self.rows.length.item(i)].tobytes()

    def picked(self, which: NDArray[np.intp]) -> UnorderedRows:
        """Those at these places, in this order."""
        rows = self.rows[which]
        starts, lengths = rows.at.copy(), rows.length.copy()
        ends = sums(lengths)
        data = np.empty(int(ends[-1]), np.uint8)
        copy_pieces(data, ends[:-1], self.data, starts, lengths)
        rows.at[:] = ends[:-1]
        why = self.why[which] if len(self.why) else self.why  # there is none where nobody wants it
        return UnorderedRows(rows, data, self.head[which], self.tail[which], self.heard[which], why)
