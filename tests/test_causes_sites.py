"""Sites that are well, or ill in one thing that a list of cases does not draw."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from random import Random

import numpy as np
import pytest

from analyzer.causes.ledger import ledger_of
from analyzer.causes.reasoning import causes_of
from analyzer.core import analyse
from analyzer.simulation.field.bench import SECOND, Bench, Expected, FieldCapture, read_pdu, site
from analyzer.simulation.field.cases.drivers import duplicated
from analyzer.simulation.field.master import FieldPoll
from analyzer.simulation.field.units import MS, FieldUnit
from analyzer.simulation.field.wire import Pulse, TapEnd
from captures.chunks import Capture


def _site(seed: int, tap: str, parities: tuple[str, ...] = ("E",)) -> Bench:
    return site(Random(seed), tap, units=(3, 3), bauds=(19200,), parities=parities, seconds=(20, 25))


def _causes(bench: Bench) -> list[tuple[str, tuple[int, ...]]]:
    return _told(bench.run(Expected(None)))


def _told(made: FieldCapture) -> list[tuple[str, tuple[int, ...]]]:
    capture = Capture.of(made.line, made.chunks)
    ledger = ledger_of(((part.batch, part.transactions) for part in analyse(capture)), capture.line)
    return [(cause.cause, cause.units) for cause in causes_of(ledger)]


def _at_times_late(random: Random, unit: FieldUnit) -> Callable[[bytes, float], float]:
    """Delays (ns) of a unit, three of twenty beyond 100 ms."""
    return lambda _pdu, _t: random.uniform(105, 140) * MS if random.random() < 0.15 else unit._usual_delay()


@pytest.mark.parametrize(("seed", "tap"), [(1, "precise"), (1, "ftdi16"), (3, "precise")])
def test_a_list_that_holds_a_slow_request_twice_in_a_row_waits_long_enough(seed: int, tap: str) -> None:
    """Though the master rests at the end of its list, so that the pause between the two is short."""
    bench = _site(seed, tap)
    unit = bench.unit()
    slow = read_pdu(3, 500, 4)
    others = [poll for poll in bench.master.polls if poll.unit != unit.unit]
    bench.master.polls[:] = [*others, *(FieldPoll(unit.unit, pdu) for pdu in (read_pdu(3, 100, 2), slow, slow))]
    unit.delay = lambda asked, _: (60 if asked == slow(0.0) else 10) * MS
    assert _causes(bench) == []


@pytest.mark.parametrize("tap", ["precise", "ftdi16"])
@pytest.mark.parametrize(("line", "set_to"), [("E", "O"), ("O", "E")])
def test_a_parity_of_the_tap_that_is_wrong_is_told_by_the_marks_of_its_uart(line: str, set_to: str, tap: str) -> None:
    """Its frames are right all the same."""
    bench = _site(5, tap, (line,))
    bench.marks_errors = True
    bench.wire.taps = [TapEnd(replace(bench.uart, parity=set_to))]
    assert _causes(bench) == [("tap-line-settings", ())]


def test_rare_late_answers_of_two_units_of_three_are_told_together() -> None:
    """By the master's own timer: no unit has most of them."""
    bench = _site(2, "precise")
    manners = bench.master.manners
    manners.timeout_ms, manners.retries = 100, 0
    late = sorted(bench.units)[:2]
    for unit in (bench.units[number] for number in late):
        unit.delay = _at_times_late(bench.random, unit)
    assert [(cause, sorted(units)) for cause, units in _causes(bench)] == [("timeout-too-short", late)]


def test_second_answers_of_two_units_need_no_second_master() -> None:
    bench = _site(0, "precise")
    twins = sorted(bench.units)[:2]
    for number in twins:
        duplicated(bench.random, bench, bench.units[number])
    found = _causes(bench)
    assert "two-masters" not in [cause for cause, _ in found]
    assert [units[0] for cause, units in found if cause == "duplicate-address"][:1] in [[twin] for twin in twins]


def test_nobody_is_heard_while_the_line_is_held() -> None:
    """However many requests are sent meanwhile, and so the cause is told."""
    bench = site(Random(1), "precise", units=(3, 3), bauds=(19200,), seconds=(100, 100))
    bench.master.manners.timeout_ms, bench.master.manners.cycle_ms = 200.0, 0.0
    held = [(t * SECOND, (t + 2.5) * SECOND) for t in range(10, 95, 14)]
    bench.pulses([Pulse(begin, end, "low") for begin, end in held])
    made = bench.run(Expected(None))
    heard = np.array([chunk.t_ns - bench.epoch_ns for chunk in made.chunks])
    assert [int(np.count_nonzero((heard > begin + 0.1 * SECOND) & (heard < end))) for begin, end in held] == [0] * 7
    assert [cause for cause, _ in _told(made)] == ["line-held"]
