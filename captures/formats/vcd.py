"""Value change dumps, `.vcd` (IEEE 1364): what simulators write, and logic analysers export.

Changes of variables of one bit are taken, each a channel, or the bits of vectors where there is no such variable;
unknown and high-impedance values are passed over. The dump is read by arrays: a token that begins with `#` is a time,
one with 0, 1 or b a change, the rest says whose.

The standard gives a dump without `$timescale` no unit. Viewers take nanoseconds (GTKWave); so are they here where a
usual baud rate comes of it, or where a baud rate is given. `--sample-rate` says how many units make a second.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import wraps
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from ..chunks import Note
from ..edges.source import EdgePiece, EdgeSource, edge_reader
from ..edges.uart import Times
from ..errors import CaptureError
from ..files import opened
from ..limits import TIME_LIMIT
from ..spacing import RATES
from . import Format

_HEADER: Final = 1 << 20  # bytes of declarations, at most
_PIECE: Final = 1 << 20
_CHANNELS: Final = 256
_SCALE: Final = re.compile(rb"\$timescale\s+(1|10|100)\s*(s|ms|us|ns|ps|fs)\s+\$end")
_FEMTOSECONDS: Final = {b"s": 10**15, b"ms": 10**12, b"us": 10**9, b"ns": 10**6, b"ps": 10**3, b"fs": 1}
_VARIABLE: Final = re.compile(
    rb"\$var\s+(\S+)\s+(\d{1,3})\s+(\S+)\s+(\S+?)\s*(?:\[(\d{1,4})(?::(\d{1,4}))?\])?\s+\$end"
)
_NUMBERS: Final = (b"real", b"realtime", b"integer", b"parameter", b"time", b"event", b"string")  # no wires
_END: Final = re.compile(rb"\$enddefinitions\s+\$end")
_COMMENT: Final = re.compile(rb"\$comment\b.*?\$end", re.S)
_DIGITS: Final = 18  # of a time
_ZERO, _ONE, _HASH = b"01#"
_VECTORS: Final = tuple(b"bBrR")
_NS: Final = 10**6  # femtoseconds


@dataclass(frozen=True, slots=True)
class _Changes:
    """Tokens of a stretch of the dump: those that say values of bits, with their time and where the name begins."""

    at: NDArray[np.int64]  # of the identifier
    size: NDArray[np.int64]  # of it
    value_at: NDArray[np.int64]  # of the value's first bit, its most significant one
    value_size: NDArray[np.int64]
    time: NDArray[np.int64]
    last: int  # the newest time


@dataclass(frozen=True, slots=True)
class _DumpBit:
    """A bit of a variable: the variable's identifier, and which bit it is, from the least significant one on."""

    code: bytes
    bit: int
    name: str


