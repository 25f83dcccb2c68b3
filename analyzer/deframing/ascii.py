"""ASCII mode: frames say themselves where they begin and end, so no lattice is needed.

A frame runs from `:` to CR LF ([2] 2.5.2); whatever stands between frames is noise. Direction comes from the
conversation, as in RTU mode.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Final

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
from .buffer import GAPS, ByteBuffer, positions_among
from .pairing import Pairer
from .rules import Bytes
from .stream import character_time

_LONGEST: Final = 513 + 4  # characters of a frame ([2] 2.5.2), and some that a fault may have added
_FRAME: Final = re.compile(rb"[:>][0-9A-Fa-f]{6,%d}(?:\r\n?|\n)" % _LONGEST)
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


class AsciiDeframer:
    """The same contract as `stream.Deframer`, for lines in ASCII mode."""

    def __init__(self, line: LineSettings, options: Options = Options()) -> None:  # noqa: ARG002, B008 - one contract
        self._character = character_time(line)
        self._buffers: dict[int, ByteBuffer] = {}
        self._pairer = Pairer()
        self._frames = 0
        self._asked: Expectation | None = None
        self._timed = True

    def feed(self, chunks: Chunk | Block | Iterable[Chunk], now_ns: int | None = None) -> Batch:
        """Take captured bytes; give what has become certain. `now_ns`: with a `tick` behind them."""
        if isinstance(chunks, Chunk):
            chunks = (chunks,)
        block = chunks if isinstance(chunks, Block) else Block.from_chunks(chunks)
        self._timed = self._timed and block.timed
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
        """The line has been silent until `now_ns`: nothing to gain, for frames end themselves."""
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
        rows = np.concatenate([rows for rows, *_ in parts]) if parts else np.zeros(0, ROW)
        data = np.concatenate([data for _, data, *_ in parts]) if parts else np.empty(0, np.uint8)
        decoded = [adu for *_, adus, _, _ in parts for adu in adus]
        frames = np.flatnonzero(rows["kind"] != Kind.NOISE)
        rows["at"] = np.cumsum(rows["length"]) - rows["length"]
        rows["index"][frames] = np.arange(self._frames, self._frames + len(frames))
        self._frames += len(frames)
        head = np.concatenate([h for *_, h, _ in parts]) if parts else np.empty(0, np.int64)
        tail = np.concatenate([t for *_, t in parts]) if parts else np.empty(0, np.int64)
        earlier = self._pair(rows, frames, decoded, head, tail)
        if not self._timed:
            rows["t_start"] = rows["t_end"] = 0
            rows["response_ns"] = -1
        return Batch(rows, data, earlier)

    def _pair(
        self, rows: Rows, frames: NDArray[np.intp], adus: list[Adu], head: NDArray[np.int64], tail: NDArray[np.int64]
    ) -> dict[int, bytes]:
        """Pair by the decoded bytes: the frames' rows as they would be without their envelope."""
        plain = rows[frames]
        plain["length"] = [len(adu.data) for adu in adus]
        plain["at"] = np.cumsum(plain["length"]) - plain["length"]
        data = np.frombuffer(b"".join(adu.data for adu in adus), np.uint8)
        earlier = self._pairer.pair(plain, data, head[frames], tail[frames])
        for name in ("request", "request_start", "response_ns"):
            rows[name][frames] = plain[name]
        return {index: b":" + request.hex().upper().encode() + b"\r\n" for index, request in earlier.items()}

    def _rows(
        self, port: int, buffer: ByteBuffer, *, last: bool
    ) -> tuple[Rows, Bytes, list[Adu], NDArray[np.int64], NDArray[np.int64]]:
        """Rows of what is certain on one port, its bytes, the frames decoded, and the reads they came in."""
        ready = buffer.ready
        text = (buffer.data[:ready] & 0x7F).tobytes()
        segments: list[tuple[int, int, Adu | None]] = []
        done = 0
        for match in _FRAME.finditer(text):
            begin, end = match.span()
            if begin > done:
                segments.append((done, begin, None))
            segments.append((begin, end, ascii_frames(match[0])[0]))
            done = end
        rest = ready if last else max(done, ready - _LONGEST)
        if last or text.find(b":", done) < 0:
            rest = ready
        elif (start := text.find(b":", done)) > done and start >= ready - _LONGEST:
            rest = start
        if rest > done:
            segments.append((done, rest, None))
        starts = np.array([p[0] for p in segments], np.intp)
        ends = np.array([p[1] for p in segments], np.intp)
        rows = np.zeros(len(segments), ROW)
        rows["start"], rows["length"], rows["port"] = starts + buffer.base, ends - starts, port
        rows["index"] = rows["request"] = rows["request_start"] = rows["response_ns"] = -1
        rows["protocol"] = Protocol.ASCII
        head = tail = np.empty(0, np.int64)
        if segments:
            reads = buffer.reads(starts, ends)
            rows["t_start"], rows["t_end"], head, tail = reads[:4]
            for name in GAPS:
                rows[name] = getattr(reads, name)
        rows["confidence"] = 1.0
        adus = []
        for row, (_, _, adu) in zip(rows, segments, strict=True):
            if adu is not None:
                self._describe(row, adu)
                adus.append(adu)
        data = buffer.data[:rest].copy() if segments else np.empty(0, np.uint8)
        buffer.drop(len(data))
        return rows, data, adus, head, tail

    def _describe(self, row: np.void, adu: Adu) -> None:
        function = adu.pdu[0]
        fits = [role for role in Role if pdu_length(adu.pdu, role) == len(adu.pdu)]
        answers = self._asked is not None and self._asked.fits(adu.data)
        role = fits[0] if len(fits) == 1 else Role.RESPONSE if answers or function & 0x80 else Role.REQUEST
        row["kind"] = Kind.REQUEST if role is Role.REQUEST else Kind.RESPONSE
        row["unit"], row["function"], row["check"] = adu.data[0], function & 0x7F, bool(adu.check_ok)
        if function & 0x80 and len(adu.pdu) > 1:
            row["exception"] = adu.pdu[1]
        if role is Role.REQUEST and adu.check_ok and len(adu.data) > len(adu.pdu):
            self._asked = expectation(adu.data)
        elif role is Role.RESPONSE:
            self._asked = None
