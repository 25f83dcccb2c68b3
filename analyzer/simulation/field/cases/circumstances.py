"""Faults in circumstances that hide them: few exchanges, a fault that begins late, clients that mostly write."""

from __future__ import annotations

import struct
from collections.abc import Callable
from random import Random

from ..bench import SECOND, Bench, Expected, longest_answer_ms, read_pdu, site, write_pdu
from ..master import FieldPoll
from ..units import MS
from ..wire import Burst
from .disturbances import bias
from .drivers import (
    another_format,
    driver_enabled_late,
    driver_released_early,
    duplicate_address,
    tap_one_direction,
    unit_line_settings,
)
from .firmware import crc_convention
from .healthy import healthy
from .registry import ANY_TAP, LOCAL, Play, Site, field_case
from .silence import dead_unit

_FEW = 60


def _shortly(case: Play, random: Random, tap: str) -> Site:
    bench, expected = case(random, tap)
    bench.most_requests = _FEW
    return bench, expected


@field_case("short-healthy")
def short_healthy(random: Random, tap: str) -> Site:
    """All is well, and sixty requests tell it."""
    return _shortly(healthy, random, tap)


@field_case("short-dead-unit")
def short_dead_unit(random: Random, tap: str) -> Site:
    """One unit of a few never answers, in sixty requests."""
    bench = site(random, tap, units=(2, 5))
    unit = bench.unit()
    unit.silent = lambda _: True
    bench.most_requests = _FEW
    return bench, Expected("dead-unit", (unit.unit,))


@field_case("short-driver-enabled-late")
def short_driver_enabled_late(random: Random, tap: str) -> Site:
    """A unit enables its driver late, in sixty requests."""
    return _shortly(driver_enabled_late, random, tap)


@field_case("short-unit-line-settings")
def short_unit_line_settings(random: Random, tap: str) -> Site:
    """A unit sends by other settings, in sixty requests."""
    return _shortly(unit_line_settings, random, tap)


@field_case("short-duplicate-address")
def short_duplicate_address(random: Random, tap: str) -> Site:
    """Two devices answer to one address, in sixty requests."""
    return _shortly(duplicate_address, random, tap)


@field_case("short-crc-convention")
def short_crc_convention(random: Random, tap: str) -> Site:
    """A unit makes another check value, in sixty requests."""
    return _shortly(crc_convention, random, tap)


@field_case("short-tap-one-direction", ANY_TAP)
def short_tap_one_direction(random: Random, tap: str) -> Site:
    """The tap hears one side only, in sixty requests."""
    return _shortly(tap_one_direction, random, tap)


def _nearly_over(bench: Bench) -> float:
    """ns: nine tenths of the capture are well."""
    return bench.begin_ns + 0.9 * (bench.duration_ns - bench.begin_ns)


@field_case("end-dead-unit")
def end_dead_unit(random: Random, tap: str) -> Site:
    """A unit goes silent in the last tenth of a capture."""
    bench = site(random, tap, units=(2, 6), seconds=(120, 600))
    unit, begin = bench.unit(), _nearly_over(bench)
    unit.silent = lambda t: t >= begin
    bench.master.manners.cycle_ms = min(bench.master.manners.cycle_ms, 500.0)
    enough = max(300.0, longest_answer_ms(bench.uart) + 4 * max(each.delay_ms for each in bench.units.values()))
    bench.master.manners.timeout_ms = min(bench.master.manners.timeout_ms, enough)
    return bench, Expected("dead-unit", (unit.unit,))


@field_case("end-driver-released-early")
def end_driver_released_early(random: Random, tap: str) -> Site:
    """A unit's driver begins to let go too early in the last tenth of a capture."""
    bench = site(random, tap, units=(2, 6), seconds=(120, 400))
    unit, begin = bench.unit(), _nearly_over(bench)
    early = random.uniform(0.5, 2.0) * bench.uart.char_ns

    def shape(burst: Burst, _: Random) -> None:
        if burst.starts[0] >= begin:
            burst.off, burst.plain = burst.last - early * random.uniform(0.9, 1.1), False

    unit.shapes.append(shape)
    return bench, Expected("driver-released-early", (unit.unit,))


@field_case("end-unit-line-settings")
def end_unit_line_settings(random: Random, tap: str) -> Site:
    """Somebody sets a unit to another speed or parity in the last tenth of a capture."""
    bench = site(random, tap, units=(2, 6), seconds=(120, 400))
    unit, wrong = bench.unit(), another_format(random, bench.uart)

    def change(_: float) -> None:
        unit.sends = wrong

    bench.schedule.at(_nearly_over(bench), change)
    return bench, Expected("unit-line-settings", (unit.unit,))


@field_case("short-bias")
def short_bias(random: Random, tap: str) -> Site:
    """Nothing holds the line at rest, in sixty requests of a client that takes its time."""
    bench, expected = bias(random, tap)
    bench.most_requests = _FEW
    bench.master.manners.pause_ms = lambda _: random.uniform(150, 400)
    return bench, expected


