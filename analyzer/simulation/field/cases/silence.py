"""Units that do not answer, or not in time: alone, or together with their segment; and what only looks like it."""

from __future__ import annotations

from random import Random

from ..bench import SECOND, Bench, Expected, longest_answer_ms, read_pdu, site, write_pdu
from ..master import FieldPoll
from ..units import MS, FieldUnit
from ..wire import Burst, TapEnd
from .registry import ANY_TAP, BYTES, LOCAL, Site, field_case


@field_case("dead-unit")
def dead_unit(random: Random, tap: str) -> Site:
    """One unit of several never answers."""
    bench = site(random, tap, units=(2, 10))
    unit = bench.unit()
    bench.master.manners.retries = random.choice((0, 0, 1, 1, 2, 3))
    begin = 0.0 if random.random() < 0.85 else bench.begin_ns + random.uniform(0.2, 0.6) * bench.duration_ns
    unit.silent = lambda t: t >= begin
    return bench, Expected("dead-unit", (unit.unit,))


@field_case("absent-units")
def absent_units(random: Random, tap: str) -> Site:
    """The client's list holds units that are not there."""
    bench = site(random, tap, units=(4, 10))
    absent = random.sample(sorted(bench.units), random.randint(2, len(bench.units) - 1))
    for number in absent:
        bench.units[number].silent = lambda _: True
    bench.master.manners.retries = random.choice((0, 0, 1, 2))
    return bench, Expected("absent-units", tuple(absent))


@field_case("unit-restarts")
def unit_restarts(random: Random, tap: str) -> Site:
    """A unit goes silent for a while, again and again."""
    bench = site(random, tap, seconds=(90, 400))
    unit = bench.unit()
    times = random.randint(3, 8)
    period = (bench.duration_ns - bench.begin_ns) / times
    down, regular = random.uniform(0.08, 0.3) * period, random.choice((0.0, 0.05, 0.4))
    spells = []
    for k in range(times):
        begin = bench.begin_ns + (k + 0.4 + regular * (random.random() - 0.5)) * period
        spells.append((begin, begin + down * random.uniform(0.9, 1.1)))
    unit.silent = lambda t: any(begin <= t < end for begin, end in spells)
    for poll in bench.master.polls:
        if poll.unit == unit.unit:  # often enough for a spell to show
            poll.period_ns = 0
    bench.master.manners.cycle_ms = min(bench.master.manners.cycle_ms, down / 4 / MS)
    bench.master.manners.timeout_ms = min(bench.master.manners.timeout_ms, down / 6 / MS)
    return bench, Expected("unit-restarts", (unit.unit,))


@field_case("unit-busy")
def unit_busy(random: Random, tap: str) -> Site:
    """A unit says for a while, again and again, that it is busy."""
    bench = site(random, tap, seconds=(40, 400))
    unit = bench.unit()
    code, times = random.choice((6, 6, 5)), random.randint(2, 7)
    period = (bench.duration_ns - bench.begin_ns) / times
    share = random.uniform(0.15, 0.6)

    def busy(request: bytes, answer: bytes, t: float) -> bytes:
        return bytes((request[0] | 0x80, code)) if (t - bench.begin_ns) % period < share * period else answer

    unit.tampers.append(busy)
    return bench, Expected("unit-busy", (unit.unit,))


@field_case("retry-policy")
def retry_policy(random: Random, tap: str) -> Site:
    """The client asks a silent unit again and again before it goes on."""
    bench = site(random, tap, units=(3, 9), seconds=(60, 400))
    unit = bench.unit()
    unit.silent = lambda _: True
    bench.master.manners.retries = random.choice((5, 6, 9, 10, 19))
    return bench, Expected("retry-policy", (unit.unit,), ("dead-unit",))


@field_case("timeout-too-short", LOCAL)
def timeout_too_short(random: Random, tap: str) -> Site:
    """A unit takes longer than its client waits, always or often."""
    bench = site(random, tap, seconds=(40, 300))
    unit = bench.unit()
    manners = bench.master.manners
    others = max((one.delay_ms for one in bench.units.values() if one is not unit), default=0.0)
    manners.timeout_ms = max(60.0, 1.5 * manners.timeout_ms / 4, 1.6 * others + longest_answer_ms(bench.uart))
    usual, often = manners.timeout_ms * random.uniform(1.05, 1.9), random.choice((0.2, 0.5, 1.0))
    unit.delay = lambda _pdu, _t: (
        usual * MS * random.uniform(0.95, 1.1) if random.random() < often else unit._usual_delay()
    )
    manners.retries = random.choice((0, 0, 1, 2))
    return bench, Expected("timeout-too-short", (unit.unit,))


