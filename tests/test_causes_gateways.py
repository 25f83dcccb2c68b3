"""What a gateway does not tell: how soon an answer came, what was sent between requests that it hands over at once."""

from __future__ import annotations

import pytest

from analyzer.causes.ledger import ledger_of
from analyzer.causes.reasoning import causes_of
from analyzer.core import analyse
from analyzer.simulation.field.cases.registry import field_cases
from captures.chunks import Capture


def _first(case: str, tap: str, seed: int) -> tuple[str, tuple[int, ...]]:
    made = field_cases()[case].capture(tap, seed)
    capture = Capture.of(made.line, made.chunks)
    found = causes_of(ledger_of(((part.batch, part.transactions) for part in analyse(capture)), capture.line))
    return found[0].cause, found[0].units


@pytest.mark.parametrize(("seed", "units"), [(83000, (30, 8)), (91001, (107, 73))])
def test_a_write_asked_again_is_no_answer_to_it_of_units_that_are_cut_off(seed: int, units: tuple[int, ...]) -> None:
    assert _first("all-silent-segment", "gateway", seed) == ("all-silent", units)


def test_a_write_asked_again_is_no_answer_to_it_of_a_unit_that_died() -> None:
    assert _first("end-dead-unit", "gateway", 91001) == ("dead-unit", (33,))


def test_a_request_in_two_reads_is_no_answer_of_a_dead_unit() -> None:
    assert _first("retry-policy", "gateway", 91001) == ("retry-policy", (31,))


def test_requests_handed_over_at_once_do_not_tell_that_one_master_gave_up_by_its_timer() -> None:
    assert _first("two-masters", "gateway", 83001) == ("two-masters", ())


@pytest.mark.parametrize("seed", [83000])
def test_reads_that_hold_minutes_back_tell_nothing_of_what_comes_how_long_behind_a_request(seed: int) -> None:
    assert _first("hours", "gateway", seed) == ("hours", ())


def test_a_unit_that_was_come_back_to_four_times_in_vain_is_silent_to_the_end() -> None:
    assert _first("end-dead-unit", "precise", 83000) == ("dead-unit", (34,))


def test_a_transfer_of_eight_blocks_is_one() -> None:
    assert _first("vendor-transfer", "precise", 83001) == ("vendor-transfer", (30,))


def test_a_unit_that_alone_stays_silent_and_is_heard_behind_others_is_late() -> None:
    assert _first("timeout-too-short-shifted", "gateway", 70002) == ("timeout-too-short", (17,))


def test_what_comes_in_spells_is_no_second_master_of_whom_nothing_else_is_seen() -> None:
    assert _first("hours", "gateway", 91002) == ("hours", ())
