"""Hex text and serial logs: `.txt`, `.log`, `.hex` and whatever else people saved a terminal's output as.

Each read that a line shows becomes a chunk, with the time and the direction mark that the log gives it; how text is
read is known in `captures.text`. A log whose first bytes mostly lack times is taken as untimed. Speakers that a log
names (jpnevulator) become ports, in the order of their first word, and so do protocols where check values show several
in one log; what shows none is of the one before it. A log whose times only go back is read from its end. A line that is
neither bytes nor anything known is noted with its number.
"""

from __future__ import annotations

import codecs
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import tzinfo
from functools import lru_cache
from itertools import chain, islice, pairwise
from pathlib import Path
from typing import BinaryIO, Final, cast

import numpy as np

from captures.text import encodings

from ..chunks import Block, Chunk, Mark, Note
from ..errors import CaptureError
from ..files import HEAD_BYTES, line_batches, opened, read_head
from ..line import DIRECTIONS_NOTE, EXCERPT_NOTE, PROTOCOLS_NOTE, LineSettings
from ..text.judging import ByteJudge, no_judge
from ..text.logs import LOOKED_FOR, LogReader, Piece, UnreadLine, joined
from . import Format

_MARK_WORDS = ("", "TX", "RX")
_DIRECTIONS = {int(Mark.TX): "request", int(Mark.RX): "response"}
_JOIN_BYTES = 1 << 16  # a dump of any length comes in chunks of this size
_BLOCK_CHUNKS = 1 << 14
_SNIFFED = 1 << 14  # bytes by which a text is known
_BATCH = 1 << 16  # bytes of text read at once
_MOST_TURNED: Final = 1 << 17  # reads of a log written newest first
_LEAST_STEPS: Final = 2  # of the clock that tell such a log


_EXCERPT: Final = 64  # reads: a text of fewer is what somebody chose to show
_TIMED: Final = 3  # one of so many lines with bytes has a time at least: frames of a terminal go on in lines without


@dataclass(frozen=True, slots=True)
class _TextReader:
    path: Path
    line: LineSettings
    timed: bool
    first_ns: int  # time for bytes before the first line with a time
    notices: tuple[str, ...]
    ports: Mapping[tuple[str, str], int]  # of those who speak, and of the protocols where there are several
    judge: ByteJudge
    zone: tzinfo | None
    sample_rate: float | None
    learnt: LogReader
    newest_first: bool

    @property
    def mixed(self) -> bool:
        """Whether the log holds several protocols."""
        return any(envelope for _, envelope in self.ports)

    def blocks(self, max_bytes: int, note: Note) -> Iterator[Block]:
        with opened(self.path) as file:
            reads = joined(self._reads(file, note), _JOIN_BYTES)
            chunks = self._chunks(_turned(reads, note) if self.newest_first else reads, note)
            while batch := list(_up_to(chunks, max_bytes)):
                yield Block.from_chunks(batch, timed=self.timed)

    def _reads(self, file: BinaryIO, note: Note) -> Iterator[Piece | UnreadLine]:
        reader = LogReader(self.judge, self.zone, self.sample_rate, self.learnt.experience)
        yield from reader.feed(enumerate(_text_of(file, note), 1))
        yield from reader.close()

    def _chunks(self, reads: Iterable[Piece | UnreadLine], note: Note) -> Iterator[Chunk]:
        ports = dict(self.ports)
        envelope = next((envelope for _, envelope in ports), "")
        t_ns = self.first_ns
        for read in reads:
            if isinstance(read, UnreadLine):
                note(f"line {read.line}", read.why)
                continue
            if read.t_ns is not None:
                t_ns = read.t_ns
            elif self.timed:
                note(f"line {read.line}", "has no time: its bytes get the previous time")
            envelope = read.envelope or envelope
            who = (read.port, envelope if self.mixed else "")
            port = ports.setdefault(who, min(len(ports), 255)) if any(who) else 0
            yield Chunk(t_ns, read.data, port, Mark(read.mark))


def _turned(reads: Iterator[Piece | UnreadLine], note: Note) -> Iterable[Piece | UnreadLine]:
    """What is written newest first, oldest first."""
    held = list(islice(reads, _MOST_TURNED))
    more = next(reads, None)
    if more is None:
        return reversed(held)
    note(f"line {held[0].line}", f"newest first, and too long to reverse (over {_MOST_TURNED} reads)")
    return chain(held, (more,), reads)


def _newest_first(times: Sequence[int]) -> bool:
    """Whether these times only ever go back."""
    steps = [later - earlier for earlier, later in pairwise(times) if later != earlier]
    return len(steps) >= _LEAST_STEPS and max(steps) < 0


def _up_to(chunks: Iterator[Chunk], max_bytes: int) -> Iterator[Chunk]:
    size = 0
    for chunk in islice(chunks, _BLOCK_CHUNKS):
        yield chunk
        size += len(chunk.data)
        if size >= max_bytes:
            return


def _silent(where: str, trouble: str) -> None:
    """For a first look, whose troubles are told when the file is read."""


