"""A capture played onto a port: the one place in this project that transmits, and only when asked to.

Bytes go out when the wire carried them, read by read, or frame by frame where only one direction is wanted; silences
between them are kept as well as the system's timers allow (about 0.1 ms).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final, Literal

from analyzer.frames import Kind
from analyzer.pipeline import deframe
from captures.chunks import Capture
from captures.errors import CaptureError
from captures.live.settings import FALLBACK_BAUD, PortSettings

_SPIN_NS: Final = 200_000  # before a byte is due: awake
_NAP_S: Final = 0.1  # asleep at most

Only = Literal["requests", "responses"]


@dataclass(frozen=True, slots=True)
class Piece:
    """Bytes that began on the wire at `t_ns`, by the capture's clock."""

    t_ns: int
    data: bytes


def pieces(capture: Capture, only: Only | None = None) -> Iterator[Piece]:
    """What to play: every read, or the frames of one direction."""
    if only is not None:
        kind = Kind.REQUEST if only == "requests" else Kind.RESPONSE
        for batch in deframe(capture):
            for row in (batch.rows["kind"] == kind).nonzero()[0].tolist():
                yield Piece(int(batch.rows["t_start"][row]), batch.bytes_of(row))
        return
    line = capture.line
    character = (line.char_bits or 11) * 1e9 / line.baud if line.baud else 0.0
    for chunk in capture.chunks():
        yield Piece(chunk.t_ns - round(len(chunk.data) * character), chunk.data)


def play(
    capture: Capture,
    port: PortSettings,
    *,
    speed: float | None = 1.0,
    only: Only | None = None,
    stop: Callable[[], bool] = bool,
) -> int:
    """Play onto a port; how many bytes went out. CaptureError where the port can't be used."""
    import serial

    try:
        out = serial.serial_for_url(
            port.url, baudrate=port.baud or FALLBACK_BAUD, parity=port.parity, stopbits=port.stop_bits, write_timeout=5
        )
    except (OSError, ValueError) as error:
        raise CaptureError(f"{port.url}: cannot be played to: {error}") from error
    sent, begun, first = 0, time.monotonic_ns(), None
    with out:
        try:
            for piece in pieces(capture, only):
                first = piece.t_ns if first is None else first
                if speed is not None:
                    _until(begun + round((piece.t_ns - first) / speed), stop)
                if stop():
                    break
                out.write(piece.data)
                sent += len(piece.data)
            out.flush()
        except OSError as error:  # SerialException is one
            raise CaptureError(f"{port.url}: after {sent:,} bytes: {error}") from error
    return sent


def _until(due: int, stop: Callable[[], bool]) -> None:
    """Wait for a time of the monotonic clock."""
    while (left := due - time.monotonic_ns()) > 0 and not stop():
        if left > _SPIN_NS:
            time.sleep(min(_NAP_S, (left - _SPIN_NS) / 1e9))
