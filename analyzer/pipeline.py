"""From a capture to batches of rows, and to what was found about them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from captures.chunks import Block, Capture

from .deframing.ascii import AsciiDeframer, looks_ascii
from .deframing.options import Options as Options
from .deframing.stream import Deframer
from .findings.model import FINDING, Findings
from .frames import Batch, Rows
from .judging import Judging
from .recorded import deaf_times, notes_of
from .records import joined
from .transactions import TRANSACTION

_BLOCK = 1 << 19  # bytes read at once: more costs memory and is no faster
_LOOK = 1 << 16  # bytes that tell RTU from ASCII mode


def deframe(
    capture: Capture,
    options: Options = Options(),  # noqa: B008 - frozen
    *,
    first: int = _BLOCK,
) -> Iterator[Batch]:
    """Rows of a whole capture, batch after batch in wire order; memory stays flat whatever its size.

    `first`: bytes that are read for the first batch, fewer where somebody waits for it.
    """
    deframer: Deframer | AsciiDeframer | None = None
    for block in _evenly(capture.blocks(_BLOCK), first):
        if deframer is None:
            ascii_mode = options.protocol == "ascii" or (
                options.protocol == "auto" and looks_ascii(block.data[:_LOOK].tobytes())
            )
            deframer = (AsciiDeframer if ascii_mode else Deframer)(capture.line, options)
        batch = deframer.feed(block)
        if len(batch):
            yield batch
    if deframer is not None and len(batch := deframer.close()):
        yield batch


@dataclass(frozen=True, slots=True)
class Analysed:
    """Rows of which all is said: `batch` with the findings on its rows, and the transactions that its requests began.

    `findings` are those of the batch and, in the last one, those about the bus as a whole.
    """

    batch: Batch
    transactions: Rows
    findings: Findings

    def until(self, count: int) -> Analysed:
        """The same of its first `count` rows alone, and of the bus as a whole."""
        if count >= len(self.batch):
            return self
        rows, evidence = self.batch.rows[:count], self.batch.evidence
        part = replace(self.batch, rows=rows, evidence=None if evidence is None else evidence[:count])
        found = self.findings[_about(self.findings, part) | (self.findings["start"] < 0)]
        begun = int(np.searchsorted(self.transactions["request"], rows["index"].max(initial=-1), side="right"))
        return Analysed(replace(part, findings=found), self.transactions[:begun], found)


def analyse(capture: Capture, options: Options = Options()) -> Iterator[Analysed]:  # noqa: B008 - frozen
    """A whole capture, diagnosed, batch after batch in wire order; the last one may hold no rows.

    A batch is held back until nothing more can be said of its rows, which the next ones decide.
    """
    judging, held = Judging(capture.line, options, deaf_times(notes_of(capture))), _Held()
    for batch in deframe(capture, options):
        held.add(batch, *judging.feed(batch))
        yield from held.ready(judging.open_from)
    held.end(*judging.close())
    yield from held.ready(None)


class _Held:
    """Batches that wait for their findings."""

    def __init__(self) -> None:
        self._batches: list[tuple[Batch, int]] = []  # and the index that the first frame behind has, at least
        self._transactions: Rows = np.zeros(0, TRANSACTION)
        self._findings: Findings = np.zeros(0, FINDING)
        self._last = False

    def add(self, batch: Batch, transactions: Rows, findings: Findings) -> None:
        self._batches.append((batch, int(batch.rows["index"].max()) + 1))
        self._say(transactions, findings)

    def end(self, transactions: Rows, findings: Findings) -> None:
        self._say(transactions, findings)
        self._last = True

    def _say(self, transactions: Rows, findings: Findings) -> None:
        self._transactions = joined((self._transactions, transactions))
        self._findings = joined((self._findings, findings))

    def ready(self, open_from: int | None) -> Iterator[Analysed]:
        """Batches whose frames all come before the first one of which more may be said."""
        while self._batches and (open_from is None or self._batches[0][1] <= open_from):
            batch, behind = self._batches.pop(0)
            if self._last and not self._batches:
                mine = np.ones(len(self._findings), np.bool_)
            else:
                mine = _about(self._findings, batch)
            found, self._findings = self._findings[mine], self._findings[~mine]
            begun = int(np.searchsorted(self._transactions["request"], behind))
            settled, self._transactions = self._transactions[:begun], self._transactions[begun:]
            yield Analysed(replace(batch, findings=found), settled, found)
        if self._last and not self._batches and len(self._findings):
            found, self._findings = self._findings, self._findings[:0]
            yield Analysed(replace(Batch.empty(), findings=found), np.zeros(0, TRANSACTION), found)


def _about(findings: Findings, batch: Batch) -> NDArray[np.bool_]:
    """Which findings speak of rows of this batch."""
    mine = np.zeros(len(findings), np.bool_)
    rows = batch.rows
    ports = np.ascontiguousarray(rows["port"])
    for port in np.flatnonzero(np.bincount(ports)).tolist():
        here = np.flatnonzero(ports == port)
        first, last = rows[here[0]], rows[here[-1]]  # a port's rows lie in order, without a gap
        after = findings["start"] >= first["start"]
        mine |= (findings["port"] == port) & after & (findings["start"] < last["start"] + last["length"])
    return mine


def _evenly(blocks: Iterable[Block], room: int) -> Iterator[Block]:
    """The same chunks in blocks whose ends hang on the chunks alone, so that a capture reads alike from any format."""
    held: list[Block] = []
    for block in blocks:
        first = 0
        while first < len(block):
            last = int(np.searchsorted(block.offsets, block.offsets[first] + room))
            part = block.slice(first, min(max(last, first + 1), len(block)))
            held.append(part)
            room -= len(part.data)
            first += len(part)
            if room <= 0:
                yield Block.joined(held)
                held, room = [], _BLOCK
    if held:
        yield Block.joined(held)
