"""Bytes, chunks and rows for tests: frames of every kind, streams of them, and what the deframer makes of a stream.

Whole captures as one batch, and pieces of them: for tests that look at rows across batches. And a meter that is polled:
one float, as often as wanted.
"""

from __future__ import annotations

import struct
from array import array
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from random import Random

import numpy as np
import pytest
from hypothesis import strategies as st

import captures
from analyzer.core import Analysed, analyse
from analyzer.deframing.protocols import Deframer
from analyzer.deframing.weighing import PortWeights
from analyzer.filters import BatchTable
from analyzer.options import Options
from analyzer.simulation import TAPS
from analyzer.tables.batch import Batch
from analyzer.tables.findings import Findings
from analyzer.tables.schema import Kind, Rows
from analyzer.tables.transactions import TransactionRows
from captures.chunks import Block, Capture, Chunk
from captures.line import LineSettings
from dissectors.crc import crc_bytes

LINE = LineSettings(baud=19200, char_bits=11)
CHAR_NS = 11 * 1_000_000_000 // 19200
SHARED = Path(__file__).resolve().parents[3] / "shared"


def shared(path: str) -> Path:
    """A file of the shared corpus, or a skipped test."""
    found = SHARED / path
    if not found.exists():
        pytest.skip(f"the shared corpus is not on this machine: no {path}")
    return found


def adu(text: str) -> bytes:
    """An RTU ADU from hex without its CRC."""
    data = bytes.fromhex(text)
    return data + crc_bytes(data)


READ_AND_ANSWER = (adu("1103006b0003"), bytes.fromhex("110306ae415652434049ad"))


@dataclass(frozen=True)
class Found:
    """All rows of a stream, with its bytes."""

    rows: Rows
    data: bytes

    def frames(self) -> list[tuple[int, int, str, bool]]:
        """(start, length, direction, check) of each frame."""
        return [
            (row.start, row.length, Kind(row.kind).name.lower(), row.check)
            for row in self.rows
            if row.kind != Kind.NOISE
        ]

    def good(self) -> list[bytes]:
        """The bytes of the frames with a right CRC."""
        return [self.data[s : s + n] for s, n, _, check in self.frames() if check]


def collect(batches: Sequence[Batch]) -> Found:
    """Batches end to end."""
    return Found(Rows.joined([b.rows for b in batches]), b"".join(b.data.tobytes() for b in batches))


def rtu_deframer(line: LineSettings, options: Options = Options()) -> Deframer:  # noqa: B008 - frozen
    """One of a line that is known to speak RTU."""
    return Deframer(line, replace(options, protocol="rtu"))


def deframed(feeds: Sequence[Chunk | Block], line: LineSettings = LINE, options: Options | None = None) -> Found:
    """What the deframer finds when it is fed these, one after the other."""
    deframer = rtu_deframer(line, options or Options())
    return collect([*(deframer.feed(feed) for feed in feeds), deframer.close()])


def spaced(pieces: Sequence[bytes], gap_ns: int = 6_000_000) -> list[Chunk]:
    """A chunk a piece, as a UART with a FIFO would give them."""
    chunks, now = [], 1_000_000_000
    for piece in pieces:
        now += gap_ns + len(piece) * CHAR_NS
        chunks.append(Chunk(now, piece))
    return chunks


def heard(pieces: Sequence[bytes], tap: str, seed: int, pause_ns: int = 8_000_000) -> list[Chunk]:
    """What a tap gives of pieces with pauses of well over 3.5 characters between them."""
    data, times, now = bytearray(), array("d"), 1e9
    for piece in pieces:
        for byte in piece:
            now += CHAR_NS
            data.append(byte)
            times.append(now)
        now += pause_ns
    return list(TAPS[tap].deliver(bytes(data), times, Random(seed), CHAR_NS))


units = st.sampled_from([1, 2, 17, 247])
words = st.integers(0, 0xFFFF)


@st.composite
def transactions(draw: st.DrawFn) -> list[bytes]:
    """A request with its answer, of the common functions."""
    unit, function, start = draw(units), draw(st.sampled_from([1, 2, 3, 4, 5, 6, 15, 16, 0x16, 0x17])), draw(words)
    head = f"{unit:02x}{function:02x}{start:04x}"
    if draw(st.integers(0, 15)) == 0 and function in (3, 4):
        return [adu(f"{head}0001"), adu(f"{unit:02x}{function | 0x80:02x}02")]
    if function in (1, 2):
        quantity = draw(st.integers(1, 64))
        count = (quantity + 7) // 8
        return [adu(f"{head}{quantity:04x}"), adu(f"{unit:02x}{function:02x}{count:02x}" + _data(draw, count))]
    if function in (3, 4):
        quantity = draw(st.integers(1, 40))
        payload = _data(draw, 2 * quantity)
        return [adu(f"{head}{quantity:04x}"), adu(f"{unit:02x}{function:02x}{2 * quantity:02x}" + payload)]
    if function in (15, 16):
        quantity = draw(st.integers(1, 20))
        count = (quantity + 7) // 8 if function == 15 else 2 * quantity
        return [adu(f"{head}{quantity:04x}{count:02x}" + _data(draw, count)), adu(f"{head}{quantity:04x}")]
    if function == 0x17:
        quantity = draw(st.integers(1, 20))
        request = adu(f"{head}{quantity:04x}000000020400010002")
        return [request, adu(f"{unit:02x}17{2 * quantity:02x}" + _data(draw, 2 * quantity))]
    echo = adu(
        head + (draw(st.sampled_from(["0000", "ff00"])) if function == 5 else _data(draw, 2 + 2 * (function == 0x16)))
    )
    return [echo, echo]


