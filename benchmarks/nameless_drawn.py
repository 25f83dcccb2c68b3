"""Faults that no cause is a word for, put together: what happens to an exchange, and when. To whom is drawn.

A kind is a pair of a row of each table; the rows name the causes that are true of it besides.
"""

from __future__ import annotations

from collections.abc import Callable
from random import Random
from typing import NamedTuple
from zlib import crc32

from nameless_kinds import deaf, nameless_case, refusing

from analyzer.simulation.field.bench import Bench
from analyzer.simulation.field.cases.registry import ANY_TAP, LOCAL, FieldCase
from analyzer.simulation.field.units import FieldUnit, WireEnvelope
from analyzer.simulation.field.wire import ReceivedOctet
from dissectors.crc import crc_bytes

When = Callable[[bytes, float], bool]  # of a request's PDU and a time
Harm = Callable[[Random, Bench, list[FieldUnit], When], None]
Spoil = Callable[[Random, bytes], bytes]


class Circumstance(NamedTuple):
    """When it happens: how that is drawn, and the causes that are true then of each symptom."""

    draw: Callable[[Random, Bench], When]
    silence: tuple[str, ...] = ()
    refusal: tuple[str, ...] = ("unit-busy", "unit-fails")
    damage: tuple[str, ...] = ()


class Happening(NamedTuple):
    """What happens: how it is done to units, of which symptom a circumstance's causes are true, and what is always."""

    harm: Harm
    symptom: str = "damage"
    always: tuple[str, ...] = ("same-damage",)
    taps: tuple[str, ...] = LOCAL


def _by_chance(random: Random, _bench: Bench) -> When:
    share, own = random.uniform(0.05, 0.5), Random(random.random())
    return lambda _r, _t: own.random() < share


def _in_spells(random: Random, bench: Bench) -> When:
    long = random.uniform(0.02, 0.1) * bench.duration_ns
    share, offset = random.uniform(0.1, 0.5), random.random() * long
    return lambda _r, t: (t + offset) % long < share * long


def _since(random: Random, bench: Bench) -> When:
    """From some moment on, and not always then."""
    begin, share, own = bench.clock(), random.uniform(0.3, 0.9), Random(random.random())
    return lambda _r, t: t > begin and own.random() < share


def _by_request(random: Random, _bench: Bench) -> When:
    """Of some requests, the first one among them, and not always."""
    salt, share, own = random.randbytes(2), random.uniform(0.5, 0.95), Random(random.random())
    first: list[bytes] = []

    def some(request: bytes, _t: float) -> bool:
        if not first:
            first.append(request)
        return (request == first[0] or crc32(salt + request) % 5 < 2) and own.random() < share

    return some


def _every_nth(random: Random, _bench: Bench) -> When:
    n, count = random.randint(2, 6), [0]

    def nth(_request: bytes, _t: float) -> bool:
        count[0] += 1
        return count[0] % n == 0

    return nth


def _after_rest(random: Random, bench: Bench) -> When:
    """Behind a longer rest than usual."""
    last, usual, own = [0.0], [0.0], random.uniform(1.1, 1.6)
    bench.master.manners.pause_ms = lambda _: random.uniform(2, 60)

    def rested(_request: bytes, t: float) -> bool:
        gap, last[0] = t - last[0], t
        usual[0] += 0.05 * (gap - usual[0])
        return gap > own * usual[0]

    return rested


def _rarer(random: Random, bench: Bench) -> When:
    """Less and less often."""
    begin, long, own = random.uniform(0.5, 1), bench.duration_ns, Random(random.random())
    return lambda _r, t: own.random() < begin * max(1 - t / long, 0) ** 2


