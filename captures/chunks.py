"""The shape of captured bytes, and nothing of what they mean.

A tap delivers reads: some bytes and the time when the read returned. A `Chunk` is one read, a `Block` many of them as
columns (one byte buffer, offsets, times), a `Capture` the line's settings with blocks that come one after the other
from a file, so that a capture larger than memory is read like a small one. What is damaged is said (`Damage`) and
left out; what is whole is always given.

Times are integers in nanoseconds, at or after the last byte's stop bit, and do not decrease within a port: where a
source breaks that, a `Capture` mends it (`captures.time_order`) and says so.
"""

from __future__ import annotations

import enum
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from .limits import TIME_LIMIT
from .line import LineSettings as LineSettings
from .ragged import copy_pieces, sums
from .time_order import TimeOrder

if TYPE_CHECKING:
    from .edges.source import BitSpans
    from .recording.notes import Note as LineNote

MAX_DAMAGE = 100  # entries kept; further ones are counted
_CHUNKS_AT_ONCE = 1 << 16  # of a capture that passes: some 10 MiB of objects

Note = Callable[[str, str], None]  # (where, what): a reader's report of something lost


class Mark(enum.IntEnum):
    """The direction mark that a log gives a chunk; what it means on the bus is for the analyzer to find."""

    NONE = 0
    TX = 1
    RX = 2


@dataclass(frozen=True, slots=True)
class Chunk:
    """One read of a tap: at least one byte, with the time when it returned (0 where the source has no times).

    `errors` are the offsets, in this chunk, of bytes that came with a parity or framing error.
    """

    t_ns: int
    data: bytes
    port: int = 0
    mark: Mark = Mark.NONE
    errors: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class Damage:
    """Something that a source held and that could not be given: where (line or byte offset) and what, in a line."""

    where: str
    what: str

    def __str__(self) -> str:
        return f"{self.where}: {self.what}"


