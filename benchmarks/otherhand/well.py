"""Buses that are well, however odd."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import cycle

from .line import OtherDevice, OtherPoll
from .sites import OtherSite, other_kind, read
from .spoiling import hurt, refuse


@other_kind("well", units=(1, 12), healthy=True)
def _well(_: OtherSite) -> Iterable[OtherDevice]:
    return []


@other_kind("well-but-for-a-few", units=(1, 10), healthy=True)
def _few_errors(site: OtherSite) -> Iterable[OtherDevice]:
    site.line.requests, random = 1200, site.random
    site.line.spoils.append(lambda spell: hurt(random, spell.heard) if random.random() < 0.0012 else spell.heard)
    return []


@other_kind("well-scanned", also=("absent-units", "dead-unit"), units=(1, 6), healthy=True)
def _scanned(site: OtherSite) -> Iterable[OtherDevice]:
    spare = cycle(number for number in range(1, 80) if number not in site.line.devices)
    scan = OtherPoll(0, read(3, 0, 1), 5)

    def another(_: float) -> bytes:
        scan.unit = next(spare)  # the next time
        return read(3, 0, 1)

    scan.pdu, scan.unit = another, next(spare)
    site.client.polls.append(scan)
    site.client.retries = site.client.skips = 0
    return []


@other_kind("well-asleep", also=("absent-units", "dead-unit", "all-silent"), units=(3, 8), healthy=True)
def _asleep(site: OtherSite) -> Iterable[OtherDevice]:
    """Inverters, at dusk each in its own time; some captures end before dawn."""
    site.line.requests, dusk, dawn = 1200, site.random.uniform(0.35, 0.6), site.random.uniform(0.75, 2)
    for unit in site.some(2):
        own = site.random.uniform(-0.05, 0.05)
        unit.deaf.append(lambda _, __, own=own: dusk < site.line.share - own < dawn)  # type: ignore[misc]
    return []


@other_kind("well-full", units=(1, 4), healthy=True)
def _full(site: OtherSite) -> Iterable[OtherDevice]:
    client, line = site.client, site.line
    client.by_timers, client.rest_ns, client.gap_jitter = False, 0.0, 0.05
    client.gap_ns = line.rest_ns * site.random.uniform(1.05, 1.6)
    client.polls = [OtherPoll(unit.number, read(3, 0, site.random.randint(10, 40))) for unit in site.units]
    for unit in site.units:
        unit.delay_ns, unit.jitter, unit.per_byte_ns = site.random.uniform(1.1, 3) * line.rest_ns, 0.1, 0.0
    return []


@other_kind("well-slow", units=(2, 6), healthy=True)
def _slow(site: OtherSite) -> Iterable[OtherDevice]:
    random, timeout = site.random, site.client.timeout_ns
    site.one().delays.append(lambda _, delay: random.uniform(0.3, 0.8) * timeout if random.random() < 0.3 else delay)
    return []


@other_kind("well-busy-at-times", units=(1, 6), healthy=True)
def _busy_at_times(site: OtherSite) -> Iterable[OtherDevice]:
    refuse(site.one(), 6, lambda _, __: site.random.random() < 0.01)
    return []


@other_kind("well-off-once", also=("all-silent",), units=(2, 8), healthy=True)
def _off_once(site: OtherSite) -> Iterable[OtherDevice]:
    begin = site.random.uniform(0.3, 0.5)
    for unit in site.units:
        unit.deaf.append(lambda _, __: begin < site.line.share < begin + 0.15)
    return []