WHEN = {
    "chance": Circumstance(_by_chance),
    "spells": Circumstance(_in_spells, silence=("unit-restarts", "hours"), damage=("hours",)),
    "since": Circumstance(_since, silence=("unit-restarts",), damage=("hours",)),
    "request": Circumstance(
        _by_request,
        silence=("cannot-serve",),
        refusal=("cannot-serve", "missing-registers", "unit-busy", "unit-fails"),
    ),
    "nth": Circumstance(_every_nth),
    "rest": Circumstance(_after_rest, silence=("rest-too-short",)),
    "rarer": Circumstance(_rarer, silence=("unit-restarts", "hours"), damage=("hours",)),
}


def _silent(_random: Random, _bench: Bench, units: list[FieldUnit], when: When) -> None:
    for unit in units:
        deaf(unit, when)


def _refused(random: Random, _bench: Bench, units: list[FieldUnit], when: When) -> None:
    code = random.choice((1, 2, 3, 4, 6, 7, 10))
    for unit in units:
        refusing(unit, code, when)


def _bytes(spoil: Spoil) -> Harm:
    """Answers' bytes, check value and all, as they go on the line."""

    def harm(random: Random, _bench: Bench, units: list[FieldUnit], when: When) -> None:
        for unit in units:
            _spoil(unit, random, when, spoil)

    return harm


def _spoil(unit: FieldUnit, random: Random, when: When, spoil: Spoil) -> None:
    seal, newest = unit.seal, [(b"", 0.0)]

    def note(request: bytes, answer: bytes, t: float) -> bytes:
        newest[0] = request, t
        return answer

    unit.tampers.append(note)
    unit.seal = lambda number, pdu: spoil(random, seal(number, pdu)) if when(*newest[0]) else seal(number, pdu)


def _left_out(random: Random, data: bytes) -> bytes:
    at = random.randrange(1, len(data) - 1)
    return data[:at] + data[at + random.randint(1, 3) :]


def _put_in(random: Random, data: bytes) -> bytes:
    at = random.randrange(1, len(data) - 1)
    return data[:at] + random.randbytes(random.randint(1, 3)) + data[at:]


def _exchanged(random: Random, data: bytes) -> bytes:
    at = random.randrange(1, len(data) - 2)
    other = data[at + 1 : at + 2] + data[at : at + 1]
    return data[:at] + (other if other[0] != other[1] else bytes((other[0] ^ 1, other[1]))) + data[at + 2 :]


def _of_before(random: Random, data: bytes) -> bytes:
    """Values of another moment behind a check value of this one: a value of two bytes counts on."""
    at = random.randrange(3, max(len(data) - 3, 4))
    value = (int.from_bytes(data[at : at + 2]) + random.randint(1, 30)) & 0xFFFF
    return data[:at] + value.to_bytes(2) + data[at + 2 :]


def _other_bytes(random: Random, data: bytes) -> bytes:
    """Some bytes in the middle are anything."""
    at = random.randrange(2, max(len(data) - 4, 3))
    return data[:at] + random.randbytes(min(random.randint(1, 8), len(data) - at)) + data[at + 8 :]


def _with_tail(random: Random, data: bytes) -> bytes:
    return data + random.randbytes(random.randint(1, 6))


def _cut(random: Random, data: bytes) -> bytes:
    return data[: random.randrange(2, len(data))]


def _headers(random: Random, data: bytes) -> bytes:
    """Its function or byte count is another, and the check value right."""
    at = random.choice((1, 2))
    body = data[:at] + bytes(((data[at] + random.choice((1, 2, 4, 16))) & 0x7F,)) + data[at + 1 : -2]
    return body + crc_bytes(body)


def _twice(_random: Random, data: bytes) -> bytes:
    return data + data


def _tap(spoil: Callable[[Random, list[ReceivedOctet]], list[ReceivedOctet]]) -> Harm:
    """Only the tap hears it; its pieces are some bytes long."""

    def harm(random: Random, bench: Bench, _units: list[FieldUnit], when: When) -> None:
        piece = random.randint(20, 60)

        def tapped(octets: list[ReceivedOctet]) -> list[ReceivedOctet]:
            found: list[ReceivedOctet] = []
            for i in range(0, len(octets), piece):
                part = octets[i : i + piece]
                found += spoil(random, part) if when(bytes(each.value for each in part[:4]), part[0].t_ns) else part
            return found

        bench.tapped = tapped

    return harm


