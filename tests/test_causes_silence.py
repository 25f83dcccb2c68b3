"""Units that fall silent: to the capture's end, in spells, alone or with all others."""

from __future__ import annotations

from collections.abc import Callable
from random import Random

import pytest

from analyzer.causes.ledger import ledger_of
from analyzer.causes.model import Cause
from analyzer.causes.reasoning import causes_of
from analyzer.core import analyse
from analyzer.simulation.field.bench import SECOND, Bench, Expected, FieldCapture, read_pdu, site
from analyzer.simulation.field.master import FieldPoll
from captures.chunks import Capture, Chunk

SILENT, OTHERS = 5, (6, 7, 8)


def _bench(*, polls: int = 1, cycle_ms: float = 500.0) -> Bench:
    """Four units, 60 s at 9600 bit/s; unit 5 is asked so many things a cycle."""
    bench = site(Random(11), "precise", units=(4, 4), bauds=(9600,), seconds=(60, 60.1))
    for number, unit in zip((SILENT, *OTHERS), list(bench.units.values()), strict=True):
        unit.unit, unit.delay_ms = number, 10.0
    bench.master.polls = [FieldPoll(SILENT, read_pdu(3, 100 * i, 4)) for i in range(polls)]
    bench.master.polls += [FieldPoll(other, read_pdu(3, 0, 4)) for other in OTHERS]
    manners = bench.master.manners
    manners.cycle_ms, manners.timeout_ms, manners.retries = cycle_ms, 200.0, 0
    bench.begin_ns, bench.duration_ns = 0.0, 60 * SECOND
    return bench


def _silence(bench: Bench, silent: Callable[[float], bool], *numbers: int) -> FieldCapture:
    for unit in bench.units.values():
        if unit.unit in numbers:
            unit.silent = silent
    return bench.run(Expected(None))


def _causes(made: FieldCapture, chunks: list[Chunk] | None = None) -> list[Cause]:
    capture = Capture.of(made.line, made.chunks if chunks is None else chunks)
    return causes_of(ledger_of(((part.batch, part.transactions) for part in analyse(capture)), capture.line))


def _named(causes: list[Cause]) -> list[tuple[str, tuple[int, ...]]]:
    return [(cause.cause, cause.units) for cause in causes]


def test_a_unit_that_is_silent_to_the_end_is_dead_since_then() -> None:
    found = _causes(_silence(_bench(), lambda t: t >= 40 * SECOND, SILENT))
    assert _named(found) == [("dead-unit", (SILENT,))]
    assert found[0].since_ns is not None
    assert 39 * SECOND < found[0].since_ns < 41 * SECOND


@pytest.mark.parametrize("left", [0, 1, 3, 5, 7])
def test_a_last_frame_that_is_cut_damages_nobody_and_ends_no_silence(left: int) -> None:
    """The capture ends `left` bytes into an answer of another unit, or into a request to the silent one."""
    made = _silence(_bench(), lambda t: t >= 40 * SECOND, SILENT)
    data = b"".join(chunk.data for chunk in made.chunks)
    assert len(data) == len(made.chunks)  # a byte each
    for frame in (bytes((SILENT, 3, 0)), bytes((OTHERS[0], 3, 8))):
        at = data.rindex(frame, 0, -100)
        assert _named(_causes(made, made.chunks[: at + left])) == [("dead-unit", (SILENT,))]


def test_spells_of_two_silent_polls_are_restarts() -> None:
    """A unit that is asked every two seconds, and misses two polls each time."""
    often = _bench(cycle_ms=2000.0)
    found = _causes(_silence(often, lambda t: 5 * SECOND < t % (12 * SECOND) < 9 * SECOND, SILENT))
    assert _named(found) == [("unit-restarts", (SILENT,))]


def test_a_unit_that_falls_silent_while_others_answer_restarts() -> None:
    found = _causes(_silence(_bench(polls=3), lambda t: t % (20 * SECOND) < 4 * SECOND, SILENT))
    assert _named(found) == [("unit-restarts", (SILENT,))]


def test_units_that_fall_silent_all_at_once_do_not_restart_each_for_itself() -> None:
    found = _causes(_silence(_bench(polls=3), lambda t: 10 * SECOND < t % (20 * SECOND) < 14 * SECOND, SILENT, *OTHERS))
    assert _named(found) == [("all-silent", ())]
    assert found[0].lost_answers is not None
    assert "5, 6, 7, 8" in found[0].text
