"""Captures made of captures: cut, merged by time, their clocks shifted. Nothing is read before it is asked for.

What is damaged in a source is found at its own `damage`, when the blocks of what was made of it have been read.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from .chunks import Block, Capture, Note
from .errors import CaptureError
from .line import DIRECTIONS_NOTE, PROTOCOLS_NOTE, LineSettings
from .recording.notes import Note as LineNote

if TYPE_CHECKING:
    from .edges.source import BitSpans

Spans = Mapping[int, Sequence[tuple[int, int]]]  # by port: stretches of its stream, in order, none overlapping another
Times = Sequence[tuple[int, int]]  # stretches of time in ns, both ends in them, in order
_PORTS: Final = 256
_LISTS: Final = (PROTOCOLS_NOTE, DIRECTIONS_NOTE)  # notes of a line that hold a word a port
_SETTINGS: Final = "baud", "char_bits", "parity", "stop_bits", "tap"


def shifted(capture: Capture, by_ns: int) -> Capture:
    """The same with another clock."""
    return _made(_Shifted(capture, capture.line, capture.timed, by_ns), capture)


def cut_to_spans(capture: Capture, spans: Spans) -> Capture:
    """What of each port's stream lies in these spans; reads that reach beyond them are cut, with their time kept."""
    return _made(_CutToSpans(capture, capture.line, capture.timed, spans), capture)


def cut_to_times(capture: Capture, times: Times) -> Capture:
    """The reads that returned in these times; CaptureError where the capture has no times."""
    if not capture.timed:
        raise CaptureError(f"{capture.path or 'the capture'}: has no timestamps to cut by: use --frames")
    return _made(_CutToTimes(capture, capture.line, capture.timed, times), capture)


def of_port(capture: Capture, port: int) -> Capture:
    """What came in at one port, which keeps its number."""
    return _made(_OfPort(capture, capture.line, capture.timed, port), capture)


def merged(captures: Sequence[Capture], names: Sequence[str] = ()) -> Capture:
    """Several captures as one, in order of time, each with ports of its own; one alone as it is.

    `names` are what their ports are called, one a capture, as far as they go. CaptureError where one has no times, or
    where there are more ports than a capture can have.
    """
    if len(captures) == 1 and not names:
        return captures[0]
    for capture in captures if len(captures) > 1 else ():
        if not capture.timed:
            raise CaptureError(f"{capture.path or 'a capture'}: has no timestamps to merge by")
    counts = [_port_count(capture) for capture in captures]
    if sum(counts) > _PORTS:
        raise CaptureError(f"{sum(counts)} ports: a capture can have at most {_PORTS}")
    firsts = [sum(counts[:i]) for i in range(len(counts))]
    line = _common_line(captures, firsts, counts, names)
    return Capture(_Merged(tuple(captures), tuple(firsts), line, captures[0].timed))


def unlike_settings(captures: Sequence[Capture]) -> list[str]:
    """Which settings captures do not share, by their names in `LineSettings`: `merged` leaves these out."""
    lines = [capture.line for capture in captures]
    return [name for name in _SETTINGS if any(getattr(line, name) != getattr(lines[0], name) for line in lines)]


def _made(source: _Shifted | _CutToSpans | _CutToTimes | _OfPort, capture: Capture) -> Capture:
    return Capture(source, path=capture.path, format=capture.format, notices=capture.notices)


def _port_count(capture: Capture) -> int:
    return 1 + max((int(block.port.max()) for block in capture.blocks() if len(block)), default=0)


def _common_line(
    captures: Sequence[Capture], firsts: Sequence[int], counts: Sequence[int], names: Sequence[str]
) -> LineSettings:
    """The settings on which all agree, their notes, and the names of the ports."""
    lines = [capture.line for capture in captures]
    unlike = unlike_settings(captures)
    agreed = {name: getattr(lines[0], name) for name in _SETTINGS if name not in unlike}
    notes: dict[str, str] = {}
    for line, first in zip(lines, firsts, strict=True):
        for key, value in line.notes.items():
            word, _, number = key.partition(" ")
            if word == "port" and number.isdecimal():
                notes[f"port {int(number) + first}"] = value
            elif key not in _LISTS:
                notes.setdefault(key, value)
    for key in _LISTS:
        if any(key in line.notes for line in lines):
            words = [
                word.strip()
                for line, count in zip(lines, counts, strict=True)
                for word in (line.notes.get(key, "").split(",") + [""] * count)[:count]
            ]
            notes[key] = ",".join(words)
    for name, first, count in zip(names, firsts, counts, strict=False):
        for port in range(first, first + count):
            notes[f"port {port}"] = name
    return LineSettings(**agreed, notes=notes)


@dataclass(frozen=True, slots=True)
class _Shifted:
    capture: Capture
    line: LineSettings
    timed: bool
    by_ns: int

    def notes(self) -> list[LineNote]:
        return [replace(note, t_ns=note.t_ns + self.by_ns) for note in self.capture.notes()]

    def blocks(self, max_bytes: int, note: Note) -> Iterator[Block]:  # noqa: ARG002 - the protocol's signature
        for block in self.capture.blocks(max_bytes):
            yield replace(block, t_ns=block.t_ns + self.by_ns) if self.timed else block


