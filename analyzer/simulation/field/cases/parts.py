"""Faults of a part of what a client sends, or to a part of the units, beside what is well or hits all."""

from __future__ import annotations

from random import Random

from ..bench import Expected, site, write_pdu
from ..master import FieldPoll
from ..units import MS, WireEnvelope
from .registry import ANY_TAP, LOCAL, Site, field_case


@field_case("rest-too-short-called", LOCAL)
def rest_too_short_called(random: Random, tap: str) -> Site:
    """A unit is busy with each broadcast for a while, and the client asks it right behind them."""
    bench = site(random, tap, units=(2, 6), seconds=(60, 300))
    unit, manners = bench.unit(), bench.master.manners
    pdu = write_pdu(random, random.choice((5, 6, 16)), random.randrange(100), 2)
    mine = next(poll for poll in bench.master.polls if poll.unit == unit.unit)
    mine.period_ns = 0
    at = bench.master.polls.index(mine)
    bench.master.polls.insert(at, FieldPoll(0, pdu))
    bench.master.polls.append(FieldPoll(unit.unit, mine.pdu))
    manners.turnaround_ms = random.uniform(2, 15) + bench.uart.silence_ns * 1.05 / MS
    manners.cycle_ms, manners.retries = 0.0, random.choice((0, 1, 2))
    work = (manners.turnaround_ms + random.uniform(20, 60)) * MS + 10 * bench.uart.char_ns

    def busy(t: float) -> bool:
        last = next((one.end for one in reversed(bench.master.requests[-4:]) if one.unit == 0), -work)
        return t - last < work

    unit.silent = busy
    return bench, Expected("rest-too-short", (unit.unit,), ("master-too-fast", "broadcast-storm"))


@field_case("request-flaw-one", ANY_TAP)
def request_flaw_one(random: Random, tap: str) -> Site:
    """One driver of the client, for one unit, makes the CRC the other way round."""
    bench = site(random, tap, units=(3, 8), seconds=(40, 200))
    unit = bench.unit()
    bench.master.envelope = WireEnvelope(
        lambda data: data[:-2] + data[:-3:-1] if data[0] == unit.unit else data, lambda data: data
    )
    bench.master.manners.retries = random.choice((0, 1, 2))
    return bench, Expected("request-flaw", (), ("dead-unit", "absent-units"))
