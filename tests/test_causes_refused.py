"""A unit of another parity behind a tap that marks no errors: its answers are whole, and its requests come again."""

from __future__ import annotations

from dataclasses import replace
from random import Random

import pytest

from analyzer.causes.ledger import ledger_of
from analyzer.causes.reasoning import causes_of
from analyzer.causes.registry import Cause
from analyzer.core import analyse
from analyzer.simulation.field.bench import SECOND, Expected, FieldCapture, read_pdu, site
from analyzer.simulation.field.cases.registry import field_cases
from analyzer.simulation.field.master import FieldPoll
from captures.chunks import Capture


def _causes(*, wrong: bool, twice: bool) -> list[Cause]:
    bench = site(Random(7), "ftdi16", units=(3, 5), bauds=(19200,), parities=("E",), seconds=(20, 30))
    bench.marks_errors, bench.master.manners.retries = False, 1
    unit = bench.unit()
    bench.master.polls.append(FieldPoll(unit.unit, read_pdu(3, 9000, 4)))
    if wrong:
        unit.sends = replace(bench.uart, parity="O")
    if twice:  # a client that asks one poll of a unit twice on purpose
        poll = next(poll for poll in bench.master.polls if poll.unit == unit.unit)
        bench.master.polls.insert(bench.master.polls.index(poll), replace(poll))
    made = bench.run(Expected("unit-line-settings", (unit.unit,)) if wrong else Expected(None))
    found = _of(made)
    assert not wrong or [(cause.cause, cause.units) for cause in found] == [("unit-line-settings", (unit.unit,))]
    return found


def _of(made: FieldCapture) -> list[Cause]:
    capture = Capture.of(made.line, made.chunks)
    return causes_of(ledger_of(((part.batch, part.transactions) for part in analyse(capture)), capture.line))


def test_answers_that_are_whole_and_asked_for_again_tell_another_parity() -> None:
    assert "are whole, and the client asks again" in _causes(wrong=True, twice=False)[0].text


@pytest.mark.parametrize("twice", [False, True])
def test_a_unit_that_is_asked_more_often_is_well(twice: bool) -> None:
    assert _causes(wrong=False, twice=twice) == []


@pytest.mark.parametrize(
    ("case", "seed", "unit"),
    [("end-unit-line-settings", 70003, 15), ("end-unit-line-settings", 91000, 8), ("ascii-settings", 91001, 21)],
)
def test_answers_behind_which_the_master_waits_on_are_not_taken_though_of_one_poll_or_lately(
    case: str, seed: int, unit: int
) -> None:
    made = field_cases()[case].capture("precise", seed)
    found = _of(made)
    assert [(cause.cause, cause.units) for cause in found] == [("unit-line-settings", (unit,))]


@pytest.mark.parametrize("fast_s", [0.3, 0.5])
@pytest.mark.parametrize("slow_s", [2.0, 5.0, 4.97])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_poll_that_has_a_timer_of_its_own_is_repeated_for_that(fast_s: float, slow_s: float, seed: int) -> None:
    """Alone, or beside another poll of the same unit: its answers are neither refused nor late."""
    random = Random(f"{fast_s} {slow_s} {seed}")
    bench = site(random, "precise", units=(2, 4), bauds=(9600, 19200), seconds=(60, 60.1))
    fast, *others = bench.units
    bench.master.polls = [FieldPoll(fast, read_pdu(4, 5, 2), fast_s * SECOND, random.random() * SECOND)]
    for unit in (fast, *others) if seed == 2 else others:
        bench.master.polls.append(FieldPoll(unit, read_pdu(3, 0, 10), slow_s * SECOND, random.random() * SECOND))
    assert not _of(bench.run(Expected(None)))
