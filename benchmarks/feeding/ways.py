"""Ways of feeding, and what is compared."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from random import Random
from typing import Final

import numpy as np

from analyzer.core import Analysed, Analyzer
from analyzer.outages import deaf_times
from analyzer.tables.findings import Findings
from analyzer.tables.schema import Rows
from analyzer.tables.transactions import TransactionRows
from captures import Chunk
from captures.chunks import Block
from captures.recording.notes import Note
from feeding.streams import FedStream

_PAUSES: Final = (8_000_000, 50_000_000, 700_000_000, 3_000_000_000)  # ns of silence that a clock tells
_OCTETS: Final = 120  # of a stream that are fed one by one: the rest read by read
_HOLD_NS: Final = 20_000_000  # reads are gathered for so long
_BY_BATCH: Final = {"at", "confidence"}  # columns of rows that tell of their batch; see docs/deframing.md, Laws
_BY_READ: Final = {
    "gap_before_ns",
    "gap_most_ns",
    "gap_least_ns",
    "gap_at",
    "reads",
}  # columns that tell how reads were cut


@dataclass(frozen=True)
class Told:
    """What an analysis said of a stream."""

    rows: Rows
    transactions: TransactionRows
    findings: Findings

    @classmethod
    def of(cls, parts: Sequence[Analysed]) -> Told:
        rows = Rows.joined([part.batch.rows for part in parts])
        transactions = TransactionRows.joined([part.transactions for part in parts])
        return cls(rows, transactions, Findings.joined([part.findings for part in parts]))


def at_once(stream: FedStream) -> Told:
    """All in one block."""
    analyzer = Analyzer(stream.line, outages=deaf_times(stream.notes))
    parts = analyzer.feed(_block(stream, stream.chunks)) if stream.chunks else []
    return Told.of([Analysed.nothing(), *parts, *analyzer.close()])


def read_by_read(stream: FedStream) -> Told:
    """A block a read."""
    return _fed(stream, [[chunk] for chunk in stream.chunks])


def gathered(stream: FedStream, random: Random) -> Told:
    """A block some reads."""
    blocks: list[list[Chunk]] = []
    most = random.choice((2, 5, 20))
    at = 0
    while at < len(stream.chunks):
        count = random.randint(1, most)
        blocks.append(stream.chunks[at : at + count])
        at += count
    return _fed(stream, blocks)


def live(stream: FedStream, random: Random) -> Told:
    """As a tap gives them: reads of some milliseconds together, silences told, never one in which bytes were sent; none
    behind the last, of which a file knows nothing: an answer may have been due."""
    analyzer = Analyzer(stream.line)
    notes = list(stream.notes)
    parts: list[Analysed] = []
    character_ns = stream.line.nominal_character_ns or 1e6
    begins = [chunk.t_ns - int(len(chunk.data) * character_ns) for chunk in stream.chunks]
    quiet_until = np.minimum.accumulate(np.array([*begins, stream.chunks[-1].t_ns])[::-1])[::-1].tolist()
    held: list[Chunk] = []
    for i, chunk in enumerate(stream.chunks):
        held.append(chunk)
        free = quiet_until[i + 1] - chunk.t_ns
        pauses = [pause for pause in _PAUSES if pause < free and random.random() < 0.8]
        if not pauses and chunk.t_ns < held[0].t_ns + _HOLD_NS and random.random() < 0.9:
            continue
        told = chunk.t_ns + pauses[0] if pauses and random.random() < 0.5 else None
        _note(analyzer, notes, chunk.t_ns if told is None else told)
        parts += analyzer.feed(_block(stream, held), told)
        held = []
        for pause in pauses:
            _note(analyzer, notes, chunk.t_ns + pause)
            parts += analyzer.tick(chunk.t_ns + pause)
    if held:
        _note(analyzer, notes, held[-1].t_ns)
        parts += analyzer.feed(_block(stream, held))
    _note(analyzer, notes)
    return Told.of([Analysed.nothing(), *parts, *analyzer.close()])


def _fed(stream: FedStream, blocks: Sequence[Sequence[Chunk]]) -> Told:
    """Blocks; what is noted is told when it comes."""
    analyzer = Analyzer(stream.line)
    notes = list(stream.notes)
    parts = []
    for block in filter(None, blocks):
        _note(analyzer, notes, max(chunk.t_ns for chunk in block))
        parts += analyzer.feed(_block(stream, block))
    _note(analyzer, notes)
    return Told.of([Analysed.nothing(), *parts, *analyzer.close()])


def given_early(stream: FedStream) -> Rows:
    """The rows that somebody saw who looked at what was certain, read by read."""
    analyzer = Analyzer(stream.line, settles=False)
    parts = [Analysed.nothing().batch.rows]
    for chunk in stream.chunks:
        analyzer.feed(_block(stream, [chunk]))
        parts.append(analyzer.latest.batch.rows)
    analyzer.close()
    return Rows.joined([*parts, analyzer.latest.batch.rows])


def _note(analyzer: Analyzer, notes: list[Note], until_ns: int | None = None) -> None:
    """Tell what was noted by then (None: all that is left)."""
    while notes and (until_ns is None or notes[0].t_ns <= until_ns):
        analyzer.note(notes.pop(0))


def _block(stream: FedStream, chunks: Sequence[Chunk]) -> Block:
    return replace(Block.from_chunks(chunks), timed=stream.timed)


def breaches(stream: FedStream, random: Random) -> Iterator[str]:
    """What is told otherwise when the stream is fed otherwise."""
    once = at_once(stream)
    for way, told in (
        ("read by read", read_by_read(stream)),
        ("gathered", gathered(stream, random)),
        ("live", live(stream, random)),
    ):
        yield from (f"{way}: {difference}" for difference in _differences(once, told, _BY_BATCH))
    early = Told(given_early(stream), once.transactions, once.findings)
    yield from (f"given early: {difference}" for difference in _differences(once, early, _BY_BATCH))
    by_bytes = replace(stream, chunks=_cut_in_bytes(stream.chunks, random))
    bytes_at_once = at_once(by_bytes)
    told = read_by_read(by_bytes)
    yield from (f"byte by byte: {difference}" for difference in _differences(bytes_at_once, told, _BY_BATCH))
    whole, parts = (Told(each.rows, once.transactions[:0], once.findings[:0]) for each in (once, bytes_at_once))
    yield from (f"cut in bytes: {d}" for d in _differences(whole, parts, _BY_BATCH | _BY_READ))


def _cut_in_bytes(chunks: Sequence[Chunk], random: Random) -> list[Chunk]:
    """The same reads, but some neighbours byte by byte."""
    first = random.randrange(max(1, sum(len(chunk.data) for chunk in chunks) - _OCTETS))
    at, cut = 0, []
    for chunk in chunks:
        inside = first < at + len(chunk.data) and at < first + _OCTETS
        size = 1 if inside else len(chunk.data)
        cut += [replace(chunk, data=chunk.data[i : i + size]) for i in range(0, len(chunk.data), size)]
        at += len(chunk.data)
    return cut


def _differences(one: Told, other: Told, left_out: set[str]) -> Iterator[str]:
    if len(one.rows) != len(other.rows):
        yield f"{len(one.rows)} rows, {len(other.rows)}"
        return
    names = [name for name in Rows.dtypes() if name not in left_out]
    different = [name for name in names if not np.array_equal(one.rows.column(name), other.rows.column(name))]
    if different:
        yield f"rows differ in {', '.join(different)}"
    if one.transactions.tolist() != other.transactions.tolist():
        yield f"transactions differ{_columns(one.transactions, other.transactions)}"
    if _sorted(one.findings) != _sorted(other.findings):
        yield f"findings differ ({len(one.findings)}, {len(other.findings)})"


def _columns(one: TransactionRows, other: TransactionRows) -> str:
    if len(one) != len(other):
        return f" in number: {len(one)}, {len(other)}"
    return " in " + ", ".join(name for name in one.dtypes() if one.column(name).tolist() != other.column(name).tolist())


def _sorted(findings: Findings) -> list[str]:
    """Findings, whatever the order in which they were said; NaN is like NaN."""
    return sorted(map(repr, findings.tolist()))
