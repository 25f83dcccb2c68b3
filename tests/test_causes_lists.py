"""A master's list against a device's map: what is refused, beside what reads well in parts."""

from __future__ import annotations

from random import Random

import pytest

from analyzer.causes.ledger import ledger_of
from analyzer.causes.reasoning import causes_of
from analyzer.core import analyse
from analyzer.simulation.field.bench import Expected, read_pdu, site
from analyzer.simulation.field.master import FieldPoll
from captures.chunks import Capture


def _named(taken: list[tuple[int, int]]) -> list[str]:
    """Causes where a device of registers 9000..9009 is asked for these (starting address, quantity) also."""
    bench = site(Random(7), "ftdi16", units=(3, 5), bauds=(19200,), parities=("E",), seconds=(30, 40))
    unit = bench.unit()
    missing = {read_pdu(3, at, count)(0.0) for at, count in taken if at + count > 9010}
    unit.tampers.append(lambda asked, pdu, _: bytes((asked[0] | 0x80, 2)) if asked in missing else pdu)
    bench.master.polls += [FieldPoll(unit.unit, read_pdu(3, at, count)) for at, count in taken]
    made = bench.run(Expected(None))
    capture = Capture.of(made.line, made.chunks)
    ledger = ledger_of(((part.batch, part.transactions) for part in analyse(capture)), capture.line)
    return [cause.cause for cause in causes_of(ledger)]


@pytest.mark.parametrize("parts", [[(9000, 10)], [(9000, 5), (9005, 5)], [(9000, 7), (9005, 5)]])
def test_one_register_beyond_what_reads_well_in_parts(parts: list[tuple[int, int]]) -> None:
    assert _named([*parts, (9000, 11)]) == ["off-by-one"]


def test_parts_with_a_register_between_do_not_make_one_area() -> None:
    assert _named([(9000, 4), (9005, 5), (9000, 11)]) == ["missing-registers"]
