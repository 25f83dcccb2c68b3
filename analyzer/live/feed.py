"""Blocks in, rows with their transactions and findings out: the analysis of a bus while it happens.

The same parts as on files (`analyzer.pipeline`), but nothing is held back: a row is given as soon as it is certain, and
a finding when it is made, which may be after the row that it speaks of was given (by `index`).
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from analyzer.deframing.ascii import AsciiDeframer, looks_ascii
from analyzer.deframing.options import Options
from analyzer.deframing.stream import Deframer
from analyzer.findings.diagnosis import Diagnosis
from analyzer.findings.model import NOTHING, Findings
from analyzer.frames import Batch, Kind, Rows
from analyzer.transactions import TRANSACTION, Transactions
from captures.chunks import Block
from captures.line import LineSettings

_FOREIGN: Final = re.compile(rb"[^:0-9A-Fa-f\r\n]")  # what no line in ASCII mode carries
_LOOK: Final = 2048  # bytes: by then it is plain what a line speaks


@dataclass(frozen=True, slots=True)
class Fed:
    """What one step brought: rows, the transactions settled by then, and what was found, of these rows or earlier ones.

    `batch.findings` are those that speak of the batch's own rows.
    """

    batch: Batch
    transactions: Rows
    findings: Findings


class Feed:
    """The analysis of one line. Frames are numbered on when it has to begin anew."""

    def __init__(self, line: LineSettings, options: Options = Options()) -> None:  # noqa: B008 - frozen
        self._options = options
        self._frames = 0  # of deframers before the present one
        self._seen = 0
        self._starts: dict[int, int] = {}  # bytes before the present deframer's, by port
        self._heard: dict[int, int] = {}  # bytes so far, by port
        self._line = line
        self._deframer: Deframer | AsciiDeframer | None = None
        self._held: list[Block] = []  # until it is plain what the line speaks
        self._transactions = Transactions()
        self._diagnosis = Diagnosis(line, options)

    def feed(self, block: Block) -> Fed:
        """What these bytes make certain."""
        self._count(octets_by_port(block))
        if self._deframer is None:
            self._held.append(block)
            block = Block.joined(self._held)
            self._choose(block)
            if self._deframer is None:
                return self._told(Batch.empty())
            self._held = []
        return self._told(self._deframer.feed(block))

    def tick(self, now_ns: int) -> Fed:
        """What the silence up to `now_ns` makes certain."""
        return self._told(Batch.empty() if self._deframer is None else self._deframer.tick(now_ns))

    def restart(self, line: LineSettings, missed: Mapping[int, int] | None = None) -> Fed:
        """Bytes were missed (so many, by port), or the line is another from now on: what was certain before."""
        last = self.close()
        self._count(missed or {})
        self._starts = dict(self._heard)
        self._frames = self._seen
        self._line = line
        self._deframer, self._held = None, []
        self._transactions = Transactions()
        self._diagnosis = Diagnosis(line, self._options)
        return last

    def nothing(self) -> Fed:
        """No step at all."""
        return self._told(Batch.empty())

    def close(self) -> Fed:
        """No more comes; the rest."""
        batch = Batch.empty()
        if self._deframer is None and self._held:
            self._deframer = Deframer(self._line, self._options)
            batch = self._deframer.feed(Block.joined(self._held))
            self._held = []
        if self._deframer is not None:
            rest = self._deframer.close()
            batch = rest if not len(batch) else _joined(batch, rest)
        fed = self._told(batch)
        settled = self._transactions.close()
        findings = np.concatenate((fed.findings, self._diagnosed(self._diagnosis.close(settled))))
        return Fed(_said(fed.batch, findings), np.concatenate((fed.transactions, self._settled(settled))), findings)

    def _count(self, heard: Mapping[int, int]) -> None:
        for port, octets in heard.items():
            self._heard[port] = self._heard.get(port, 0) + octets

    def _choose(self, block: Block) -> None:
        """RTU as soon as a byte tells so, ASCII mode when frames do."""
        data = block.data[:_LOOK].tobytes()
        mode = self._options.protocol
        if mode == "auto" and (_FOREIGN.search(data) or len(data) == _LOOK):
            mode = "rtu"
        if mode == "ascii" or (mode == "auto" and looks_ascii(data)):
            self._deframer = AsciiDeframer(self._line, self._options)
        elif mode == "rtu":
            self._deframer = Deframer(self._line, self._options)

    def _told(self, batch: Batch) -> Fed:
        if not len(batch):
            return Fed(batch, np.zeros(0, TRANSACTION), NOTHING)
        settled = self._transactions.feed(batch)
        findings = self._diagnosis.feed(batch, settled)
        batch = self._placed(batch)
        findings = self._diagnosed(findings)
        return Fed(_said(batch, findings), self._settled(settled), findings)

    def _settled(self, transactions: Rows) -> Rows:
        if self._frames:
            for name in ("request", "response"):
                transactions[name][transactions[name] >= 0] += self._frames
        return transactions

    def _diagnosed(self, findings: Findings) -> Findings:
        findings["index"][findings["index"] >= 0] += self._frames
        if self._starts:
            placed = findings["start"] >= 0
            findings["start"][placed] += self._before()[findings["port"][placed]]
        return findings

    def _before(self) -> NDArray[np.int64]:
        """Bytes before the present deframer's, by port."""
        before = np.zeros(256, np.int64)
        for port, start in self._starts.items():
            before[port] = start
        return before

    def _placed(self, batch: Batch) -> Batch:
        """Rows numbered and placed as if the deframer had been there from the beginning."""
        rows = batch.rows
        frames = rows["kind"] != Kind.NOISE
        answers = rows["request"] >= 0
        if self._frames:
            rows["index"][frames] += self._frames
            rows["request"][answers] += self._frames
            batch = replace(batch, earlier={index + self._frames: adu for index, adu in batch.earlier.items()})
        if self._starts:
            before = self._before()
            rows["start"] += before[rows["port"]]
            rows["request_start"][answers] += before[rows["port"][answers]]
        if frames.any():
            self._seen = int(rows["index"].max()) + 1
        return batch


def _said(batch: Batch, findings: Findings) -> Batch:
    """The batch with the findings that speak of its rows."""
    if not len(findings) or not len(batch):
        return replace(batch, findings=NOTHING)
    mine = np.zeros(len(findings), np.bool_)
    for port in np.flatnonzero(np.bincount(batch.rows["port"])).tolist():
        starts = batch.rows["start"][batch.rows["port"] == port]
        mine |= (findings["port"] == port) & (findings["start"] >= starts.min()) & (findings["start"] <= starts.max())
    return replace(batch, findings=findings[mine])


def octets_by_port(block: Block) -> dict[int, int]:
    """How many bytes of each port a block holds."""
    counts = np.bincount(block.port, np.diff(block.offsets))
    return {port: int(counts[port]) for port in np.flatnonzero(counts).tolist()}


def _joined(first: Batch, second: Batch) -> Batch:
    """Two batches as one."""
    rows = second.rows.copy()
    rows["at"] += len(first.data)
    data = np.concatenate((first.data, second.data))
    return Batch(np.concatenate((first.rows, rows)), data, {**first.earlier, **second.earlier})
