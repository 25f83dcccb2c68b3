"""What whole reads of a tap tell, whose clock carries no silence inside frames; and what wears another envelope."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from random import Random

import pytest
from bursts import answer_of, named, read_of

from analyzer.causes.ledger import ledger_of
from analyzer.causes.reasoning import causes_of
from analyzer.causes.registry import Cause
from analyzer.core import analyse
from captures.chunks import Capture, Chunk
from captures.line import LineSettings

_CHAR_MS = 1e4 / 9600
_LEVEL = 14  # bytes of a FIFO that are read at once,
_HELD = 4.0  # characters: so long fewer of them wait for more
Sent = tuple[float, bytes]  # ms of silence before it


def _reads(sent: Iterable[Sent], twice: float = 0.0) -> Iterator[Chunk]:
    """A FIFO's reads; `twice`: the share of those that its driver hands over twice."""
    random, held, now = Random(5), bytearray(), 0.0

    def read(late: float) -> Iterator[Chunk]:
        for again in range(1 + (random.random() < twice)):
            yield Chunk(round((now + late) * 1e6) + 30_000 * again, bytes(held))
        held.clear()

    for silence, data in sent:
        if held and silence > _HELD * _CHAR_MS:
            yield from read(_HELD * _CHAR_MS)
        now += silence
        for byte in data:
            now += _CHAR_MS
            held.append(byte)
            if len(held) == _LEVEL:
                yield from read(0.05)
    if held:
        yield from read(_HELD * _CHAR_MS)


def _causes(chunks: Iterable[Chunk]) -> list[Cause]:
    line = LineSettings(9600, 10, "N", 1, "irq")
    parts = analyse(Capture.of(line, list(chunks)))
    return causes_of(ledger_of(((part.batch, part.transactions) for part in parts), line))


def _polled(pause_ms: tuple[float, float], rounds: int = 60) -> Iterator[Sent]:
    random = Random(3)
    for i in range(rounds):
        for unit in (1, 2, 3):
            yield random.uniform(*pause_ms), read_of(unit, quantity=16)
            yield 9.0 + random.random(), answer_of(unit, 300 + i, 16)


@pytest.mark.parametrize(
    ("pause_ms", "told"),
    [((0.7, 2.2), [("master-too-fast", ())]), ((3.5, 4.1), []), ((6.0, 9.0), [])],
)
def test_a_pause_is_known_at_the_most_where_one_read_reaches_over_it(
    pause_ms: tuple[float, float], told: list[tuple[str, tuple[int, ...]]]
) -> None:
    assert named(_causes(_reads(_polled(pause_ms)))) == told


def test_reads_that_come_twice_come_sooner_than_anybody_sends() -> None:
    """Whole requests among them, which a client that has given up sends as well, but later."""
    assert named(_causes(_reads(_polled((9.0, 14.0), 150), 0.04))) == [("tap-repeats", ())]
    assert not _causes(_reads(_polled((9.0, 14.0), 150)))


def _enveloped(*, answered: bool) -> Iterator[Sent]:
    for i in range(40):
        yield 900.0, bytes((0, i, 0, 0, 0, 6)) + read_of(1 + i % 3)[:-2]
        if answered:
            yield 9.0, bytes((0, i, 0, 0, 0, 7)) + answer_of(1 + i % 3, 300 + i)[:-2]


def test_requests_of_modbus_tcp_that_nobody_answers_are_a_flaw() -> None:
    (found,) = _causes(_reads(_enveloped(answered=False)))
    assert found.cause == "request-flaw" and "Modbus TCP" in found.text
    assert not _causes(_reads(_enveloped(answered=True)))
