"""Rows of a port as its engine decided them: not numbered yet, nor in one order with those of other ports."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

from captures.ragged import copy_pieces, sums

from ..tables.columnar import Float32s, UInt8s
from ..tables.schema import BoundaryEvidence, Kind, Rows
from .buffer import Times
from .rules import Bytes
from .segments import NOISE, StreamSegments, evidence_rows

_KIND_OF_ROLE = np.array([Kind.REQUEST, Kind.RESPONSE, Kind.NOISE], np.uint8)
_KINDS = _KIND_OF_ROLE.tobytes()
_FEW = 48  # segments
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
        unknown, octets = np.empty((4, len(at)), np.int64), np.zeros((3, len(at)), np.uint8)
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
        )
        why = evidence_rows(0) if decided.why is None else decided.why
        return cls(rows, data, reads.head, reads.tail, reads.heard, why)

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