@dataclass(frozen=True, slots=True, eq=False)
class Block:
    """Chunks as columns; n chunks, none of them empty.

    `data` all bytes, `offsets` (n + 1) where chunks begin in it, `t_ns`, `port`, `mark` (n) one value a chunk, `errors`
    sorted positions in `data`. `timed` is False where all times are 0 for want of a clock.
    """

    data: NDArray[np.uint8]
    offsets: NDArray[np.int64]
    t_ns: NDArray[np.int64]
    port: NDArray[np.uint8]
    mark: NDArray[np.uint8]
    errors: NDArray[np.int64]
    timed: bool = True

    def __len__(self) -> int:
        return len(self.t_ns)

    @classmethod
    def from_chunks(cls, chunks: Iterable[Chunk], *, timed: bool = True) -> Block:
        """Columns of these chunks, empty ones left out; ValueError for a value out of its range."""
        filled = [chunk for chunk in chunks if chunk.data]
        offsets = np.cumsum([0, *(len(chunk.data) for chunk in filled)], dtype=np.int64)
        errors: list[int] = []
        for start, chunk in zip(offsets.tolist(), filled, strict=False):
            if not -TIME_LIMIT < chunk.t_ns < TIME_LIMIT:
                raise ValueError(f"time {chunk.t_ns} ns is out of range")
            if not 0 <= chunk.port <= 255:
                raise ValueError(f"port {chunk.port} is not in 0 to 255")
            if any(not 0 <= error < len(chunk.data) for error in chunk.errors):
                raise ValueError(f"errors {list(chunk.errors)} are not all inside a chunk of {len(chunk.data)} bytes")
            errors.extend(start + error for error in sorted(set(chunk.errors)))
        return cls(
            data=np.frombuffer(b"".join(chunk.data for chunk in filled), dtype=np.uint8),
            offsets=offsets,
            t_ns=np.array([chunk.t_ns if timed else 0 for chunk in filled], dtype=np.int64),
            port=np.array([chunk.port for chunk in filled], dtype=np.uint8),
            mark=np.array([chunk.mark for chunk in filled], dtype=np.uint8),
            errors=np.array(errors, dtype=np.int64),
            timed=timed,
        )

    def chunk(self, i: int) -> Chunk:
        """Chunk number `i` of this block."""
        start, stop = int(self.offsets[i]), int(self.offsets[i + 1])
        low, high = np.searchsorted(self.errors, (start, stop))
        return Chunk(
            t_ns=int(self.t_ns[i]),
            data=self.data[start:stop].tobytes(),
            port=int(self.port[i]),
            mark=Mark(int(self.mark[i])),
            errors=tuple((self.errors[low:high] - start).tolist()),
        )

    def octets_by_port(self) -> dict[int, int]:
        """How many bytes of each port there are; ports without any are left out."""
        if not np.count_nonzero(self.port):
            return {0: len(self.data)} if len(self) else {}
        counts = np.bincount(self.port, np.diff(self.offsets))
        return {port: int(counts[port]) for port in np.flatnonzero(counts).tolist()}

    def slice(self, first: int, last: int) -> Block:
        """Chunks `first` to `last` (excluded), as a view."""
        start, stop = int(self.offsets[first]), int(self.offsets[last])
        low, high = np.searchsorted(self.errors, (start, stop))
        return Block(
            data=self.data[start:stop],
            offsets=self.offsets[first : last + 1] - start,
            t_ns=self.t_ns[first:last],
            port=self.port[first:last],
            mark=self.mark[first:last],
            errors=self.errors[low:high] - start,
            timed=self.timed,
        )

    def taken(self, which: NDArray[np.intp]) -> Block:
        """These chunks, in this order."""
        sizes, begins = np.diff(self.offsets)[which], self.offsets[which]
        offsets = sums(sizes)
        data = np.empty(int(offsets[-1]), np.uint8)
        copy_pieces(data, offsets[:-1], self.data, begins, sizes)
        errors = self.errors
        if len(errors):
            marked = np.zeros(len(self.data), np.uint8)
            marked[errors] = 1
            moved = np.empty(len(data), np.uint8)
            copy_pieces(moved, offsets[:-1], marked, begins, sizes)
            errors = np.flatnonzero(moved)
        return replace(
            self, data=data, offsets=offsets, t_ns=self.t_ns[which], port=self.port[which], mark=self.mark[which],
            errors=errors,
        )  # fmt: skip

    @classmethod
    def joined(cls, blocks: Sequence[Block]) -> Block:
        """Blocks end to end, at least one."""
        if len(blocks) == 1:
            return blocks[0]
        shifts = np.cumsum([0, *(len(block.data) for block in blocks)])
        ends = [block.offsets[1:] + shift for block, shift in zip(blocks, shifts, strict=False)]
        return cls(
            data=np.concatenate([block.data for block in blocks]),
            offsets=np.concatenate([blocks[0].offsets[:1], *ends]),
            t_ns=np.concatenate([block.t_ns for block in blocks]),
            port=np.concatenate([block.port for block in blocks]),
            mark=np.concatenate([block.mark for block in blocks]),
            errors=np.concatenate([block.errors + shift for block, shift in zip(blocks, shifts, strict=False)]),
            timed=all(block.timed for block in blocks),
        )

    def split(self, max_bytes: int) -> Iterator[Block]:
        """This block in slices of whole chunks, each of at most `max_bytes` or of one chunk."""
        first = 0
        while first < len(self):
            last = int(np.searchsorted(self.offsets, self.offsets[first] + max_bytes, side="right")) - 1
            last = max(last, first + 1)
            yield self if last - first == len(self) else self.slice(first, last)
            first = last


class Source(Protocol):
    """What a format's reader gives: settings at once, blocks each time that they are asked for."""

    @property
    def line(self) -> LineSettings: ...

    @property
    def timed(self) -> bool: ...

    def blocks(self, max_bytes: int, note: Note) -> Iterator[Block]:
        """All chunks in order, in blocks of about `max_bytes`; whatever can't be given goes to `note`."""
        ...


def spans_of(source: Source) -> BitSpans | None:
    """How long bits took, of a source that has edges."""
    spans: BitSpans | None = getattr(source, "spans", None)
    return spans


