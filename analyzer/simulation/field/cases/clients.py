"""What clients do wrong: too fast, too much, two of them, broadcasts."""

from __future__ import annotations

from random import Random

from ..bench import SECOND, Bench, Expected, read_pdu, site, write_pdu
from ..master import FieldMaster, FieldPoll, Manners
from ..units import MS
from ..wire import Burst
from .registry import BYTES, TIMED, Site, field_case


@field_case("two-masters")
def two_masters(random: Random, tap: str) -> Site:
    """Two clients poll on one line and know nothing of each other."""
    bench = site(random, tap, units=(2, 8), seconds=(40, 300))
    manners = Manners(
        timeout_ms=random.choice((150.0, 300.0, 500.0, 1000.0)),
        retries=random.choice((0, 1, 2)),
        pause_ms=lambda _: random.uniform(20, 60),
        cycle_ms=random.choice((700.0, 1000.0, 3000.0)),
    )
    bench.master.manners.cycle_ms = random.choice((400.0, 1000.0, 1500.0))
    numbers = random.sample(sorted(bench.units), random.randint(1, min(3, len(bench.units))))
    polls = [FieldPoll(number, read_pdu(random.choice((3, 4)), random.choice((0, 2, 500)), random.randint(1, 12)))
             for number in numbers for _ in range(random.randint(1, 2))]  # fmt: skip
    bench.masters.append(FieldMaster(bench.uart, bench.wire, random, polls, manners, strength=random.uniform(0.5, 1.5)))
    return bench, Expected("two-masters")


@field_case("broadcast-answered")
def broadcast_answered(random: Random, tap: str) -> Site:
    """One or several units answer what is sent to unit 0."""
    bench = site(random, tap, units=(2, 8), seconds=(40, 300))
    wrong = random.sample(sorted(bench.units), random.choice((1, 1, 2, len(bench.units))))
    number = random.choice((None, 0))
    for each in wrong:
        unit = bench.units[each]
        unit.answers_all = True
        if number == 0:
            unit.answer_unit = lambda: 0  # type: ignore[method-assign]
    # An echo of 05 or 06 by unit 0 could as well be the broadcast once more.
    pdu = write_pdu(random, random.choice((5, 6, 16)) if number is None else 16, random.randrange(100), 2)
    bench.master.polls.append(FieldPoll(0, pdu, random.uniform(1, 4) * SECOND))
    bench.master.manners.turnaround_ms = 2.5 * max(100.0, max(unit.delay_ms for unit in bench.units.values()))
    return bench, Expected("broadcast-answered")


@field_case("broadcast-storm", TIMED)
def broadcast_storm(random: Random, tap: str) -> Site:
    """Broadcasts follow each other without a pause and leave no time for polls."""
    bench = site(random, tap, seconds=(20, 120))
    bench.master.manners.turnaround_ms = random.uniform(0, 12) + bench.uart.silence_ns * 1.05 / MS
    pdu = write_pdu(random, random.choice((5, 6, 16)), random.randrange(100), 2)
    many = random.randint(3, 8) * len(bench.master.polls)
    listed = list(bench.master.polls)
    bench.master.polls = []
    for k in range(many):
        bench.master.polls.append(FieldPoll(0, pdu))
        if k * len(listed) // many != (k + 1) * len(listed) // many:
            bench.master.polls.append(listed[k * len(listed) // many])
    bench.master.manners.cycle_ms = 0.0
    if random.random() < 0.5:  # units that are busy with one do not hear what follows
        _deaf_after_broadcasts(random, bench)
    return bench, Expected("broadcast-storm")


def _deaf_after_broadcasts(random: Random, bench: Bench) -> None:
    work = random.uniform(10, 60) * MS
    for unit in bench.units.values():

        def busy(t: float) -> bool:
            last = next((one.end for one in reversed(bench.master.requests[-12:]) if one.unit == 0), -work)
            return t - last < work

        unit.silent = busy


@field_case("master-too-fast", BYTES)
def master_too_fast(random: Random, tap: str) -> Site:
    """The client sends its next request less than t3.5 after an answer."""
    bench = site(random, tap, seconds=(20, 120), bauds=(1200, 2400, 4800, 9600, 9600, 19200))
    chars = random.uniform(1.3, 2.9)
    bench.master.hasty_ns = chars * bench.uart.char_ns
    for unit in bench.units.values():
        unit.lenient = True
        unit.patience = 0.3
    return bench, Expected("master-too-fast")


@field_case("unit-too-fast", BYTES)
def unit_too_fast(random: Random, tap: str) -> Site:
    """A unit answers less than t3.5 after the request."""
    bench = site(random, tap, seconds=(20, 120), bauds=(1200, 2400, 4800, 9600, 9600, 19200))
    unit = bench.unit()
    chars = random.uniform(0.6, 2.8)
    unit.delay = lambda _pdu, _t: chars * random.uniform(0.97, 1.03) * bench.uart.char_ns
    return bench, Expected("unit-too-fast", (unit.unit,))


@field_case("overload", TIMED)
def overload(random: Random, tap: str) -> Site:
    """More is to be polled in each period than the line can carry."""
    bench = site(random, tap, units=(4, 10), seconds=(40, 300), bauds=(1200, 2400, 4800, 9600, 19200))
    wanted = random.choice((0.5, 1.0, 2.0)) * SECOND
    for unit in bench.units.values():
        unit.delay_ms = random.uniform(2, 8)
    bench.master.manners.pause_ms = lambda _: 0.0
    each = 60 * bench.uart.char_ns
    numbers = sorted(bench.units)
    while len(bench.master.polls) * each < 2.0 * wanted:
        number = random.choice(numbers)
        bench.master.polls.append(
            FieldPoll(number, read_pdu(3, random.randrange(0, 3000, 50), random.choice((20, 30, 40))))
        )
    for poll in bench.master.polls:
        poll.period_ns = wanted * random.choice((1, 1, 1, 2))
        poll.due = random.random() * wanted
    return bench, Expected("overload")


@field_case("converter-gaps", BYTES)
def converter_gaps(random: Random, tap: str) -> Site:
    """Some units stand behind a radio or converter that passes frames on in pieces."""
    bench = site(random, tap, units=(2, 8), seconds=(30, 200))
    behind = random.sample(sorted(bench.units), random.randint(1, len(bench.units)))
    size, pause = random.choice((8, 16, 16, 32, 64)), random.uniform(4, 40) * MS
    for number in behind:
        unit = bench.units[number]
        for poll in bench.master.polls:
            if poll.unit == number:
                poll.pdu = read_pdu(3, random.randrange(100), random.randint(size // 2, max(size, 40)))

        def shape(burst: Burst, _: Random) -> None:
            shift = 0.0
            starts = []
            for i, start in enumerate(burst.starts):
                if i and i % size == 0:
                    shift += pause * random.uniform(0.8, 1.3)
                starts.append(start + shift)
            burst.starts = starts
            burst.off += shift

        unit.shapes.append(shape)
    bench.master.manners.timeout_ms += 20 * pause / MS
    return bench, Expected("converter-gaps", tuple(behind))
