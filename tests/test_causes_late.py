"""Answers that the master did not wait for, however they show themselves, and what only looks like them."""

from __future__ import annotations

from collections.abc import Iterator
from random import Random

import pytest
from bursts import CHAR_MS, Sent, answer_of, causes, frame, ledger, named, read_of

from analyzer.causes.evidence import Evidence
from analyzer.causes.ledger import ledger_of
from analyzer.causes.reasoning import causes_of, weigh
from analyzer.core import analyse
from analyzer.simulation.field.cases.registry import field_cases
from captures.chunks import Capture

_TIMEOUT_MS = 60.0
_ADAPTER_MS = 16.0


def _overlaid(one: bytes, other: bytes, behind: int) -> bytes:
    """Two bursts at once, of which the second begins so many characters later and a 0 of either wins."""
    length = max(len(one), behind + len(other))
    first, second = one.ljust(length, b"\xff"), (b"\xff" * behind + other).ljust(length, b"\xff")
    return bytes(a & b for a, b in zip(first, second, strict=True))


@pytest.mark.parametrize("seed", [1, 2])
def test_late_answers_that_meet_the_next_request_each_time_are_of_one_device(seed: int) -> None:
    """No request stays without a byte, so that nothing tells the timeout: garbage begins later than any good answer."""
    random = Random(seed)

    def sent() -> Iterator[Sent]:
        for i in range(500):
            unit = i % 5 + 1 if i % 2 else 2
            yield 8.0, read_of(unit, quantity=8)
            answer = answer_of(unit, 900 + 37 * i, 8)
            if unit == 2 and random.random() < 0.4:
                asked, behind = read_of(3), random.randrange(-6, 15)
                if behind < 0:
                    yield _TIMEOUT_MS + 8, _overlaid(asked, answer, -behind)
                else:
                    yield _TIMEOUT_MS + 8 - behind * CHAR_MS, _overlaid(answer, asked, behind)
                yield _TIMEOUT_MS, b""
            else:
                yield 25.0 + random.random(), answer

    assert named(causes(sent())) == [("timeout-too-short", (2,))]


@pytest.mark.parametrize("tick_ms", [0.0, _ADAPTER_MS])
def test_answers_to_the_request_before_its_repetition_come_sooner_than_the_unit_ever_answers(tick_ms: float) -> None:
    """Its own answers vary, as late ones do: only that they come so soon behind a repetition is odd."""
    random = Random(2)

    def sent() -> Iterator[Sent]:
        for i in range(450):
            unit = i % 3 + 1
            yield 30.0, read_of(unit)
            took = 4 * _TIMEOUT_MS * random.uniform(0.4, 0.7) if unit == 3 else 20.0
            if unit == 3 and random.random() < 0.5:
                yield 4 * _TIMEOUT_MS, read_of(unit)
                took = 4 * _TIMEOUT_MS * random.uniform(0.02, 0.7)
            yield took, answer_of(unit, 300 + i)

    assert named(causes(sent(), tick_ms=tick_ms)) == [("timeout-too-short", (3,))]


def test_late_answers_to_writes_do_not_pass_for_usual_ones() -> None:
    """A write that is asked again reads like a request and two echoes; what comes behind it tells no usual delay."""
    random = Random(4)
    write = frame(3, 5, 0, 1, 0xFF, 0)

    def sent() -> Iterator[Sent]:
        for i in range(450):
            unit, late = i % 3 + 1, random.random() < 0.4
            asked, answer = (write, write) if unit == 3 and i % 2 else (read_of(unit), answer_of(unit, 300 + i))
            yield 30.0, asked
            took = 4 * _TIMEOUT_MS * random.uniform(0.4, 0.7) if unit == 3 else 20.0
            if unit == 3 and late:
                yield 4 * _TIMEOUT_MS, asked
                took = 4 * _TIMEOUT_MS * random.uniform(0.02, 0.35)
            yield took, answer

    assert named(causes(sent())) == [("timeout-too-short", (3,))]