def _client(random: Random, bench: Bench, _units: list[FieldUnit], when: When) -> None:
    """The client spoils its own requests."""
    spoil = random.choice((_left_out, _put_in, _exchanged, _cut, _with_tail))
    schedule = bench.schedule
    bench.master.envelope = WireEnvelope(
        lambda data: spoil(random, data) if when(data, schedule.now) else data, lambda data: data
    )


def _client_deaf(random: Random, bench: Bench, units: list[FieldUnit], when: When) -> None:
    """The client does not take answers, of some units, that are right on the line."""
    numbers, schedule = {unit.unit for unit in units}, bench.schedule
    state: dict[int, bool] = {}

    def take(data: bytes) -> bytes:
        if not data or data[0] not in numbers:
            return data
        turn = len(bench.master.requests)
        if turn not in state:
            state[turn] = when(data[:1], schedule.now)
        return b"" if state[turn] else data

    bench.master.manners.retries = random.choice((0, 1, 2))
    bench.master.envelope = WireEnvelope(lambda data: data, take)


def _tap_out(random: Random, part: list[ReceivedOctet]) -> list[ReceivedOctet]:
    at = random.randrange(len(part))
    return [*part[:at], part[at]._replace(value=random.randrange(256)), *part[at + 1 :]]


def _tap_swap(_random: Random, part: list[ReceivedOctet]) -> list[ReceivedOctet]:
    half = len(part) // 2
    times = [each.t_ns for each in part]
    mixed = part[half:] + part[:half]
    return [each._replace(t_ns=t) for each, t in zip(mixed, times, strict=True)]


WHAT = {
    "silent": Happening(_silent, "silence", (), ANY_TAP),
    "refused": Happening(_refused, "refusal", (), ANY_TAP),
    "left-out": Happening(_bytes(_left_out)),
    "put-in": Happening(_bytes(_put_in)),
    "exchanged": Happening(_bytes(_exchanged)),
    "of-before": Happening(_bytes(_of_before)),
    "other-bytes": Happening(_bytes(_other_bytes)),
    "with-tail": Happening(_bytes(_with_tail)),
    "cut": Happening(_bytes(_cut)),
    "headers": Happening(_bytes(_headers), always=("same-damage", "byte-count")),
    "twice": Happening(_bytes(_twice), always=()),
    "tap-other": Happening(_tap(_tap_out), always=("tap-loses",)),
    "tap-swap": Happening(_tap(_tap_swap), always=("tap-loses",)),
    "client-spoils": Happening(_client, "silence", ("request-flaw", "interference", "all-silent", "absent-units")),
    "client-deaf": Happening(_client_deaf, "none", (), ANY_TAP),
}
_OF_ALL = ("interference", "all-silent")  # what befalls all of them alike may be the line's doing


def _kind(name: str, happening: Happening, circumstance: Circumstance) -> FieldCase:
    def harm(random: Random, bench: Bench) -> tuple[str, ...]:
        every = list(bench.units.values())
        several = random.random() < 0.3
        units = random.sample(every, max(2, len(every) // 2)) if several else [bench.unit()]
        happening.harm(random, bench, units, circumstance.draw(random, bench))
        then = getattr(circumstance, happening.symptom, ())
        return (*then, *happening.always, *(_OF_ALL if several else ()))

    harm.__doc__ = f"What happens and when: {name}."
    return nameless_case(name, harm, happening.taps)


DRAWN = {
    name: _kind(name, happening, circumstance)
    for what, happening in WHAT.items()
    for when, circumstance in WHEN.items()
    for name in (f"drawn-{what}-{when}",)
}
