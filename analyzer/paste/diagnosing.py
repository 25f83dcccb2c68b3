"""The diagnosis of a paste: its frames as rows of a bus, each in its envelope, without times that mean anything."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from captures.line import LineSettings
from dissectors.length_rules import Role

from ..diagnosis.running import Diagnosis
from ..options import Options
from ..tables.batch import Batch
from ..tables.findings import Finding, describe
from ..tables.schema import NO_GAP, ROW, Kind, Protocol, Rows
from ..tables.transactions import Transactions
from .model import PastedFrame

_MOST_FINDINGS: Final = 10_000  # findings: a paste is read by people


def findings(frames: Sequence[PastedFrame]) -> list[tuple[Finding, ...]]:
    """What is wrong with each of these frames; of one cut before its function code there is nothing to say."""
    examined = [i for i, frame in enumerate(frames) if frame.adu.pdu or frame.adu.protocol == "rtu"]
    chosen = [frames[i] for i in examined]
    sent = [_as_captured(frame) for frame in chosen]
    batch = Batch(_rows(chosen, sent), np.frombuffer(b"".join(sent), np.uint8))
    transactions, diagnosis = Transactions(), Diagnosis(LineSettings(), Options())
    reported = list(diagnosis.feed(batch, transactions.feed(batch)))
    reported += list(diagnosis.close(transactions.close()))
    by_frame: list[list[Finding]] = [[] for _ in frames]
    for row in reported[:_MOST_FINDINGS]:
        if row["index"] >= 0:
            by_frame[examined[int(row["index"])]].append(describe(row))
    return [tuple(each) for each in by_frame]


def _as_captured(frame: PastedFrame) -> bytes:
    adu = frame.adu
    return b":" + adu.data.hex().upper().encode() + b"\r\n" if adu.protocol == "ascii" else adu.data


def _rows(frames: Sequence[PastedFrame], sent: Sequence[bytes]) -> Rows:
    rows = np.zeros(len(frames), ROW)
    lengths = np.array([len(data) for data in sent])
    rows["index"] = np.arange(len(frames))
    rows["length"], rows["start"] = lengths, np.cumsum(lengths) - lengths
    rows["at"] = rows["start"]
    rows["request"] = rows["request_start"] = rows["response_ns"] = -1
    rows["gap_before"] = rows["gap_most"] = rows["gap_least"] = NO_GAP
    rows["reads"] = 1
    at = {frame.start: i for i, frame in enumerate(frames)}
    for row, frame in zip(rows, frames, strict=True):
        row["kind"] = Kind.REQUEST if frame.role is Role.REQUEST else Kind.RESPONSE
        row["protocol"] = Protocol[frame.adu.protocol.upper()]
        row["unit"] = frame.adu.unit or 0
        row["function"] = frame.function or 0
        row["exception"] = frame.exception or 0
        row["check"] = frame.check_ok is not False or row["protocol"] == Protocol.TCP  # which has none to be wrong
        if frame.request_start in at:
            row["request"] = at[frame.request_start]
    return rows
