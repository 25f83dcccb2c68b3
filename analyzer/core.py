"""The analysis of a line, without a file, a clock or a thread inside: blocks in, rows with what was said of them out.

One way for all: a capture read at once, the interface, a replay, a live tap. `Analyzer` takes blocks as they come and
gives `Analysed`: rows of which all is said. Who cannot wait for that, as somebody at a terminal can't, looks at
`latest`: rows as soon as they are certain, and what is said of them as soon as it is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from captures.chunks import Block, Capture
from captures.line import LineSettings
from captures.recording.notekinds import CLOSED

from .deframing.clockskew import ClockSkew
from .deframing.protocols import Deframer
from .diagnosis.judge import Judge
from .failures import FailedPart
from .options import Options
from .outages import Deaf, Deafness, deaf_times, listened_until, notes_of
from .tables.batch import Batch, join_batches, rows_of_findings
from .tables.findings import NOTHING, Findings
from .tables.origin import StreamOrigin
from .tables.transactions import NEVER, TransactionRows

if TYPE_CHECKING:
    from captures.recording.notes import Note

_BLOCK = 1 << 19  # bytes read at once: more costs memory and is no faster
_OUTAGES = 256  # over, that are remembered, the newest


@dataclass(frozen=True, slots=True)
class Analysed:
    """Rows with what is said of them: transactions that settled, findings that were made.

    Of an `Analyzer`'s results the transactions are those that the batch's requests began, and the findings those on its
    rows and, in the last one, those about the bus as a whole. Of its `latest` both may speak of rows before.
    `batch.findings` are those of `findings` that stand on its rows. `skew` is what is known at the end of the clocks of
    two taps, in the last one. `failed`: looks that failed so far, in `latest` and in the last one.
    """

    batch: Batch
    transactions: TransactionRows
    findings: Findings
    skew: ClockSkew | None = None
    failed: tuple[FailedPart, ...] = ()

    @property
    def off_ns(self) -> float:
        """By how much response times may be wrong: see `Batch`."""
        return self.batch.off_ns

    @classmethod
    def nothing(cls) -> Analysed:
        """No rows, and nothing said."""
        return cls(Batch.empty(), TransactionRows.zeros(0), NOTHING)

    def until(self, count: int) -> Analysed:
        """The same of its first `count` rows alone, and of the bus as a whole."""
        if count >= len(self.batch):
            return self
        rows, evidence = self.batch.rows[:count], self.batch.evidence
        part = replace(self.batch, rows=rows, evidence=None if evidence is None else evidence[:count])
        findings = self.findings[(rows_of_findings(rows, self.findings) >= 0) | (self.findings.start < 0)]
        begun = int(np.searchsorted(self.transactions.request, rows.index.max(initial=-1), side="right"))
        part = replace(part, findings=findings)
        return replace(self, batch=part, transactions=self.transactions[:begun], findings=findings)


class Analyzer:
    """The analysis of one line. Frames are numbered on where it has to begin anew (`restart`).

    `feed` blocks as they come, `tick` when the line is quiet (live), `close` at the end: each gives what is settled by
    then, in wire order. `outages` are times in which nothing was received; nobody is blamed for what is missing then.
    `settles`: False where `latest` alone is looked at; then these give nothing, and no row is kept for them.
    """

    _options: Options
    _settles: bool
    _outages: list[Deaf]
    _deafness: Deafness
    _octets: dict[int, int]
    _frames: int
    _now: int
    line: LineSettings
    _origin: StreamOrigin
    _deframer: Deframer
    _judge: Judge
    _unsettled: _Unsettled
    _latest: Analysed

    def __init__(
        self,
        line: LineSettings,
        options: Options = Options(),  # noqa: B008 - frozen
        outages: Sequence[Deaf] = (),
        *,
        settles: bool = True,
    ) -> None:
        self._options = options
        self._settles = settles
        self._outages = list(outages)
        self._deafness = Deafness()
        self._octets = {}  # bytes so far, by port
        self._frames = 0
        self._now = 0
        self._begin(line, StreamOrigin())

    def _begin(self, line: LineSettings, origin: StreamOrigin) -> None:
        self.line, self._origin = line, origin
        self._deframer = Deframer(line, self._options)
        self._judge = Judge(line, self._options, self._outages)
        self._unsettled = _Unsettled(self._frames)
        self._latest = Analysed.nothing()

    @property
    def latest(self) -> Analysed:
        """What the newest call made certain: rows, and what is said of these or of earlier ones."""
        batch, transactions, findings = self._latest.batch, self._latest.transactions, self._latest.findings
        mine = findings[rows_of_findings(batch.rows, findings) >= 0] if len(findings) else NOTHING
        return Analysed(batch.said(mine), transactions, findings, failed=self._judge.failed)

    def feed(self, block: Block, now_ns: int | None = None) -> list[Analysed]:
        """Take captured bytes. `now_ns`: with a `tick` behind them."""
        self._count(block.octets_by_port())
        if now_ns is not None or len(block.t_ns):
            self._now = int(block.t_ns[-1]) if now_ns is None else now_ns
        return self._advance(self._deframer.feed(block, now_ns))

    def tick(self, now_ns: int) -> list[Analysed]:
        """The line has been silent until `now_ns` (the blocks' clock)."""
        self._now = now_ns
        return self._advance(self._deframer.tick(now_ns))

    def note(self, note: Note) -> None:
        """Something happened to a port: lost, opened, bytes missing. No answer is missed that came meanwhile."""
        self._deafness.feed(note)
        del self._deafness.over[:-_OUTAGES]
        self._outages[:] = self._deafness.times

    def deafen(self, outages: Sequence[Deaf]) -> None:
        """Times in which nothing was received, all of them, where more have become known."""
        self._outages[:] = outages

    def restart(self, line: LineSettings, missed: Mapping[int, int] | None = None) -> list[Analysed]:
        """Bytes were missed (so many, by port), or the line is another from now on; gives what was certain before."""
        last = self.close()
        latest = self._latest
        self._count(missed or {})
        self._begin(line, StreamOrigin(self._frames, dict(self._octets)))
        self._latest = latest
        return last

    def pending(self) -> Batch:
        """Rows that are certain and of which more may be said."""
        return self._unsettled.rows()

    def close(self, heard_ns: int = NEVER) -> list[Analysed]:
        """No more comes, and the line was listened to until `heard_ns`, or to its last byte: the rest, and what
        concerns the bus as a whole."""
        self._now = max(self._now, heard_ns)
        settled = self._advance(self._deframer.close())
        batch = self._latest.batch
        transactions, findings = self._judge.close(self._now)
        transactions, findings = self._origin.transactions(transactions), self._origin.findings(findings)
        self._latest = Analysed(
            batch,
            TransactionRows.joined((self._latest.transactions, transactions)),
            Findings.joined((self._latest.findings, findings)),
        )
        if not self._settles:
            return []
        self._unsettled.add_said(transactions, findings)
        last = settled + list(self._unsettled.rest(batch.off_ns))
        failed = self._judge.failed
        return [*last[:-1], replace(last[-1], skew=self._deframer.skew, failed=failed)] if last else last

    def _count(self, octets_by_port: Mapping[int, int]) -> None:
        for port, octets in octets_by_port.items():
            self._octets[port] = self._octets.get(port, 0) + octets

    def _advance(self, batch: Batch) -> list[Analysed]:
        transactions, findings = self._judge.feed(batch, self._now)
        findings = self._origin.findings(findings)
        transactions = self._origin.transactions(transactions)
        batch = self._origin.batch(batch)
        if len(batch):
            self._frames += int(np.count_nonzero(batch.rows.kind))  # all but NOISE
            if self._settles:
                self._unsettled.add_rows(batch, self._frames)
        self._latest = Analysed(batch, transactions, findings)
        if not self._settles:
            return []
        self._unsettled.add_said(transactions, findings)
        if self._judge.waits:
            return []
        open_from = self._judge.open_from
        behind = None if open_from is None else open_from + self._origin.frames
        return list(self._unsettled.settled(behind, batch.off_ns))


class _Unsettled:
    """Batches that wait until nothing more can be said of their rows, and what was said so far."""

    _batches: list[tuple[Batch, int]]
    _frames: int
    _transactions: TransactionRows
    _findings: Findings

    def __init__(self, frames: int) -> None:
        self._batches = []  # and how many frames there were behind it
        self._frames = frames
        self._transactions = TransactionRows.zeros(0)
        self._findings = NOTHING

    def add_rows(self, batch: Batch, frames: int) -> None:
        """Take in a batch; `frames` so far, those in it counted."""
        self._batches.append((batch, frames))

    def add_said(self, transactions: TransactionRows, findings: Findings) -> None:
        """Take in what was said, of any rows that are still here."""
        if len(transactions):
            self._transactions = TransactionRows.joined((self._transactions, transactions))
        if len(findings):
            self._findings = Findings.joined((self._findings, findings))

    def rows(self) -> Batch:
        """All rows that wait."""
        return join_batches([batch for batch, _ in self._batches]) if self._batches else Batch.empty()

    def settled(self, open_from: int | None, off_ns: float) -> Iterator[Analysed]:
        """Batches whose frames all come before the first one of which more may be said.

        The newest stays: what stands at its end may hang on the row behind it. `off_ns`: see `Batch`.
        """
        while len(self._batches) > 1 and (open_from is None or self._batches[0][1] <= open_from):
            batch, behind = self._batches.pop(0)
            yield self._analysed(batch, behind, rows_of_findings(batch.rows, self._findings) >= 0, off_ns)

    def rest(self, off_ns: float) -> Iterator[Analysed]:
        """No more comes: everything, with what concerns the bus as a whole in the last one, which may hold no rows."""
        while len(self._batches) > 1:
            yield from self.settled(None, off_ns)
        every = np.ones(len(self._findings), np.bool_)
        if self._batches:
            batch, behind = self._batches.pop()
            yield self._analysed(batch, behind, every, off_ns)
        elif len(self._findings):
            yield self._analysed(Batch.empty(), 0, every, off_ns)

    def _analysed(self, batch: Batch, behind: int, mine: NDArray[np.bool_], off_ns: float) -> Analysed:
        findings, self._findings = self._findings[mine], self._findings[~mine]
        begun = int(np.searchsorted(self._transactions.request, behind))
        transactions, self._transactions = self._transactions[:begun], self._transactions[begun:]
        return Analysed(replace(batch, findings=findings, off_ns=off_ns), transactions, findings)


def analyse(capture: Capture, options: Options = Options()) -> Iterator[Analysed]:  # noqa: B008 - frozen
    """A whole capture, diagnosed, batch after batch in wire order; the last one may hold no rows.

    Memory stays flat whatever the capture's size.
    """
    notes = notes_of(capture)
    analyzer = Analyzer(capture.line, options, deaf_times(notes))
    for block in _evenly(capture.blocks(_BLOCK), _BLOCK):
        yield from analyzer.feed(block)
    yield from analyzer.close(listened_until(notes))


def as_it_comes(
    capture: Capture,
    options: Options = Options(),  # noqa: B008 - frozen
    *,
    outages: Sequence[Deaf] = (),
    first: int = _BLOCK,
) -> Iterator[Analysed]:
    """The same for somebody who waits: rows as soon as they are certain, what is said of them when it is.

    `first`: bytes that are read for the first batch.
    """
    analyzer = Analyzer(capture.line, options, outages, settles=False)
    for block in _evenly(capture.blocks(_BLOCK), first):
        analyzer.feed(block)
        yield analyzer.latest
    analyzer.close(listened_until(notes_of(capture)))
    yield analyzer.latest


def deframe(capture: Capture, options: Options = Options()) -> Iterator[Batch]:  # noqa: B008 - frozen
    """Rows of a whole capture, undiagnosed, batch after batch in wire order."""
    deframer = Deframer(capture.line, options)
    for block in _evenly(capture.blocks(_BLOCK), _BLOCK):
        if len(batch := deframer.feed(block)):
            yield batch
    if len(batch := deframer.close()):
        yield batch


def observed(
    capture: Capture, *, look: Callable[[Block], None] | None = None, stop: Callable[[], bool] | None = None
) -> Capture:
    """The same capture, each block shown to `look` before it is used; it ends early once `stop` says True.

    What is damaged in it is found at `capture.damage`, not at the result's.
    """
    return Capture(_ObservedSource(capture, look, stop), path=capture.path, format=capture.format)


@dataclass(frozen=True, slots=True)
class _ObservedSource:
    """The source of such a capture."""

    capture: Capture
    look: Callable[[Block], None] | None
    stop: Callable[[], bool] | None

    @property
    def line(self) -> LineSettings:
        return self.capture.line

    @property
    def timed(self) -> bool:
        return self.capture.timed

    def notes(self) -> list[Note]:
        left = CLOSED if self.stop is not None and self.stop() else ""  # then no silence was heard out
        return [note for note in self.capture.notes() if note.kind != left]

    def blocks(self, max_bytes: int, note: Callable[[str, str], None]) -> Iterator[Block]:  # noqa: ARG002
        for block in self.capture.blocks(max_bytes):
            if self.stop is not None and self.stop():
                return
            if self.look is not None:
                self.look(block)
            yield block


def _evenly(blocks: Iterable[Block], room: int) -> Iterator[Block]:
    """All chunks as `EvenBlocks` cuts them."""
    even = EvenBlocks(room)
    for block in blocks:
        yield from even.feed(block)
    yield from even.close()


class EvenBlocks:
    """The same chunks in blocks whose ends hang on the chunks alone, so that a capture reads alike from any format.

    `room`: bytes of the first block.
    """

    _room: int
    _parts: list[Block]

    def __init__(self, room: int = _BLOCK) -> None:
        self._room = room
        self._parts = []

    def feed(self, block: Block) -> Iterator[Block]:
        """The blocks that these chunks complete."""
        first = 0
        while first < len(block):
            last = int(np.searchsorted(block.offsets, block.offsets[first] + self._room))
            part = block.slice(first, min(max(last, first + 1), len(block)))
            self._parts.append(part)
            self._room -= len(part.data)
            first += len(part)
            if self._room <= 0:
                yield from self.close()
                self._room = _BLOCK

    def close(self) -> Iterator[Block]:
        """What is left, if anything."""
        parts, self._parts = self._parts, []
        if parts:
            yield Block.joined(parts)
