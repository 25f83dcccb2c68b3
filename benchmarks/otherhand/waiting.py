"""Who asks and who waits: clients without patience, two of them, units of one number, lines without rests."""

from __future__ import annotations

from collections.abc import Iterable
from random import Random

from .line import MS, SECOND, OtherClient, OtherDevice, OtherPoll
from .sites import OtherSite, other_kind, read


def _impatient(site: OtherSite) -> float:
    site.client.timeout_ns = site.random.choice((60, 100, 150, 250)) * MS + 140 * site.line.char_ns
    for unit in site.units:
        unit.delay_ns, unit.jitter, unit.per_byte_ns = min(unit.delay_ns, site.client.timeout_ns / 4), 0.1, 0.0
    return site.client.timeout_ns


@other_kind("impatient", "timeout-too-short")
def _impatient_by_chance(site: OtherSite) -> Iterable[OtherDevice]:
    timeout, unit, share = _impatient(site), site.one(), site.random.choice((0.05, 0.15, 0.4, 0.8))
    most = site.random.uniform(1.1, 1.8)
    unit.delays.append(
        lambda _, delay: timeout * site.random.uniform(0.9, most) if site.random.random() < share else delay
    )
    return [unit]


@other_kind("impatient-by-size", "timeout-too-short", units=(2, 6))
def _impatient_by_size(site: OtherSite) -> Iterable[OtherDevice]:
    timeout, unit = _impatient(site), site.one()
    site.client.polls.append(OtherPoll(unit.number, read(3, 600, site.random.randint(50, 100)), 2))
    unit.delays.append(lambda pdu, delay: timeout * site.random.uniform(1.02, 1.25) if pdu[3:5] > b"\0\x30" else delay)
    return [unit]


@other_kind("two-clients", "two-masters", units=(2, 6))
def _two_clients(site: OtherSite) -> Iterable[OtherDevice]:
    random, first = site.random, site.client
    polls = [
        OtherPoll(unit.number, read(3, random.choice((0, 200, 700)), random.choice((2, 4, 10))), random.uniform(1, 3))
        for unit in site.some(1)
    ]
    other = OtherClient(polls, True, random.uniform(100, 600) * MS, 0.1, 0.0, first.timeout_ns, 0)
    other.listens, other.begin_ns = False, 0.37 * SECOND
    site.line.askers.append(other)
    return []


@other_kind("twins", "duplicate-address")
def _twins(site: OtherSite) -> Iterable[OtherDevice]:
    unit = site.one()
    delay = unit.delay_ns * site.random.uniform(0.8, 1.3)
    site.line.twins.append(OtherDevice(unit.number, Random(site.random.random()), delay, unit.jitter, unit.per_byte_ns))
    return [unit]


@other_kind("rests", "rest-too-short", units=(2, 6))
def _rests(site: OtherSite) -> Iterable[OtherDevice]:
    unit, need = site.one(), site.random.uniform(20, 60) * MS
    site.client.gap_ns, site.client.gap_jitter, site.client.skips = max(need / 2, 1.25 * site.line.rest_ns), 0.6, 0
    site.client.polls += [OtherPoll(each.number, read(3, 333, 3)) for each in (unit, site.one())]

    def hurried(data: bytes, now: float) -> bool:
        begin = now - len(data) * site.line.char_ns
        before = max((each.end for each in site.line.spells if each.end <= begin), default=-SECOND)
        return begin - before < need

    unit.deaf.append(hurried)
    return [unit]
