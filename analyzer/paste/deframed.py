"""What of a paste needs arrays: the deframer's word where frames tile its bytes in several ways, and its diagnosis.

For the diagnosis frames are rows of a bus, each in its envelope, with the times of their lines where all have one.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Final

import numpy as np

from captures import Capture, Chunk, Mark
from captures.line import EXCERPT_NOTE, LineSettings
from dissectors.crc import crc_bytes
from dissectors.length_rules import Role
from dissectors.limits import CRC_SIZE

from ..core import deframe
from ..diagnosis.judge import Diagnosis
from ..options import Options
from ..tables.batch import Batch
from ..tables.findings import Finding, Findings, described
from ..tables.schema import NO_GAP, Kind, Protocol, Rows
from ..tables.transactions import Transactions
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


_MOST_FINDINGS: Final = 10_000  # findings: a paste is read by people


def findings(pieces: Sequence[Piece]) -> list[tuple[Finding, ...]]:
    """What is wrong with each frame of a paste; of one cut before its function code there is nothing to say."""
    frames = [piece for piece in pieces if isinstance(piece, PastedFrame)]
    examined = [i for i, frame in enumerate(frames) if frame.adu.pdu or frame.adu.protocol == "rtu"]
    chosen = [frames[i] for i in examined]
    sent = [_as_captured(frame) for frame in chosen]
    batch = Batch(_rows(chosen, sent), np.frombuffer(b"".join(sent), np.uint8))
    transactions, diagnosis = Transactions(), Diagnosis(LineSettings(notes={EXCERPT_NOTE: ""}), Options())
    reported = diagnosis.feed(batch, transactions.feed(batch))
    reported = Findings.joined((reported, diagnosis.close(transactions.close())))
    by_frame: list[list[Finding]] = [[] for _ in frames]
    unclear = _unclear(pieces)
    first = {frame.adu.data: frame.start for frame in reversed(frames)}
    for finding in described(reported[:_MOST_FINDINGS]):
        if finding.index is None:
            continue
        frame = frames[examined[finding.index]]
        again = first[frame.adu.data] < frame.start
        if _carried(finding.code, frame, again=again, answered=frame.start not in unclear):
            by_frame[examined[finding.index]].append(finding)
    return [tuple(each) for each in by_frame]


def _unclear(pieces: Sequence[Piece]) -> set[int]:
    """Where requests begin that may well have got an answer: what is behind them is no whole frame."""
    return {
        request.start
        for request, behind in pairwise(pieces)
        if isinstance(request, PastedFrame)
        and (request.also is not None or isinstance(behind, PastedNoise) or behind.check_ok is False)
    }


def _carried(code: str, frame: PastedFrame, *, again: bool, answered: bool) -> bool:
    """Whether a text can tell this of a frame: it may leave bytes out, and say again what it said above."""
    if frame.missing and code == "crc-error":
        return False
    if code == "no-response":
        return answered
    return frame.t_start_ns is not None or not (again and code == "duplicate-response")


def _as_captured(frame: PastedFrame) -> bytes:
    """The bytes of a frame on its line; with the CRC that a text leaves out."""
    adu = frame.adu
    if adu.protocol == "ascii":
        return b":" + adu.data.hex().upper().encode() + b"\r\n"
    return adu.data + crc_bytes(adu.data) if _shows_no_crc(frame) else adu.data


def _shows_no_crc(frame: PastedFrame) -> bool:
    return frame.adu.protocol == "rtu" and frame.missing == CRC_SIZE and frame.length_known


def _rows(frames: Sequence[PastedFrame], sent: Sequence[bytes]) -> Rows:
    rows = Rows.zeros(len(frames))
    lengths = np.array([len(data) for data in sent])
    rows.index[:] = np.arange(len(frames))
    rows.length[:], rows.start[:] = lengths, np.cumsum(lengths) - lengths
    rows.at[:] = rows.start
    rows.request[:] = rows.request_start[:] = rows.response_ns[:] = rows.taken_for_start[:] = -1
    rows.gap_before_ns[:] = rows.gap_most_ns[:] = rows.gap_least_ns[:] = NO_GAP
    rows.reads[:] = 1
    begins = [frame.t_start_ns for frame in frames if frame.t_start_ns is not None]
    if len(begins) == len(frames):
        rows.t_start_ns[:] = rows.t_end_ns[:] = begins
    at = {frame.start: i for i, frame in enumerate(frames)}
    for row, frame in enumerate(frames):
        rows.kind[row] = Kind.REQUEST if frame.role is Role.REQUEST else Kind.RESPONSE
        rows.protocol[row] = Protocol[frame.adu.protocol.upper()]
        rows.unit[row], rows.mark[row] = frame.adu.unit or 0, frame.mark
        rows.function[row] = frame.function or 0
        rows.exception[row] = frame.exception or 0
        rows.check[row] = frame.check_ok is not False or frame.adu.protocol == "tcp"  # which has none to be wrong
        rows.check[row] |= _shows_no_crc(frame)
        if frame.request_start in at:
            rows.request[row] = at[frame.request_start]
    return rows