def _data(draw: st.DrawFn, size: int) -> str:
    return draw(st.binary(min_size=size, max_size=size)).hex()


@st.composite
def streams(draw: st.DrawFn, *, faults: bool = True) -> list[Chunk]:
    """Chunks of a bus: transactions, noise between and inside, cut into reads with times of any worth."""
    pieces: list[bytes] = []
    for pair in draw(st.lists(transactions(), max_size=8)):
        for frame in pair:
            fault = draw(st.integers(0, 9)) if faults else 9
            if fault == 0:
                at = draw(st.integers(0, len(frame) - 1))
                frame = frame[:at] + bytes([frame[at] ^ 1 << draw(st.integers(0, 7))]) + frame[at + 1 :]
            elif fault == 1:
                frame = frame[: draw(st.integers(0, len(frame)))]
            elif fault == 2:
                frame = draw(st.sampled_from([b"\0", b"\xff", b"\0\0", b"\xfe\xff"])) + frame
            elif fault == 3:
                frame += draw(st.binary(min_size=1, max_size=30))
            pieces.append(frame)
    return cut(draw, b"".join(pieces))


def cut(draw: st.DrawFn, data: bytes) -> list[Chunk]:
    """Reads of any size at times that never decrease."""
    chunks, now, at = [], 0, 0
    while at < len(data):
        size = draw(st.sampled_from([1, 1, 2, 5, 8, 30, 62, 300]))
        now += draw(
            st.sampled_from([0, 300_000, CHAR_NS, 3_000_000, 16_000_000, 60_000_000, 700_000_000, 4_000_000_000])
        )
        chunks.append(Chunk(now, data[at : at + size]))
        at += size
    return chunks


def joined(batches: Iterable[Batch]) -> Batch:
    """All rows of a capture as one batch."""
    parts = list(batches)
    shifts = np.cumsum([0, *(len(part.data) for part in parts)])
    rows = Rows.joined([part.rows for part in parts])
    rows.at[:] += np.repeat(shifts[:-1], [len(part) for part in parts])
    found = [part.findings for part in parts if part.findings is not None]
    data = np.concatenate([part.data for part in parts])
    return Batch(rows, data, findings=Findings.joined(found) if found else None)


def whole(capture: Capture) -> Analysed:
    """A capture analysed, as one."""
    found = list(analyse(capture))
    batch = joined(each.batch for each in found)
    assert batch.findings is not None
    return Analysed(batch, TransactionRows.joined([each.transactions for each in found]), batch.findings)


def table(capture: Capture) -> BatchTable:
    """A capture as a filter sees it."""
    one = whole(capture)
    return BatchTable(one.batch, capture.line, transactions=one.transactions)


def piece(one: Analysed, capture: Capture, first: int, last: int) -> Analysed:
    """Rows `first` to `last` of it, with what is said of them, as the pipeline would give them."""
    batch = BatchTable(one.batch, capture.line).batch(first, last)
    rows, spots = batch.rows, one.findings
    mine = [
        bool(((rows.port == port) & (rows.start == start)).any())
        for port, start in zip(spots.port.tolist(), spots.start.tolist(), strict=True)
    ]
    findings = spots[np.array(mine, np.bool_)] if len(mine) else spots
    begun = one.transactions[np.isin(one.transactions.request, rows.index)]
    return Analysed(replace(batch, findings=findings), begun, findings)


def write_meter(path: Path, values: list[float]) -> None:
    """One unit's holding registers 0 and 1, a float, polled once a second."""
    chunks = []
    for i, value in enumerate(values):
        for at, frame in ((0, bytes.fromhex("010300000002")), (20, b"\x01\x03\x04" + struct.pack(">f", value))):
            chunks.append(Chunk(1_780_000_000_000_000_000 + i * 10**9 + at * 10**6, frame + crc_bytes(frame)))
    captures.write(path, Capture.of(LineSettings(baud=19200, char_bits=10), chunks))


def proven(data: bytes) -> str | None:
    """The protocol that the first bytes of a port make sure."""
    weights = PortWeights()
    weights.feed(data)
    return weights.proven
