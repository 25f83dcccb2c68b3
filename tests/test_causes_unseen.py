"""Kinds of faults that buses of other hands showed first: who answers for whom, what nobody asked for, what is late."""

from __future__ import annotations

from collections.abc import Iterator
from random import Random

import pytest
from bursts import Sent, answer_of, causes, frame, ledger, named, read_of

from analyzer.causes.reasoning import story_of


def _left(sent: Iterator[Sent]) -> list[tuple[int | None, int, str]]:
    """What no cause takes, where no cause is told."""
    story = story_of(ledger(sent))
    assert not story.causes, named(story.causes)
    return [(left.unit, left.exchanges, left.like) for left in story.not_explained]


def _rounds(count: int, *units: int) -> Iterator[tuple[int, int]]:
    yield from ((i, unit) for i in range(count) for unit in units)


def test_a_unit_that_answers_by_the_number_of_another_is_not_dead() -> None:
    def sent() -> Iterator[Sent]:
        for i, unit in _rounds(60, 1, 2, 7):
            yield 20.0, read_of(unit)
            yield 8.0, answer_of(1 if unit == 7 else unit, 300 + i)
            if unit == 7:
                yield 180.0, b""

    ((unit, count, like),) = _left(sent())
    assert (unit, count) == (7, 59) and "by the number of unit 1" in like


def test_answers_that_nobody_asked_for_are_told() -> None:
    def sent() -> Iterator[Sent]:
        for i, unit in _rounds(60, 1, 2):
            yield 20.0, read_of(unit)
            yield 8.0, answer_of(unit, 300 + i)
            if i % 3 == 0 and unit == 2:
                yield 60.0, answer_of(14, 700 + i)
                yield 60.0, b""

    ((unit, count, like),) = _left(sent())
    assert unit == 14 and count >= 15 and "nobody asked" in like


def test_a_list_in_which_each_poll_stands_twice_is_told() -> None:
    def sent() -> Iterator[Sent]:
        for i, unit in _rounds(40, 1, 2, 3, 4, 5):
            for _ in range(2):
                yield 15.0 + unit, read_of(unit)
                yield 8.0, answer_of(unit, 300 + i)

    ((unit, count, like),) = _left(sent())
    assert (unit, count) == (None, 200) and "again at once" in like


@pytest.mark.parametrize("unit", [2, 0])
def test_bytes_that_begin_like_a_poll_of_a_broadcast_are_of_no_unit(unit: int) -> None:
    """What stands in the place of an answer begins by the number and function of what else is polled."""

    def sent() -> Iterator[Sent]:
        random = Random(3)
        for i, asked in _rounds(60, 1, 2, 3):
            if asked == 1 and i % 4 == 0:
                yield 60.0, frame(0, 3, 0, 1, 0, 2)
                yield 60.0, b""
            yield 20.0, read_of(asked)
            hit = asked == 3 and i % 3 == 0
            yield 8.0, bytes((unit, 3)) + random.randbytes(5) if hit else answer_of(asked, 300 + i)

    assert "two-masters" not in [cause.cause for cause in causes(sent())]


def test_a_converter_that_sends_requests_to_one_unit_back_is_told_with_the_unit() -> None:
    def sent() -> Iterator[Sent]:
        for i, unit in _rounds(40, 1, 2, 3):
            yield 30.0 + i % 5, read_of(unit)
            if unit == 2:
                yield 7.0, read_of(unit)
            yield 9.0, answer_of(unit, 300 + i)

    assert named(causes(sent())) == [("local-echo", (2,))]


def test_writes_whose_check_value_is_exchanged_are_a_flaw_of_the_client() -> None:
    def sent() -> Iterator[Sent]:
        for i, unit in _rounds(60, 1, 2, 3):
            yield 20.0, read_of(unit)
            yield 8.0, answer_of(unit, 300 + i)
            if unit == 2:
                write = frame(2, 16, 0, 9, 0, 2, 4, 1, i, 2, i)
                yield 20.0, write[:-2] + write[:-3:-1]
                yield 200.0, b""

    assert named(causes(sent()))[:1] == [("request-flaw", ())]


def test_exceptions_without_a_check_value_are_a_convention() -> None:
    def sent() -> Iterator[Sent]:
        for i, unit in _rounds(60, 1, 2, 3):
            yield 20.0, read_of(unit)
            yield 8.0, answer_of(unit, 300 + i)
            if unit == 3:
                yield 20.0, read_of(3, quantity=4)
                yield 8.0, b"\3\x83\2\0\0"
                yield 200.0, b""

    assert named(causes(sent()))[:1] == [("crc-convention", (3,))]


