"""Buses that are well and look odd, and faults that look like those of others."""

from __future__ import annotations

from collections.abc import Iterator
from random import Random

import pytest
from bursts import CHAR_MS, Sent, answer_of, causes, frame, named, read_of

_SLOW = 3
_GLITCH = b"\xfe"


def _write(unit: int, i: int) -> bytes:
    return frame(unit, 6, 0, i % 7, i // 256 % 256, i % 256)


def test_a_slow_writer_behind_which_the_client_rests_about_as_long_is_well() -> None:
    def sent() -> Iterator[Sent]:
        for i in range(300):
            unit = i % _SLOW + 1
            slow = unit == _SLOW
            yield (128.0 if unit == 1 else 20.0), _write(unit, i)
            yield (158.0 + i % 5 if slow else 5.0 + unit), _write(unit, i)

    assert not causes(sent())


def _written(*, dies: int = -1, tries: int = 4, rounds: int = 40) -> Iterator[Sent]:
    """Three units that are only written to; the second dies in a round."""
    for i in range(rounds):
        for unit in (1, 2, 3):
            yield (900.0 if unit == 1 else 25.0), _write(unit, i)
            if unit != 2 or i < dies:
                yield 18.0 + unit, _write(unit, i)
                continue
            for _ in range(tries - 1):
                yield 200.0 + i % 2, _write(unit, i)
            yield 200.0, b""


@pytest.mark.parametrize("tick_ms", [0.0, 16.0])
@pytest.mark.parametrize("dies", [-1, 12])
def test_a_dead_unit_that_is_only_written_to_is_told_though_the_client_rests_behind_short_rounds(
    dies: int, tick_ms: float
) -> None:
    (found,) = causes(_written(dies=dies), tick_ms=tick_ms)
    assert named([found]) == [("dead-unit", (2,))]
    assert found.lost_answers == 4 * (40 - max(dies, 0))


def test_a_tap_that_hears_one_direction_tells_it_where_a_value_is_written_twice() -> None:
    def sent() -> Iterator[Sent]:
        random = Random(4)
        for i in range(120):
            yield 40.0 + random.uniform(0, 60), _write(i % 4 + 1, 50 if i == 54 else i)

    assert named(causes(sent())) == [("tap-one-direction", ())]


@pytest.mark.parametrize("tick_ms", [0.0, 16.0])
def test_a_full_line_is_told_where_short_answers_leave_much_of_it_to_silences(tick_ms: float) -> None:
    def sent() -> Iterator[Sent]:
        due = 3.5 * CHAR_MS
        for i in range(900):
            unit = i % 80 + 1
            yield due + 0.1, read_of(unit, quantity=1 + unit % 4)
            yield due + 0.1, answer_of(unit, i, 1 + unit % 4)

    assert named(causes(sent(), tick_ms=tick_ms)) == [("overload", ())]


def test_a_client_that_takes_noise_for_an_answer_and_goes_on_is_not_two() -> None:
    def sent() -> Iterator[Sent]:
        for i in range(400):
            unit = i % 4 + 1
            if i % 16 != 5:
                yield 25.0, read_of(unit)
                yield 20.0, answer_of(unit, i)
                continue
            yield 25.0, read_of(unit)
            yield 4.0, _GLITCH
            yield 4.0, read_of(unit % 4 + 1)
            yield 7.0, answer_of(unit, i)
            yield 5.0, answer_of(unit % 4 + 1, i)

    assert "two-masters" not in {found.cause for found in causes(sent())}
