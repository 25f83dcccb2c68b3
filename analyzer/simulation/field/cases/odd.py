"""Buses that are well and odd, of which facts may be told and nobody accused; faults that no cause has a word for."""

from __future__ import annotations

from random import Random

from ..bench import Bench, Expected, read_pdu, site
from ..master import FieldPoll
from ..units import MS, burst_of
from .registry import ANY_TAP, Site, field_case

NAMELESS = Expected("")  # something is wrong that no cause is a word for


@field_case("healthy-event-log")
def healthy_event_log(random: Random, tap: str) -> Site:
    """An event log is read, which refuses by exception 04 while it is empty."""
    bench = site(random, tap, seconds=(60, 300))
    unit = bench.unit()
    at, full = 4000 + random.randrange(100), random.uniform(0.05, 0.4)
    bench.master.polls.append(FieldPoll(unit.unit, read_pdu(3, at, random.choice((8, 16)))))

    def log(request: bytes, answer: bytes, _: float) -> bytes:
        empty = request[0] == 3 and int.from_bytes(request[1:3]) == at and random.random() > full
        return bytes((0x83, 4)) if empty else answer

    unit.tampers.append(log)
    return bench, Expected(None)


@field_case("healthy-discovery")
def healthy_discovery(random: Random, tap: str) -> Site:
    """In each round one free address is tried."""
    bench = site(random, tap, units=(2, 8), seconds=(60, 300))
    free = [number for number in range(1, 60) if number not in bench.units]
    at = random.randrange(len(free))
    bench.master.manners.retries = 0
    tried = iter([*free[at:], *free[:at]] * 100)

    class Trying(FieldPoll):
        """A poll whose unit is another one each time."""

        def __getattribute__(self, name: str) -> object:
            return next(tried) if name == "unit" else super().__getattribute__(name)

    bench.master.polls.append(Trying(0, read_pdu(3, 0, 1)))
    return bench, Expected(None, (), ("absent-units",))


@field_case("healthy-boot-text")
def healthy_boot_text(random: Random, tap: str) -> Site:
    """A device prints its boot text while nobody asks, once."""
    bench = site(random, tap, seconds=(60, 300))
    bench.master.manners.pause_ms = lambda _: 150.0
    text = b"\r\nBOOT v%d.%d crc ok, starting\r\n" % (random.randrange(9), random.randrange(99))
    sender = bench.unit()

    def boot(t: float) -> None:
        bench.wire.send(burst_of(sender, bench.uart, text, t))

    bench.schedule.at(bench.clock(), boot)
    return bench, Expected(None)


@field_case("healthy-asleep")
def healthy_asleep(random: Random, tap: str) -> Site:
    """A unit sleeps for one long while, as an inverter does at night, and wakes again."""
    bench = site(random, tap, units=(2, 8), seconds=(120, 400))
    unit = bench.unit()
    span = bench.duration_ns - bench.begin_ns
    begin = bench.begin_ns + random.uniform(0.1, 0.4) * span
    end = begin + random.uniform(0.25, 0.45) * span
    unit.silent = lambda t: begin <= t < end
    bench.master.manners.cycle_ms = min(bench.master.manners.cycle_ms, span / 100 / MS)
    return bench, Expected(None, (), ("unit-restarts", "dead-unit"))


@field_case("healthy-one-outage")
def healthy_one_outage(random: Random, tap: str) -> Site:
    """The plant is switched off once: all units are silent for a while, and come back."""
    bench = site(random, tap, units=(3, 8), seconds=(120, 400))
    span = bench.duration_ns - bench.begin_ns
    begin = bench.begin_ns + random.uniform(0.1, 0.6) * span
    end = begin + random.uniform(0.1, 0.3) * span
    for unit in bench.units.values():
        back = end + random.uniform(0, 0.01) * span
        unit.silent = lambda t, back=back: begin <= t < back  # type: ignore[misc]
    return bench, Expected(None, (), ("all-silent",))


@field_case("nameless-deaf-behind", ANY_TAP)
def nameless_deaf_behind(random: Random, tap: str) -> Site:
    """A unit is deaf to what comes right behind another unit's answer: that one's tail keeps its receiver busy."""
    bench = site(random, tap, units=(3, 8), seconds=(60, 300))
    deaf, other = random.sample(sorted(bench.units), 2)
    rest = [poll for poll in bench.master.polls if poll.unit not in (deaf, other) and not poll.period_ns]
    request = read_pdu(3, 70, 2)
    bench.master.polls = [
        FieldPoll(other, read_pdu(3, 0, 4)), FieldPoll(deaf, request), *rest, FieldPoll(deaf, request)
    ]  # fmt: skip
    bench.master.manners.retries = random.choice((0, 1))

    def before(_request: bytes, answer: bytes, _t: float) -> bytes | None:
        return None if _asked_before(bench, deaf) == other else answer

    bench.units[deaf].tampers.append(before)
    return bench, NAMELESS


def _asked_before(bench: Bench, unit: int) -> int:
    requests = bench.master.requests
    return requests[-2].unit if len(requests) > 1 and requests[-1].unit == unit else 0


@field_case("nameless-every-nth", ANY_TAP)
def nameless_every_nth(random: Random, tap: str) -> Site:
    """A unit swallows every so many-eth request, whatever it is."""
    bench = site(random, tap, units=(2, 7), seconds=(60, 300))
    unit, every = bench.unit(), random.choice((5, 7, 9))
    count = {"heard": 0}

    def swallow(_request: bytes, answer: bytes, _t: float) -> bytes | None:
        count["heard"] += 1
        return None if count["heard"] % every == 0 else answer

    unit.tampers.append(swallow)
    return bench, NAMELESS


@field_case("nameless-refuses-by-chance", ANY_TAP)
def nameless_refusals(random: Random, tap: str) -> Site:
    """A unit refuses now and then by exception 03 what it answers else."""
    bench = site(random, tap, units=(2, 7), seconds=(60, 300))
    unit, share = bench.unit(), random.uniform(0.15, 0.5)

    def refuse(request: bytes, answer: bytes, _: float) -> bytes:
        return bytes((request[0] | 0x80, 3)) if random.random() < share else answer

    unit.tampers.append(refuse)
    return bench, NAMELESS
