"""Faults that no cause is a word for, of devices, converters and clients that do what nobody expects of them."""

from __future__ import annotations

from random import Random

from nameless_kinds import deaf, nameless_kind, sealed

from analyzer.simulation.conversation import adu
from analyzer.simulation.field.bench import SECOND, Bench, read_pdu
from analyzer.simulation.field.cases.registry import LOCAL, FieldCase
from analyzer.simulation.field.master import FieldMaster, FieldPoll
from analyzer.simulation.field.units import MS, FieldUnit, WireEnvelope, burst_of
from analyzer.simulation.field.wire import ReceivedOctet
from dissectors.crc import crc_bytes, crc_ok

STRANGE: dict[str, FieldCase] = {}
strange = nameless_kind(STRANGE)


@strange("reports-unasked")
def reports_unasked(random: Random, bench: Bench) -> None:
    """A unit reports its alarms by itself, in frames that look like answers, when the line is at rest."""
    unit, rate = bench.unit(), random.uniform(0.1, 0.6)
    pdu = bytes((3, 4)) + random.randbytes(4)

    def speak(now: float) -> None:
        burst = burst_of(unit, unit.sends, adu(unit.unit, pdu), now)
        burst.strength = unit.strength
        bench.wire.send(burst)
        bench.schedule.at(now + random.expovariate(rate) * SECOND, speak)

    bench.schedule.at(random.expovariate(rate) * SECOND, speak)


@strange("client-leads-byte")
def client_leads_byte(random: Random, bench: Bench) -> tuple[str, ...]:
    """The client's driver makes a byte when it switches on, ahead of some of its requests."""
    share, byte = random.choice((1.0, 0.5, 0.2)), bytes((random.choice((0x00, 0xFF, 0xFE)),))
    bench.master.envelope = WireEnvelope(
        lambda data: byte + data if random.random() < share else data, lambda data: data
    )
    for unit in bench.units.values():
        unit.lenient = True
    return ("bias", "interference")


@strange("client-trails-bytes")
def client_trails_bytes(random: Random, bench: Bench) -> None:
    """The client's program sends some bytes too many behind its requests, which its units do not mind."""
    share, more = random.choice((1.0, 0.5, 0.2)), random.randbytes(random.randint(1, 4))
    bench.master.envelope = WireEnvelope(
        lambda data: data + more if random.random() < share else data, lambda data: data
    )
    for unit in bench.units.values():
        _minds_nothing_behind(unit)


def _minds_nothing_behind(unit: FieldUnit) -> None:
    """It looks for its request at the beginning of what it hears, whatever follows."""
    usual = unit._request

    def request() -> bytes | None:
        heard = unit._heard
        for size in (8, len(heard)):
            data = bytes(octet.value for octet in heard[:size])
            if data[:1] == bytes((unit.unit,)) and len(data) >= 8 and crc_ok(data):
                return data
        return usual()

    unit._request = request  # type: ignore[method-assign]


@strange("byte-replaced", LOCAL)
def byte_replaced(random: Random, bench: Bench) -> tuple[str, ...]:
    """A converter before some units takes one byte value for another, in what they answer."""
    one = random.choice((0x00, 0x01, 0x02, 0x04, 0x0D, 0x1A, 0xFF))
    other = random.choice([byte for byte in (0x00, 0x0A, 0x20, 0x7F, 0xFE) if byte != one])
    for unit in _some(random, bench):
        unit.seal = lambda number, pdu: (
            adu(number, pdu)[:3] + adu(number, pdu)[3:].replace(bytes((one,)), bytes((other,)))
        )
    return ("same-damage",)


@strange("byte-swallowed", LOCAL)
def byte_swallowed(random: Random, bench: Bench) -> tuple[str, ...]:
    """A converter before some units swallows one byte value, in what they answer."""
    one = random.choice((0x00, 0x01, 0x02, 0x03, 0x0D, 0x1A, 0xFF))
    for unit in _some(random, bench):
        unit.seal = lambda number, pdu: adu(number, pdu)[:3] + adu(number, pdu)[3:].replace(bytes((one,)), b"")
    return ("same-damage",)


