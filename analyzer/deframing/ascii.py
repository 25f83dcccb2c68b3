"""ASCII mode: frames say themselves where they begin and end, so no lattice is needed.

A frame runs from `:` to CR LF ([2] 2.5.2); whatever stands between frames is noise. Direction comes from the
conversation, as in RTU mode.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from captures.chunks import Block, Chunk
from captures.line import LineSettings
from dissectors.answers import Expectation, expectation
from dissectors.envelopes import Adu, ascii_frames
from dissectors.length_rules import Role
from dissectors.lengths import pdu_length

from ..options import Options
from ..tables.batch import Batch
from ..tables.schema import ROW, Kind, Protocol, Rows
from .buffer import GAPS, ByteBuffer, Times, positions_among
from .directions import said_directions
from .pairing import Pairer
from .segments import evidence_rows
from .stream import character_time
from .unordered import UnorderedRows
from .wireorder import Across

_LONGEST: Final = 513 + 4  # characters of a frame ([2] 2.5.2), and some that a fault may have added
_FRAME: Final = re.compile(rb"[:>][0-9A-Fa-f]{6,%d}(?:\r\n?|\n)" % _LONGEST)
_NOISE: Final = 1024  # bytes: longer noise is told in pieces
_ENOUGH: Final = 2  # frames with a right LRC that make a capture one of ASCII mode


def ascii_after(head: bytes) -> int | None:
    """After how many of these bytes it is sure that they are ASCII mode: frames with a right LRC, and little else."""
    good = octets = 0
    for match in _FRAME.finditer(head):
        (adu,) = ascii_frames(match[0])[:1] or (None,)
        if adu is None or not adu.check_ok:
            continue
        good += 1
        octets += match.end() - match.start()
        if good >= _ENOUGH and 2 * octets > match.end():
            return match.end()
    return None


class _Piece(NamedTuple):
    """A frame, or noise (None), in the bytes of a buffer."""

    begin: int
    end: int
    adu: Adu | None


class AsciiDeframer:
    """The same contract as `stream.Deframer`, for lines in ASCII mode."""

    def __init__(self, line: LineSettings, options: Options = Options()) -> None:  # noqa: B008 - one contract
        self._line, self._options = line, options
        self._character = character_time(line)
        self._directions = said_directions(line)
        self._buffers: dict[int, ByteBuffer] = {}
        self._held = UnorderedRows.nothing()
        self._pairer = Pairer()
        self._frames = 0
        self._asked: Expectation | None = None
        self._timed = True
        self._now: int | None = None  # ns: what was heard before is known
        self._silent: int | None = None  # the newest tick: no port has more bytes up to then

    def feed(self, chunks: Chunk | Block | Iterable[Chunk], now_ns: int | None = None) -> Batch:
        """Take captured bytes; give what has become certain. `now_ns`: with a `tick` behind them."""
        if isinstance(chunks, Chunk):
            chunks = (chunks,)
        block = chunks if isinstance(chunks, Block) else Block.from_chunks(chunks)
        self._timed = self._timed and block.timed
        if len(block):
            self._now = int(block.t_ns[-1])
        sizes = np.diff(block.offsets).astype(np.intp)
        for port in np.flatnonzero(np.bincount(block.port)).tolist():
            mine = block.port == port
            octets = np.repeat(mine, sizes)
            buffer = self._buffers.setdefault(port, ByteBuffer(self._character))
            errors = positions_among(block.errors, octets)
            buffer.append(block.data[octets], sizes[mine], block.t_ns[mine], block.mark[mine], errors)
            buffer.close(over=False)
        return self._take(last=False) if now_ns is None else self.tick(now_ns)

    def tick(self, now_ns: int) -> Batch:
        """The line has been silent until `now_ns`: that ends a frame which a CR alone ends."""
        self._now = self._silent = now_ns
        for buffer in self._buffers.values():
            if now_ns > buffer.last_time:
                buffer.close(over=True)
        return self._take(last=False)

    def close(self) -> Batch:
        """No more bytes come; give the rest."""
        for buffer in self._buffers.values():
            buffer.close(over=True)
        return self._take(last=True)

    def _take(self, *, last: bool) -> Batch:
        parts = [self._rows(port, buffer, last=last) for port, buffer in sorted(self._buffers.items())]
        loose = UnorderedRows.joined([self._held, *parts])
        if len(self._buffers) > 1:
            order = np.lexsort((loose.rows["port"], loose.heard))
            known = len(order)
            if not last:
                undecided = [int(buffer.time[0]) for buffer in self._buffers.values() if len(buffer)]
                until = min([*undecided, *([] if self._now is None else [self._now])])
                known = int(np.searchsorted(loose.heard[order], until))
            loose, self._held = loose.picked(order[:known]), loose.picked(order[known:])
        return self._batch(loose)

    def _batch(self, loose: UnorderedRows) -> Batch:
        """Rows in wire order, described, numbered and paired."""
        rows = loose.rows
        frames = np.flatnonzero(rows["kind"] != Kind.NOISE)
        decoded = [
            ascii_frames(loose.data[at : at + n].tobytes())[0] for at, n in rows[["at", "length"]][frames].tolist()
        ]
        for i, adu in zip(frames.tolist(), decoded, strict=True):
            self._describe(rows[i], adu)
        rows["index"][frames] = np.arange(self._frames, self._frames + len(frames))
        self._frames += len(frames)
        earlier = self._pair(rows, frames, decoded, loose.head, loose.tail)
        if not self._timed:
            rows["t_start"] = rows["t_end"] = 0
            rows["response_ns"] = -1
        return Batch(rows, loose.data, earlier)

    def _pair(
        self, rows: Rows, frames: NDArray[np.intp], adus: list[Adu], head: Times, tail: Times
    ) -> dict[int, bytes]:
        """Pair by the decoded bytes: the frames' rows as they would be without their envelope."""
        plain = rows[frames]
        plain["length"] = [len(adu.data) for adu in adus]
        plain["at"] = np.cumsum(plain["length"]) - plain["length"]
        data = np.frombuffer(b"".join(adu.data for adu in adus), np.uint8)
        across = None
        if self._directions is not None:
            asks, answers = self._directions
            across = Across(plain["port"] == answers, asks, np.full(len(plain), -1, np.int64))
        earlier = self._pairer.pair(plain, data, head[frames], tail[frames], across)
        for name in ("request", "request_start", "response_ns"):
            rows[name][frames] = plain[name]
        return {index: b":" + request.hex().upper().encode() + b"\r\n" for index, request in earlier.items()}

    def _rows(self, port: int, buffer: ByteBuffer, *, last: bool) -> UnorderedRows:
        """Rows of what is certain on one port: their places and times."""
        pieces = self._pieces(buffer, last=last)
        if not pieces:
            return UnorderedRows.nothing()
        starts = np.array([piece.begin for piece in pieces], np.intp)
        ends = np.array([piece.end for piece in pieces], np.intp)
        rows = np.zeros(len(pieces), ROW)
        rows["start"], rows["length"], rows["at"], rows["port"] = starts + buffer.base, ends - starts, starts, port
        rows["index"] = rows["request"] = rows["request_start"] = rows["response_ns"] = -1
        rows["kind"] = [Kind.NOISE if piece.adu is None else Kind.REQUEST for piece in pieces]
        rows["protocol"] = Protocol.ASCII
        reads = buffer.reads(starts, ends)
        rows["t_start"], rows["t_end"] = reads.t_start, reads.t_end
        for name in GAPS:
            rows[name] = getattr(reads, name)
        rows["confidence"] = 1.0
        data = buffer.data[: int(ends[-1])].copy()
        buffer.drop(len(data))
        return UnorderedRows(rows, data, reads.head, reads.tail, reads.heard, evidence_rows(0))

    def _pieces(self, buffer: ByteBuffer, *, last: bool) -> list[_Piece]:
        """Frames and noise, end to end, as far as no later byte can change them.

        Noise is one piece up to the next frame, or of `_NOISE` bytes: so it does not hang on the reads.
        """
        ready = buffer.ready
        text = (buffer.data[:ready] & 0x7F).tobytes()
        pieces: list[_Piece] = []
        done = 0
        for match in _FRAME.finditer(text):
            begin, end = match.span()
            if text[end - 2 : end] == b"\r\n" and len(buffer.quiet(end - 2, end, self._options.idle_ns)):
                end -= 1  # the line feed came too late to belong to it
            elif end == ready and text[end - 1 : end] == b"\r" and not (last or self._quiet(buffer)):
                break  # its line feed may be to come
            while begin - done > _NOISE:
                pieces.append(_Piece(done, done + _NOISE, None))
                done += _NOISE
            if begin > done:
                pieces.append(_Piece(done, begin, None))
            pieces.append(_Piece(begin, end, ascii_frames(match[0])[0]))
            done = end
        while ready - done > (_NOISE if last else _NOISE + _LONGEST + 2):
            pieces.append(_Piece(done, done + _NOISE, None))
            done += _NOISE
        if last and ready > done:
            pieces.append(_Piece(done, ready, None))
        return pieces

    def _quiet(self, buffer: ByteBuffer) -> bool:
        """Whether the line has been idle since the newest byte."""
        return self._silent is not None and self._silent - buffer.last_time >= self._options.idle_ns

    def _describe(self, row: np.void, adu: Adu) -> None:
        function = adu.pdu[0]
        fits = [role for role in Role if pdu_length(adu.pdu, role) == len(adu.pdu)]
        answers = self._asked is not None and self._asked.fits(adu.data)
        role = fits[0] if len(fits) == 1 else Role.RESPONSE if answers or function & 0x80 else Role.REQUEST
        if self._directions is not None and len(fits) != 1 and row["port"] in self._directions:
            role = Role.RESPONSE if row["port"] == self._directions[1] else Role.REQUEST
        row["kind"] = Kind.REQUEST if role is Role.REQUEST else Kind.RESPONSE
        row["unit"], row["function"], row["check"] = adu.data[0], function & 0x7F, bool(adu.check_ok)
        if function & 0x80 and len(adu.pdu) > 1:
            row["exception"] = adu.pdu[1]
        if role is Role.REQUEST and adu.check_ok and len(adu.data) > len(adu.pdu):
            self._asked = expectation(adu.data)
        elif role is Role.RESPONSE:
            self._asked = None
