"""No problems found."""

from __future__ import annotations

import struct
from random import Random

from ..bench import SECOND, Expected, site, write_pdu
from ..master import FieldPoll
from ..units import MS
from ..wire import Pulse
from .registry import Site, field_case


@field_case("healthy")
def healthy(random: Random, tap: str) -> Site:
    """All is well."""
    return site(random, tap, units=(1, 12)), Expected(None)


@field_case("healthy-broadcasts")
def healthy_broadcasts(random: Random, tap: str) -> Site:
    """A client that sets its units' clocks, outputs or setpoints all at once, again and again."""
    bench = site(random, tap)
    for _ in range(random.randint(1, 3)):
        pdu = write_pdu(random, random.choice((5, 6, 16)), random.randrange(100), 3)
        if random.random() < 0.5:
            same = pdu(0)
            pdu = lambda _, same=same: same  # type: ignore[misc]  # noqa: E731
        bench.master.polls.append(FieldPoll(0, pdu, random.choice((0.0, random.uniform(0.5, 5) * SECOND))))
    return bench, Expected(None)


@field_case("healthy-rare-errors")
def healthy_rare_errors(random: Random, tap: str) -> Site:
    """A line on which something goes wrong once in a while, as on every line."""
    bench = site(random, tap, seconds=(60, 300))
    times = [bench.clock() for _ in range(random.randint(1, 4))]
    bench.pulses([Pulse(t, t + random.uniform(0.4, 2) * bench.uart.bit_ns, "flip") for t in times])
    return bench, Expected(None)


@field_case("healthy-refusals")
def healthy_refusals(random: Random, tap: str) -> Site:
    """Operators who now and then write what a device refuses."""
    bench = site(random, tap)
    unit = bench.unit()
    high = random.randrange(500, 2000)

    def refuse(request: bytes, answer: bytes, _: float) -> bytes:
        refused = request[0] == 6 and struct.unpack(">H", request[3:5])[0] > high
        return bytes((0x86, 3)) if refused else answer

    unit.tampers.append(refuse)
    pdu = write_pdu(random, 6, random.randrange(100))
    bench.master.polls.append(FieldPoll(unit.unit, pdu, random.uniform(3, 12) * SECOND))
    return bench, Expected(None)


@field_case("healthy-slow-unit")
def healthy_slow_unit(random: Random, tap: str) -> Site:
    """One unit takes far longer than the others, which its client grants it."""
    bench = site(random, tap, seconds=(40, 300))
    unit = bench.unit()
    unit.delay_ms = random.uniform(150, 700)
    bench.master.manners.timeout_ms = unit.delay_ms * random.uniform(3.0, 5.0)
    return bench, Expected(None)


@field_case("healthy-timers")
def healthy_timers(random: Random, tap: str) -> Site:
    """Polls with periods of their own, a line that rests in between."""
    bench = site(random, tap)
    round_ns = 100 * bench.uart.char_ns * len(bench.master.polls)  # and more: what the line can carry
    for poll in bench.master.polls:
        poll.period_ns = max(random.choice((0.5, 1, 1, 2, 5, 10)) * SECOND, 2 * round_ns)
        poll.due = random.random() * poll.period_ns + 100 * MS
    return bench, Expected(None)