@dataclass(frozen=True, slots=True)
class _CutToTimes:
    capture: Capture
    line: LineSettings
    timed: bool
    times: Times

    def notes(self) -> list[LineNote]:
        return [note for note in self.capture.notes() if self._inside(np.array([note.t_ns]))[0]]

    def _inside(self, t_ns: NDArray[np.int64]) -> NDArray[np.bool_]:
        begins = np.array([begin for begin, _ in self.times], np.int64)
        ends = np.array([end for _, end in self.times], np.int64)
        which = np.searchsorted(begins, t_ns, side="right") - 1
        inside: NDArray[np.bool_] = (which >= 0) & (t_ns <= ends[which]) if len(ends) else t_ns != t_ns
        return inside

    def blocks(self, max_bytes: int, note: Note) -> Iterator[Block]:  # noqa: ARG002
        for block in self.capture.blocks(max_bytes):
            inside = self._inside(block.t_ns)
            yield block if inside.all() else block.taken(np.flatnonzero(inside))


@dataclass(frozen=True, slots=True)
class _CutToSpans:
    capture: Capture
    line: LineSettings
    timed: bool
    spans: Spans

    def notes(self) -> list[LineNote]:
        times = [(int(block.t_ns[0]), int(block.t_ns[-1])) for block in self.blocks(1 << 20, _unheard) if len(block)]
        if not times:
            return []
        return [note for note in self.capture.notes() if times[0][0] <= note.t_ns <= times[-1][1]]

    def blocks(self, max_bytes: int, note: Note) -> Iterator[Block]:  # noqa: ARG002
        counts: dict[int, int] = {}
        for block in self.capture.blocks(max_bytes):
            sizes = np.diff(block.offsets)
            inside_spans = np.zeros(len(block.data), np.bool_)
            for port in np.flatnonzero(np.bincount(block.port)).tolist():
                mine = np.repeat(block.port == port, sizes)
                first = counts.get(port, 0)
                count = int(np.count_nonzero(mine))
                counts[port] = first + count
                inside = np.zeros(count, np.bool_)
                for begin, end in self.spans.get(port, ()):
                    inside[max(begin - first, 0) : max(end - first, 0)] = True
                inside_spans[mine] = inside
            yield block if inside_spans.all() else _of_bytes(block, inside_spans)


@dataclass(frozen=True, slots=True)
class _OfPort:
    capture: Capture
    line: LineSettings
    timed: bool
    port: int

    def notes(self) -> list[LineNote]:
        return self.capture.notes()

    @property
    def spans(self) -> BitSpans | None:
        return self.capture.spans

    def blocks(self, max_bytes: int, note: Note) -> Iterator[Block]:
        heard: set[int] = set()
        for block in self.capture.blocks(max_bytes):
            heard.update(np.unique(block.port).tolist())
            yield block.taken(np.flatnonzero(block.port == self.port))
        for damage in self.capture.damage:
            note(damage.where, damage.what)
        if heard and self.port not in heard:
            others = ", ".join(map(str, sorted(heard)))
            raise CaptureError(f"{self.capture.path or 'the capture'}: has no port {self.port}; its ports: {others}")


def _unheard(_where: str, _what: str) -> None:
    """For a look at what was read before."""


@dataclass(frozen=True, slots=True)
class _Merged:
    captures: tuple[Capture, ...]
    firsts: tuple[int, ...]  # the first port of each
    line: LineSettings
    timed: bool

    def notes(self) -> list[LineNote]:
        return sorted((note for each in self.captures for note in each.notes()), key=lambda note: note.t_ns)

    def blocks(self, max_bytes: int, note: Note) -> Iterator[Block]:  # noqa: ARG002
        streams = [iter(capture.blocks(max_bytes)) for capture in self.captures]
        heads: list[Block | None] = [None] * len(streams)
        while True:
            for i, stream in enumerate(streams):
                if heads[i] is None and (block := next(stream, None)) is not None:
                    heads[i] = replace(block, port=block.port + np.uint8(self.firsts[i]))
            waiting = [block for block in heads if block is not None]
            if not waiting:
                return
            horizon = min(int(block.t_ns.max()) for block in waiting)
            parts: list[Block] = []
            for i, block in enumerate(heads):
                if block is None:
                    continue
                turn = np.maximum.accumulate(block.t_ns)
                count = int(np.searchsorted(turn, horizon, side="right"))
                parts.append(block.slice(0, count))
                heads[i] = block.slice(count, len(block)) if count < len(block) else None
            joined = Block.joined(parts)
            turns = np.concatenate([np.maximum.accumulate(part.t_ns) for part in parts])
            yield joined.taken(np.argsort(turns, kind="stable"))


def _of_bytes(block: Block, kept: NDArray[np.bool_]) -> Block:
    """These bytes of a block; chunks without any are left out."""
    before = np.concatenate(([0], np.cumsum(kept)))
    sizes = np.diff(before[block.offsets])
    chunks = np.flatnonzero(sizes)
    return replace(
        block, data=block.data[kept], offsets=np.concatenate(([0], np.cumsum(sizes[chunks]))), t_ns=block.t_ns[chunks],
        port=block.port[chunks], mark=block.mark[chunks], errors=before[block.errors[kept[block.errors]]],
    )  # fmt: skip
