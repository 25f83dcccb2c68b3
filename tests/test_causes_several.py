"""Causes of several units at once, and such as meet all units alike: on buses written byte by byte."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from random import Random

import pytest
from bursts import CHAR_MS, Sent, answer_of, causes, frame, ledger, named, read_of

from analyzer.causes.evidence import Evidence
from analyzer.causes.ledger import ledger_of
from analyzer.causes.reasoning import causes_of, story_of, weigh
from analyzer.core import analyse
from analyzer.simulation.field.cases.registry import field_cases
from captures.chunks import Capture

_TIMEOUT_MS = 100.0


@pytest.mark.parametrize("slow", [(1, 2), (1, 2, 3)])
def test_late_answers_of_several_units_met_by_the_master_s_own_timer_are_no_second_master_s(
    slow: tuple[int, ...],
) -> None:
    random = Random(1)

    def sent() -> Iterator[Sent]:
        owed = b""  # an answer that comes behind the next request
        for i in range(300):
            unit = i % 4 + 1
            late = unit in slow and random.random() < 0.4
            yield 8.0 if owed or not i else 10.0, read_of(unit)
            waited = 0.0
            if owed:
                waited, was = 5.0 + 30 * random.random(), owed
                yield waited, was
                waited += len(was) * CHAR_MS
            owed = answer_of(unit, 900 + i) if late else b""
            if late:
                yield _TIMEOUT_MS - waited, b""
            else:
                yield 6.0 + i % 3, answer_of(unit, 900 + i)

    found = causes(sent())
    assert [(cause.cause, sorted(cause.units)) for cause in found] == [("timeout-too-short", list(slow))]


def test_a_late_echo_reads_like_a_request_and_ends_no_wait() -> None:
    """Of a write that is repeated at the timeout, and answered then by two echoes of it."""
    random = Random(2)

    def sent() -> Iterator[Sent]:
        for i in range(240):
            unit = i % 3 + 1
            write = frame(unit, 6, 0, 40, i // 256, i % 256)
            yield 10.0, write
            if random.random() < 0.5:
                yield _TIMEOUT_MS, write
                yield 5.0 + 20 * random.random(), write
                yield 8.0, read_of(unit)
                yield 4.0 + random.random(), write
                yield 4.0, answer_of(unit, i)
            else:
                yield 6.0, write

    waits = [wait for unit in ledger(sent()).units.values() for wait in unit.quiet_waits.numbers.tolist()]
    assert not [wait for wait in waits if wait < 0.9 * _TIMEOUT_MS * 1e6]


@pytest.mark.parametrize("heard", [0.05, 0.3, 0.7])
def test_answers_that_only_the_tap_does_not_hear_are_nobody_s_silence(heard: float) -> None:
    random = Random(3)

    def sent() -> Iterator[Sent]:
        silence = 10.0
        for i in range(400):
            unit = i % 4 + 1
            yield silence + random.random(), read_of(unit, quantity=2 * unit)
            delay, data = 5.0 + 3 * random.random() + unit, answer_of(unit, 700 + i, 2 * unit)
            silence = 10.0
            if random.random() < heard:
                yield delay, data
            else:
                silence += delay + len(data) * CHAR_MS

    assert named(causes(sent())) == [("tap-one-direction", ())]


@pytest.mark.parametrize(("holders", "often"), [((3,), 0.35), ((3, 5), 1.0)])
def test_drivers_of_several_units_may_be_held_or_of_one_at_times(holders: tuple[int, ...], often: float) -> None:
    random = Random(4)

    def sent() -> Iterator[Sent]:
        held = False
        for i in range(360):
            unit = i % 6 + 1
            if held:  # nobody understands the request, and the master asks again
                yield 8.0, bytes(octet | random.randrange(1, 256) for octet in read_of(unit))
                yield _TIMEOUT_MS, b""
            yield 8.0, read_of(unit)
            yield 5.0 + random.random(), answer_of(unit, 500 + i)
            held = unit in holders and random.random() < often

    assert [(cause.cause, tuple(sorted(cause.units))) for cause in causes(sent())] == [("driver-held", holders)]


def test_a_zero_behind_some_frames_of_one_unit_is_its_and_not_a_line_s_that_floats() -> None:
    def sent() -> Iterator[Sent]:
        for i in range(240):
            unit = i % 4 + 1
            yield 12.0, read_of(unit)
            yield 5.0, answer_of(unit, 500 + i) + (b"\0" if unit == 2 and i % 3 == 0 else b"")

    assert named(causes(sent())) == [("null-suffix", (2,))]


@pytest.mark.parametrize("code", [1, 2, 3])
def test_what_is_always_refused_does_not_exist_by_whatever_code(code: int) -> None:
    def sent() -> Iterator[Sent]:
        for i in range(120):
            for unit in (1, 2):
                yield 12.0, read_of(unit)
                yield 5.0, answer_of(unit, 500 + i)
            yield 12.0, frame(2, 4, 30, 0, 0, 3)
            yield 5.0, frame(2, 0x84, code)

    (told,) = named(causes(sent()))
    assert told[0] in ("cannot-serve", "missing-registers") and told[1] == (2,)


@pytest.mark.parametrize("units", [1, 3])
def test_a_tap_that_marks_requests_and_answers_alike_accuses_no_unit(units: int) -> None:
    def sent() -> Iterator[Sent]:
        for i in range(200):
            yield 12.0, read_of(i % units + 1)
            yield 5.0, answer_of(i % units + 1, 500 + i)

    assert "unit-line-settings" not in [cause.cause for cause in causes(sent(), frozenset(range(400)))]
    answers = frozenset(i for i in range(400) if i % 2 and i // 2 % units == 0)
    assert named(causes(sent(), answers)) == [("unit-line-settings", (1,))]


@pytest.mark.parametrize(("settings", "frozen"), [((7, 20_000, 9), False), ((410, 395, 402), True)])
def test_registers_that_stand_still_and_are_unlike_those_of_sisters_are_something_else(
    settings: tuple[int, ...], frozen: bool
) -> None:
    random = Random(5)

    def sent() -> Iterator[Sent]:
        for i in range(300):
            unit = i % 3 + 1
            values = settings if unit == 2 else [400 + random.randrange(30) for _ in settings]
            yield 12.0, frame(unit, 3, 0, 0, 0, 3)
            yield 5.0, frame(unit, 3, 6, *(octet for each in values for octet in divmod(each, 256)))

    assert ("frozen-values" in [cause.cause for cause in causes(sent())]) is frozen


@pytest.mark.parametrize("units", [6, 10])
def test_stray_bytes_behind_the_few_units_that_are_two_each_disturb_no_line(units: int) -> None:
    """Of two devices now one begins first, now the other, and the rest of a weak one is heard behind a good answer."""
    random = Random(8)

    def sent() -> Iterator[Sent]:
        for i in range(600):
            unit = i % units + 1
            yield 60.0, read_of(unit, quantity=6)
            good, second, at = answer_of(unit, 900 + i, 6), answer_of(unit, 7000 - 3 * i, 6), random.randrange(2, 8)
            if unit > 2:
                yield 6.0, good
            elif random.random() < 0.5:
                yield 6.0, bytes((second[0] & good[0],)) + second[1:at] + good[1:]
            else:
                yield 6.0, good
                yield 0.01, second[-at:]

    found = causes(sent())
    assert {cause.cause for cause in found} == {"duplicate-address"}
    assert sorted(unit for cause in found for unit in cause.units) == [1, 2]


def test_what_strays_right_behind_one_of_two_units_is_its_own_though_it_is_asked_most() -> None:
    random = Random(8)

    def sent() -> Iterator[Sent]:
        for i in range(500):
            unit = 1 if i % 4 else 2
            yield 100.0, read_of(unit, quantity=6)
            good, second = answer_of(unit, 900 + i, 6), answer_of(unit, 7000 - 3 * i, 6)
            if unit == 2:
                yield 6.0, good
            elif random.random() < 0.5:
                yield 6.0, bytes(octet & random.randrange(256) for octet in good[:4]) + good
            else:
                yield 6.0, good
                yield 3.0, second[-random.randrange(2, 6) :]

    story = story_of(ledger(sent()))
    told = [(cause.cause, cause.units) for cause in story.causes]
    assert "bias" not in [cause for cause, _ in told]
    assert (told and told[0][1] == (1,)) or [left.unit for left in story.not_explained] == [1]


def test_a_line_that_floats_in_the_rest_behind_the_last_unit_floats_for_all() -> None:
    """Nearly all that strays does so behind one unit, for there the line is idle."""
    random = Random(9)

    def sent() -> Iterator[Sent]:
        for i in range(450):
            unit = i % 3 + 1
            yield 10.0, read_of(unit)
            yield 8.0, answer_of(unit, 900 + i)
            rest = 300.0 if unit == 3 else 0.0
            if unit == 3 or random.random() < 0.05:
                stray = random.uniform(2.0, 8.0 + rest)
                yield stray, bytes((random.randrange(256),))
                rest -= min(stray, rest)
            yield rest, b""

    assert named(causes(sent())) == [("bias", ())]


def _behind_unit_2(more: Callable[[int], Iterator[Sent]]) -> Iterator[Sent]:
    """Two units asked in turn; what comes behind the answers of unit 2 instead of the next request."""
    for i in range(400):
        unit = i % 2 + 1
        yield 5.0, read_of(unit)
        yield 8.0, answer_of(unit, 500 + i)
        if unit == 2:
            yield from more(i)


def test_a_few_bytes_where_a_request_is_due_and_a_wait_behind_them_are_the_rest_of_a_request() -> None:
    def rest(i: int) -> Iterator[Sent]:
        yield 5.0 + 5 * CHAR_MS, bytes((0x42 + i % 7, 0xD7 ^ i % 3))
        yield 300.0, b""

    assert named(causes(_behind_unit_2(rest))) == [("driver-held", (2,))]


def test_a_few_bytes_that_nothing_waits_behind_are_no_request() -> None:
    def strays(i: int) -> Iterator[Sent]:
        yield 5.0 + 5 * CHAR_MS, bytes((0x42 + i % 7, 0xD7 ^ i % 3))

    assert ("driver-held", (2,)) not in named(causes(_behind_unit_2(strays)))


def test_a_second_master_that_comes_later_disturbs_at_no_certain_hours() -> None:
    """From then on requests are cut short before any unit ever answers, and frames damage each other."""
    random = Random(4)

    def sent() -> Iterator[Sent]:
        for i in range(800):
            unit = i % 2 + 1
            met = i > 500 and random.random() < 0.35
            yield 12.0, read_of(unit)
            if met and random.random() < 0.08:
                yield 4.0, read_of(3 - unit)
                yield 12.0, answer_of(3 - unit, 100 + i)
            elif met and random.random() < 0.15:
                yield 12.0, bytes(octet ^ 0x5A * (at in (4, 6)) for at, octet in enumerate(answer_of(unit, 500 + i)))
            else:
                yield 12.0, answer_of(unit, 500 + i)
                if met:
                    yield 12.0, bytes(random.randrange(256) for _ in range(random.randrange(5, 12)))

    assert [cause.cause for cause in causes(sent())] == ["two-masters"]


def test_what_strays_behind_one_unit_only_is_no_floating_line_though_the_clock_shows_no_pauses() -> None:
    """An adapter hands over an answer and the next request at once."""

    def sent() -> Iterator[Sent]:
        for i in range(400):
            unit = i % 2 + 1
            yield 2.0, read_of(unit)
            yield 4.0, answer_of(unit, 500 + i)
            if unit == 2:
                yield 2.0, bytes((0x42 + i % 7, 0xD7 ^ i % 3))
                yield 300.0, b""

    suspected = [each.suspect.cause for each in weigh(Evidence(ledger(sent(), tick_ms=16.0)))]
    assert suspected[0] == "driver-held" and "bias" not in suspected


def test_two_masters_are_told_by_what_runs_into_what_where_no_time_is() -> None:
    made = field_cases()["two-masters"].capture("ftdi16", 8801)
    capture = Capture.of(made.line, made.chunks)
    found = causes_of(ledger_of(((part.batch, part.transactions) for part in analyse(capture)), capture.line))
    assert [cause.cause for cause in found][:1] == ["two-masters"]
