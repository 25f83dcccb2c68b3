"""What the line itself suffers: reflections, no bias, interference."""

from __future__ import annotations

from random import Random

from ..bench import SECOND, Bench, Expected, read_pdu, site
from ..master import FieldPoll
from ..registers import analog, steps
from ..units import FieldUnit
from ..wire import Burst, Pulse
from .registry import BYTES, TIMED, Site, field_case


@field_case("termination")
def termination(random: Random, tap: str) -> Site:
    """Reflections bend the early bits of what far units send."""
    bench = site(random, tap, units=(4, 10), seconds=(40, 300), bauds=(9600, 19200, 38400, 57600, 115200))
    numbers = list(bench.units)
    random.shuffle(numbers)
    far = numbers[: max(2, len(numbers) // 3)]
    reach = {number: random.uniform(0.4, 1.0) for number in far}
    rate = random.choice((0.004, 0.01, 0.03))
    from_start = random.random() < 0.6  # ringing behind the start's edge only, or behind any

    def bend(burst: Burst, chance: Random) -> list[Pulse]:
        share = reach.get(burst.sender.unit, 0.0) if isinstance(burst.sender, FieldUnit) else 0.0
        if not share:
            return []
        bit, pulses = burst.uart.bit_ns, []
        for start in burst.starts:
            if chance.random() < rate * share * 4:
                at = chance.choice((1, 1, 1, 2, 2, 3)) if from_start else chance.choice((1, 1, 2, 2, 3, 4, 5))
                t = start + (at + 0.2) * bit
                pulses.append(Pulse(t, t + chance.uniform(0.5, 0.7) * bit, "flip"))
        return pulses

    bench.wire.bends = bend
    return bench, Expected("termination", tuple(far))


@field_case("bias")
def bias(random: Random, tap: str) -> Site:
    """Nothing holds the line when nobody drives it: it picks up bytes that nobody sent."""
    bench = site(random, tap, seconds=(30, 300))
    bench.master.manners.pause_ms = lambda _: random.uniform(10, 120)
    bit, char = bench.uart.bit_ns, bench.uart.char_ns
    pulses: list[Pulse] = []
    rate = random.choice((0.5, 2.0, 8.0))  # stretches a second
    t = 0.0
    while t < bench.duration_ns:
        t += random.expovariate(rate) * SECOND
        at = t
        for _ in range(random.choice((1, 1, 2, 4, 8))):
            width = random.choice((0.7, 1.2, 2.0, 5.0, 9.5)) * bit * random.uniform(0.8, 1.2)
            pulses.append(Pulse(at, at + width, "float"))
            at += width + random.uniform(0.5, 2.0) * char
    bench.pulses(pulses)
    return bench, Expected("bias")


def _spikes(random: Random, bench: Bench, times: list[float]) -> None:
    width = random.uniform(0.6, 2.5) * bench.uart.bit_ns
    bench.pulses([Pulse(t, t + width * random.uniform(0.7, 1.3), "flip") for t in times])


@field_case("emi-mains", BYTES)
def emi_mains(random: Random, tap: str) -> Site:
    """Spikes in step with the mains."""
    bench = site(random, tap, seconds=(60, 300), bauds=(2400, 4800, 9600, 19200, 38400))
    mains = random.choice((50.0, 50.0, 60.0)) * (1 + random.uniform(-4e-4, 4e-4))
    half = SECOND / mains / random.choice((1, 2, 2))
    phase, share, jitter = random.random(), random.choice((0.005, 0.02, 0.06)), random.uniform(0.01, 0.06)
    count = int(bench.duration_ns / half)
    times = [(k + phase + random.gauss(0, jitter)) * half for k in range(count) if random.random() < share]
    _spikes(random, bench, times)
    return bench, Expected("emi-mains")


@field_case("emi-drive")
def emi_drive(random: Random, tap: str) -> Site:
    """Interference while a drive runs, which its state on the bus tells."""
    bench = site(random, tap, units=(3, 8), seconds=(90, 400))
    unit = bench.unit()
    spells, t = [], random.uniform(0, 20) * SECOND
    while t < bench.duration_ns:
        length = random.uniform(0.04, 0.2) * bench.duration_ns
        spells.append((t, t + length))
        t += length + random.uniform(0.04, 0.2) * bench.duration_ns
    address = random.choice((10, 400, 2000))

    def on(at: float) -> bool:
        return any(begin <= at < end for begin, end in spells)

    kind = random.random()
    if kind < 0.2:  # a speed, which is told from 0 only
        speed = analog(random)
        unit.holdings.words[address] = lambda at: speed(at) if on(at) else 0
        bench.master.polls.append(FieldPoll(unit.unit, read_pdu(random.choice((3, 4)), address, 2)))
    elif kind < 0.6:
        unit.bits.words[address] = lambda at: int(on(at))
        bench.master.polls.append(FieldPoll(unit.unit, read_pdu(random.choice((1, 2)), address, 8)))
    else:
        unit.holdings.words[address] = steps(random, on)
        bench.master.polls.append(FieldPoll(unit.unit, read_pdu(random.choice((3, 4)), address, 2)))
    rate = random.choice((1.0, 3.0, 8.0))
    times = [t for begin, end in spells for t in _poisson(random, begin, end, rate)]
    _spikes(random, bench, times)
    return bench, Expected("emi-drive", (), ("hours",))


def _poisson(random: Random, begin: float, end: float, rate: float) -> list[float]:
    times, t = [], begin
    while (t := t + random.expovariate(rate) * SECOND) < end:
        times.append(t)
    return times


@field_case("hours", TIMED)
def hours(random: Random, tap: str) -> Site:
    """Interference at certain times only, days or minutes long, which nothing on the bus tells."""
    if random.random() < 0.5:
        bench = site(random, tap, units=(2, 6), seconds=(200, 600))
        count, rate = random.randint(1, 3), random.choice((2.0, 5.0))
        spells = []
        for k in range(count):
            begin = (k + random.uniform(0.1, 0.5)) / count * bench.duration_ns
            spells.append((begin, begin + random.uniform(0.1, 0.3) / count * bench.duration_ns))
    else:
        bench = site(random, tap, units=(2, 5))
        hour, days = 3600 * SECOND, random.choice((1, 2, 3))
        bench.duration_ns, bench.begin_ns = days * 24 * hour, 0.0
        bench.epoch_ns = 1_760_000_000_000_000_000
        period = days * 24 * hour / 900 / len({id(poll) for poll in bench.master.polls}) * len(bench.master.polls)
        bench.master.manners.cycle_ms = period / 1e6
        at, long = random.uniform(2, 18), random.uniform(1, 4)
        spells = [((day * 24 + at) * hour, (day * 24 + at + long) * hour) for day in range(days)]
        rate = random.choice((2.0, 5.0))
        bench.wire.pulses = []
        spells = [(begin, end) for begin, end in spells]
        bench.master.random = random
        return _sparse(random, bench, spells)
    _spikes(random, bench, [t for begin, end in spells for t in _poisson(random, begin, end, rate)])
    return bench, Expected("hours")


def _sparse(random: Random, bench: Bench, spells: list[tuple[float, float]]) -> Site:
    """Frames are rare: only where one passes can a spike do harm, so each gets its chance as it passes."""
    share = random.uniform(0.15, 0.5)

    def bend(burst: Burst, chance: Random) -> list[Pulse]:
        t = burst.starts[0]
        if chance.random() >= share or not any(begin <= t < end for begin, end in spells):
            return []
        at = t + chance.random() * (burst.last - t)
        return [Pulse(at, at + chance.uniform(0.6, 2.5) * burst.uart.bit_ns, "flip")]

    bench.wire.bends = bend
    return bench, Expected("hours")