class Capture:
    """Line settings and a stream of blocks, which can be read again and again.

    `path` and `format` say where it came from (None and "memory" for one made by `of`); `timed` is False where the
    source has no times. `damage` and `damage_count` belong to the newest pass over the blocks and are complete when
    that pass has ended; the list holds the first 100 only. `notices` are what a person should know of how it was
    opened, a line each: settings that were inferred, a suffix that says something else than the content.
    """

    def __init__(
        self,
        source: Source,
        *,
        path: Path | None = None,
        format: str = "memory",
        notices: Sequence[str] = (),
    ) -> None:
        self.line = source.line
        self.notices = tuple(notices)
        self.timed = source.timed
        self.path = path
        self.format = format
        self.damage: list[Damage] = []
        self.damage_count = 0
        self._source = source

    @classmethod
    def of(cls, line: LineSettings, chunks: Iterable[Chunk], *, timed: bool = True) -> Capture:
        """A capture in memory; ValueError for a chunk with a value out of its range."""
        return cls(_Memory(line, Block.from_chunks(chunks, timed=timed), timed))

    @classmethod
    def passing(cls, line: LineSettings, chunks: Iterable[Chunk]) -> Capture:
        """A capture of chunks that are made as they are read, once; ValueError, then, for a value out of its range."""
        return cls(_Passing(line, iter(chunks)))

    def blocks(self, max_bytes: int = 1 << 20) -> Iterator[Block]:
        """The chunks in order, as blocks of at most `max_bytes` bytes (or of one larger chunk).

        Raises CaptureError where the source can no longer be read at all.
        """
        self.damage, self.damage_count = [], 0
        order = TimeOrder()
        for block in self._source.blocks(max_bytes, self._note):
            if len(block):
                yield from _retimed(block, order).split(max_bytes)
        for where, what in order.complaints():
            self._note(where, what)

    def chunks(self) -> Iterator[Chunk]:
        """The chunks one by one; slow, for small captures and for people."""
        for block in self.blocks():
            for i in range(len(block)):
                yield block.chunk(i)

    @property
    def spans(self) -> BitSpans | None:
        """How long bits took, by the bytes of the newest pass; None of a source that has no edges."""
        return spans_of(self._source)

    def notes(self) -> list[LineNote]:
        """What the source says besides bytes, in order of time: an adapter unplugged, a comment on a packet.

        Read from the source each time; most have none.
        """
        of_source = getattr(self._source, "notes", None)
        return list(of_source()) if of_source is not None else []

    def _note(self, where: str, what: str) -> None:
        self.damage_count += 1
        if len(self.damage) < MAX_DAMAGE:
            self.damage.append(Damage(where, what))


@dataclass(frozen=True, slots=True)
class _Memory:
    """A source that is one block."""

    line: LineSettings
    block: Block
    timed: bool

    def blocks(self, max_bytes: int, note: Note) -> Iterator[Block]:  # noqa: ARG002 - the protocol's signature
        yield self.block


@dataclass(frozen=True, slots=True)
class _Passing:
    """A source of chunks that nobody holds; it can be read once."""

    line: LineSettings
    chunks: Iterator[Chunk]
    timed: bool = True

    def blocks(self, max_bytes: int, note: Note) -> Iterator[Block]:  # noqa: ARG002 - the protocol's signature
        while some := list(islice(self.chunks, min(max_bytes, _CHUNKS_AT_ONCE))):
            yield Block.from_chunks(some)


def _retimed(block: Block, order: TimeOrder) -> Block:
    if not block.timed:
        return block
    times = order.mend(block.t_ns, block.port)
    return block if times is block.t_ns else replace(block, t_ns=times)


def columns(
    data: bytes,
    sizes: Sequence[int] | NDArray[np.int64],
    t_ns: Sequence[int] | NDArray[np.int64],
    *,
    timed: bool,
    extras: Mapping[str, NDArray[np.generic]] | None = None,
) -> Block:
    """A block out of a reader's columns; `extras` may name `port`, `mark` and `errors`, which else are 0 and none."""
    n = len(sizes)
    offsets = np.zeros(n + 1, dtype=np.int64)
    np.cumsum(sizes, out=offsets[1:])
    extras = extras or {}
    zeros = np.zeros(n, dtype=np.uint8)
    return Block(
        data=np.frombuffer(data, dtype=np.uint8),
        offsets=offsets,
        t_ns=np.asarray(t_ns, dtype=np.int64) if timed else np.zeros(n, dtype=np.int64),
        port=extras.get("port", zeros).astype(np.uint8),
        mark=extras.get("mark", zeros).astype(np.uint8),
        errors=extras.get("errors", np.zeros(0, dtype=np.int64)).astype(np.int64),
        timed=timed,
    )
