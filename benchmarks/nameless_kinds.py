"""Faults that no cause is a word for, one by one; `nameless` tells what they are for."""

from __future__ import annotations

import struct
from collections import defaultdict
from collections.abc import Callable
from random import Random

from analyzer.simulation.conversation import adu
from analyzer.simulation.field.bench import SECOND, Bench, Expected, read_pdu, site, write_pdu
from analyzer.simulation.field.cases.registry import ANY_TAP, LOCAL, FieldCase, Site
from analyzer.simulation.field.master import FieldPoll
from analyzer.simulation.field.units import MS, FieldUnit, WireEnvelope
from analyzer.simulation.field.wire import Burst, ReceivedOctet
from dissectors.crc import crc_bytes

KINDS: dict[str, FieldCase] = {}
_EXCEPTION = 0x80
Harm = Callable[[Random, Bench], tuple[str, ...] | None]


def nameless_case(name: str, harm: Harm, taps: tuple[str, ...] = ANY_TAP) -> FieldCase:
    """The case of what does harm to a site; that gives the causes that are true of it besides."""

    def play(random: Random, tap: str) -> Site:
        bench = site(random, tap, units=(2, 8), seconds=(60, 300))
        return bench, Expected("", (), harm(random, bench) or ())

    play.__doc__, play.__module__ = harm.__doc__, harm.__module__
    return FieldCase(name, play, taps)


def nameless_kind(kinds: dict[str, FieldCase]) -> Callable[..., Callable[[Harm], Harm]]:
    """A decorator that registers, by name, what does harm to a site."""

    def named(name: str, taps: tuple[str, ...] = ANY_TAP) -> Callable[[Harm], Harm]:
        def enter(harm: Harm) -> Harm:
            kinds[name] = nameless_case(name, harm, taps)
            return harm

        return enter

    return named


nameless = nameless_kind(KINDS)


def deaf(unit: FieldUnit, to: Callable[[bytes, float], bool]) -> None:
    """It gives no answer to some requests (PDU, time)."""
    unit.tampers.append(lambda request, answer, t: None if to(request, t) else answer)


def refusing(unit: FieldUnit, code: int, when: Callable[[bytes, float], bool]) -> None:
    """It answers some requests by an exception."""
    unit.tampers.append(
        lambda request, answer, t: bytes((request[0] | _EXCEPTION, code)) if when(request, t) else answer
    )


def sealed(unit: FieldUnit, random: Random, share: float, harm: Callable[[bytes], bytes]) -> None:
    """A share of its answers is spoilt by chance."""
    seal = unit.seal
    unit.seal = lambda number, pdu: harm(seal(number, pdu)) if random.random() < share else seal(number, pdu)


def written_to(bench: Bench, unit: FieldUnit, period_s: float) -> Callable[[float], float]:
    """The client writes to a unit now and then; gives how long ago that was, ns."""
    random, last = bench.random, [-1e18]
    pdu = write_pdu(random, random.choice((6, 16)), 900, 1)
    bench.master.polls.append(FieldPoll(unit.unit, pdu, period_s * SECOND))

    def note(request: bytes, answer: bytes, t: float) -> bytes:
        if request[0] in (6, 16):
            last[0] = t
        return answer

    unit.tampers.append(note)
    return lambda t: t - last[0]


@nameless("weak-ear")
def weak_ear(random: Random, bench: Bench) -> None:
    """A unit misses requests by chance, each with the same share."""
    share = random.uniform(0.08, 0.5)
    deaf(bench.unit(), lambda _r, _t: random.random() < share)


