"""Requests that come once more, answers that go on when they are over, values that happen to change at a bad time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from random import Random

import pytest
from bursts import CHAR_MS, Sent, answer_of, causes, frame, ledger, named, read_of

from analyzer.causes.ledger import ledger_of
from analyzer.causes.reasoning import causes_of
from analyzer.core import analyse
from analyzer.reports import summarize
from analyzer.simulation.field.cases.registry import field_cases
from captures.chunks import Capture

_TIMEOUT_MS = 60.0
_LONG = 40  # registers


@pytest.mark.parametrize("tick_ms", [0.0, 16.0])
def test_a_request_that_comes_again_into_its_own_answer_is_the_client_s_that_gave_up(tick_ms: float) -> None:
    """Though each answer begins as soon as the one before, so that no time strays."""
    random = Random(1)

    def sent() -> Iterator[Sent]:
        for i in range(240):
            unit = i % 4 + 1
            request = read_of(unit, quantity=_LONG if unit == 3 else 2)
            yield 12.0, request
            answer = answer_of(unit, 900 + i, _LONG if unit == 3 else 2)
            if unit != 3:
                yield 6.0 + unit, answer
                continue
            begun, mixed = len(answer) - 5, random.randrange(2, 6)
            yield 14.0, answer[:begun] + random.randbytes(mixed) + request[mixed:]
            yield _TIMEOUT_MS, b""

    assert named(causes(sent(), tick_ms=tick_ms)) == [("timeout-too-short", (3,))]


def test_an_echo_without_its_head_is_no_request_that_comes_again() -> None:
    def sent() -> Iterator[Sent]:
        for i in range(240):
            unit = i % 4 + 1
            write = frame(unit, 6, 0, 40, i // 256, i % 256)
            yield 12.0, write
            yield 5.0 + unit, (bytes((write[0] | 0x41,)) + write[1:] if unit == 3 and i % 8 < 4 else write)

    assert named(causes(sent())) == [("driver-enabled-late", (3,))]


@pytest.mark.parametrize("tick_ms", [0.0, 16.0])
def test_the_rest_of_a_repeated_request_behind_an_answer_is_no_second_device_s(tick_ms: float) -> None:
    random = Random(2)

    def sent() -> Iterator[Sent]:
        for i in range(320):
            unit = i % 4 + 1
            request, answer = read_of(unit), answer_of(unit, 900 + i)
            yield 12.0, request
            if unit != 3 or random.random() < 0.7:
                yield (40.0 if unit == 3 else 6.0) + random.random(), answer
                continue
            yield _TIMEOUT_MS - len(answer) * CHAR_MS / 2, answer
            yield 0.05, request[random.randrange(3, 6) :]
            yield _TIMEOUT_MS, b""

    assert named(causes(sent(), tick_ms=tick_ms)) == [("timeout-too-short", (3,))]


def test_answers_behind_silence_that_come_when_the_unit_never_answers_are_to_the_request_before() -> None:
    random = Random(8)

    def sent() -> Iterator[Sent]:
        for i in range(600):
            unit = i % 4 + 1
            yield 12.0, read_of(unit)
            if unit == 3 and random.random() < 0.1:
                yield _TIMEOUT_MS + 40.0, read_of(unit)
                yield 20.0 + 60.0 * random.random(), answer_of(unit, 700 + i)
            else:
                yield 6.0 + random.random(), answer_of(unit, 700 + i)

    assert named(causes(sent())) == [("timeout-too-short", (3,))]


def test_what_ends_an_answer_late_is_a_second_device_s_and_no_noise_of_an_idle_line() -> None:
    """Beside noise that is: a spike makes low bits behind a start bit, and comes at any time."""
    random = Random(3)

    def sent() -> Iterator[Sent]:
        rested = 20.0
        for i in range(400):
            unit = i % 4 + 1
            yield rested, read_of(unit)
            yield 5.0 + unit, answer_of(unit, 700 + i)
            rested = 60.0
            if unit == 2:
                yield 0.05, random.randbytes(random.randrange(1, 4))
            elif random.random() < 0.1:
                yield 50 * random.random(), bytes((0xFF << random.randrange(9) & 0xFF,))

    found = named(causes(sent()))
    assert found[0] == ("duplicate-address", (2,))
    assert ("duplicate-address", (1,)) not in found


def _behind_unit_2(behind: Callable[[int], bytes]) -> Iterator[Sent]:
    """Polls of four units; such bytes right behind each answer of unit 2, after which the client waits."""
    for i in range(240):
        unit = i % 4 + 1
        yield 12.0, read_of(unit, quantity=12)
        yield 5.0 + unit, answer_of(unit, 700 + i, 12)
        if unit == 2:
            yield 0.05, behind(i)
            yield _TIMEOUT_MS, b""


@pytest.mark.parametrize("tick_ms", [0.0, 16.0])
def test_an_end_that_is_longer_than_any_request_is_no_request_into_which_a_driver_is_held(tick_ms: float) -> None:
    random = Random(6)
    sent = _behind_unit_2(lambda _: random.randbytes(random.randrange(6, 18)))
    assert named(causes(sent, tick_ms=tick_ms)) == [("duplicate-address", (2,))]


def test_what_an_idle_line_makes_behind_answers_is_no_end_of_a_second_one() -> None:
    """Nearly all of its bytes are low once, from the start bit on; a few are not."""
    random = Random(8)

    def idle(i: int) -> bytes:
        octets = [0xFF << random.randrange(9) & 0xFF for _ in range(random.randrange(3, 9))]
        return bytes((*octets, random.choice((0xF0, 0xFE))) if i % 8 < 4 else (0x7F, *octets, 0xFE, 0xE0))

    assert "duplicate-address" not in {cause.cause for cause in causes(_behind_unit_2(idle))}


@pytest.mark.parametrize("unheard", [5, 6])
def test_the_answer_to_a_request_that_a_tap_cut_in_two_is_no_second_answer(unheard: int) -> None:
    """As a gateway does that hands over the rest of a packet with what comes next; with a byte missing it is one."""

    def sent() -> Iterator[Sent]:
        for i in range(120):
            yield 20.0, read_of(1)
            yield 6.0, answer_of(1, 700 + i)
            if i % 6 == 0:
                yield 20.0, read_of(1, 4)[:5]
                yield 90e3, read_of(1, 4)[unheard:]
                yield 6.0, frame(1, 4, 4, 0, i, 0, 3)

    assert ledger(sent()).unit(1).doubles == (20 if unheard > 5 else 0)


def test_requests_that_follow_each_other_sooner_than_anybody_gives_up_are_answered_out_of_hearing() -> None:
    """Behind a coarse adapter, where few polls tell how long each is waited for, the client resting between rounds."""
    random = Random(7)

    def sent() -> Iterator[Sent]:
        for i in range(90):
            yield (900.0 if i % 3 == 0 else 22.0 + random.random()), read_of(i % 3 // 2 + 1, 3, 2 + i % 3)

    assert [cause for cause, _ in named(causes(sent(), tick_ms=16.0))] == ["tap-one-direction"]


def test_a_few_frames_of_another_protocol_are_its_however_much_else_is_said() -> None:
    def sent() -> Iterator[Sent]:
        for i in range(600):
            unit = i % 3 + 1
            yield 20.0, read_of(unit, quantity=30)
            yield 6.0, answer_of(unit, 700 + i, 30)
            if i % 30 == 0:
                body = bytes((3, 3, 4, i % 256, 1, 2, 3))
                yield 15.0, b":" + (body + bytes((-sum(body) & 0xFF,))).hex().upper().encode() + b"\r\n"

    assert [cause for cause, _ in named(causes(sent()))] == ["other-protocol"]


def test_a_second_answer_that_is_lost_in_the_next_request_but_for_its_end_is_not_the_next_unit_s() -> None:
    """It is over before any answer can come, and what is asked again is answered well."""
    random = Random(4)

    def sent() -> Iterator[Sent]:
        for i in range(300):
            unit = i % 3 + 1
            yield 20.0, read_of(unit)
            if unit == 2:
                yield 0.1, random.randbytes(random.randrange(2, 4))
                yield _TIMEOUT_MS, read_of(unit)
            yield 6.0, answer_of(unit, 700 + i)

    assert named(causes(sent())) == [("duplicate-address", (1,))]


def test_a_second_answer_that_comes_two_exchanges_later_is_not_the_unit_s_that_it_meets() -> None:
    random = Random(9)

    def sent() -> Iterator[Sent]:
        for i in range(240):
            unit, answer = i % 4 + 1, answer_of(i % 4 + 1, 700 + i)
            yield 12.0, read_of(unit)
            if unit != 3:
                yield 5.0 + unit, answer
                continue
            second = answer_of(1, 300 + i)  # of another device than the one that answered before
            if random.random() < 0.5:
                yield 5.0, second[: random.randrange(3, 7)] + random.randbytes(12)
            else:
                yield 5.0, answer
                yield 3.0, second if random.random() < 0.3 else second[:4] + random.randbytes(7)
            yield _TIMEOUT_MS, read_of(unit)
            yield 8.0, answer

    assert named(causes(sent()))[0] == ("duplicate-address", (1,))


def test_a_few_refusals_in_a_row_for_want_of_time_are_told() -> None:
    def sent() -> Iterator[Sent]:
        for i in range(160):
            unit = i % 4 + 1
            yield 20.0, read_of(unit)
            yield 6.0, frame(unit, 0x83, 6) if unit == 2 and 60 <= i < 88 else answer_of(unit, 700 + i)

    assert named(causes(sent())) == [("unit-busy", (2,))]


def test_a_value_that_changes_about_when_the_line_is_hit_once_is_no_drive_s() -> None:
    """Of many values one always does so; where the line is hit each time the value stands, it is no chance."""
    random = Random(5)

    def sent(periods: int) -> Iterator[Sent]:
        for i in range(1200):
            unit = i % 4 + 1
            on = 300 <= i < 400 or i // 50 in (10, 14, 18, 21)
            hit = on and i < (400 if periods == 1 else 1200) and random.random() < 0.5
            yield 20.0, read_of(unit, quantity=1 if unit == 1 else 2)
            answer = answer_of(unit, 1 if on else 0, 1) if unit == 1 else answer_of(unit, 700 + i)
            at = random.randrange(3, len(answer))
            yield (
                6.0,
                answer[:at] + bytes((answer[at] ^ 1 << random.randrange(8),)) + answer[at + 1 :] if hit else answer,
            )

    assert [cause for cause, _ in named(causes(sent(1)))] == ["hours"]
    assert [cause for cause, _ in named(causes(sent(5)))] == ["emi-drive"]


@pytest.mark.parametrize(
    ("case", "seed", "tap", "units"),
    [
        ("absent-units", 8100, "ftdi16", [10, 12, 23, 28, 31]),  # writes that are asked again read like their echo
        ("timeout-too-short", 8100, "ftdi16", [10]),  # answers that only now and then meet the repeated request
        ("ascii-driver-enabled-late", 8100, "precise", [1]),  # every line in ASCII ends as its request does
        ("emi-drive", 8103, "precise", []),  # what strays comes at its times, wherever the master rests then
        ("timeout-too-short", 70002, "precise", [3]),  # answers that begin when the master gives up are no one else's
        ("written-dead-unit", 4, "precise", [2]),  # all that seems to answer is the request, asked again by its timer
        (
            "written-driver-enabled-late",
            2,
            "precise",
            [38],
        ),  # damaged answers, and repetitions that read like good ones
        ("written-unit-line-settings", 2, "gateway", [27]),
        ("mixed-driver-released-early", 3, "precise", [32]),  # of answers whose length no request tells
        ("two-masters-alike", 120001, "gateway", []),  # in step: their requests meet, and no answer does
        ("timeout-too-short", 130004, "precise", [30]),  # each late answer is counted once, though others begin by it
        ("tap-flow-control", 130003, "precise", []),  # requests lack bytes as well
    ],
)
def test_cases_in_which_another_cause_was_named_once(case: str, seed: int, tap: str, units: list[int]) -> None:
    made = field_cases()[case].capture(tap, seed)
    parts = analyse(Capture.of(made.line, made.chunks))
    found = causes_of(ledger_of(((part.batch, part.transactions) for part in parts), made.line))
    name = case.removeprefix("ascii-").removeprefix("written-").removeprefix("mixed-").removesuffix("-alike")
    assert [(cause.cause, sorted(cause.units)) for cause in found] == [(name, units)]


@pytest.mark.parametrize("case", ["driver-held", "two-masters"])
def test_a_request_that_came_through_damaged_is_lost_as_well(case: str) -> None:
    made = field_cases()[case].capture("precise", 98001)
    parts = analyse(Capture.of(made.line, made.chunks))
    found = causes_of(ledger_of(((part.batch, part.transactions) for part in parts), made.line))
    assert found[0].lost_answers == pytest.approx(len(made.lost()), rel=0.1)


def test_requests_that_a_gateway_hands_over_in_pieces_are_lost_as_well() -> None:
    made = field_cases()["all-silent-trunk"].capture("gateway", 120002)
    parts = analyse(Capture.of(made.line, made.chunks))
    found = causes_of(ledger_of(((part.batch, part.transactions) for part in parts), made.line))
    assert found[0].lost_answers == pytest.approx(len(made.lost()), rel=0.1)


def test_the_time_lost_is_the_same_in_causes_and_findings() -> None:
    made = field_cases()["written-dead-unit"].capture("precise", 2)
    report = summarize(Capture.of(made.line, made.chunks))
    (silent,) = [row for row in report.findings if row.code == "no-response"]
    assert report.causes[0].lost_ms == pytest.approx(silent.lost_ms, rel=0.02)


def test_a_gateway_tells_no_time_that_was_lost() -> None:
    """Of requests that it hands over at once nobody knows what was between them."""
    made = field_cases()["mixed-dead-unit"].capture("gateway", 1)
    parts = analyse(Capture.of(made.line, made.chunks))
    found = causes_of(ledger_of(((part.batch, part.transactions) for part in parts), made.line))
    assert (found[0].cause, found[0].lost_ms) == ("dead-unit", None)


@pytest.mark.parametrize("seed", [8100, 8101])
def test_a_line_full_without_its_silences_is_no_overload(seed: int) -> None:
    """Behind a tap that tells the haste of the client at the most."""
    made = field_cases()["master-too-fast"].capture("ftdi16", seed)
    parts = analyse(Capture.of(made.line, made.chunks))
    found = causes_of(ledger_of(((part.batch, part.transactions) for part in parts), made.line))
    assert {cause.cause for cause in found} <= {"master-too-fast"}


@pytest.mark.parametrize(("behind_ms", "told"), [(60.0, []), (0.0, ["null-suffix"])])
def test_a_zero_belongs_to_the_frame_that_it_is_hard_at(behind_ms: float, told: list[str]) -> None:
    """The client makes one before each request; a unit that sends one behind its answer is another matter."""

    def sent() -> Iterator[Sent]:
        for i in range(240):
            unit = i % 4 + 1
            yield 60.0 - behind_ms, read_of(unit)
            yield 5.0, answer_of(unit, i)
            yield behind_ms, b"\0"

    found = causes(sent())
    assert [cause.cause for cause in found if cause.cause in ("null-suffix", "bias")] == told


def test_units_that_fall_silent_for_good_one_after_another_do_not_do_so_together() -> None:
    def sent() -> Iterator[Sent]:
        for i in range(900):
            unit = i % 5 + 1
            silent = unit < 4 and i > 600 + 25 * unit
            yield 200.0 if i and (i - 1) % 5 < 3 and i > 700 else 20.0, read_of(unit)
            if not silent:
                yield 5.0, answer_of(unit, i)

    assert "all-silent" not in {cause.cause for cause in causes(sent())}
