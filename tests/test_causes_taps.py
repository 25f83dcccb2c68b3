"""What is wrong with the tap is no unit's fault: one direction, the two exchanged, a line on which nobody answers."""

from __future__ import annotations

from collections.abc import Callable
from math import ceil
from random import Random

import pytest

from analyzer.causes.ledger import ledger_of
from analyzer.causes.reasoning import causes_of
from analyzer.core import analyse
from analyzer.simulation import Scenario, simulate
from analyzer.simulation.field.bench import Expected, FieldCapture, site
from analyzer.simulation.field.cases.registry import field_cases
from captures.chunks import Capture, Chunk
from captures.line import LineSettings
from dissectors.crc import crc_bytes

_CHAR_NS = 11e9 / 19200


def _named(made: FieldCapture) -> list[str]:
    return _causes(Capture.of(made.line, made.chunks))


def _causes(capture: Capture) -> list[str]:
    ledger = ledger_of(((part.batch, part.transactions) for part in analyse(capture)), capture.line)
    return [cause.cause for cause in causes_of(ledger)]


@pytest.mark.parametrize("tap", ["precise", "ftdi16"])
@pytest.mark.parametrize("seed", [7081, 9302, 9308])
def test_exchanged_directions_are_told_where_requests_are_as_long_as_answers(seed: int, tap: str) -> None:
    assert _named(field_cases()["tap-reversed"].capture(tap, seed)) == ["tap-reversed"]


@pytest.mark.parametrize("tap", ["precise", "ftdi16"])
@pytest.mark.parametrize("seed", [7081, 9305, 9316, 9334])
def test_requests_alone_whose_pace_hangs_on_the_poll_are_answered(seed: int, tap: str) -> None:
    assert _named(field_cases()["tap-one-direction"].capture(tap, seed)) == ["tap-one-direction"]


@pytest.mark.parametrize("tap", ["precise", "ftdi16"])
@pytest.mark.parametrize("seed", [3, 4, 31])
def test_requests_whose_pace_is_the_timeouts_are_not(seed: int, tap: str) -> None:
    """Though the client's pauses stray, and so does the clock."""
    bench = site(Random(f"dead{seed}"), tap, units=(2, 8), seconds=(60, 300))
    for unit in bench.units.values():
        unit.silent = lambda _: True
    bench.master.manners.retries = 0
    assert _named(bench.run(Expected(None))) == ["absent-units"]


def _asked_only(rest_ns: Callable[[int], float], rounds: int, strays_ns: float) -> list[str]:
    """Causes where units 1 to 5 are asked for several quantities, and no answer is heard: `rest_ns` from the end of a
    request for so many registers to the next request, and a pause that strays; reads return 16 ms apart."""
    random, t, line = Random(5), 0.0, LineSettings(baud=19200, char_bits=11)
    reads: dict[int, bytes] = {}
    for _ in range(rounds):
        for unit, quantity in ((1 + k // 2, (2, 6)[k % 2] + k // 2 % 4) for k in range(10)):
            t += 8 * _CHAR_NS
            at = ceil(t / 16e6) * 16_000_000
            asked = bytes((unit, 3, 0, quantity, 0, quantity))
            reads[at] = reads.get(at, b"") + asked + crc_bytes(asked)
            t += rest_ns(quantity) + random.uniform(16e6, 16e6 + strays_ns)
    return _causes(Capture.of(line, [Chunk(at, data) for at, data in reads.items()]))


def test_the_longer_the_answer_that_is_asked_for_the_later_the_master_goes_on() -> None:
    """A few characters tell it behind pauses and a clock that stray by more."""
    assert _asked_only(lambda quantity: 10e6 + (5 + 2 * quantity) * _CHAR_NS, 128, 10e6) == ["tap-one-direction"]


def test_a_timer_behind_which_pauses_stray_is_told_by_some_rounds() -> None:
    assert _asked_only(lambda _: 200e6, 17, 40e6) == ["absent-units"]


@pytest.mark.parametrize("seed", [2, 3])
def test_flow_control_on_the_tap_is_no_units_fault(seed: int) -> None:
    made = simulate(Scenario("clean", "precise", transactions=300, seed=seed, defect="flow-control-loss"))
    assert _causes(Capture.of(made.line, made.chunks)) == ["tap-flow-control"]


def test_a_unit_19_whose_number_flow_control_eats_is_behind_answers_of_another() -> None:
    assert _named(field_cases()["tap-flow-control"].capture("precise", 500)) == ["tap-flow-control"]


def test_damage_on_a_bus_that_says_no_11_and_no_13_is_not_flow_controls() -> None:
    request = bytes.fromhex("050300640008")
    random, chunks, t_ns = Random(4), list[Chunk](), 1_000_000_000
    while len(chunks) < 240:
        body = bytes((5, 3, 16, *random.choices((0, 1, 2, 0x40, 0x7C), k=16)))
        answer = bytearray(body + crc_bytes(body))
        if len(chunks) % 3 == 0:
            answer[random.randrange(4, len(answer))] ^= 0x04
        if not {0x11, 0x13}.intersection(answer):
            for adu, pause_ns in ((request + crc_bytes(request), 40_000_000), (bytes(answer), 8_000_000)):
                t_ns += pause_ns + ceil(len(adu) * _CHAR_NS)
                chunks.append(Chunk(t_ns, adu))
    assert not {0x11, 0x13}.intersection(b"".join(chunk.data for chunk in chunks))
    assert "tap-flow-control" not in _causes(Capture.of(LineSettings(baud=19200, char_bits=11), chunks))
