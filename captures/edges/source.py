"""The capture in a logic analyser's file: each channel that carries characters a port, a byte a read.

The first edges of all channels are looked at when the file is opened: they say which channels carry characters, and how
the line was set. A read's time is the end of its byte's stop bit.

How long the bits of each byte took on the line is kept until somebody asks for those of a frame.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from ..chunks import Block, Note, columns
from ..errors import CaptureError
from ..line import LineSettings
from ..spacing import INFERRED
from .inference import ENOUGH, GivenSettings, settings_of
from .uart import Characters, Times, Uart, UartSettings

Ints = NDArray[np.int64]
_NONE = np.zeros((2, 1), np.int64)


class BitSpans:
    """By port: sums, over the bytes that were given so far, of time and of the bits that took it.

    Kept of the one pass over the bytes that begins after `want`, for what is kept grows until it is taken. `bauds`: the
    rate of each port by its settings, bit/s.
    """

    def __init__(self, bauds: Mapping[int, float]) -> None:
        self.bauds = dict(bauds)
        self._armed, self._pass = False, 0
        self._clear()

    def want(self) -> None:
        """Somebody will take what the next pass brings."""
        self._armed = True

    def begin(self) -> int:
        """A pass over the bytes begins; its number, 0 where nobody wants it."""
        if not self._armed:
            return 0
        self._armed, self._pass = False, self._pass + 1
        self._clear()
        return self._pass

    def _clear(self) -> None:
        self._sums: dict[int, Ints] = {}  # by port, (2, n + 1): ns and bits before each byte that is kept, from 0 on
        self._gone: dict[int, int] = {}  # bytes before those

    def add(self, number: int, ports: NDArray[np.uint8], spans: Ints) -> None:
        """Bytes that come next in a pass: the port of each, and (2, n) its ns and bits, 0 and 0 where unknown."""
        for port in np.bincount(ports).nonzero()[0].tolist() if number and number == self._pass else ():
            sums = self._sums.get(port, _NONE)
            more = sums[:, -1:] + np.cumsum(spans[:, ports == port], axis=1)
            self._sums[port] = np.concatenate((sums, more), axis=1)

    def take_stretches(self, port: int, starts: Ints, lengths: Ints) -> tuple[Ints, Ints]:
        """Time in ns and bits of stretches of a port's stream, in order; bytes before the last one are forgotten."""
        sums, gone = self._sums.get(port, _NONE), self._gone.get(port, 0)
        most = sums.shape[1] - 1
        first, last = (np.clip(edges - gone, 0, most) for edges in (starts, starts + lengths))
        ns, bits = sums[:, last] - sums[:, first]
        done = int(first.max(initial=0))
        self._sums[port], self._gone[port] = sums[:, done:] - sums[:, done : done + 1], gone + done
        return ns, bits


TAP: Final = "logic"  # the line's `tap`
_PORTS: Final = 256
_SAME: Final = 0.9  # of the characters of a channel that another one has, too
_JUDGED: Final = 64  # pieces of a file by which its channels are judged, at most


@dataclass(frozen=True, slots=True)
class EdgePiece:
    """Edges of all channels in a stretch of time, ns, ascending; all of them up to `until_ns` are known by then."""

    edges: Sequence[Times]
    until_ns: int


class EdgeFile(Protocol):
    """What a file format's reader gives: channels with their names, when they begin, the levels before their edges."""

    @property
    def names(self) -> Sequence[str]: ...

    @property
    def levels(self) -> Sequence[int]: ...

    @property
    def begin_ns(self) -> int: ...

    def pieces(self, note: Note) -> Iterator[EdgePiece]: ...


@dataclass(frozen=True, slots=True)
class _Channel:
    number: int
    port: int
    level: int
    settings: UartSettings


@dataclass(frozen=True, slots=True)
class _SerialChannel:
    """A channel that may carry characters: their settings, and when the first ones begin."""

    number: int
    settings: UartSettings
    starts: Times


def edge_source(path: Path, file: EdgeFile, given: GivenSettings) -> EdgeSource:
    """The capture in a file of edges; CaptureError where no channel carries characters."""
    heads = _heads(file)
    found: list[_SerialChannel] = []
    for number, edges in enumerate(heads):
        judged = settings_of(edges, file.levels[number], given, file.begin_ns)
        if judged is not None:
            starts = Uart(judged[0], file.levels[number], file.begin_ns).feed(edges, None).start_ns
            found.append(_SerialChannel(number, judged[0], starts))
    serial, told = _apart(found, file.names)
    if not serial:
        busy = [name for name, edges in zip(file.names, heads, strict=True) if len(edges)]
        reason = f"{', '.join(busy[:8])} change, but not like a UART's line" if busy else "none of them ever changes"
        raise CaptureError(
            f"{path}: no serial line among {len(heads)} channels: {reason} (a rate can be given with --baud)"
        )
    channels = [
        _Channel(one.number, port, file.levels[one.number], one.settings) for port, one in enumerate(serial[:_PORTS])
    ]
    spans = BitSpans({one.port: one.settings.baud for one in channels})
    return EdgeSource(file, channels, _line_of_channels(file, channels, given), told, spans)


