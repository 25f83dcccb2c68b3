"""A dead unit beside a fault of the line, of the client or of the tap, which is told and does not swallow it."""

from __future__ import annotations

from dataclasses import replace
from random import Random

from ..bench import Expected
from .clients import two_masters
from .disturbances import emi_mains
from .registry import BYTES, LOCAL, Play, Site, field_case
from .structured import tap_loses


def _with_dead_unit(play: Play, random: Random, tap: str) -> Site:
    bench, expected = play(random, tap)
    unit = bench.unit()
    unit.silent = lambda _: True
    return bench, replace(expected, beside=Expected("dead-unit", (unit.unit,), ("retry-policy", "absent-units")))


@field_case("two-masters-beside-dead", LOCAL)
def two_masters_beside_dead(random: Random, tap: str) -> Site:
    """Two clients, and a unit without supply."""
    return _with_dead_unit(two_masters, random, tap)


@field_case("emi-mains-beside-dead", BYTES)
def emi_mains_beside_dead(random: Random, tap: str) -> Site:
    """Spikes in step with the mains, and a unit without supply."""
    return _with_dead_unit(emi_mains, random, tap)


@field_case("tap-loses-beside-dead", LOCAL)
def tap_loses_beside_dead(random: Random, tap: str) -> Site:
    """A tap that loses bytes, and a unit without supply."""
    return _with_dead_unit(tap_loses, random, tap)
