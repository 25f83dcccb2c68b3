"""What speaks for a cause, held against its rivals: outages, held lines, late answers, a tap that loses, failures."""

from __future__ import annotations

from collections.abc import Iterator
from random import Random

import pytest
from bursts import Sent, answer_of, causes, frame, ledger, read_of

import captures
from analyzer.causes.ledger import ledger_of
from analyzer.causes.reasoning import Story, story_of
from analyzer.core import analyse
from analyzer.simulation.field.cases.registry import field_cases
from captures import samples
from captures.chunks import Capture


def _told(case: str, seed: int, tap: str = "irq") -> Story:
    made = field_cases()[case].capture(tap, seed)
    capture = Capture.of(made.line, made.chunks)
    return story_of(ledger_of(((part.batch, part.transactions) for part in analyse(capture)), capture.line))


def test_no_cause_is_its_own_rival() -> None:
    """Several suspicions of one cause, of more or fewer units, do not compete for what is at fault."""
    capture = captures.open(samples.path("troubled.jsonl"))
    told = story_of(ledger_of(((part.batch, part.transactions) for part in analyse(capture)), capture.line)).causes
    assert told and all(cause.runner_up != cause.cause for cause in told)


@pytest.mark.parametrize("seed", [20, 25])
def test_an_outage_in_which_each_unit_misses_one_request_is_everybodys(seed: int) -> None:
    assert [cause.cause for cause in _told("all-silent-briefly", seed).causes][:1] == ["all-silent"]


def test_a_request_whose_answer_is_heard_where_others_are_due_can_be_served() -> None:
    found = [cause.cause for cause in _told("timeout-too-short-writes", 29).causes]
    assert found[0] == "timeout-too-short" and "cannot-serve" not in found


def test_registers_that_a_larger_request_reads_are_there() -> None:
    """A unit stores what was written to it, and hears nothing meanwhile."""
    random = Random(2)

    def sent() -> Iterator[Sent]:
        for i in range(120):
            yield 10.0, read_of(1)
            yield 8.0, answer_of(1, 900 + i)
            yield 10.0 + 2 * random.random(), frame(2, 3, 0, 0, 0, 12)
            yield 8.0, answer_of(2, 70 + i, registers=12)
            yield 10.0, (write := frame(2, 6, 0, 20, *divmod(500 + i, 256)))
            yield 8.0, write
            yield 10.0 + 2 * random.random(), frame(2, 3, 0, 5, 0, 4)
            yield 300.0, b""

    found = story_of(ledger(sent()))
    assert "cannot-serve" not in [cause.cause for cause in found.causes]
    assert [each.unit for each in found.not_explained] == [2]


@pytest.mark.parametrize("lag", [1, 3])
def test_a_write_whose_answers_read_like_requests_can_be_served(lag: int) -> None:
    """The client takes the answer to a write some rounds before for that to the newest, and goes on."""
    random = Random(1)

    def sent() -> Iterator[Sent]:
        owed = list[bytes]()
        for i in range(150):
            for unit in (1, 2, 3, 4):
                yield 8.0 + random.random(), read_of(unit)
                yield 8.0 + random.random(), answer_of(unit, 900 + i)
            owed.append(frame(2, 6, 0, 20, *divmod(500 + random.randrange(300), 256)))
            yield 8.0 + random.random(), owed[-1]
            yield (random.uniform(20, 80), owed.pop(0)) if len(owed) > lag + 1 else (500.0 + random.random(), b"")

    assert "cannot-serve" not in [cause.cause for cause in causes(sent())]


def test_a_write_whose_answers_come_late_can_be_served() -> None:
    assert [cause.cause for cause in _told("timeout-too-short-write", 1).causes][:1] == ["timeout-too-short"]