@dataclass(frozen=True, slots=True)
class _WaveDump:
    path: Path
    wires: Sequence[_DumpBit]
    levels: list[int]
    begin: int  # where the changes begin
    scale: int  # femtoseconds in a unit of time
    supposed: bool  # nobody says the scale
    begin_ns: int = 0

    @property
    def names(self) -> list[str]:
        return [wire.name for wire in self.wires]

    def pieces(self, note: Note) -> Iterator[EdgePiece]:
        high = [level == 1 for level in self.levels]
        for data, changes in self._changes(note):
            edges = []
            for channel, wire in enumerate(self.wires):
                mine, value = _values(data, changes, wire)
                flipped = value != np.concatenate(([high[channel]], value[:-1])) if len(value) else value
                edges.append(self._nanoseconds(changes.time[mine][flipped]))
                high[channel] = bool(value[-1]) if len(value) else high[channel]
            yield EdgePiece(edges, int(self._nanoseconds(np.array([changes.last]))[0]))

    def _changes(self, note: Note) -> Iterator[tuple[NDArray[np.uint8], _Changes]]:
        now, damaged = 0, 0
        with opened(self.path) as file:
            file.seek(self.begin)
            rest, ended = b"", False
            while not ended:
                octets = file.read(_PIECE)
                ended = not octets
                rest += octets
                cut = len(rest) if ended else max(rest.rfind(b"\n"), rest.rfind(b" ")) + 1
                text = rest[:cut]
                if b"$comment" in text:
                    if not ended and text.rfind(b"$comment") > text.rfind(b"$end") and len(rest) < 8 * _PIECE:
                        continue
                    text = _COMMENT.sub(b"", text)
                rest = rest[cut:]
                if len(rest) > 8 * _PIECE:
                    note(self.path.name, "a word that never ends: the rest is skipped")
                    return
                if text:
                    data = np.frombuffer(text, np.uint8)
                    changes, wrong = _parsed(data, now)
                    damaged += wrong
                    now = changes.last
                    yield data, changes
        if damaged:
            note(self.path.name, f"{damaged:,} times that are not numbers or go back: held at the previous time")

    def _nanoseconds(self, time: NDArray[np.int64]) -> Times:
        if self.scale >= _NS:
            return np.minimum(time, (TIME_LIMIT - 1) // (self.scale // _NS)) * (self.scale // _NS)
        return time // (_NS // self.scale)


def _parsed(data: NDArray[np.uint8], now: int) -> tuple[_Changes, int]:
    """The changes in a text of whole tokens, from time `now` on, and how many times are none."""
    space = data <= 32
    edge = np.diff(space.astype(np.int8), prepend=1, append=1)
    starts, ends = np.flatnonzero(edge < 0), np.flatnonzero(edge > 0)
    first = data[starts]
    size = ends - starts
    vector = np.isin(first, _VECTORS)
    behind = np.concatenate(([False], vector[:-1]))[: len(first)]  # its identifier is a token of its own
    is_time = (first == _HASH) & ~behind
    stamps = np.flatnonzero(is_time)
    times, right = _numbers(data, starts[stamps] + 1, size[stamps] - 1)
    times = np.concatenate(([now], np.where(right, times, 0)))
    ordered = np.maximum.accumulate(times)
    wrong = int((ordered != times).sum())
    of_token = ordered[np.cumsum(is_time)]
    bit = ((first == _ZERO) | (first == _ONE)) & ~behind & (size > 1)
    named = behind & np.concatenate(([False], np.isin(first[:-1], _VECTORS[:2])))[: len(first)]
    chosen = np.flatnonzero(bit | named)
    skip = np.where(behind[chosen], 0, 1)
    before = np.maximum(chosen - 1, 0)  # the value that a name of its own token stands behind
    value_at = np.where(behind[chosen], starts[before] + 1, starts[chosen])
    value_size = np.where(behind[chosen], size[before] - 1, 1)
    return _Changes(
        starts[chosen] + skip, size[chosen] - skip, value_at, value_size, of_token[chosen], int(ordered[-1])
    ), wrong


def _numbers(
    data: NDArray[np.uint8], at: NDArray[np.int64], size: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Decimal numbers of so many digits that begin there, and which of them are numbers."""
    value = np.zeros(len(at), np.int64)
    right = (size > 0) & (size <= _DIGITS)
    for position in range(int(min(size.max(initial=0), _DIGITS))):
        longer = np.flatnonzero(right & (size > position))
        digit = data[at[longer] + position].astype(np.int64) - _ZERO
        value[longer] = value[longer] * 10 + digit
        right[longer[(digit < 0) | (digit > 9)]] = False
    return value, right


def _values(data: NDArray[np.uint8], changes: _Changes, wire: _DumpBit) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """The changes that say 0 or 1 of a wire, and which of the two. A value's leading zeros may be left away."""
    mine = np.flatnonzero((changes.size == len(wire.code)) & (changes.value_size > 0))
    for position, octet in enumerate(wire.code):
        mine = mine[data[changes.at[mine] + position] == octet]
    size = changes.value_size[mine]
    bit_said = data[changes.value_at[mine] + np.maximum(size - 1 - wire.bit, 0)]
    bit_said[(size <= wire.bit) & (bit_said == _ONE)] = _ZERO
    known = (bit_said == _ZERO) | (bit_said == _ONE)
    return mine[known], bit_said[known] == _ONE


def _sniff(head: bytes) -> float:
    if b"$var" not in head or (b"$timescale" not in head and b"$enddefinitions" not in head):
        return 0.0
    return 1.0 if head.lstrip().startswith(b"$") else 0.0


def _load(path: Path, sample_rate: float | None = None) -> _WaveDump:
    with opened(path) as file:
        head = file.read(_HEADER)
    end = _END.search(head)
    scale = _SCALE.search(head)
    if end is None:
        raise CaptureError(f"{path}: not a value change dump, or one without $enddefinitions")
    if scale is not None:
        unit = int(scale[1]) * _FEMTOSECONDS[scale[2]]
    else:
        unit = _NS if sample_rate is None else max(round(_FEMTOSECONDS[b"s"] / sample_rate), 1)
    wires = _wires(head[: end.start()])
    if not wires:
        raise CaptureError(f"{path}: no bit signals in this dump: no serial line in it")
    supposed = scale is None and sample_rate is None
    dump = _WaveDump(path, wires, [0] * len(wires), end.end(), unit, supposed)
    for data, changes in dump._changes(lambda *_: None):
        values = [_values(data, changes, wire)[1][:1] for wire in wires]
        first = int(dump._nanoseconds(changes.time[:1])[0]) if len(changes.time) else 0
        return replace(dump, levels=[int(value.any()) for value in values], begin_ns=first)
    return dump


def _wires(declarations: bytes) -> list[_DumpBit]:
    """Variables of one bit; where there are none, the bits of the others. A later name of the same one counts not."""
    found: dict[bytes, list[_DumpBit]] = {}
    for kind, width, code, name, left, right in _VARIABLE.findall(declarations):
        if kind not in _NUMBERS:
            title, least = name.decode("utf-8", "replace"), int(right or 0)
            step = 1 if int(left or 0) >= least else -1
            wires = [_DumpBit(code, bit, f"{title}[{least + step * bit}]") for bit in range(int(width))]
            found.setdefault(code, wires if len(wires) > 1 else [_DumpBit(code, 0, title)])
    single = [wires[0] for wires in found.values() if len(wires) == 1]
    return (single or [wire for wires in found.values() for wire in wires])[:_CHANNELS]


_edges = edge_reader(_load)


@wraps(_edges)
def _read(path: Path, **given: Any) -> EdgeSource:
    source = _edges(path, **given)
    dump = source.file
    if not (isinstance(dump, _WaveDump) and dump.supposed):
        return source
    if given.get("baud") is None and any(one.settings.baud not in RATES for one in source.channels):
        raise CaptureError(
            f"{path}: no $timescale, and as nanoseconds its times match no usual rate: give the ticks per second with "
            "--sample-rate"
        )
    notice = "no $timescale: the times of this dump are read as nanoseconds (--sample-rate overrides this)"
    return replace(source, notices=(notice, *source.notices))


FORMAT = Format("vcd", (".vcd",), _sniff, _read)
