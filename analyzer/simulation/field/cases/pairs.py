"""Two faults at once, of which either may be named first, and faults seen through adapters and gateways."""

from __future__ import annotations

from random import Random

from ..bench import SECOND, Bench, Expected, read_pdu, site
from ..master import FieldMaster, FieldPoll
from ..units import FieldUnit
from ..wire import Burst, Pulse
from .drivers import another_format, duplicated, echo_of_client
from .registry import LOCAL, Site, field_case


def _two(random: Random, tap: str) -> tuple[Bench, FieldUnit, FieldUnit]:
    bench = site(random, tap, units=(4, 9), seconds=(40, 300))
    one, two = random.sample(sorted(bench.units), 2)
    return bench, bench.units[one], bench.units[two]


def _late_driver(random: Random, unit: FieldUnit) -> None:
    late = random.uniform(0.6, 1.8) * unit.sends.char_ns

    def shape(burst: Burst, _: Random) -> None:
        burst.on, burst.plain = burst.starts[0] + late * random.uniform(0.9, 1.1), False

    unit.shapes.append(shape)


@field_case("dead-beside-driver")
def dead_beside_driver(random: Random, tap: str) -> Site:
    """One unit is dead, another enables its driver late."""
    bench, dead, late = _two(random, tap)
    dead.silent = lambda _: True
    _late_driver(random, late)
    return bench, Expected("dead-unit", (dead.unit,), (), Expected("driver-enabled-late", (late.unit,)))


@field_case("duplicate-beside-dead")
def duplicate_beside_dead(random: Random, tap: str) -> Site:
    """Two devices share an address, and another unit is dead."""
    bench, twins, dead = _two(random, tap)
    duplicated(random, bench, twins)
    dead.silent = lambda _: True
    return bench, Expected("duplicate-address", (twins.unit,), (), Expected("dead-unit", (dead.unit,)))


@field_case("duplicate-beside-settings")
def duplicate_beside_settings(random: Random, tap: str) -> Site:
    """Two devices share an address, and another unit sends by other settings."""
    bench, twins, other = _two(random, tap)
    duplicated(random, bench, twins)
    other.sends = another_format(random, bench.uart)
    return bench, Expected("duplicate-address", (twins.unit,), (), Expected("unit-line-settings", (other.unit,)))


@field_case("busy-beside-bias")
def busy_beside_bias(random: Random, tap: str) -> Site:
    """A unit is busy for a while, again and again, on a line that floats when nobody drives it."""
    bench, unit, _ = _two(random, tap)
    bench.master.manners.pause_ms = lambda _: random.uniform(10, 120)
    period = (bench.duration_ns - bench.begin_ns) / random.randint(2, 5)

    def busy(request: bytes, answer: bytes, t: float) -> bytes:
        return bytes((request[0] | 0x80, 6)) if (t - bench.begin_ns) % period < 0.4 * period else answer

    unit.tampers.append(busy)
    pulses, t = [], 0.0
    while t < bench.duration_ns:
        t += random.expovariate(3.0) * SECOND
        pulses.append(Pulse(t, t + random.choice((0.7, 2.0, 5.0)) * bench.uart.bit_ns, "float"))
    bench.pulses(pulses)
    return bench, Expected("unit-busy", (unit.unit,), (), Expected("bias"))


@field_case("echo-dead-unit")
def echo_dead_unit(random: Random, tap: str) -> Site:
    """The client's adapter shows what it is given to send, and one unit is dead."""
    bench, dead, _ = _two(random, tap)
    dead.silent = lambda _: True
    echo_of_client(random, bench)
    return bench, Expected("dead-unit", (dead.unit,), (), Expected("local-echo"))


@field_case("echo-driver-enabled-late")
def echo_driver_enabled_late(random: Random, tap: str) -> Site:
    """The client's adapter shows what it is given to send, and one unit enables its driver late."""
    bench, late, _ = _two(random, tap)
    _late_driver(random, late)
    echo_of_client(random, bench)
    return bench, Expected("driver-enabled-late", (late.unit,), (), Expected("local-echo"))


@field_case("gateway-dead-unit")
def gateway_dead_unit(random: Random, tap: str) -> Site:
    """A gateway answers for a unit behind it that does not: exception 0B, a little before the client would give up."""
    bench, dead, _ = _two(random, tap)
    wait = random.uniform(0.3, 0.8) * bench.master.manners.timeout_ms * 1e6
    dead.delay = lambda _pdu, _t: wait * random.uniform(0.98, 1.02)
    dead.tampers.append(lambda request, _answer, _t: bytes((request[0] | 0x80, 0x0B)))
    return bench, Expected("dead-unit", (dead.unit,))


@field_case("crowded-dead-unit")
def crowded_dead_unit(random: Random, tap: str) -> Site:
    """One of about thirty units never answers."""
    bench = site(random, tap, units=(25, 31), seconds=(60, 600))
    unit = bench.unit()
    unit.silent = lambda _: True
    return bench, Expected("dead-unit", (unit.unit,))