def test_lines_of_text_between_frames_are_other_traffic_and_no_floating_line() -> None:
    def sent() -> Iterator[Sent]:
        for i, unit in _rounds(80, 1, 2, 3):
            yield 20.0, read_of(unit)
            yield 8.0, answer_of(unit, 300 + i)
            if unit == 2 and i % 4 == 0:
                yield 90.0, (b"NO CARRIER\r\n", b"RING\r\n", b"CONNECT 9600\r\n")[i // 4 % 3]
                yield 90.0, b""

    assert named(causes(sent())) == [("other-protocol", ())]


@pytest.mark.parametrize("registers", [20, 40])
def test_a_full_line_with_short_rounds_is_a_fact(registers: int) -> None:
    def sent() -> Iterator[Sent]:
        for i, unit in _rounds(150, 1, 2):
            yield 2.2, read_of(unit, quantity=registers)
            yield 2.5, answer_of(unit, 300 + i, registers)

    assert all(cause.severity == "note" for cause in causes(sent()))


def test_a_client_that_loses_good_answers_now_and_then_is_told() -> None:
    def sent() -> Iterator[Sent]:
        random = Random(8)
        for i, unit in _rounds(60, 1, 2, 3, 4):
            yield 20.0, read_of(unit)
            yield 8.0, answer_of(unit, 300 + i)
            while random.random() < 0.15:
                yield 11.0, read_of(unit)
                yield 8.0, answer_of(unit, 300 + i)

    assert {unit for unit, _, like in _left(sent()) if "does not take" in like} <= {1, 2, 3, 4} != set()


@pytest.mark.parametrize("gap_ms", [20.0, 45.0])
def test_answers_behind_which_the_client_goes_on_by_its_timer_came_too_late(gap_ms: float) -> None:
    """Its next request comes later than they do, so that they look good."""

    def sent() -> Iterator[Sent]:
        random = Random(5)
        for i, unit in _rounds(120, 1, 2, 3):
            yield gap_ms + 3 * random.random(), read_of(unit)
            late = random.uniform(0, 15) if unit == 2 and i % 4 == 0 else -1.0
            yield (150.0 + late if late >= 0 else 8.0 + random.random()), answer_of(unit, 300 + i)
            if late >= 0:
                yield -late, b""

    assert named(causes(sent())) == [("timeout-too-short", (2,))]


@pytest.mark.parametrize("times", [2, 3])
def test_a_list_in_which_most_polls_stand_several_times_is_told(times: int) -> None:
    def sent() -> Iterator[Sent]:
        for i, unit in _rounds(40, 1, 2, 3, 4, 5):
            for _ in range(1 if unit == 5 else times):
                yield 20.0, read_of(unit)
                yield 8.0, answer_of(unit, 300 + i)

    ((unit, count, like),) = _left(sent())
    assert (unit, count) == (None, 160 * (times - 1)) and "again at once" in like


def test_a_unit_that_answers_by_another_function_than_is_asked_is_not_dead() -> None:
    def sent() -> Iterator[Sent]:
        for i, unit in _rounds(60, 1, 2, 7):
            yield 20.0, read_of(unit, 4 if unit == 7 else 3)
            yield 8.0, answer_of(unit, 300 + i)
            if unit == 7:
                yield 180.0, b""

    left = _left(sent())
    assert {unit for unit, _, _ in left} == {7}
    assert any("to something else than was asked" in like for _, _, like in left)


def test_broadcasts_that_come_once_more_sooner_than_the_client_sends_are_given_back() -> None:
    def sent() -> Iterator[Sent]:
        for i, unit in _rounds(60, 1, 2, 3):
            yield 40.0, read_of(unit)
            yield 8.0, answer_of(unit, 300 + i)
            if unit == 3:
                yield 40.0, frame(0, 6, 0, 30, 0, i)
                yield 9.0, frame(0, 6, 0, 30, 0, i)
                yield 300.0, b""

    assert named(causes(sent())) == [("broadcast-answered", ())]


def test_holes_in_the_answers_of_some_units_are_not_the_taps() -> None:
    """It reads several bytes at once, and short holes stand in whatever it hears."""

    def sent() -> Iterator[Sent]:
        for i, unit in _rounds(60, 1, 2, 3):
            yield 30.0, read_of(unit, quantity=12)
            answer = answer_of(unit, 300 + i, 12)
            yield 12.0, answer[:16]
            yield 28.0 if unit == 3 else 0.0, answer[16:]

    assert named(causes(sent(), tick_ms=5.0)) == [("converter-gaps", (3,))]


def test_other_traffic_between_frames_of_modbus_is_a_warning() -> None:
    def sent() -> Iterator[Sent]:
        for i, unit in _rounds(80, 1, 2):
            yield 20.0, read_of(unit)
            yield 8.0, answer_of(unit, 300 + i)
            yield 90.0, bytes((0x10, 0x5B, unit, 0x5B + unit, 0x16))
            yield 90.0, b""

    assert [(each.cause, each.severity) for each in causes(sent())] == [("other-protocol", "warning")]