def test_a_unit_that_answers_some_of_what_it_is_asked_meanwhile_does_not_restart() -> None:
    random = Random(5)

    def sent() -> Iterator[Sent]:
        for i in range(240):
            down = i % 40 in range(20, 28)  # one request is always answered, others seldom
            for quantity in (1, 2, 3, 4):
                yield 10.0, read_of(2, quantity=quantity)
                lost = down and quantity > 1 and random.random() < 0.7
                yield (200.0, b"") if lost else (8.0 + random.random(), answer_of(2, 90 + i, registers=quantity))
            yield 10.0, read_of(1)
            yield 8.0, answer_of(1, 900 + i)

    found = story_of(ledger(sent()))
    assert not found.causes and [each.unit for each in found.not_explained] == [2]


def test_answers_that_a_gateway_hands_on_one_too_late_are_no_timeouts() -> None:
    """The client gives up on nothing, and stores each answer under the next request."""
    random = Random(3)

    def sent() -> Iterator[Sent]:
        levels = [[1000 * (k + 1) + 130 * i for i in range(6)] for k in range(4)]
        owed = list[bytes]()
        for i in range(400):
            k = i % 4
            yield 10.0, frame(2, 3, 0, 50 * k, 0, 6)
            values = [level + random.randrange(9) for level in levels[k]]
            owed.append(frame(2, 3, 12, *(octet for value in values for octet in divmod(value, 256))))
            yield 8.0 + random.random(), owed.pop(0) if i < 120 or len(owed) > 1 else owed[0]
            if k == 3:
                yield 10.0, read_of(1)
                yield 8.0, answer_of(1, 900 + i)

    assert [(each.cause, each.units) for each in causes(sent())] == [("values-under-wrong-registers", (2,))]


def test_what_a_tap_loses_is_no_second_client() -> None:
    assert [cause.cause for cause in _told("tap-loses", 7700, "precise").causes] == ["tap-loses"]


def test_a_line_that_is_held_while_somebody_sends_is_held() -> None:
    random = Random(4)

    def sent() -> Iterator[Sent]:
        rest = 10.0
        for i in range(400):
            unit = i % 4 + 1
            yield rest, read_of(unit)
            answer = answer_of(unit, 900 + i)
            rest = 10.0
            if i % 40 == 20:  # what is sent then ends there, or the next request does
                yield 8.0, answer[: random.choice((4, 5, 7))] + b"\0" if i % 80 == 20 else answer
                yield (2.0, b"") if i % 80 == 20 else (10.0, read_of(unit % 4 + 1)[:5] + b"\0\0")
                rest = random.uniform(1500, 3000)
            else:
                yield 8.0 + random.random(), answer

    assert [cause.cause for cause in causes(sent())][:1] == ["line-held"]


def test_strays_behind_all_units_are_the_lines_though_one_rests_longer() -> None:
    random = Random(1)

    def sent() -> Iterator[Sent]:
        rest = 12.0
        for i in range(480):
            unit = i % 6 + 1
            yield rest, read_of(unit)
            yield 8.0 + random.random(), answer_of(unit, 900 + i)
            rest = 12.0 if unit < 6 else 900.0  # the next round
            if random.random() < 0.15:
                yield random.uniform(1.5, 4), random.choice((b"\xff", b"\0", b"\xf0\xfe"))

    assert [cause.cause for cause in causes(sent())][:1] == ["bias"]


@pytest.mark.parametrize("alone", [True, False])
def test_a_failure_now_and_then_is_a_fact_only_beside_what_never_fails(alone: bool) -> None:
    random = Random(3)

    def sent() -> Iterator[Sent]:
        for i in range(400):
            unit = i % 2 + 1
            yield 10.0, read_of(unit)
            fails = unit == 2 and random.random() < 0.25
            yield 8.0, frame(2, 0x83, 4) if fails else answer_of(unit, 900 + i)
            if not alone:
                yield 10.0, read_of(2, quantity=3)
                yield 8.0, answer_of(2, 70 + i, registers=3)

    left = story_of(ledger(sent())).not_explained
    assert [each.unit for each in left] == ([2] if alone else [])
