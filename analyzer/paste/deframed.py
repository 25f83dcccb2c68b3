"""What of a paste needs arrays: the deframer's word on its bytes, and the diagnosis of its frames.

Parts are reads of one line, as they are when a capture is made of the text: each envelope that check values show has a
port of its own, and one that shows none is of that before it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Final

import numpy as np

from captures import Capture, Chunk, Mark
from captures.line import DIRECTIONS_NOTE, EXCERPT_NOTE, PROTOCOLS_NOTE, LineSettings
from dissectors.crc import crc_bytes
from dissectors.length_rules import Role

from ..core import deframe
from ..deframing.judging import envelope_of, judge
from ..diagnosis.damage.triage import VAGUE
from ..diagnosis.judge import Diagnosis
from ..diagnosis.rules.noise import Pattern
from ..options import Options
from ..outages import with_cut_off
from ..tables.batch import Batch, Frame
from ..tables.findings import Finding, Findings, described
from ..tables.schema import NO_GAP, Kind, Protocol, Rows
from ..tables.transactions import Transactions
from .model import Envelope, PastedFrame, PastedNoise, PastePart, Piece, edges_of, frames_of

_SIDES: Final = ("", "request", "response")  # by marks


def deframed(parts: Sequence[PastePart], envelope: Envelope, roles: Sequence[Role]) -> list[Piece]:
    """The deframer's frames, and the noise between them; with times where every part has one."""
    kinds = _envelopes(parts) if envelope == "auto" else [envelope] * len(parts)
    ports = [*dict.fromkeys(kinds)]
    side = roles[0].name.lower() if len(roles) == 1 else _only_side(parts)
    capture = _captured(parts, [ports.index(kind) for kind in kinds], {
        PROTOCOLS_NOTE: ",".join(ports), DIRECTIONS_NOTE: ",".join([side] * len(ports)),
    })  # fmt: skip
    places: dict[str, list[int]] = {kind: [] for kind in ports}  # in the paste, of each byte of a port
    for start, part, kind in zip(edges_of(parts), parts, kinds, strict=False):
        places[kind].extend(range(start, start + len(part.data)))
    pieces: list[Piece] = []
    pdus: dict[int, bytes] = {}
    for batch in deframe(capture, Options()):
        for row in range(len(batch)):
            data, noise = batch.bytes_of(row), batch.rows.kind[row] == Kind.NOISE
            start = int(batch.rows.start[row])
            piece = PastedNoise(start, data) if noise else _frame(batch.frame(row), pdus, capture.timed)
            pieces.extend(_placed(piece, data, places[ports[batch.rows.port[row]]]))
    return sorted(pieces, key=lambda piece: piece.start)


def _captured(parts: Sequence[PastePart], ports: Sequence[int], notes: dict[str, str]) -> Capture:
    """The parts as reads of their ports; a mark on every line is no speaker."""
    timed = all(part.t_ns is not None for part in parts)
    told = len({part.mark for part in parts}) > 1
    chunks = [
        Chunk((part.t_ns or 0) * timed, part.data, port, Mark(part.mark * told))
        for part, port in zip(parts, ports, strict=True)
    ]
    return Capture.of(LineSettings(notes=notes), chunks, timed=timed)


def _envelopes(parts: Sequence[PastePart]) -> list[str]:
    """The envelope of each part by its own check values; of one that has none that before it, or the first behind."""
    own = [envelope_of(part.data) for part in parts]
    latest = next((kind for kind in own if kind is not None), "")
    return [latest := kind or latest for kind in own]


def _only_side(parts: Sequence[PastePart]) -> str:
    """The direction of a client's text that marks one side alone, if its frames read alike both ways."""
    side, *others = {_SIDES[part.mark] for part in parts}
    if others or not side:
        return ""
    spans = [span for part in parts for span in judge(part.data)]
    return side * (len(spans) >= len(parts) and all(span.repeats for span in spans))


def _placed(piece: Piece, data: bytes, places: Sequence[int]) -> Iterator[Piece]:
    """A piece of a port among the bytes of all; where bytes of other ports lie in it, it is no frame, and divided."""
    mine = places[piece.start : piece.start + piece.length]
    if isinstance(piece, PastedFrame) and mine[-1] - mine[0] == piece.length - 1:
        asked = None if piece.request_start is None else places[piece.request_start]
        yield replace(piece, start=mine[0], adu=replace(piece.adu, start=mine[0]), request_start=asked)
        return
    gaps = [at for at in range(1, len(mine)) if mine[at] - mine[at - 1] > 1]
    for first, last in pairwise([0, *gaps, len(mine)]):
        yield PastedNoise(mine[first], data[first:last])