@field_case("two-masters-alike", LOCAL)
def two_masters_alike(random: Random, tap: str) -> Site:
    """Both of two redundant clients poll, the same list in the same manner."""
    bench = site(random, tap, units=(2, 8), seconds=(40, 300))
    manners = bench.master.manners
    manners.cycle_ms = random.choice((500.0, 1000.0, 1500.0))
    manners.pause_ms = lambda _: random.uniform(20, 60)
    polls = [FieldPoll(poll.unit, poll.pdu) for poll in bench.master.polls]
    bench.masters.append(FieldMaster(bench.uart, bench.wire, random, polls, manners, strength=random.uniform(0.5, 1.5)))
    return bench, Expected("two-masters")


@field_case("driver-held-fast")
def driver_held_fast(random: Random, tap: str) -> Site:
    """A unit holds its driver into the next request, at a speed at which that takes little."""
    bench = site(random, tap, units=(2, 7), seconds=(20, 120), bauds=(57600, 115200, 230400, 250000))
    unit = bench.unit()
    base = random.choice((2.0, 5.0, 10.0))
    bench.master.manners.pause_ms = lambda _: base
    bench.wire.contention = random.choice(("strong", "random"))
    unit.strength = 2.0
    into = max(base * 1e6, bench.uart.silence_ns + 2e5) + random.uniform(0.5, 4.0) * bench.uart.char_ns

    def shape(burst: Burst, _: Random) -> None:
        burst.off, burst.plain = burst.last + into, False

    unit.shapes.append(shape)
    return bench, Expected("driver-held", (unit.unit,))


@field_case("overload-few-polls", LOCAL)
def overload_few_polls(random: Random, tap: str) -> Site:
    """A few long polls, each of which should come every second, on a slow line."""
    bench = site(random, tap, units=(2, 4), seconds=(60, 300), bauds=(1200, 2400, 4800))
    bench.master.manners.pause_ms = lambda _: 0.0
    for unit in bench.units.values():
        unit.delay_ms = random.uniform(2, 8)
    bench.master.manners.timeout_ms += 260 * bench.uart.char_ns / 1e6
    many = random.randint(4, 7)
    bench.master.polls = [
        FieldPoll(random.choice(sorted(bench.units)), read_pdu(3, 100 * k, random.choice((30, 40, 60, 100))))
        for k in range(many)
    ]
    for poll in bench.master.polls:
        poll.period_ns = random.choice((0.5, 1.0)) * SECOND
        poll.due = random.random() * SECOND
    return bench, Expected("overload")


@field_case("overload-fixed-pause", LOCAL)
def overload_fixed_pause(random: Random, tap: str) -> Site:
    """A long list of long polls, one after the other; the client keeps a pause somewhat longer than is due."""
    bench = site(random, tap, units=(8, 15), seconds=(60, 300), bauds=(2400, 4800))
    due = 3.5 * bench.uart.char_ns
    pause = random.uniform(0.15, 0.6) * due / 1e6
    bench.master.manners.pause_ms = lambda _: pause
    for unit in bench.units.values():
        unit.delay_ms = random.uniform(2, 8)
    bench.master.manners.timeout_ms += 260 * bench.uart.char_ns / 1e6
    bench.master.polls = [
        FieldPoll(unit, read_pdu(3, 100 * k, random.choice((50, 60, 80))))
        for unit in sorted(bench.units)
        for k in range(random.randint(1, 2))
    ]
    for poll in bench.master.polls:
        poll.period_ns = SECOND
        poll.due = random.random() * SECOND
    return bench, Expected("overload")


@field_case("ascii-healthy")
def ascii_healthy(random: Random, tap: str) -> Site:
    """All is well, in Modbus ASCII."""
    bench = site(random, tap, bauds=(2400, 4800, 9600, 19200))
    bench.speak_ascii()
    return bench, Expected(None)


@field_case("ascii-dead-unit")
def ascii_dead_unit(random: Random, tap: str) -> Site:
    """One unit never answers, in Modbus ASCII."""
    bench, dead, _ = _two(random, tap)
    bench.speak_ascii()
    dead.silent = lambda _: True
    return bench, Expected("dead-unit", (dead.unit,))


@field_case("ascii-driver-enabled-late")
def ascii_driver_enabled_late(random: Random, tap: str) -> Site:
    """A unit enables its driver late, in Modbus ASCII."""
    bench, late, _ = _two(random, tap)
    bench.speak_ascii()
    _late_driver(random, late)
    return bench, Expected("driver-enabled-late", (late.unit,))


@field_case("ascii-settings")
def ascii_settings(random: Random, tap: str) -> Site:
    """One unit sends at another speed, in Modbus ASCII."""
    bench, other, _ = _two(random, tap)
    bench.speak_ascii()
    other.sends = another_format(random, bench.uart)
    return bench, Expected("unit-line-settings", (other.unit,))