@field_case("timeout-too-short-shifted", ANY_TAP)
def timeout_too_short_shifted(random: Random, tap: str) -> Site:
    """A slow unit's answers are each taken for that of the next request, which asks the same shape."""
    bench = site(random, tap, units=(2, 6), seconds=(40, 300))
    unit = bench.unit()
    manners = bench.master.manners
    quantity, address, many = random.choice((1, 2, 4, 10)), random.choice((0, 100, 1000)), random.randint(3, 8)
    bench.master.polls = [poll for poll in bench.master.polls if poll.unit != unit.unit]
    for k in range(many):
        pdu = read_pdu(random.choice((3, 3, 3)), address + k * (quantity + 20), quantity)
        bench.master.polls.append(FieldPoll(unit.unit, pdu))
    others = max((one.delay_ms for one in bench.units.values() if one is not unit), default=0.0)
    manners.timeout_ms = max(50.0, manners.timeout_ms / 3, 1.6 * others + longest_answer_ms(bench.uart))
    manners.retries = random.choice((0, 0, 1))
    request_ms = 8 * bench.uart.char_ns / MS
    late = manners.timeout_ms * random.uniform(1.08, 1.4)
    if random.random() < 0.7:  # just behind the next request
        late = (
            manners.timeout_ms
            + max(manners.pause_ms(0), 4 * bench.uart.char_ns / MS)
            + request_ms
            + random.uniform(3, 40)
        )
    unit.delay = lambda _pdu, _t: late * MS * random.uniform(0.99, 1.01)
    return bench, Expected("timeout-too-short", (unit.unit,), ("values-under-wrong-registers",))


@field_case("timeout-too-short-writes", LOCAL)
def timeout_too_short_writes(random: Random, tap: str) -> Site:
    """A unit takes long to store what is written to it, and answers when the client is at the next polls."""
    bench = site(random, tap, units=(4, 9), seconds=(40, 200))
    unit, manners = bench.unit(), bench.master.manners
    bench.master.polls.insert(
        random.randrange(len(bench.master.polls)), FieldPoll(unit.unit, write_pdu(random, 16, 40))
    )
    usual, late = unit.delay, random.uniform(1.03, 1.5)
    manners.retries = 0
    unit.delay = lambda pdu, t: late * manners.timeout_ms * MS if pdu[0] == 16 else usual(pdu, t)
    return bench, Expected("timeout-too-short", (unit.unit,), ("values-under-wrong-registers",))


@field_case("timeout-too-short-write", LOCAL)
def timeout_too_short_write(random: Random, tap: str) -> Site:
    """A unit takes long to store a value: the client takes its answer for that to its next write, which it is like."""
    bench = site(random, tap, units=(4, 9), seconds=(40, 200))
    unit, manners = bench.unit(), bench.master.manners
    bench.master.polls.append(FieldPoll(unit.unit, write_pdu(random, 6, 40)))
    for poll in bench.master.polls:
        poll.period_ns = 0
    usual, late = unit.delay, random.uniform(1.05, 1.6)
    manners.retries, manners.cycle_ms, manners.compares_values = random.choice((0, 1)), 0.0, False
    unit.delay = lambda pdu, t: late * manners.timeout_ms * MS if pdu[0] == 6 else usual(pdu, t)
    return bench, Expected("timeout-too-short", (unit.unit,), ("values-under-wrong-registers",))


_NEVER_AGAIN = 1e18  # ns


def _part(bench: Bench, least_left: int) -> list[int]:
    """Two units or more, at least so many others spared."""
    return bench.random.sample(sorted(bench.units), bench.random.randint(2, len(bench.units) - least_left))


def _often(bench: Bench, silence_ns: float) -> None:
    """Ask often enough for a silence of this length to show."""
    manners, units = bench.master.manners, len(bench.units)
    for poll in bench.master.polls:
        poll.period_ns = 0
    manners.cycle_ms = min(manners.cycle_ms, silence_ns / 8 / MS)
    least = 2 * max(unit.delay_ms for unit in bench.units.values()) + longest_answer_ms(bench.uart)
    manners.timeout_ms = max(min(manners.timeout_ms, silence_ns / 8 / units / MS), least)
    manners.retries = min(manners.retries, 1)


def _within(bench: Bench, low: float, high: float) -> float:
    return bench.begin_ns + bench.random.uniform(low, high) * (bench.duration_ns - bench.begin_ns)


@field_case("all-silent-segment")
def all_silent_segment(random: Random, tap: str) -> Site:
    """A part of the bus is cut off in the middle of a capture."""
    bench = site(random, tap, units=(4, 10), seconds=(60, 400))
    lost, begin = _part(bench, 1), _within(bench, 0.2, 0.7)
    _often(bench, bench.duration_ns - begin)
    for number in lost:
        bench.units[number].silent = lambda t: t >= begin
    return bench, Expected("all-silent", tuple(lost))