def _frame(frame: Frame, pdus: dict[int, bytes], timed: bool) -> PastedFrame:
    """A row as a frame of a paste; `pdus` collects those of all, by index."""
    pdus[frame.index] = frame.adu.pdu
    return PastedFrame(
        frame.adu,
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


_KINDS: Final = {Role.REQUEST: Kind.REQUEST, Role.RESPONSE: Kind.RESPONSE}
_MOST_FINDINGS: Final = 10_000  # findings: a paste is read by people
_PLACELESS: Final = (Pattern.STRAY, Pattern.IDLE, Pattern.QUOTED)  # of noise: a text shows that it is none of a frame


def findings(pieces: Sequence[Piece]) -> list[tuple[Finding, ...]]:
    """What is wrong with each piece of a paste; of a frame cut before its function code there is nothing to say."""
    frames = frames_of(pieces)
    unclear = _unclear(pieces)
    first = {frame.adu.data: frame.start for frame in reversed(frames)}
    by_start: dict[int, list[Finding]] = {piece.start: [] for piece in pieces}
    for piece, finding in _diagnosed([piece for piece in pieces if _is_examined(piece)]):
        if isinstance(piece, PastedNoise):
            vague = finding.code in VAGUE and "due" not in finding.numbers
            carried = not vague and finding.numbers.get("pattern") not in _PLACELESS
        else:
            again, answered = first[piece.adu.data] < piece.start, piece.start not in unclear
            carried = _carried(finding.code, piece, again=again, answered=answered)
        by_start[piece.start] += [finding] * carried
    return [tuple(by_start[piece.start]) for piece in pieces]


def _is_examined(piece: Piece) -> bool:
    return isinstance(piece, PastedNoise) or bool(piece.adu.pdu) or piece.adu.protocol == "rtu"


def _diagnosed(pieces: Sequence[Piece]) -> Iterator[tuple[Piece, Finding]]:
    """What is wrong with pieces."""
    sent = [piece.data if isinstance(piece, PastedNoise) else _as_captured(piece) for piece in pieces]
    rows = _rows(pieces, sent)
    batch = Batch(rows, np.frombuffer(b"".join(sent), np.uint8))
    transactions, diagnosis = Transactions(), Diagnosis(LineSettings(notes={EXCERPT_NOTE: ""}), Options())
    reported = diagnosis.feed(batch, transactions.feed(batch))
    end_ns = int(rows.t_end_ns.max(initial=0))
    last = with_cut_off(transactions.close(), end_ns, transactions.patience_ns, -1)  # a text may end anywhere
    reported = Findings.joined((reported, diagnosis.close(last)))
    frames = frames_of(pieces)
    at = dict(zip(rows.start.tolist(), pieces, strict=True))
    for finding in described(reported[:_MOST_FINDINGS]):
        if finding.index is not None:
            yield frames[finding.index], finding
        elif finding.start in at:
            yield at[finding.start], finding


def _unclear(pieces: Sequence[Piece]) -> set[int]:
    """Where requests begin that may well have got an answer: what is behind them is no whole frame."""
    right = {frame.start for frame in frames_of(pieces) if frame.is_right or frame.lacks_crc}
    both = {frame.start for frame in frames_of(pieces) if frame.also is not None}
    return both.union(piece.start for piece, behind in pairwise(pieces) if behind.start not in right)


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
    return adu.data + crc_bytes(adu.data) if frame.lacks_crc else adu.data


def _rows(pieces: Sequence[Piece], sent: Sequence[bytes]) -> Rows:
    rows = Rows.zeros(len(pieces))
    lengths = np.array([len(data) for data in sent])
    framed = np.array([isinstance(piece, PastedFrame) for piece in pieces])
    number = np.cumsum(framed) - 1
    rows.index[:] = np.where(framed, number, -1)
    rows.length[:], rows.start[:] = lengths, np.cumsum(lengths) - lengths
    rows.at[:] = rows.start
    rows.request[:] = rows.request_start[:] = rows.response_ns[:] = rows.taken_for_start[:] = -1
    rows.gap_before_ns[:] = rows.gap_most_ns[:] = rows.gap_least_ns[:] = NO_GAP
    rows.reads[:] = 1
    frames = frames_of(pieces)
    begins = [frame.t_start_ns for frame in frames if frame.t_start_ns is not None]
    if len(begins) == len(frames) > 0:  # bytes outside frames: as of the frame before them
        rows.t_start_ns[:] = rows.t_end_ns[:] = np.array(begins)[np.maximum(number, 0)]
    at: dict[int | None, int] = {frame.start: i for i, frame in enumerate(frames)}
    for row, frame in zip(np.flatnonzero(framed).tolist(), frames, strict=True):
        _fill(rows, row, frame, at)
    return rows


def _fill(rows: Rows, row: int, frame: PastedFrame, at: Mapping[int | None, int]) -> None:
    """What a row has of its frame; `at`: the numbers of frames by their starts."""
    rows.kind[row] = _KINDS[frame.role]
    rows.protocol[row] = Protocol[frame.adu.protocol.upper()]
    rows.unit[row], rows.mark[row] = frame.adu.unit or 0, frame.mark
    rows.function[row], rows.exception[row] = frame.function or 0, frame.exception or 0
    # Modbus TCP has no check value to be wrong, and one that a text leaves out is not
    rows.check[row] = frame.is_right or frame.adu.protocol == "tcp" or frame.lacks_crc
    rows.request[row] = at.get(frame.request_start, -1)
