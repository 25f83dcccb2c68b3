"""A unit of another parity behind a tap that marks no errors: its answers are whole, and its requests come again."""

from __future__ import annotations

from dataclasses import replace
from random import Random

import pytest

from analyzer.causes.ledger import ledger_of
from analyzer.causes.model import Cause
from analyzer.causes.reasoning import causes_of
from analyzer.core import analyse
from analyzer.simulation.field.bench import Expected, read_pdu, site
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
    capture = Capture.of(made.line, made.chunks)
    found = causes_of(ledger_of(((part.batch, part.transactions) for part in analyse(capture)), capture.line))
    assert not wrong or [(cause.cause, cause.units) for cause in found] == [("unit-line-settings", (unit.unit,))]
    return found


def test_answers_that_are_whole_and_asked_for_again_tell_another_parity() -> None:
    assert "are whole, and the client asks again" in _causes(wrong=True, twice=False)[0].text


@pytest.mark.parametrize("twice", [False, True])
def test_a_unit_that_is_asked_more_often_is_well(twice: bool) -> None:
    assert _causes(wrong=False, twice=twice) == []
