"""Damage with a structure, of units, of the client, or of the tap alone."""

from __future__ import annotations

from random import Random

from dissectors.crc import crc_bytes

from ...conversation import adu
from ..bench import SECOND, Expected, read_pdu, site
from ..master import FieldPoll
from ..units import MS, WireEnvelope, constant
from ..wire import Burst, Pulse, ReceivedOctet
from .disturbances import let_float
from .registry import ANY_TAP, BYTES, LOCAL, Site, field_case


@field_case("cut-at-length", LOCAL)
def cut_at_length(random: Random, tap: str) -> Site:
    """A unit's transmit buffer holds so many bytes: longer answers stop there."""
    bench = site(random, tap, units=(1, 8), seconds=(40, 300), bauds=(9600, 19200, 38400, 57600))
    unit = bench.unit()
    holds = random.choice((16, 24, 32, 40, 48, 64))
    bench.master.polls = [poll for poll in bench.master.polls if poll.unit != unit.unit]
    for quantity in [*random.sample(range(holds // 2, 60), random.randint(1, 2)), random.randint(1, holds // 2 - 3)]:
        bench.master.polls.append(FieldPoll(unit.unit, read_pdu(3, random.randrange(500), quantity)))
    unit.seal = lambda number, pdu: adu(number, pdu)[:holds]
    return bench, Expected("cut-at-length", (unit.unit,))


@field_case("tap-loses", LOCAL)
def tap_loses(random: Random, tap: str) -> Site:
    """The tap's port overruns now and then and loses some bytes; the client gets all."""
    bench = site(random, tap, seconds=(60, 300))
    rate, most = random.choice((0.001, 0.002, 0.004)), random.choice((1, 3, 7))

    def lossy(octets: list[ReceivedOctet]) -> list[ReceivedOctet]:
        kept, lost = [], 0
        for octet in octets:
            if not lost and random.random() < rate:
                lost = random.randint(1, most)
            if lost:
                lost -= 1
            else:
                kept.append(octet)
        return kept

    bench.tapped = lossy
    return bench, Expected("tap-loses")


@field_case("tap-repeats", LOCAL)
def tap_repeats(random: Random, tap: str) -> Site:
    """The tap's adapter hands some bytes over twice; on the line all is well."""
    bench = site(random, tap, seconds=(60, 300))
    rate, most = random.choice((0.001, 0.002, 0.004)), random.choice((6, 16, 62))

    def doubled(octets: list[ReceivedOctet]) -> list[ReceivedOctet]:
        found: list[ReceivedOctet] = []
        for octet in octets:
            found.append(octet)
            if random.random() < rate:
                found += [each._replace(t_ns=octet.t_ns) for each in found[-random.randint(2, most) :]]
        return found

    bench.tapped = doubled
    return bench, Expected("tap-repeats")


@field_case("bad-drop")
def bad_drop(random: Random, tap: str) -> Site:
    """A loose terminal at one unit: some of its answers are hit, anywhere, and it may miss requests."""
    bench = site(random, tap, units=(3, 9), seconds=(100, 300))
    unit, share, most = bench.unit(), random.choice((0.1, 0.2, 0.4)), random.choice((1, 4, 12))
    deaf_to = random.choice((0.0, 0.3)) * share
    unit.silent = lambda _: random.random() < deaf_to

    def loose(burst: Burst, chance: Random) -> list[Pulse]:
        if burst.sender is not unit or chance.random() >= share:
            return []
        bit = burst.uart.bit_ns
        begins = (chance.uniform(burst.on, burst.last) for _ in range(chance.randint(1, most)))
        return [Pulse(t, t + chance.uniform(0.6, 3.0) * bit, "flip") for t in begins]

    bench.wire.bends = loose
    return bench, Expected("bad-drop", (unit.unit,))


@field_case("request-flaw", ANY_TAP)
def request_flaw(random: Random, tap: str) -> Site:
    """A bug in the client: the last byte of each request is missing, or its CRC is made otherwise."""
    bench = site(random, tap, seconds=(40, 200))
    flaw = random.choice(
        (
            lambda data: data[:-1],
            lambda data: data[:-2] + data[:-3:-1],
            lambda data: data[:-2] + crc_bytes(data[1:-2]),
        )
    )
    bench.master.envelope = WireEnvelope(flaw, lambda data: data)
    bench.master.manners.retries = random.choice((0, 1, 2))
    return bench, Expected("request-flaw", (), ("tap-one-direction",))


@field_case("null-suffix-several", LOCAL)
def null_suffix_several(random: Random, tap: str) -> Site:
    """A unit sends several zeros behind each answer."""
    bench = site(random, tap, units=(2, 8), seconds=(40, 300))
    unit, count = bench.unit(), random.randint(2, 5)
    unit.seal = lambda number, pdu: adu(number, pdu) + bytes(count)
    bench.master.takes_prefix = True
    return bench, Expected("null-suffix", (unit.unit,))


@field_case("counter-torn", ANY_TAP)
def counter_torn(random: Random, tap: str) -> Site:
    """A unit refreshes the two words of a counter at different times: it falls back by 65536 at each carry."""
    bench = site(random, tap, units=(2, 7), seconds=(120, 400))
    unit = bench.unit()
    rate, begin = random.uniform(1200, 6000), random.randrange(65536)
    late = random.uniform(0.6, 1.4) * max(bench.master.manners.cycle_ms / 1e3, 0.5)
    at = random.randrange(100, 200)
    unit.holdings.words[at] = lambda t: int(begin + rate * max(t / 1e9 - late, 0)) >> 16 & 0xFFFF
    unit.holdings.words[at + 1] = lambda t: int(begin + rate * t / 1e9) & 0xFFFF
    unit.holdings.words[at - 1] = unit.holdings.words[at + 2] = constant(7)
    bench.master.polls = [poll for poll in bench.master.polls if poll.unit != unit.unit]
    bench.master.polls.append(FieldPoll(unit.unit, read_pdu(3, at - 1, 4)))
    return bench, Expected("counter-jumps", (unit.unit,))


@field_case("bias-beside-dead", LOCAL)
def bias_beside_dead(random: Random, tap: str) -> Site:
    """Nothing holds the idle line, and one unit is without supply."""
    bench = site(random, tap, units=(4, 9), seconds=(60, 300))
    unit = bench.unit()
    unit.silent = lambda _: True
    bench.master.manners.retries = random.choice((0, 1, 1))
    let_float(random, bench)
    return bench, Expected("bias", (), (), Expected("dead-unit", (unit.unit,)))


@field_case("line-held", ANY_TAP)
def line_held(random: Random, tap: str) -> Site:
    """Some transceiver pulls the line low for seconds at a time: nobody gets through."""
    bench = site(random, tap, units=(3, 8), seconds=(120, 400))
    bench.master.manners.cycle_ms = 0.0
    period, held = random.uniform(15, 40) * SECOND, random.uniform(0.8, 3) * SECOND
    begins = [bench.begin_ns + (k + 0.5) * period for k in range(int(bench.duration_ns / period))]
    bench.pulses([Pulse(t, t + held, "low") for t in begins])
    return bench, Expected("line-held", (), ("hours", "interference", "all-silent", "driver-held"))


def _as_text(data: bytes) -> bytes:
    return data.replace(b"\n", b"\r\n")


@field_case("same-damage-text", LOCAL)
def same_damage_text(random: Random, tap: str) -> Site:
    """A converter in text mode puts 0D before each 0A of a unit's answers."""
    bench = site(random, tap, units=(2, 7), seconds=(60, 300))
    unit = bench.unit()
    unit.seal = lambda number, pdu: _as_text(adu(number, pdu))
    at = random.randrange(100)
    unit.holdings.words[at] = lambda _: 10 if random.random() < 0.3 else 300
    bench.master.polls.append(FieldPoll(unit.unit, read_pdu(3, at, 4)))
    return bench, Expected("same-damage", (unit.unit,))


@field_case("same-damage-bit", LOCAL)
def same_damage_bit(random: Random, tap: str) -> Site:
    """A unit's memory has a bad cell: byte so-and-so of its longer answers is always wrong."""
    bench = site(random, tap, units=(2, 7), seconds=(60, 300))
    unit, at = bench.unit(), random.randrange(4, 12)

    def seal(number: int, pdu: bytes) -> bytes:
        data = bytearray(adu(number, pdu))
        if len(data) > at + 2:
            data[at] ^= 0x10
        return bytes(data)

    unit.seal = seal
    bench.master.polls.append(FieldPoll(unit.unit, read_pdu(3, 700, 12)))
    unit.holdings.words[700] = constant(5)
    return bench, Expected("same-damage", (unit.unit,))


@field_case("client-driver-held", BYTES)
def client_driver_held(random: Random, tap: str) -> Site:
    """The client holds its driver into the answers of units that are quick; those of slow ones are well."""
    bench = site(random, tap, units=(4, 8), seconds=(60, 300), bauds=(9600, 19200, 38400))
    quick = random.sample(sorted(bench.units), random.randint(2, len(bench.units) - 2))
    least = (bench.uart.silence_ns + 0.3 * MS) / MS
    for number, unit in bench.units.items():
        unit.delay_ms = random.uniform(1.0, 1.5) * least if number in quick else random.uniform(4, 8) * least
        unit.jitter = 0.03
    held = 1.5 * least * MS + random.uniform(0.8, 3.0) * bench.uart.char_ns

    def shape(burst: Burst, _: Random) -> None:
        burst.off, burst.plain = burst.last + held, False

    bench.master.shapes.append(shape)
    bench.master.strength = 2.0
    bench.wire.contention = "strong"
    return bench, Expected("client-driver-held", tuple(quick))
