"""A bus for tests of causes, written burst by burst, each behind a silence."""

from __future__ import annotations

from collections.abc import Iterable

from analyzer.causes.ledger import Ledger, ledger_of
from analyzer.causes.reasoning import causes_of
from analyzer.causes.registry import Cause
from analyzer.core import analyse
from captures.chunks import Capture, Chunk
from captures.line import LineSettings
from dissectors.crc import crc_bytes

Sent = tuple[float, bytes]  # ms of silence before, or from the start of what was sent before where it is negative
LINE = LineSettings(baud=19200, char_bits=11, parity="E")
CHAR_MS = 11e3 / 19200


def frame(*octets: int) -> bytes:
    return bytes(octets) + crc_bytes(bytes(octets))


def read_of(unit: int, function: int = 3, quantity: int = 2) -> bytes:
    return frame(unit, function, 0, unit, 0, quantity)


def answer_of(unit: int, value: int, registers: int = 2) -> bytes:
    return frame(unit, 3, 2 * registers, *(octet for i in range(registers) for octet in divmod(value + 91 * i, 256)))


def captured(sent: Iterable[Sent], marked: frozenset[int] = frozenset(), tick_ms: float = 0.0) -> Capture:
    """`marked`: what was sent, by its number, whose bytes the UART marks; `tick_ms`: an adapter hands over what it has
    so long after the first of its bytes came."""
    chunks, t, due = list[Chunk](), 0.0, 0.0
    for i, (silence_ms, data) in enumerate(sent):
        t += silence_ms
        for octet in data:
            t += CHAR_MS
            due = t + tick_ms if t > due else due
            chunks.append(Chunk(round(due * 1e6), bytes((octet,)), errors=(0,) if i in marked else ()))
    return Capture.of(LINE, chunks)


def ledger(sent: Iterable[Sent], marked: frozenset[int] = frozenset(), tick_ms: float = 0.0) -> Ledger:
    """Of what `captured` gives."""
    capture = captured(sent, marked, tick_ms)
    return ledger_of(((part.batch, part.transactions) for part in analyse(capture)), capture.line)


def causes(sent: Iterable[Sent], marked: frozenset[int] = frozenset(), tick_ms: float = 0.0) -> list[Cause]:
    return causes_of(ledger(sent, marked, tick_ms))


def named(found: Iterable[Cause]) -> list[tuple[str, tuple[int, ...]]]:
    return [(cause.cause, cause.units) for cause in found]