def _heads(file: EdgeFile) -> list[Times]:
    """The first edges of each channel, enough to judge it."""
    parts: list[list[Times]] = [[] for _ in file.names]
    for piece in islice(file.pieces(lambda *_: None), _JUDGED):
        for part, edges in zip(parts, piece.edges, strict=True):
            part.append(edges)
        counts = [sum(map(len, part)) for part in parts]
        if max(counts) >= ENOUGH and all(count == 0 or count >= ENOUGH / 8 for count in counts):
            break
    return [np.concatenate(part)[:ENOUGH] if part else np.zeros(0, np.int64) for part in parts]


def _apart(found: Sequence[_SerialChannel], names: Sequence[str]) -> tuple[list[_SerialChannel], tuple[str, ...]]:
    """The channels that say what no other says, and what is told of those that are left out.

    Both wires of a pair are one line; a transmitter's own pin is heard again by its receiver, beside what others send.
    """
    left: dict[int, int] = {}  # number of a channel that is left out: of the one that says the same
    for one in reversed(found):
        for other in found:
            fuller = (len(other.starts), -other.number) > (len(one.starts), -one.number)
            if fuller and other.number not in left and _heard_in(one.starts, other.starts, one.settings):
                left[one.number] = other.number
                break
    size = {one.number: len(one.starts) for one in found}
    told = [
        f"{names[one]} carries the same as {names[other]}: skipped"
        if size[one] > _SAME * size[other]
        else f"what {names[one]} carries also appears on {names[other]}: skipped"
        for one, other in sorted(left.items())
    ]
    return [one for one in found if one.number not in left], tuple(told)


def _heard_in(one: Times, other: Times, settings: UartSettings) -> bool:
    """Whether the characters of a channel begin when characters of another one do."""
    one = one[one <= other[-1]] if len(other) else one[:0]
    if not len(one):
        return False
    after = np.minimum(np.searchsorted(other, one), len(other) - 1)
    off = np.minimum(np.abs(other[after] - one), np.abs(other[np.maximum(after - 1, 0)] - one))
    return bool((off < settings.bit_ns).mean() > _SAME)


def _line_of_channels(file: EdgeFile, channels: Sequence[_Channel], given: GivenSettings) -> LineSettings:
    first = channels[0].settings
    parity, stop = first.parity, float(first.stop_bits)
    notes = {}
    if len(file.names) > 1:
        notes = {f"port {one.port}": f"{file.names[one.number]}, {one.settings}" for one in channels}
    if given.baud is None or given.parity is None:
        others = {str(one.settings) for one in channels}
        notes[INFERRED] = f"{' and '.join(sorted(others))} inferred from the edges (--baud and --parity override this)"
    return LineSettings(round(first.baud), first.char_bits, parity, stop, TAP, notes)


@dataclass(frozen=True, slots=True)
class EdgeSource:
    """The bytes of the channels that carry characters."""

    file: EdgeFile
    channels: Sequence[_Channel]
    line: LineSettings
    notices: tuple[str, ...]
    spans: BitSpans
    timed: bool = True

    def blocks(self, max_bytes: int, note: Note) -> Iterator[Block]:  # noqa: ARG002 - as the file comes
        number = self.spans.begin()
        uarts = [Uart(one.settings, one.level, self.file.begin_ns) for one in self.channels]
        for piece in self.file.pieces(note):
            parts = [
                uart.feed(piece.edges[one.number], piece.until_ns)
                for uart, one in zip(uarts, self.channels, strict=True)
            ]
            yield self._block(number, parts)
        none = np.zeros(0, np.int64)
        yield self._block(number, [uart.feed(none, None) for uart in uarts])

    def _block(self, number: int, parts: Sequence[Characters]) -> Block:
        """Characters of all channels as single bytes in order of their ends."""
        ends = np.concatenate([part.end_ns for part in parts])
        order = np.argsort(ends, kind="stable")
        port = np.repeat([one.port for one in self.channels], [len(part.end_ns) for part in parts])[order]
        value = np.concatenate([part.value for part in parts])[order]
        wrong = np.concatenate([part.framing | part.parity for part in parts])[order]
        extras = {"port": port, "errors": np.flatnonzero(wrong)}
        block = columns(value.tobytes(), np.ones(len(order), np.int64), ends[order], timed=True, extras=extras)
        if number:
            span = np.concatenate([part.span_ns for part in parts])[order]
            bits = np.concatenate([part.span_bits for part in parts])[order]
            self.spans.add(number, block.port, np.stack((span, bits.astype(np.int64))))
        return block


def edge_reader(load: Callable[[Path, float | None], EdgeFile]) -> Callable[..., EdgeSource]:
    """The `read` of a format whose files `load` opens as edges; it is given the rate of samples, where one is said."""

    def read(
        path: Path,
        *,
        baud: int | None = None,
        parity: str | None = None,
        bits: int | None = None,
        stop: float | None = None,
        polarity: str | None = None,
        sample_rate: float | None = None,
    ) -> EdgeSource:
        inverted = None if polarity is None else polarity == "inverted"
        return edge_source(path, load(path, sample_rate), GivenSettings(baud, parity, bits, stop, inverted))

    return read
