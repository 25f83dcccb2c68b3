"""What of a paste needs arrays: the deframer's word where frames tile its bytes in several ways, and its diagnosis.

For the diagnosis frames are rows of a bus, each in its envelope, without times that mean anything.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from captures import Capture, Chunk, Mark
from captures.line import LineSettings
from dissectors.length_rules import Role

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
_OF_AN_ANSWER: Final = ("no-response", "retry")  # a list of requests, without times, says nothing of answers


def findings(frames: Sequence[PastedFrame]) -> list[tuple[Finding, ...]]:
    """What is wrong with each of these frames; of one cut before its function code there is nothing to say."""
    examined = [i for i, frame in enumerate(frames) if frame.adu.pdu or frame.adu.protocol == "rtu"]
    chosen = [frames[i] for i in examined]
    sent = [_as_captured(frame) for frame in chosen]
    batch = Batch(_rows(chosen, sent), np.frombuffer(b"".join(sent), np.uint8))
    transactions, diagnosis = Transactions(), Diagnosis(LineSettings(), Options())
    reported = diagnosis.feed(batch, transactions.feed(batch))
    reported = Findings.joined((reported, diagnosis.close(transactions.close())))
    by_frame: list[list[Finding]] = [[] for _ in frames]
    one_sided = all(frame.role is Role.REQUEST and frame.t_start_ns is None for frame in frames)
    for finding in described(reported[:_MOST_FINDINGS]):
        if finding.index is not None and not (one_sided and finding.code in _OF_AN_ANSWER):
            by_frame[examined[finding.index]].append(finding)
    return [tuple(each) for each in by_frame]


def _as_captured(frame: PastedFrame) -> bytes:
    adu = frame.adu
    return b":" + adu.data.hex().upper().encode() + b"\r\n" if adu.protocol == "ascii" else adu.data


def _rows(frames: Sequence[PastedFrame], sent: Sequence[bytes]) -> Rows:
    rows = Rows.zeros(len(frames))
    lengths = np.array([len(data) for data in sent])
    rows.index[:] = np.arange(len(frames))
    rows.length[:], rows.start[:] = lengths, np.cumsum(lengths) - lengths
    rows.at[:] = rows.start
    rows.request[:] = rows.request_start[:] = rows.response_ns[:] = -1
    rows.gap_before_ns[:] = rows.gap_most_ns[:] = rows.gap_least_ns[:] = NO_GAP
    rows.reads[:] = 1
    at = {frame.start: i for i, frame in enumerate(frames)}
    for row, frame in enumerate(frames):
        rows.kind[row] = Kind.REQUEST if frame.role is Role.REQUEST else Kind.RESPONSE
        rows.protocol[row] = Protocol[frame.adu.protocol.upper()]
        rows.unit[row] = frame.adu.unit or 0
        rows.function[row] = frame.function or 0
        rows.exception[row] = frame.exception or 0
        rows.check[row] = frame.check_ok is not False or frame.adu.protocol == "tcp"  # which has none to be wrong
        if frame.request_start in at:
            rows.request[row] = at[frame.request_start]
    return rows
