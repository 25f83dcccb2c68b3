"""Buses whose clients do more than read: answers that read like their requests, or whose length no request tells."""

from __future__ import annotations

import struct
from collections.abc import Callable
from random import Random

from ..bench import Bench, Expected, longest_answer_ms, read_pdu, site, write_pdu
from ..master import FieldPoll
from .drivers import driver_enabled_late, driver_released_early, duplicate_address
from .healthy import healthy
from .registry import LOCAL, Play, Site, field_case
from .settings import unit_line_settings
from .silence import dead_unit

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
