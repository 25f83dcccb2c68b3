"""Blocks in, rows with their transactions and findings out: the analysis of a bus while it happens.

The same parts as on files (`analyzer.pipeline`), but nothing is held back: a row is given as soon as it is certain, and
a finding when it is made, which may be after the row that it speaks of was given (by `index` and `start`).
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from analyzer import records
from analyzer.deframing.ascii import AsciiDeframer, looks_ascii
from analyzer.deframing.options import Options
from analyzer.deframing.stream import Deframer
from analyzer.findings.model import NOTHING, Findings
from analyzer.frames import Batch, Rows
from captures.chunks import Block
from captures.line import LineSettings
from captures.recording.notes import Note

from .diagnosing import Diagnosing, joined
from .placing import Place

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
        self._heard: dict[int, int] = {}  # bytes so far, by port
        self._frames = 0
        self._now = 0
        self._begin(line, Place())

    def _begin(self, line: LineSettings, place: Place) -> None:
        self._line, self._place = line, place
        self._deframer: Deframer | AsciiDeframer | None = None
        self._held: list[Block] = []  # until it is plain what the line speaks
        self._diagnosing = Diagnosing(line, self._options)

    def feed(self, block: Block, now_ns: int | None = None) -> Fed:
        """What these bytes make certain. `now_ns`: with a `tick` behind them."""
        self._count(octets_by_port(block))
        self._now = int(block.t_ns[-1]) if now_ns is None else now_ns
        if self._deframer is None:
            self._held.append(block)
            block = Block.joined(self._held)
            self._deframer = self._chosen(block)
            if self._deframer is None:
                return self.nothing()
            self._held = []
        return self._told(self._deframer.feed(block, now_ns))

    def tick(self, now_ns: int) -> Fed:
        """What the silence up to `now_ns` makes certain."""
        self._now = now_ns
        return self.nothing() if self._deframer is None else self._told(self._deframer.tick(now_ns))

    def note(self, note: Note) -> None:
        """Something happened to a port: lost, opened, bytes missing."""
        self._diagnosing.note(note)

    def restart(self, line: LineSettings, missed: Mapping[int, int] | None = None) -> Fed:
        """Bytes were missed (so many, by port), or the line is another from now on: what was certain before."""
        last = self.close()
        self._count(missed or {})
        self._begin(line, Place(self._frames, dict(self._heard)))
        return last

    def nothing(self) -> Fed:
        """No rows."""
        return self._told(Batch.empty())

    def close(self) -> Fed:
        """No more comes; the rest."""
        parts = []
        if self._deframer is None and self._held:
            self._deframer = Deframer(self._line, self._options)
            parts.append(self._deframer.feed(Block.joined(self._held)))
        if self._deframer is not None:
            parts.append(self._deframer.close())
        fed = self._told(joined(parts) if parts else Batch.empty())
        transactions, findings = self._diagnosing.close()
        found = records.joined((fed.findings, self._place.findings(findings)))
        settled = records.joined((fed.transactions, self._place.transactions(transactions)))
        return Fed(_said(fed.batch, found), settled, found)

    def _count(self, heard: Mapping[int, int]) -> None:
        for port, octets in heard.items():
            self._heard[port] = self._heard.get(port, 0) + octets

    def _chosen(self, block: Block) -> Deframer | AsciiDeframer | None:
        """RTU as soon as a byte tells so, ASCII mode when frames do."""
        data = block.data[:_LOOK].tobytes()
        mode = self._options.protocol
        if mode == "ascii" or (mode == "auto" and looks_ascii(data)):
            return AsciiDeframer(self._line, self._options)
        if mode == "rtu" or _FOREIGN.search(data) or len(data) == _LOOK:
            return Deframer(self._line, self._options)
        return None

    def _told(self, batch: Batch) -> Fed:
        transactions, findings = self._diagnosing.feed(batch, self._now)
        findings = self._place.findings(findings)
        batch = self._place.batch(batch)
        if len(batch):
            self._frames = max(self._frames, int(batch.rows["index"].max()) + 1)
        return Fed(_said(batch, findings), self._place.transactions(transactions), findings)


def _said(batch: Batch, findings: Findings) -> Batch:
    """The batch with the findings that speak of its rows."""
    if not len(findings) or not len(batch):
        return Batch(batch.rows, batch.data, batch.earlier, batch.evidence, NOTHING)
    mine = np.zeros(len(findings), np.bool_)
    for port in np.flatnonzero(np.bincount(batch.rows["port"])).tolist():
        starts = batch.rows["start"][batch.rows["port"] == port]
        mine |= (findings["port"] == port) & (findings["start"] >= starts.min()) & (findings["start"] <= starts.max())
    return replace(batch, findings=findings[mine])


def octets_by_port(block: Block) -> dict[int, int]:
    """How many bytes of each port a block holds."""
    if not block.port.any():
        return {0: len(block.data)} if len(block) else {}
    counts = np.bincount(block.port, np.diff(block.offsets))
    return {port: int(counts[port]) for port in np.flatnonzero(counts).tolist()}