def test_a_unit_whose_answer_comes_late_since_another_s_was_taken_for_it_is_not_accused() -> None:
    """What runs into its request makes the master go on before its own answer comes."""
    random = Random(5)

    def exchange(unit: int, i: int) -> Iterator[Sent]:
        yield 20.0, read_of(unit)
        yield 15.0 + random.random(), answer_of(unit, 300 + i)

    def sent() -> Iterator[Sent]:
        for i in range(300):
            if i % 4 != 3:
                yield from (each for unit in (1, 2, 3) for each in exchange(unit, i))
                continue
            yield 20.0, read_of(1)
            yield _TIMEOUT_MS, read_of(2)
            yield 3.0, answer_of(1, 300 + i)
            if i % 16 == 3:
                yield 5.0, read_of(3)
                yield 4.0, answer_of(2, 500 + i)
                yield 9.0, answer_of(3, 700 + i)
            else:
                yield 15.0, answer_of(2, 500 + i)
                yield from exchange(3, i)

    assert named(causes(sent())) == [("timeout-too-short", (1,))]


def test_waits_that_are_alike_behind_an_adapter_are_a_timer_s() -> None:
    """Where the adapter's times tell no single wait: no clock makes waits more alike than they are."""
    random = Random(3)

    def sent() -> Iterator[Sent]:
        silence, owed = 20.0, b""
        for i in range(240):
            unit = i % 4 + 1
            yield silence, read_of(unit)
            waited = 0.0
            if owed:
                waited = random.uniform(1.0, 8.0) + len(owed) * CHAR_MS
                yield waited - len(owed) * CHAR_MS, owed
            late, owed, silence = random.random() < 0.3, b"", 20.0
            if late:
                owed, silence = answer_of(unit, 900 + i), _TIMEOUT_MS + 20 - waited
            else:
                yield _TIMEOUT_MS * random.uniform(0.5, 0.8) - waited, answer_of(unit, 900 + i)

    found = causes(sent(), tick_ms=_ADAPTER_MS)
    assert [cause.cause for cause in found] == ["timeout-too-short"]


@pytest.mark.parametrize("function", [6, 16])
@pytest.mark.parametrize("pause_ms", [2.5, 60.0])
def test_an_answer_to_a_broadcast_by_its_sender_s_own_address_is_neither_late_nor_a_second_one(
    function: int, pause_ms: float
) -> None:
    def sent() -> Iterator[Sent]:
        for i in range(300):
            unit = i % 5
            if unit:
                yield 20.0, read_of(unit)
                yield 8.0, answer_of(unit, 500 + i)
                continue
            values = (2, 4, 0, i % 256, 0, 7) if function == 16 else ()
            yield 20.0, frame(0, function, 0, 30, 0, *(values or (i % 256,)))
            yield 7.0, frame(1, function, 0, 30, 0, values[0] if values else i % 256)
            yield pause_ms - 20.0 if pause_ms > 20 else pause_ms, b""

    assert [cause.cause for cause in causes(sent())] == ["broadcast-answered"]


def test_noise_that_looks_like_requests_makes_no_dead_unit_late() -> None:
    random = Random(5)

    def sent() -> Iterator[Sent]:
        for i in range(600):
            unit = i % 3 + 1
            yield 20.0, read_of(unit)
            if unit != 3:
                yield 8.0, answer_of(unit, 500 + i)
            elif random.random() < 0.08:  # its repetition is hit
                yield 3 * _TIMEOUT_MS, bytes((random.randrange(256),)) + read_of(unit)[1:]
            else:
                yield 3 * _TIMEOUT_MS, b""

    assert named(causes(sent()))[0] == ("dead-unit", (3,))


@pytest.mark.parametrize("tick_ms", [0.0, _ADAPTER_MS])
def test_all_units_are_late_where_what_is_repeated_though_answered_comes_by_a_timer(tick_ms: float) -> None:
    """The master pauses for longer than the answers are late, so that nothing stays without an answer."""
    random = Random(6)

    def sent() -> Iterator[Sent]:
        silence = 0.0
        for i in range(400):
            unit = i % 2 + 1
            for _ in range(3):
                yield silence, read_of(unit)
                took = _TIMEOUT_MS * random.uniform(0.55, 1.5)
                late = took > _TIMEOUT_MS
                silence = 1.5 * _TIMEOUT_MS + random.uniform(0.0, 4.0)
                yield took, answer_of(unit, 300 + i)
                if not late:
                    break
                silence += _TIMEOUT_MS - took - len(answer_of(unit, 0)) * CHAR_MS

    found = causes(sent(), tick_ms=tick_ms)
    assert [(cause.cause, set(cause.units)) for cause in found] == [("timeout-too-short", {1, 2})]


