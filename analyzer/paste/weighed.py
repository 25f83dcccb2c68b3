"""A paste that whole frames don't tile in one way: the deframer weighs it. The only place here that needs arrays."""

from __future__ import annotations

from collections.abc import Sequence

from captures import Capture, Chunk, LineSettings, Mark

from ..core import deframe
from ..options import Options
from ..tables.batch import Batch
from ..tables.schema import Kind
from .model import PastedFrame, PastedNoise, PastePart, Piece


def weighed(parts: Sequence[PastePart]) -> list[Piece]:
    """Frames and noise of the parts' bytes, with times where every part has one."""
    timed = all(part.t_ns is not None for part in parts)
    chunks = [Chunk(part.t_ns or 0 if timed else 0, part.data, mark=Mark(part.mark)) for part in parts]
    pieces: list[Piece] = []
    pdus: dict[int, bytes] = {}
    for batch in deframe(Capture.of(LineSettings(), chunks, timed=timed), Options(protocol="rtu")):
        pieces.extend(_pieces(batch, pdus, timed))
    return pieces


def _pieces(batch: Batch, pdus: dict[int, bytes], timed: bool) -> list[Piece]:
    """Rows as pieces; `pdus` collects those of the requests, by index."""
    pieces: list[Piece] = []
    for row in range(len(batch)):
        if batch.rows.kind[row] == Kind.NOISE:
            pieces.append(PastedNoise(int(batch.rows.start[row]), batch.bytes_of(row)))
            continue
        frame = batch.frame(row)
        adu = frame.adu
        pdus[frame.index] = adu.pdu
        pieces.append(
            PastedFrame(
                adu,
                frame.role,
                frame.start,
                frame.length,
                request=pdus.get(frame.row.request),
                request_start=frame.request_start,
                confidence=frame.confidence,
                t_start_ns=frame.t_start_ns if timed else None,
                t_end_ns=frame.t_end_ns if timed else None,
                response_time_ns=frame.response_time_ns if timed else None,
            )
        )
    return pieces