@field_case("all-silent-trunk")
def all_silent_trunk(random: Random, tap: str) -> Site:
    """The trunk breaks behind the client, or its converter fails: nobody answers any more."""
    bench = site(random, tap, units=(2, 10), seconds=(60, 400))
    begin = _within(bench, 0.2, 0.7)
    _often(bench, bench.duration_ns - begin)
    for unit in bench.units.values():
        unit.silent = lambda t: t >= begin
    return bench, Expected("all-silent", tuple(bench.units))


@field_case("all-silent-power")
def all_silent_power(random: Random, tap: str) -> Site:
    """The units of a cabinet lose their power for a while, once or a few times, and start each in its own time."""
    bench = site(random, tap, units=(4, 10), seconds=(120, 600))
    lost = _part(bench, random.choice((0, 1, 1, 2)))
    times = random.choice((1, 1, 2, 3, 5))
    period = (bench.duration_ns - bench.begin_ns) / times
    off = random.uniform(0.1, 0.3) * period
    _often(bench, off)
    spells = [bench.begin_ns + (k + random.uniform(0.2, 0.5)) * period for k in range(times)]
    for number in lost:
        starts = random.uniform(0.0, 0.15) * off
        bench.units[number].silent = lambda t, starts=starts: any(  # type: ignore[misc]
            begin <= t < begin + off + starts for begin in spells
        )
    return bench, Expected("all-silent", tuple(lost))


@field_case("all-silent-briefly", LOCAL)
def all_silent_briefly(random: Random, tap: str) -> Site:
    """What all units hang on fails again and again, each time for less than a round: each misses a request or two."""
    bench = site(random, tap, units=(4, 10), seconds=(60, 200))
    manners, times = bench.master.manners, random.randint(5, 8)
    manners.retries, manners.cycle_ms = random.choice((0, 0, 1)), 0.0
    off = (manners.timeout_ms * random.uniform(3, 5) + 50) * MS
    period = (bench.duration_ns - bench.begin_ns) / times
    begins = [bench.begin_ns + (k + random.uniform(0.2, 0.6)) * period for k in range(times)]
    for poll in bench.master.polls:
        poll.period_ns = 0
    for unit in bench.units.values():
        unit.silent = lambda t: any(begin <= t < begin + off for begin in begins)
    return bench, Expected("all-silent", ())


@field_case("healthy-paused-master")
def healthy_paused_master(random: Random, tap: str) -> Site:
    """The client stops to poll for a while, as when somebody loads its program, and goes on."""
    bench = site(random, tap, seconds=(60, 300))
    times, usual = random.choice((1, 1, 2, 3)), bench.master.manners.pause_ms
    begins = [_within(bench, k / times, (k + 0.6) / times) for k in range(times)]
    stops = [(begin, begin + random.uniform(3, 60) * SECOND) for begin in begins]

    def pause(t: float) -> float:
        return next(((end - t) / MS for begin, end in stops if begin <= t < end), usual(t))

    bench.master.manners.pause_ms = pause
    return bench, Expected(None)


@field_case("healthy-scan")
def healthy_scan(random: Random, tap: str) -> Site:
    """Somebody looks once for what answers at which address: in one go, or between the polls."""
    bench = site(random, tap, units=(2, 8), seconds=(60, 300))
    if random.random() < 0.4:
        bench.master.polls = []  # a tool for it, not a client that polls
    begin, apart = _within(bench, 0.0, 0.4), random.choice((0.0, 0.0, 1.0, 3.0)) * SECOND
    least = max(250.0, 2 * longest_answer_ms(bench.uart))  # or it gives up while answers are on their way
    bench.master.manners.timeout_ms = min(bench.master.manners.timeout_ms, least)
    first, last = 1, random.choice((31, 63, 247))
    pdu = read_pdu(random.choice((3, 3, 4)), random.choice((0, 1, 100)), 1)
    for k, number in enumerate(range(first, last + 1)):
        bench.master.polls.append(FieldPoll(number, pdu, _NEVER_AGAIN, begin + k * max(apart, 1)))
    return bench, Expected(None)


@field_case("tap-loses-answers", BYTES)
def tap_loses_answers(random: Random, tap: str) -> Site:
    """Of two taps, a direction each, the one for the answers falls off: the client goes on as it did."""
    bench = site(random, tap, units=(2, 9), seconds=(40, 300))
    begin = _within(bench, 0.2, 0.7)

    def answers(burst: Burst) -> bool:
        return isinstance(burst.sender, FieldUnit) and burst.on < begin

    bench.wire.taps = [
        TapEnd(bench.uart, lambda burst: not isinstance(burst.sender, FieldUnit)),
        TapEnd(bench.uart, answers),
    ]
    bench.header["notes"] = {"directions": "request,response"}
    return bench, Expected("tap-one-direction")