@field_case("healthy-slow-round")
def healthy_slow_round(random: Random, tap: str) -> Site:
    """A client that asks all its units in a burst and then rests for half a minute."""
    bench = site(random, tap, units=(2, 8), seconds=(600, 1500))
    bench.master.manners.cycle_ms = random.uniform(15, 40) * SECOND / MS
    return bench, Expected(None)


@field_case("single-dead-unit")
def single_dead_unit(random: Random, tap: str) -> Site:
    """The only unit of a bus stops to answer."""
    bench, _ = dead_unit(random, tap)
    unit = bench.unit()
    for number in [number for number in bench.units if number != unit.unit]:
        bench.units[number].silent = lambda _: True
        bench.master.polls = [poll for poll in bench.master.polls if poll.unit == unit.unit]
    begin = bench.begin_ns + random.uniform(0.3, 0.6) * (bench.duration_ns - bench.begin_ns)
    unit.silent = lambda t: t >= begin
    return bench, Expected("dead-unit", (unit.unit,))


_IDENTIFY = bytes((43, 14, 1, 0))
_Lists = Callable[[Random, Bench], list[FieldPoll]]


def _mask_write(random: Random, address: int) -> Callable[[float], bytes]:
    return lambda _: struct.pack(">BHHH", 22, address, 0xF2F2, random.getrandbits(8))


def _read_and_write(random: Random, address: int, quantity: int) -> Callable[[float], bytes]:
    return lambda _: struct.pack(">BHHHHBH", 23, address, quantity, address + 200, 1, 2, random.randrange(2000))


def _mixed(random: Random, bench: Bench) -> list[FieldPoll]:
    """Of each unit, some of all functions."""
    polls = []
    for number in bench.units:
        at = random.choice((0, 1, 100, 4000))
        every = [
            read_pdu(random.choice((1, 2)), at, random.choice((4, 16, 80))),
            read_pdu(random.choice((3, 4)), at, random.choice((1, 4, 10))),
            write_pdu(random, random.choice((5, 6)), at + 40),
            write_pdu(random, 16, at + 50, 4),
            _mask_write(random, at + 60),
            _read_and_write(random, at, random.choice((1, 4, 10))),
            lambda _: _IDENTIFY,
        ]
        polls += [FieldPoll(number, pdu) for pdu in random.sample(every, random.randint(1, 4))]
    return polls


def _written(random: Random, bench: Bench) -> list[FieldPoll]:
    """Each unit gets a setpoint, and nothing is read."""
    return [FieldPoll(number, write_pdu(random, 6, random.randrange(50))) for number in bench.units]


def _asked(play: Play, lists: _Lists, random: Random, tap: str) -> Site:
    bench, expected = play(random, tap)
    bench.master.polls = lists(random, bench)
    slowest = max(unit.delay_ms for unit in bench.units.values())
    manners = bench.master.manners
    manners.timeout_ms = max(manners.timeout_ms, 4 * slowest + longest_answer_ms(bench.uart))
    return bench, expected


@field_case("healthy-mixed")
def healthy_mixed(random: Random, tap: str) -> Site:
    """All is well, whatever is asked."""
    return _asked(healthy, _mixed, random, tap)


@field_case("healthy-written")
def healthy_written(random: Random, tap: str) -> Site:
    """All is well, and each answer is its request once more."""
    bench = site(random, tap, units=(2, 9), seconds=(30, 200))
    bench.master.polls = _written(random, bench)
    return bench, Expected(None)


@field_case("mixed-driver-enabled-late")
def mixed_driver_enabled_late(random: Random, tap: str) -> Site:
    """A unit enables its driver late, whatever it answers."""
    return _asked(driver_enabled_late, _mixed, random, tap)


@field_case("mixed-driver-released-early")
def mixed_driver_released_early(random: Random, tap: str) -> Site:
    """A unit lets go of the line too soon, whatever it answers."""
    return _asked(driver_released_early, _mixed, random, tap)


@field_case("mixed-dead-unit")
def mixed_dead_unit(random: Random, tap: str) -> Site:
    """A unit answers nothing of what it is asked, reads and writes."""
    return _asked(dead_unit, _mixed, random, tap)


@field_case("mixed-duplicate-address", LOCAL)
def mixed_duplicate_address(random: Random, tap: str) -> Site:
    """Two devices of one address, which each hear the other's answer to a write as a request."""
    return _asked(duplicate_address, _mixed, random, tap)


@field_case("written-dead-unit", LOCAL)
def written_dead_unit(random: Random, tap: str) -> Site:
    """A unit does not answer, and an answer would be the request once more, which the client repeats."""
    return _asked(dead_unit, _written, random, tap)


@field_case("written-driver-enabled-late")
def written_driver_enabled_late(random: Random, tap: str) -> Site:
    """A unit enables its driver late; what the client asks again reads like the right answer."""
    return _asked(driver_enabled_late, _written, random, tap)


@field_case("written-unit-line-settings")
def written_unit_line_settings(random: Random, tap: str) -> Site:
    """A unit sends by other settings; what the client asks again reads like the right answer."""
    return _asked(unit_line_settings, _written, random, tap)