def _text_of(file: BinaryIO, note: Note) -> Iterator[str]:
    """The lines of a text file."""
    codec = encodings.utf16(file.read(HEAD_BYTES))
    file.seek(0)
    if codec is not None:
        file = cast(BinaryIO, codecs.EncodedFile(file, "utf-8", codec, "replace"))
    page = ""
    for _, lines in line_batches(file, note, _BATCH):
        page = page or encodings.code_page(lines)
        for line in lines:
            text = encodings.line_of(line, page)
            yield from encodings.lines_of(text.rstrip("\r\n")) if b"\r" in line else (text,)


@lru_cache(maxsize=1)  # asked more than once about the same file
def _sniff(head: bytes) -> float:
    if encodings.is_binary(head):
        return 0.0
    learnt = LogReader().learn(encodings.lines_of(encodings.decoded(head[:_SNIFFED])))
    with_bytes = {read.line for read in learnt if isinstance(read, Piece)}
    without = {read.line for read in learnt if isinstance(read, UnreadLine)} - with_bytes
    share = len(with_bytes) / len(with_bytes | without) if with_bytes else 0.0
    return 0.4 + 0.4 * share if share >= 0.2 else 0.0


def _read(
    path: Path, *, judge: ByteJudge = no_judge, tz: tzinfo | None = None, sample_rate: float | None = None
) -> _TextReader:
    if encodings.is_binary(read_head(path)):
        raise CaptureError(f"{path}: not text: rename it to .bin if it holds raw bytes of a line")
    reader = LogReader(judge, tz, sample_rate)
    with opened(path) as file:
        lines = _text_of(file, _silent)
        learnt = reader.learn(lines)
        whole = next(lines, None) is None
    reads = [read for read in learnt if isinstance(read, Piece)]
    if not reads:
        _refuse(path, [read for read in learnt if isinstance(read, UnreadLine)])
    times = [read.t_ns for read in reads if read.t_ns is not None]
    timed = _TIMED * len(times) >= len(reads)
    notices = [f"times without a zone are read as {_zone_name(tz)}"] if timed and reader.zoneless else []
    notices += reader.notices if timed else ()
    turned = timed and _newest_first(times)
    if turned:
        notices.append("the log is written newest first: it is read from its end")
    ports = _ports(reads)
    spoken = {number: envelope for (_, envelope), number in ports.items()}
    if not any(spoken.values()):
        spoken = dict.fromkeys(spoken, next((read.envelope for read in reads if read.envelope), ""))
    notes = {PROTOCOLS_NOTE: ",".join(spoken.values())} if any(spoken.values()) else {}
    if whole and (direction := _only_direction(reads)) is not None:
        notes[DIRECTIONS_NOTE] = direction
    if whole and len(reads) < _EXCERPT:
        notes[EXCERPT_NOTE] = str(len(reads))
    first_ns = (times[-1] if turned else times[0]) if timed else 0
    return _TextReader(
        path,
        LineSettings(notes=notes),
        timed,
        first_ns,
        tuple(notices),
        ports,
        judge,
        tz,
        sample_rate,
        reader,
        newest_first=turned,
    )


def _only_direction(reads: Sequence[Piece]) -> str | None:
    """The direction of a log, a client's as most are, that marks one side alone, if its frames read alike both ways."""
    sides = {read.mark for read in reads}
    if len(sides) > 1 or not all(read.either_way and read.envelope == "rtu" and not read.port for read in reads):
        return None
    return _DIRECTIONS.get(sides.pop())


def _ports(reads: Sequence[Piece]) -> dict[tuple[str, str], int]:
    """A port for each who speaks, and for each protocol of theirs where there are several."""
    mixed = len({read.envelope for read in reads} - {""}) > 1
    envelope = next((read.envelope for read in reads if read.envelope), "")
    ports: dict[tuple[str, str], int] = {}
    for read in reads:
        envelope = read.envelope or envelope
        who = (read.port, envelope if mixed else "")
        ports.setdefault(who, min(len(ports), 255) if any(who) else 0)
    return ports


def _refuse(path: Path, unread: list[UnreadLine]) -> None:
    if not unread:
        raise CaptureError(f"{path}: no hex bytes found: the file holds only empty lines and comments")
    first = next((one for one in unread if not one.empty), unread[0])
    raise CaptureError(f"{path}: no hex bytes found, {LOOKED_FOR}; line {first.line}: {first.why}")


def _zone_name(zone: tzinfo | None) -> str:
    return "local time of this machine (--tz names another zone)" if zone is None else str(zone)


def _write(file: BinaryIO, line: LineSettings, blocks: Iterable[Block], timed: bool) -> None:  # noqa: ARG001 - no room
    """A read a line: time in UTC, direction mark, bytes."""
    for block in blocks:
        times = np.datetime_as_string(block.t_ns.astype("datetime64[ns]"), unit="ns").tolist() if timed else None
        lines = []
        for i in range(len(block)):
            words = [f"{times[i]}Z"] if times is not None else []
            words += [_MARK_WORDS[block.mark[i]]] if block.mark[i] else []
            lines.append(
                " ".join([*words, block.data[block.offsets[i] : block.offsets[i + 1]].tobytes().hex(" ")]) + "\n"
            )
        file.write("".join(lines).encode())


FORMAT = Format(
    "text",
    (".txt", ".log", ".hex", ".asc", ".out", ".csv"),
    _sniff,
    _read,
    _write,
    (".txt", ".log", ".hex"),
    sniff_last=True,
)