@nameless("weak-ears")
def weak_ears(random: Random, bench: Bench) -> tuple[str, ...]:
    """Requests reach several far units spoilt, which the tap at the client does not hear."""
    far = random.sample(sorted(bench.units), max(2, len(bench.units) // 2))
    share = random.uniform(0.05, 0.3)
    for number in far:
        deaf(bench.units[number], lambda _r, _t: random.random() < share)
    return ("bad-drop", "termination", "interference")


@nameless("deaf-after-write")
def deaf_after_write(random: Random, bench: Bench) -> None:
    """A unit is deaf while it stores what was written to it."""
    unit = bench.unit()
    since, long = written_to(bench, unit, random.uniform(1, 4)), random.uniform(0.2, 1.2) * SECOND
    deaf(unit, lambda request, t: request[0] not in (6, 16) and since(t) < long)


@nameless("wakes-slowly")
def wakes_slowly(random: Random, bench: Bench) -> None:
    """A unit sleeps after a rest; the request that wakes it gets no answer."""
    unit, last = bench.unit(), [0.0]
    bench.master.manners.retries = random.choice((1, 2))  # or it would never be heard
    rest = random.uniform(1.3, 2.0) * bench.master.manners.timeout_ms * MS
    bench.master.manners.cycle_ms = random.uniform(2, 4) * rest / MS

    def wakes(_request: bytes, t: float) -> bool:
        slept, last[0] = t - last[0] > rest, t
        return slept

    deaf(unit, wakes)


@nameless("deaf-to-bytes")
def deaf_to_bytes(random: Random, bench: Bench) -> None:
    """A unit's port takes XON and XOFF out of requests: writes of some values get no answer."""
    unit = bench.unit()
    written_to(bench, unit, random.uniform(0.3, 1.0))
    values = random.sample(range(2000), 40)
    bench.master.polls[-1].pdu = lambda _: struct.pack(">BHH", 6, 900, random.choice(values))
    deaf(unit, lambda request, _: request[0] == 6 and request[-1] % 8 == 1)


@nameless("every-second-try")
def every_second_try(random: Random, bench: Bench) -> None:
    """A unit answers only what it is asked twice."""
    unit, last = bench.unit(), [b""]
    bench.master.manners.retries = random.choice((1, 2))

    def first(request: bytes, _t: float) -> bool:
        again = request == last[0]
        last[0] = b"" if again else request
        return not again

    deaf(unit, first)


@nameless("torn-check")
def torn_check(random: Random, bench: Bench) -> None:
    """A unit's values change behind the back of what makes its CRC."""
    share = random.uniform(0.05, 0.4)

    def torn(data: bytes) -> bytes:
        at = random.randrange(3, max(len(data) - 2, 4))
        return data[:at] + bytes((data[at] ^ random.choice((1, 3, 7, 15)),)) + data[at + 1 :]

    sealed(bench.unit(), random, share, torn)


@nameless("drops-a-byte", LOCAL)
def drops_a_byte(random: Random, bench: Bench) -> None:
    """A unit's transmitter runs empty and leaves a byte out, anywhere."""

    def without(data: bytes) -> bytes:
        at = random.randrange(1, len(data) - 1)
        return data[:at] + data[at + 1 :]

    sealed(bench.unit(), random, random.uniform(0.05, 0.4), without)


@nameless("doubles-a-byte", LOCAL)
def doubles_a_byte(random: Random, bench: Bench) -> None:
    """A unit's transmitter sends some byte twice."""

    def doubled(data: bytes) -> bytes:
        at = random.randrange(1, len(data) - 1)
        return data[: at + 1] + data[at:]

    sealed(bench.unit(), random, random.uniform(0.05, 0.5), doubled)


@nameless("byte-ahead", LOCAL)
def byte_ahead(random: Random, bench: Bench) -> tuple[str, ...]:
    """A unit sends a byte too many ahead of its answers."""
    ahead = bytes((random.choice((0xFF, 0x00, 0xFE)),))
    sealed(bench.unit(), random, random.choice((1.0, 0.6)), lambda data: ahead + data)
    return ("same-damage", "driver-enabled-late")


@nameless("stale-answer")
def stale_answer(random: Random, bench: Bench) -> None:
    """A unit answers now and then what was asked before, of another length."""
    unit, share, before = bench.unit(), random.uniform(0.05, 0.35), [b""]
    bench.master.polls += [FieldPoll(unit.unit, read_pdu(3, 500, n)) for n in (3, 7)]

    def stale(_request: bytes, answer: bytes, _t: float) -> bytes:
        old, before[0] = before[0], answer
        return old if old and random.random() < share else answer

    unit.tampers.append(stale)


@nameless("other-number")
def other_number(random: Random, bench: Bench) -> tuple[str, ...]:
    """A unit answers now and then by the number of another unit."""
    unit, share = bench.unit(), random.uniform(0.1, 0.5)
    other = random.choice([number for number in range(1, 60) if number not in bench.units])
    unit.seal = lambda number, pdu: adu(other if random.random() < share else number, pdu)
    return ("same-damage",)


@nameless("other-function")
def other_function(random: Random, bench: Bench) -> tuple[str, ...]:
    """A unit answers by another function than it was asked, now and then."""
    share = random.uniform(0.1, 0.5)

    def another(_request: bytes, answer: bytes, _t: float) -> bytes:
        return bytes((answer[0] ^ 7,)) + answer[1:] if random.random() < share else answer

    bench.unit().tampers.append(another)
    return ("same-damage",)


@nameless("more-than-asked")
def more_than_asked(random: Random, bench: Bench) -> tuple[str, ...]:
    """A unit gives more registers than it was asked for, with a right CRC, now and then."""
    share = random.uniform(0.1, 0.6)

    def more(request: bytes, answer: bytes, _t: float) -> bytes:
        if request[0] not in (3, 4) or answer[0] != request[0] or random.random() > share:
            return answer
        return bytes((answer[0], answer[1] + 2)) + answer[2:] + b"\0\1"

    bench.unit().tampers.append(more)
    return ("byte-count", "same-damage")


@nameless("pauses-inside", ("precise",))
def pauses_inside(random: Random, bench: Bench) -> tuple[str, ...]:
    """A unit's program is held up in the middle of its answers: clients take the parts for frames."""
    unit, long = bench.unit(), random.uniform(4, 12) * bench.uart.char_ns

    def shape(burst: Burst, _: Random) -> None:
        if random.random() < 0.4:
            at = random.randrange(2, len(burst.starts))
            burst.starts = [t + long * (i >= at) for i, t in enumerate(burst.starts)]
            burst.off += long

    unit.shapes.append(shape)
    return ("converter-gaps",)


@nameless("refuses-in-spells")
def refuses_in_spells(random: Random, bench: Bench) -> tuple[str, ...]:
    """What a unit fetches from a bus of its own is gone for a while, again and again: exception 02."""
    unit, period = bench.unit(), random.uniform(10, 30) * SECOND
    refusing(unit, 2, lambda _r, t: t % period < 0.3 * period)
    return ("unit-busy", "unit-fails")


@nameless("refuses-after-write")
def refuses_after_write(random: Random, bench: Bench) -> tuple[str, ...]:
    """A unit refuses all for a while behind each write."""
    unit = bench.unit()
    since, long = written_to(bench, unit, random.uniform(1, 4)), random.uniform(0.2, 1.2) * SECOND
    code = random.choice((1, 2, 3))
    refusing(unit, code, lambda request, t: request[0] not in (6, 16) and since(t) < long)
    return ("unit-busy",)


@nameless("odd-exception")
def odd_exception(random: Random, bench: Bench) -> tuple[str, ...]:
    """A unit refuses now and then by a code that no document has."""
    code, share = random.choice((7, 9, 0x20, 0x63, 0xFF)), random.uniform(0.1, 0.5)
    refusing(bench.unit(), code, lambda _r, _t: random.random() < share)
    return ("unit-fails",)


@nameless("refuses-by-value")
def refuses_by_value(random: Random, bench: Bench) -> None:
    """A unit refuses half of what is written to it: values beyond its limits, sent again and again."""
    unit = bench.unit()
    bench.master.polls.append(FieldPoll(unit.unit, write_pdu(random, 6, 77), random.uniform(0.3, 1) * SECOND))
    most = random.randrange(500, 1500)
    refusing(unit, 3, lambda request, _: request[0] == 6 and int.from_bytes(request[3:5]) > most)


@nameless("client-deaf")
def clientdeaf(random: Random, bench: Bench) -> None:
    """The client does not get answers that are right on the line, by chance: it asks again, or goes on without."""
    share = random.uniform(0.1, 0.6)
    bench.master.manners.retries = random.choice((0, 1, 2))
    chance = Random(random.random())
    lost: dict[int, bool] = defaultdict(lambda: chance.random() < share)
    bench.master.envelope = WireEnvelope(
        lambda data: data, lambda data: b"" if lost[len(bench.master.requests)] else data
    )


@nameless("client-deaf-to-one")
def client_deaf_to_one(random: Random, bench: Bench) -> None:
    """The client does not take a unit's answers, though they are right: it waits for another length."""
    unit = bench.unit()
    bench.master.manners.retries = random.choice((0, 1, 2))
    bench.master.envelope = WireEnvelope(
        lambda data: data, lambda data: b"" if data[:1] == bytes((unit.unit,)) else data
    )


@nameless("client-deaf-behind")
def client_deaf_behind(random: Random, bench: Bench) -> None:
    """The client hears nothing for a while behind each request, as a converter turns round: what comes soon is lost."""
    bench.master.manners.retries, bench.master.manners.on_bad = random.choice((0, 1, 2)), "wait"
    delays = sorted(unit.delay_ms for unit in bench.units.values())
    middle = len(delays) // 2
    bench.master.manners.deaf_ms = (delays[middle - 1] + delays[middle]) / 2 + bench.uart.char_ns / 1e6


@nameless("client-stutters")
def client_stutters(random: Random, bench: Bench) -> tuple[str, ...]:
    """The client's port sends some requests with a byte wrong, by chance: no check value fits."""
    share = random.uniform(0.05, 0.3)

    def put(data: bytes) -> bytes:
        at = random.randrange(len(data))
        return (
            data[:at] + bytes((data[at] ^ 1 << random.randrange(8),)) + data[at + 1 :]
            if random.random() < share
            else data
        )

    bench.master.envelope = WireEnvelope(put, lambda data: data)
    return ("request-flaw", "interference")


@nameless("client-sends-twice")
def client_sends_twice(random: Random, bench: Bench) -> tuple[str, ...]:
    """The client sends now and then each request twice without a rest."""
    share = random.choice((0.2, 0.5, 1.0))
    bench.master.envelope = WireEnvelope(lambda data: data * (1 + (random.random() < share)), lambda data: data)
    for unit in bench.units.values():
        unit.lenient = random.random() < 0.7
    return ("local-echo", "request-flaw", "absent-units", "dead-unit")


@nameless("tap-flips", LOCAL)
def tap_flips(random: Random, bench: Bench) -> tuple[str, ...]:
    """The tap's own cable is bad: bits flip there, and the client hears all well."""
    rate = random.choice((0.0005, 0.001, 0.003))
    bench.tapped = lambda octets: [
        each._replace(value=each.value ^ 1 << random.randrange(8)) if random.random() < rate else each
        for each in octets
    ]
    return ("tap-loses",)


@nameless("crosstalk")
def crosstalk(random: Random, bench: Bench) -> tuple[str, ...]:
    """Pieces of another bus come through the wall, whatever is spoken here."""

    def mixed(octets: list[ReceivedOctet]) -> list[ReceivedOctet]:
        found, t, char = list(octets), bench.begin_ns, bench.uart.char_ns
        while (t := t + random.expovariate(0.7) * SECOND) < bench.duration_ns:
            frame = adu(random.randrange(100, 110), read_pdu(3, random.randrange(50), 2)(0))
            frame = frame[random.randrange(3) :]
            found += [ReceivedOctet(t + i * char, byte, False) for i, byte in enumerate(frame)]
        return sorted(found)

    bench.tapped = mixed
    return ("two-masters", "bias", "interference", "tap-loses", "other-protocol")


@nameless("crc-of-some")
def crc_of_some(random: Random, bench: Bench) -> tuple[str, ...]:
    """A unit's firmware makes the CRC of its exceptions or of one function's answers wrongly."""
    unit = bench.unit()
    bench.master.polls.append(FieldPoll(unit.unit, read_pdu(4, 60, random.choice((1, 2)))))
    bench.master.polls.append(FieldPoll(unit.unit, read_pdu(3, 60, random.choice((1, 2)))))
    unit.seal = lambda number, pdu: adu(number, pdu)[:-2] + crc_bytes(pdu) if pdu[0] == 4 else adu(number, pdu)
    return ("crc-convention", "same-damage")


@nameless("late-by-load")
def late_by_load(random: Random, bench: Bench) -> tuple[str, ...]:
    """A unit takes longer the more it is asked for, beyond the client's patience."""
    unit = bench.unit()
    bench.master.polls += [FieldPoll(unit.unit, read_pdu(3, 300, n)) for n in (2, 60)]
    most = bench.master.manners.timeout_ms * MS
    unit.tampers.append(lambda _r, answer, _t: None if len(answer) > 100 and random.random() < 0.7 else answer)
    unit.delay = lambda pdu, _: unit._usual_delay() if pdu[3:5] != b"\0\x3c" else 0.8 * most * random.random() + MS
    return ("cannot-serve", "timeout-too-short")


@nameless("loose-everywhere")
def loose_everywhere(random: Random, bench: Bench) -> tuple[str, ...]:
    """The client's own driver is weak: requests are lost on the way to any unit, by chance, and the tap hears them."""
    share = random.uniform(0.05, 0.3)
    for unit in bench.units.values():
        deaf(unit, lambda _r, _t: random.random() < share)
    return ("interference", "all-silent")


@nameless("two-faults-without")
def two_faults(random: Random, bench: Bench) -> None:
    """One unit misses requests by chance, another makes its check value of old values."""
    weak_ear(random, bench)
    torn_check(random, bench)
