"""Units that fall silent: to the capture's end, in spells, alone or with all others."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from random import Random

import pytest
from bursts import Sent, answer_of, causes, named, read_of

from analyzer.causes.flatmemory import Spell
from analyzer.causes.ledger import ledger_of
from analyzer.causes.reasoning import causes_of
from analyzer.causes.registry import Cause
from analyzer.causes.suspects.outages import outages_of
from analyzer.core import analyse
from analyzer.simulation.field.bench import SECOND, Bench, Expected, FieldCapture, read_pdu, site
from analyzer.simulation.field.cases.registry import field_cases
from analyzer.simulation.field.master import FieldPoll
from captures.chunks import Capture, Chunk

SILENT, OTHERS = 5, (6, 7, 8)


def _bench(*, polls: int = 1, cycle_ms: float = 500.0) -> Bench:
    """Four units, 60 s at 9600 bit/s; unit 5 is asked so many things a cycle."""
    bench = site(Random(11), "precise", units=(4, 4), bauds=(9600,), seconds=(60, 60.1))
    for number, unit in zip((SILENT, *OTHERS), list(bench.units.values()), strict=True):
        unit.unit, unit.delay_ms = number, 10.0
    bench.master.polls = [FieldPoll(SILENT, read_pdu(3, 100 * i, 4)) for i in range(polls)]
    bench.master.polls += [FieldPoll(other, read_pdu(3, 0, 4)) for other in OTHERS]
    manners = bench.master.manners
    manners.cycle_ms, manners.timeout_ms, manners.retries = cycle_ms, 200.0, 0
    bench.begin_ns, bench.duration_ns = 0.0, 60 * SECOND
    return bench


def _silence(bench: Bench, silent: Callable[[float], bool], *numbers: int) -> FieldCapture:
    for unit in bench.units.values():
        if unit.unit in numbers:
            unit.silent = silent
    return bench.run(Expected(None))


def _causes(made: FieldCapture, chunks: list[Chunk] | None = None) -> list[Cause]:
    capture = Capture.of(made.line, made.chunks if chunks is None else chunks)
    return causes_of(ledger_of(((part.batch, part.transactions) for part in analyse(capture)), capture.line))


def _named(causes: list[Cause]) -> list[tuple[str, tuple[int, ...]]]:
    return [(cause.cause, cause.units) for cause in causes]


def test_a_unit_that_is_silent_to_the_end_is_dead_since_then() -> None:
    found = _causes(_silence(_bench(), lambda t: t >= 40 * SECOND, SILENT))
    assert _named(found) == [("dead-unit", (SILENT,))]
    assert found[0].since_ns is not None
    assert 39 * SECOND < found[0].since_ns < 41 * SECOND


def test_a_unit_that_never_was_silent_before_is_dead_after_a_few_seconds_of_it() -> None:
    made = _silence(_bench(polls=2), lambda t: t >= 55.5 * SECOND, SILENT)
    assert _named(_causes(made)) == [("dead-unit", (SILENT,))]


@pytest.mark.parametrize("left", [0, 1, 3, 5, 7])
def test_a_last_frame_that_is_cut_damages_nobody_and_ends_no_silence(left: int) -> None:
    """The capture ends `left` bytes into an answer of another unit, or into a request to the silent one."""
    made = _silence(_bench(), lambda t: t >= 40 * SECOND, SILENT)
    data = b"".join(chunk.data for chunk in made.chunks)
    assert len(data) == len(made.chunks)  # a byte each
    for frame in (bytes((SILENT, 3, 0)), bytes((OTHERS[0], 3, 8))):
        at = data.rindex(frame, 0, -100)
        assert _named(_causes(made, made.chunks[: at + left])) == [("dead-unit", (SILENT,))]


def test_spells_of_two_silent_polls_are_restarts() -> None:
    """A unit that is asked every two seconds, and misses two polls each time."""
    often = _bench(cycle_ms=2000.0)
    found = _causes(_silence(often, lambda t: 5 * SECOND < t % (12 * SECOND) < 9 * SECOND, SILENT))
    assert _named(found) == [("unit-restarts", (SILENT,))]


def test_a_unit_that_falls_silent_while_others_answer_restarts() -> None:
    found = _causes(_silence(_bench(polls=3), lambda t: t % (20 * SECOND) < 4 * SECOND, SILENT))
    assert _named(found) == [("unit-restarts", (SILENT,))]


def test_units_that_fall_silent_all_at_once_do_not_restart_each_for_itself() -> None:
    found = _causes(_silence(_bench(polls=3), lambda t: 10 * SECOND < t % (20 * SECOND) < 14 * SECOND, SILENT, *OTHERS))
    assert [cause.cause for cause in found] == ["all-silent"]
    assert sorted(found[0].units) == [SILENT, *OTHERS]
    assert found[0].lost_answers is not None
    assert "5, 6, 7, 8" in found[0].text


def test_units_that_fall_asleep_one_after_the_other_do_not_fall_silent_together() -> None:
    """A client that asks sleepers in each twentieth round, one by one, twice each: every such probe was an outage."""
    asleep_from = {SILENT: 40, OTHERS[0]: 80, OTHERS[1]: 120}
    sent: list[Sent] = []
    for turn in range(240):
        sleepers = [unit for unit, since in asleep_from.items() if turn >= since]
        for unit in (SILENT, *OTHERS):
            if unit not in sleepers:
                sent += [(250.0, read_of(unit)), (5.0, answer_of(unit, turn))]
        if turn % 20 == 0:
            sent += [(500.0, read_of(unit)) for unit in sleepers for _ in range(2)]
    assert "all-silent" not in {cause for cause, _ in named(causes(sent))}


def test_a_part_of_the_bus_that_is_cut_off_is_one_cause() -> None:
    found = _causes(_silence(_bench(), lambda t: t >= 30 * SECOND, SILENT, OTHERS[0]))
    assert [cause.cause for cause in found] == ["all-silent"]
    assert sorted(found[0].units) == [SILENT, OTHERS[0]]
    assert "while others answered" in found[0].text
    assert found[0].since_ns is not None
    assert 29 * SECOND < found[0].since_ns < 31 * SECOND


def test_units_that_die_at_different_times_are_dead_each_for_itself() -> None:
    bench = _bench()
    for unit in bench.units.values():
        begin = {SILENT: 20, OTHERS[0]: 40}.get(unit.unit, 100) * SECOND
        unit.silent = lambda t, begin=begin: t >= begin  # type: ignore[misc]
    found = _causes(bench.run(Expected(None)))
    assert sorted(_named(found)) == [("dead-unit", (SILENT,)), ("dead-unit", (OTHERS[0],))]


def test_one_long_silence_is_told_as_one() -> None:
    found = _causes(_silence(_bench(), lambda t: 20 * SECOND < t < 35 * SECOND, SILENT))
    assert _named(found) == [("unit-restarts", (SILENT,))]
    assert "once" in found[0].text
    assert found[0].period_s is None


@pytest.mark.parametrize("case", ["healthy-scan", "healthy-paused-master"])
@pytest.mark.parametrize("seed", [0, 2, 7])
def test_a_search_for_units_and_a_pause_of_the_client_are_no_faults(case: str, seed: int) -> None:
    assert not _causes(field_cases()[case].capture("precise", seed))


def test_a_client_that_goes_on_as_soon_as_before_hears_answers_that_the_tap_does_not() -> None:
    found = _causes(field_cases()["tap-loses-answers"].capture("precise", 3))
    assert _named(found) == [("tap-one-direction", ())]
    assert found[0].lost_answers == 0


def test_a_spell_whose_times_run_backwards_is_grouped_with_nobody() -> None:
    """As where a capture has no times that can be trusted: the answer before it came after it began."""
    spells = {1: [Spell(100, 200, 3, after=150, before=90)], 2: [Spell(100, 200, 3, after=90, before=210)]}
    (group,) = outages_of(spells, 1000, lambda _: True) or ([],)
    assert all(len(outage.spells) == 2 for outage in group)


@pytest.mark.parametrize("tick_ms", [0.0, 16.0])
def test_a_dead_unit_on_a_line_that_floats_is_dead(tick_ms: float) -> None:
    """Stray bytes while the master waits for it, each by itself, are no garbled answers."""
    random = Random(3)

    def sent() -> Iterator[Sent]:
        for i in range(300):
            yield 30.0, read_of(i % 3 + 1)
            if i % 3 < 2:
                yield 20.0, answer_of(i % 3 + 1, 300 + i)
                continue
            for _ in range(random.choice((0, 1, 2, 3))):
                yield random.uniform(80.0, 150.0), bytes((random.choice((0xE0, 0xF0, 0xF8, 0xFC)),))
            yield 150.0, b""

    assert named(causes(sent(), tick_ms=tick_ms))[0] == ("dead-unit", (3,))


def test_a_search_is_one_though_a_gateway_holds_up_a_try_of_it() -> None:
    sent: list[Sent] = []
    for number in range(1, 31):
        if number == 5:
            sent += [(20.0, read_of(number)), (10.0, answer_of(number, 7))]
            continue
        held = 6000.0 if number in (12, 20, 25) else 200.0
        sent += [(200.0, read_of(number)), (held, read_of(number)), (200.0, read_of(number))]
    for value in range(150):
        sent += [(100.0, read_of(5)), (10.0, answer_of(5, value))]
    assert not causes(sent)