def test_a_list_that_holds_each_request_twice_and_keeps_time_is_no_short_timeout() -> None:
    random = Random(7)

    def sent() -> Iterator[Sent]:
        silence = 0.0
        for i in range(800):
            yield silence, read_of(i // 2 % 2 + 1)
            took = _TIMEOUT_MS * random.uniform(0.2, 0.9)
            yield took, answer_of(i // 2 % 2 + 1, 300 + i)
            silence = 2 * _TIMEOUT_MS - took

    assert not causes(sent())


def test_requests_soon_behind_others_are_a_second_master_s_though_some_answers_come_late() -> None:
    """The unit always needs its time, and silent requests were followed before that: no master gives up so soon."""
    random = Random(8)

    def sent() -> Iterator[Sent]:
        for i in range(500):
            unit = i % 5 + 1
            took = 24.0 if unit == 2 else 5.0
            yield 60.0, read_of(unit)
            if unit == 2 and random.random() < 0.15:
                soon = random.uniform(3.0, 12.0)
                yield soon, read_of(4, function=4)
                if random.random() < 0.7:
                    yield took - soon - 8 * CHAR_MS, answer_of(2, 700 + i)
            else:
                yield took, answer_of(unit, 500 + i)

    suspected = [each.suspect.cause for each in weigh(Evidence(ledger(sent())))]
    assert suspected[0] == "two-masters" and "timeout-too-short" not in suspected


@pytest.mark.parametrize("tick_ms", [0.0, _ADAPTER_MS])
def test_answers_to_broadcasts_that_are_not_waited_for_run_into_what_is_sent_behind_them(tick_ms: float) -> None:
    """No byte comes between a broadcast and the next request; whoever is asked then is hit, and nobody else."""
    random = Random(9)

    def sent() -> Iterator[Sent]:
        for i in range(600):
            unit = i % 4 + 1
            if i % 7:
                yield 20.0, read_of(unit)
                yield 8.0, answer_of(unit, 500 + i)
                continue
            yield 20.0, frame(0, 6, 0, 30, 0, i % 256)
            yield 3.0, read_of(unit)
            answered = frame(0, 6, 0, 30, 0, i % 256)
            yield 8.0, _overlaid(answer_of(unit, 500 + i), answered, random.randrange(5))

    assert [cause.cause for cause in causes(sent(), tick_ms=tick_ms)] == ["broadcast-answered"]


def test_a_unit_whose_answers_to_one_poll_are_short_answers_no_broadcast_before_it() -> None:
    def sent() -> Iterator[Sent]:
        for i in range(600):
            unit = i % 4 + 1
            if not unit - 1:
                yield 20.0, frame(0, 6, 0, 30, 0, i % 256)
            yield 20.0, read_of(unit)
            yield 8.0, answer_of(unit, 500 + i)[: 9 if unit > 1 else 6]

    assert [cause.cause for cause in causes(sent())] == ["driver-released-early"]


def test_a_client_that_rests_behind_the_last_unit_of_a_round_till_the_next_one_gave_nothing_up() -> None:
    """Its next request comes as long behind that unit's, whatever the answer took; but later behind it, not sooner."""
    random = Random(4)

    def sent() -> Iterator[Sent]:
        now = begun = 0.0
        for i in range(120):
            for unit in (1, 2, 3):
                rest = 16.0 + 8 * random.random() + (max(684.0 - now + begun, 0.0) if unit == 1 and i else 0.0)
                begun = now + rest if unit == 1 else begun
                request, answer = read_of(unit), answer_of(unit, 900 + i)
                delay = (100.0 if unit == 3 else 6.0 + unit) + (80.0 if unit == 3 else 1.0) * random.random()
                yield rest, request
                yield delay, answer
                now += rest + delay + (len(request) + len(answer)) * CHAR_MS

    assert causes(sent()) == []


def test_a_unit_beside_one_whose_delays_nobody_knows_is_not_held_against_it() -> None:
    made = field_cases()["echo-driver-enabled-late"].capture("gateway", 9100)
    capture = Capture.of(made.line, made.chunks)
    found = causes_of(ledger_of(((part.batch, part.transactions) for part in analyse(capture)), capture.line))
    assert (made.expected.cause, made.expected.units) in named(found)