def _some(random: Random, bench: Bench) -> list[FieldUnit]:
    every = list(bench.units.values())
    return random.sample(every, random.choice((1, 1, max(1, len(every) // 2))))


@strange("repeater-sleeps")
def repeater_sleeps(random: Random, bench: Bench) -> tuple[str, ...]:
    """A repeater sleeps when the line rests, and what wakes it does not reach the units behind it."""
    manners = bench.master.manners
    manners.retries, manners.cycle_ms = random.choice((1, 2)), random.uniform(2, 5) * manners.timeout_ms
    last, rest = [0.0], random.uniform(1.2, 1.8) * manners.timeout_ms * MS
    units = random.sample(sorted(bench.units), max(1, len(bench.units) // 2))

    def asleep(_request: bytes, t: float) -> bool:
        slept, last[0] = t - last[0] > rest, t
        return slept

    for number, unit in bench.units.items():
        if number in units:
            deaf(unit, asleep)
        else:
            unit.tampers.append(lambda _r, answer, t: last.__setitem__(0, t) or answer)
    return ("rest-too-short", "all-silent")


@strange("echoes-last-byte", LOCAL)
def echoes_last_byte(random: Random, bench: Bench) -> tuple[str, ...]:
    """The client's converter gives it the last byte of its own request back, ahead of each answer."""
    share, last = random.choice((1.0, 0.4)), [b""]
    bench.master.envelope = WireEnvelope(
        lambda data: last.__setitem__(0, data[-1:]) or data, lambda data: data if crc_ok(data) else data[1:]
    )
    for unit in bench.units.values():
        sealed(unit, random, share, lambda data: last[0] + data)
    return ("client-driver-held",)


@strange("spoilt-behind-unit", LOCAL)
def spoilt_behind_unit(random: Random, bench: Bench) -> None:
    """Answers that come right behind those of one unit are spoilt: its driver lets go of the line slowly."""
    numbers = sorted(bench.units)
    culprit, share, before = random.choice(numbers), random.uniform(0.4, 0.9), [0, 0]

    def spoil(number: int, pdu: bytes) -> bytes:
        before[:] = [before[1], number]
        data = adu(number, pdu)
        if before[0] != culprit or number == culprit or random.random() > share:
            return data
        at = random.randrange(len(data))
        return data[:at] + bytes((data[at] ^ 1 << random.randrange(8),)) + data[at + 1 :]

    for unit in bench.units.values():
        unit.seal = spoil


@strange("bit-stuck")
def bit_stuck(random: Random, bench: Bench) -> tuple[str, ...]:
    """One bit of a unit's buffer is stuck at times, at one place of its answers, behind the check value's back."""
    unit, place, bit, share = bench.unit(), random.randint(3, 8), 1 << random.randrange(8), random.uniform(0.3, 0.9)

    def stuck(data: bytes) -> bytes:
        at = min(place, len(data) - 3)
        return data[:at] + bytes((data[at] | bit,)) + data[at + 1 :]

    sealed(unit, random, share, stuck)
    return ("same-damage",)


@strange("neighbours-values")
def neighbours_values(random: Random, bench: Bench) -> tuple[str, ...]:
    """A unit gives now and then the registers one further on than was asked."""
    unit, share = bench.unit(), random.uniform(0.05, 0.3)

    def shifted(request: bytes, answer: bytes, _t: float) -> bytes:
        if request[0] not in (3, 4) or random.random() > share or len(answer) < 6:
            return answer
        return answer[:2] + answer[4:] + answer[2:4]

    unit.tampers.append(shifted)
    return ("counter-jumps", "values-under-wrong-registers", "word-order")


@strange("slow-spells")
def slow_spells(random: Random, bench: Bench) -> tuple[str, ...]:
    """A gateway passes all answers on late, for a while, again and again: some beyond the client's patience."""
    period = random.uniform(15, 40) * SECOND
    most = bench.master.manners.timeout_ms * MS
    for unit in bench.units.values():
        unit.delay = lambda _pdu, t, unit=unit: (  # type: ignore[misc]
            unit._usual_delay() + (random.uniform(0.7, 1.3) * most if t % period < 0.2 * period else 0)
        )
    return ("timeout-too-short", "all-silent", "hours", "two-masters")


@strange("impatient-by-chance")
def impatient_by_chance(random: Random, bench: Bench) -> tuple[str, ...]:
    """The client gives up far too soon now and then, whomever it asks."""
    share, usual = random.uniform(0.05, 0.3), bench.master.manners.timeout_ms
    soon = 0.6 * min(unit.delay_ms for unit in bench.units.values()) + 2 * bench.uart.char_ns / MS

    def put(data: bytes) -> bytes:
        bench.master.manners.timeout_ms = soon if random.random() < share else usual
        return data

    bench.master.envelope = WireEnvelope(put, lambda data: data)
    return ("timeout-too-short",)


@strange("tap-drops-frames")
def tap_drops_frames(random: Random, bench: Bench) -> tuple[str, ...]:
    """The recorder drops whole frames, requests and answers, by chance; the bus is well."""
    share, rest = random.uniform(0.03, 0.25), 3 * bench.uart.char_ns

    def dropped(octets: list[ReceivedOctet]) -> list[ReceivedOctet]:
        kept, last, drops = list[ReceivedOctet](), 0.0, False
        for octet in octets:
            if octet.t_ns - last > rest:
                drops = random.random() < share
            last = octet.t_ns
            kept += [] if drops else [octet]
        return kept

    bench.tapped = dropped
    return ("tap-loses", "tap-one-direction")


@strange("asks-anybody")
def asks_anybody(random: Random, bench: Bench) -> tuple[str, ...]:
    """The client's list is overwritten now and then: it asks a unit that is not there, each time another one."""
    share = random.uniform(0.03, 0.2)
    spare = [number for number in range(1, 120) if number not in bench.units]

    def put(data: bytes) -> bytes:
        if random.random() > share:
            return data
        body = bytes((random.choice(spare),)) + data[1:-2]
        return body + crc_bytes(body)

    bench.master.envelope = WireEnvelope(put, lambda data: data)
    return ("absent-units", "dead-unit")


@strange("request-spoilt-by-place")
def request_spoilt_by_place(random: Random, bench: Bench) -> tuple[str, ...]:
    """The client makes the CRC of the requests to one unit wrongly, most times."""
    unit, share = bench.unit(), random.uniform(0.4, 0.95)
    bench.master.envelope = WireEnvelope(
        lambda data: (
            data[:-1] + bytes((data[-1] ^ 0x40,)) if data[0] == unit.unit and random.random() < share else data
        ),
        lambda data: data,
    )
    return ("request-flaw", "interference")


@strange("hangs-till-others")
def hangs_till_others(random: Random, bench: Bench) -> None:
    """A unit that has answered twice in a row hangs until somebody else has spoken."""
    unit, spoke = bench.unit(), [0]
    bench.master.polls += [FieldPoll(unit.unit, read_pdu(3, 400 + 10 * n, 2)) for n in range(random.randint(2, 4))]
    most = random.choice((1, 2))

    def hangs(_request: bytes, answer: bytes, _t: float) -> bytes | None:
        spoke[0] += 1
        return answer if spoke[0] <= most else None

    unit.tampers.append(hangs)
    for other in bench.units.values():
        if other is not unit:
            other.tampers.append(lambda _r, answer, _t: spoke.__setitem__(0, 0) or answer)


@strange("two-answers-at-once")
def two_answers_at_once(random: Random, bench: Bench) -> None:
    """A unit keeps an answer back now and then, and sends it ahead of its next one."""
    unit, share, kept = bench.unit(), random.uniform(0.05, 0.3), [b""]

    def seal(number: int, pdu: bytes) -> bytes:
        data, kept[0] = kept[0] + adu(number, pdu), b""
        return data

    def keeps(_request: bytes, answer: bytes, _t: float) -> bytes | None:
        if random.random() > share:
            return answer
        kept[0] = adu(unit.unit, answer)
        return None

    unit.seal = seal
    unit.tampers.append(keeps)


@strange("second-client-listens-in")
def second_client_listens_in(random: Random, bench: Bench) -> tuple[str, ...]:
    """A second client waits its turn, but a few times an hour it sends its request over whatever is on the line."""
    number, rate = random.choice(sorted(bench.units)), random.uniform(0.02, 0.1)
    data = adu(number, read_pdu(3, 700, 2)(0))

    def speak(now: float) -> None:
        burst = burst_of(bench.master, bench.uart, data, now)
        burst.strength = 1.0
        bench.wire.send(burst)
        bench.schedule.at(now + random.expovariate(rate) * SECOND, speak)

    bench.schedule.at(random.expovariate(rate) * SECOND, speak)
    return ("two-masters", "interference")


@strange("client-stalls")
def client_stalls(random: Random, bench: Bench) -> None:
    """The client's computer stands still now and then, and takes no answer that comes meanwhile."""
    rate, until = random.uniform(0.02, 0.1), [0.0]
    master: FieldMaster = bench.master
    master.manners.retries = random.choice((0, 1, 2))

    def stall(now: float) -> None:
        until[0] = now + random.uniform(0.5, 3) * SECOND
        bench.schedule.at(until[0] + random.expovariate(rate) * SECOND, stall)

    bench.schedule.at(random.expovariate(rate) * SECOND, stall)
    master.envelope = WireEnvelope(lambda data: data, lambda data: b"" if bench.schedule.now < until[0] else data)


@strange("answers-get-longer", LOCAL)
def answers_get_longer(random: Random, bench: Bench) -> tuple[str, ...]:
    """A unit's buffer is not emptied: behind some answers stands the rest of a longer one before."""
    unit, share, before = bench.unit(), random.uniform(0.1, 0.6), [b""]
    bench.master.polls += [FieldPoll(unit.unit, read_pdu(3, 520, n)) for n in (2, 9)]

    def longer(data: bytes) -> bytes:
        old, before[0] = before[0], data
        return data + old[len(data) :]

    sealed(unit, random, share, longer)
    return ("null-suffix",)
