"""Kinds of buses of this hand: faults that have a word, some that have none, and buses that are well.

A kind is a function of a site that does something to it and gives the units at fault; beside it stand the causes that
name it (none: it has no word), and those that may be said as well.
"""

from __future__ import annotations

import math
from bisect import bisect
from collections.abc import Callable, Iterable, Iterator
from itertools import cycle
from random import Random
from struct import pack, unpack
from typing import NamedTuple

from captures.chunks import Chunk
from captures.line import LineSettings
from dissectors.crc import crc_ok

from .line import MS, SECOND, OtherBurst, OtherBus, OtherClient, OtherDevice, OtherPoll, adu, patience

_PLACES = (0, 1, 16, 100, 256, 1000, 4096)
_ENOUGH = 12  # lost requests, for a kind that shows in them


class OtherSite(NamedTuple):
    """A line, its client, its units, and the draw."""

    random: Random
    line: OtherBus
    client: OtherClient
    units: list[OtherDevice]

    def one(self) -> OtherDevice:
        """Some unit."""
        return self.random.choice(self.units)

    def some(self, least: int) -> list[OtherDevice]:
        """Some units."""
        return self.random.sample(self.units, self.random.randint(least, max(least, len(self.units) // 2)))


Harm = Callable[[OtherSite], Iterable[OtherDevice]]


class OtherKind(NamedTuple):
    """What is done to a site of so many units, the causes that name it and those that may be said, and whether all is
    well; `shown`: whether it shows in requests that the client loses."""

    harm: Harm
    units: tuple[int, int]
    causes: tuple[str, ...]
    also: tuple[str, ...]
    healthy: bool
    shown: bool


class OtherLine(NamedTuple):
    """One capture with what is so."""

    name: str
    seed: int
    kind: OtherKind
    at_fault: tuple[int, ...]
    line: LineSettings
    chunks: list[Chunk]


OTHER_KINDS: dict[str, OtherKind] = {}


def other_kind(
    name: str,
    *causes: str,
    units: tuple[int, int] = (2, 8),
    also: tuple[str, ...] = (),
    healthy: bool = False,
    shown: bool = True,
) -> Callable[[Harm], Harm]:
    """Registers a kind."""

    def enter(harm: Harm) -> Harm:
        OTHER_KINDS[name] = OtherKind(harm, units, causes, also, healthy, shown and not healthy)
        return harm

    return enter


def read(function: int, address: int, quantity: int) -> bytes:
    """The PDU of a read."""
    return pack(">BHH", function, address, quantity)


def _drawn_site(random: Random, units: tuple[int, int]) -> OtherSite:
    count = random.randint(*units)
    numbers = random.sample(range(1, 60), count) if random.random() < 0.5 else list(range(1, count + 1))
    devices = [
        OtherDevice(number, random, math.exp(random.uniform(0.4, 4.1)) * MS, random.choice((0.05, 0.2, 0.5)))
        for number in numbers
    ]
    if random.random() < 0.5:  # of one make
        for device in devices:
            device.delay_ns, device.jitter = devices[0].delay_ns * random.uniform(0.9, 1.1), devices[0].jitter
    for device in devices:
        device.per_byte_ns = random.uniform(0, 0.3) * MS
    baud = random.choice((2400, 4800, 9600, 9600, 9600, 19200, 19200, 38400, 57600, 115200))
    line = OtherBus(random, devices, baud, random.randint(300, 1200))
    layout = [
        (random.choice((3, 3, 3, 4, 1, 2)), random.choice(_PLACES), random.choice((1, 2, 4, 8, 16, 32, 60)))
        for _ in range(random.choice((1, 1, 2, 3, 4)))
    ]  # fmt: skip
    polls = [OtherPoll(number, read(*each), random.choice((0.5, 1, 1, 2, 5))) for number in numbers for each in layout]
    if random.random() < 0.25:
        polls.append(OtherPoll(random.choice(numbers), _writes(random, 900), random.choice((2, 10, 30))))
    if random.random() < 0.12:
        polls.append(OtherPoll(0, _writes(random, 5), random.choice((5, 20))))
    gap = max(math.exp(random.uniform(0.7, 4.8)) * MS, 1.25 * line.rest_ns)
    client = OtherClient(
        polls, random.random() < 0.33, gap, random.choice((0.0, 0.1, 0.4)),
        random.choice((0.0, 0.0, random.uniform(0.2, 3))) * SECOND,
        max(random.choice((200, 300, 500, 1000, 1500, 2000)) * MS, patience(line, devices)),
        random.choice((0, 0, 1, 2, 3)), random.random() < 0.7, random.random() < 0.33,
        random.choice((0, 0, 0, 1, 4, 15)),
    )  # fmt: skip
    whole = len(polls) * (60 * line.char_ns + 30 * MS) / SECOND
    for poll in polls:
        poll.period_s = max(poll.period_s, 1.3 * whole)
    line.askers.append(client)
    return OtherSite(random, line, client, devices)


def _writes(random: Random, address: int) -> Callable[[float], bytes]:
    return lambda _: pack(">BHH", 6, address, random.randrange(500))


def made(name: str, seed: int) -> OtherLine:
    """One capture of a kind; a fault that hardly shows is drawn anew."""
    kind = OTHER_KINDS[name]
    for draw in range(20):
        random = Random(f"{name} {seed} {draw}")
        site = _drawn_site(random, kind.units)
        at_fault = tuple(unit.number for unit in kind.harm(site))
        site.line.run()
        lost = sum(asker.lost for asker in site.line.askers)
        if site.line.made >= 100 and (lost >= _ENOUGH or not kind.shown):
            break
    tap = random.choices(("precise", "irq", "ftdi16", "gateway"), (4, 3, 3, 1))[0]
    return OtherLine(name, seed, kind, at_fault, site.line.settings(tap), list(site.line.chunks(tap)))


def every(seeds: Iterable[int]) -> Iterator[OtherLine]:
    """All kinds of all these seeds."""
    for seed in seeds:
        yield from (made(name, seed) for name in OTHER_KINDS)


def _flipped(random: Random, data: bytes) -> bytes:
    at = random.randrange(len(data))
    return data[:at] + bytes((data[at] ^ 1 << random.randrange(8),)) + data[at + 1 :]


def _hurt(random: Random, data: bytes) -> bytes:
    """Some bits turned over, a byte lost or too many, or some bytes that are anything."""
    way, at, few = random.random(), random.randrange(len(data)), random.randint(1, 4)
    if way < 0.6:
        for _ in range(random.choice((1, 1, 2, 3))):
            data = _flipped(random, data)
        return data
    if way < 0.75:
        return data[:at] + data[at + 1 :]
    if way < 0.9:
        return data[:at] + random.randbytes(1) + data[at:]
    return (data[:at] + random.randbytes(few) + data[at + few :])[: len(data)]


def _sometimes(random: Random, share: float, harm: Callable[[bytes], bytes]) -> Callable[[bytes], bytes]:
    return lambda data: harm(data) if random.random() < share else data


def _noise(site: OtherSite, a_byte: float, when: Callable[[float], bool] = lambda _: True) -> None:
    random = site.random

    def spoil(spell: OtherBurst) -> bytes:
        hit = when(spell.begin) and random.random() < 1 - (1 - a_byte) ** len(spell.data)
        return _hurt(random, spell.heard) if hit else spell.heard

    site.line.spoils.append(spoil)


def _strays(site: OtherSite, rate: float, when: Callable[[float], bool] = lambda _: True) -> None:
    """Bytes on the idle line, so many times a second."""
    random, line = site.random, site.line

    def finish() -> None:
        busy = [(spell.begin - line.char_ns, spell.end + line.char_ns) for spell in line.spells]
        begins, t = [begin for begin, _ in busy], 0.0
        while (t := t + random.expovariate(rate) * SECOND) < busy[-1][1]:
            at = bisect(begins, t) - 1
            if (at < 0 or t > busy[at][1]) and when(t):
                few = range(random.choice((1, 1, 1, 2, 3)))
                kinds = (0, 0xFF, 0xFE, 0xF8, random.randrange(256))
                line.strays += [(t + i * line.char_ns, random.choice(kinds)) for i in few]

    line.finish.append(finish)


def _refuse(unit: OtherDevice, code: int, when: Callable[[bytes, float], bool]) -> None:
    unit.tampers.append(lambda pdu, answer, t: bytes((pdu[0] | 0x80, code)) if when(pdu, t) else answer)


@other_kind("dead", "dead-unit", "absent-units", "retry-policy", units=(2, 10))
def _dead(site: OtherSite) -> Iterable[OtherDevice]:
    unit = site.one()
    unit.deaf.append(lambda _, __: True)
    return [unit]


@other_kind("died", "dead-unit", "unit-restarts")
def _died(site: OtherSite) -> Iterable[OtherDevice]:
    unit, since = site.one(), site.random.uniform(0.3, 0.8)
    unit.deaf.append(lambda _, __: site.line.share > since)
    return [unit]


@other_kind("absent", "absent-units", "dead-unit", units=(4, 10))
def _absent(site: OtherSite) -> Iterable[OtherDevice]:
    units = site.random.sample(site.units, site.random.randint(2, 3))
    for unit in units:
        unit.deaf.append(lambda _, __: True)
    return units


@other_kind("restarts", "unit-restarts")
def _restarts(site: OtherSite) -> Iterable[OtherDevice]:
    unit, away = site.one(), site.random.uniform(2, 9) * SECOND
    period, site.client.skips, site.line.requests = away * site.random.uniform(2.5, 7), 0, 1500
    unit.deaf.append(lambda _, t: (t + 0.3 * period * math.sin(t / period)) % period < away)
    return [unit]


def _impatient(site: OtherSite) -> float:
    site.client.timeout_ns = site.random.choice((60, 100, 150, 250)) * MS + 140 * site.line.char_ns
    for unit in site.units:
        unit.delay_ns, unit.jitter, unit.per_byte_ns = min(unit.delay_ns, site.client.timeout_ns / 4), 0.1, 0.0
    return site.client.timeout_ns


@other_kind("impatient", "timeout-too-short")
def _impatient_by_chance(site: OtherSite) -> Iterable[OtherDevice]:
    timeout, unit, share = _impatient(site), site.one(), site.random.choice((0.05, 0.15, 0.4, 0.8))
    most = site.random.uniform(1.1, 1.8)
    unit.delays.append(
        lambda _, delay: timeout * site.random.uniform(0.9, most) if site.random.random() < share else delay
    )
    return [unit]


@other_kind("impatient-by-size", "timeout-too-short", units=(2, 6))
def _impatient_by_size(site: OtherSite) -> Iterable[OtherDevice]:
    timeout, unit = _impatient(site), site.one()
    site.client.polls.append(OtherPoll(unit.number, read(3, 600, site.random.randint(50, 100)), 2))
    unit.delays.append(lambda pdu, delay: timeout * site.random.uniform(1.02, 1.25) if pdu[3:5] > b"\0\x30" else delay)
    return [unit]


@other_kind("two-clients", "two-masters", units=(2, 6))
def _two_clients(site: OtherSite) -> Iterable[OtherDevice]:
    random, first = site.random, site.client
    polls = [
        OtherPoll(unit.number, read(3, random.choice((0, 200, 700)), random.choice((2, 4, 10))), random.uniform(1, 3))
        for unit in site.some(1)
    ]
    other = OtherClient(polls, True, random.uniform(100, 600) * MS, 0.1, 0.0, first.timeout_ns, 0)
    other.listens, other.begin_ns = False, 0.37 * SECOND
    site.line.askers.append(other)
    return []


@other_kind("twins", "duplicate-address")
def _twins(site: OtherSite) -> Iterable[OtherDevice]:
    unit = site.one()
    delay = unit.delay_ns * site.random.uniform(0.8, 1.3)
    site.line.twins.append(OtherDevice(unit.number, Random(site.random.random()), delay, unit.jitter, unit.per_byte_ns))
    return [unit]


@other_kind("noise", "interference", units=(1, 10))
def _noisy(site: OtherSite) -> Iterable[OtherDevice]:
    _noise(site, site.random.choice((0.0004, 0.001, 0.003)))
    _strays(site, 0.3)
    return []


@other_kind("noise-in-spells", "hours", "interference", units=(1, 10))
def _noisy_in_spells(site: OtherSite) -> Iterable[OtherDevice]:
    period, site.line.requests = site.random.uniform(15, 40) * SECOND, 1200
    share = site.random.uniform(0.15, 0.35)
    _noise(site, site.random.choice((0.003, 0.01)), lambda t: t % period < share * period)
    _strays(site, 0.5, lambda t: t % period < share * period)
    return []


@other_kind("bad-drop", "bad-drop")
def _bad_drop(site: OtherSite) -> Iterable[OtherDevice]:
    unit, share = site.one(), site.random.choice((0.05, 0.12, 0.3, 0.5))
    unit.seals.append(_sometimes(site.random, share, lambda data: _hurt(site.random, data)))
    return [unit]


@other_kind("bad-drop-both-ways", "bad-drop")
def _bad_drop_both_ways(site: OtherSite) -> Iterable[OtherDevice]:
    (unit,), lost = _bad_drop(site), site.random.uniform(0.02, 0.3)
    unit.deaf.append(lambda _, __: site.random.random() < lost)
    return [unit]


@other_kind("floats", "bias", units=(1, 10), shown=False)
def _floats(site: OtherSite) -> Iterable[OtherDevice]:
    _strays(site, site.random.choice((1, 3, 6)))
    return []


@other_kind("driver-late", "driver-enabled-late")
def _driver_late(site: OtherSite) -> Iterable[OtherDevice]:
    random, unit, share, lost = (
        site.random,
        site.one(),
        site.random.choice((0.3, 0.7, 1)),
        site.random.choice((1, 1, 2)),
    )

    def beheaded(data: bytes) -> bytes:
        mangled = bytes((random.choice((0xFF, 0xFE, 0xFC, data[0] | 0xF0)),)) + data[1:]
        return data[lost:] if random.random() < 0.6 else mangled

    unit.seals.append(_sometimes(random, share, beheaded))
    return [unit]


@other_kind("driver-early", "driver-released-early")
def _driver_early(site: OtherSite) -> Iterable[OtherDevice]:
    random, unit, share = site.random, site.one(), site.random.choice((0.3, 0.7, 1))

    def let_go(data: bytes) -> bytes:
        last = bytes((data[-1] | random.choice((0x80, 0xC0, 0xF0)),))
        return data[:-1] + (b"" if random.random() < 0.5 else last)

    unit.seals.append(_sometimes(random, share, let_go))
    return [unit]


@other_kind("missing", "missing-registers", "cannot-serve", "off-by-one", units=(1, 6), shown=False)
def _missing(site: OtherSite) -> Iterable[OtherDevice]:
    unit = site.one()
    pdu = read(3, site.random.choice((500, 2000, 30000)), site.random.choice((1, 4, 10)))
    site.client.polls.append(OtherPoll(unit.number, pdu, 2))
    _refuse(unit, 2, lambda asked, _: asked == pdu)
    return [unit]


@other_kind("too-many", "cannot-serve", "missing-registers", units=(1, 6), shown=False)
def _too_many(site: OtherSite) -> Iterable[OtherDevice]:
    unit, silent = site.one(), site.random.random() < 0.5
    quantities = (site.random.choice((40, 60, 100)), 4, site.random.choice((8, 16)))
    site.client.polls += [OtherPoll(unit.number, read(3, 700 + 10 * i, n), 2) for i, n in enumerate(quantities)]

    def most(pdu: bytes, answer: bytes, _: float) -> bytes | None:
        over = pdu[0] in (3, 4) and unpack(">H", pdu[3:5])[0] > 32
        return answer if not over else None if silent else bytes((pdu[0] | 0x80, 3))

    unit.tampers.append(most)
    return [unit]


@other_kind("busy", "unit-busy", units=(1, 6), shown=False)
def _busy(site: OtherSite) -> Iterable[OtherDevice]:
    unit, period, share = site.one(), site.random.uniform(5, 20) * SECOND, site.random.uniform(0.1, 0.4)
    _refuse(unit, 6, lambda _, t: t % period < share * period)
    return [unit]


@other_kind("fails", "unit-fails", units=(1, 6), shown=False)
def _fails(site: OtherSite) -> Iterable[OtherDevice]:
    unit, since = site.one(), site.random.choice((0.0, 0.4))
    _refuse(unit, 4, lambda _, __: site.line.share >= since)
    return [unit]


@other_kind("echo", "local-echo", units=(1, 6), shown=False)
def _echo(site: OtherSite) -> Iterable[OtherDevice]:
    site.line.echoes = True
    for unit in site.units:
        unit.delay_ns = max(unit.delay_ns, 12 * site.line.char_ns + 2 * site.line.rest_ns)
    return []


@other_kind("segment", "all-silent", units=(4, 9))
def _segment(site: OtherSite) -> Iterable[OtherDevice]:
    units, period = site.random.sample(site.units, 3), site.random.uniform(15, 40) * SECOND
    away, site.client.skips, site.line.requests = site.random.uniform(4, 8) * SECOND, 0, 1300
    for unit in units:
        unit.deaf.append(lambda _, t: t % period < away)
    return units


@other_kind("rests", "rest-too-short", units=(2, 6))
def _rests(site: OtherSite) -> Iterable[OtherDevice]:
    unit, need = site.one(), site.random.uniform(20, 60) * MS
    site.client.gap_ns, site.client.gap_jitter, site.client.skips = max(need / 2, 1.25 * site.line.rest_ns), 0.6, 0
    site.client.polls += [OtherPoll(each.number, read(3, 333, 3)) for each in (unit, site.one())]

    def hurried(data: bytes, now: float) -> bool:
        begin = now - len(data) * site.line.char_ns
        before = max((each.end for each in site.line.spells if each.end <= begin), default=-SECOND)
        return begin - before < need

    unit.deaf.append(hurried)
    return [unit]


@other_kind("zeros", "null-suffix", units=(1, 6), shown=False)
def _zeros(site: OtherSite) -> Iterable[OtherDevice]:
    unit, tail = site.one(), bytes(site.random.randint(1, 3))
    unit.seals.append(lambda data: data + tail)
    site.client.ears.append(lambda data: data[: -len(tail)] if crc_ok(data[: -len(tail)]) else data)
    return [unit]


@other_kind("exchanged-check", "crc-convention", units=(2, 6))
def _exchanged_check(site: OtherSite) -> Iterable[OtherDevice]:
    unit = site.one()
    unit.seals.append(lambda data: data[:-2] + data[-1:] + data[-2:-1])
    return [unit]


@other_kind("reflections", "termination", units=(3, 9))
def _reflections(site: OtherSite) -> Iterable[OtherDevice]:
    random, units = site.random, site.units[-max(2, len(site.units) // 3) :]

    def bent(data: bytes) -> bytes:
        at = random.randrange(len(data))
        return data[:at] + bytes((data[at] ^ 1 << random.choice((0, 0, 0, 1)),)) + data[at + 1 :]

    for unit in units:
        unit.seals.append(_sometimes(random, random.uniform(0.08, 0.3), bent))
    return units


@other_kind("tap-loses", "tap-loses", units=(1, 10), shown=False)
def _tap_loses(site: OtherSite) -> Iterable[OtherDevice]:
    random, rate = site.random, site.random.choice((0.002, 0.004, 0.008))

    def lossy(octets: list[tuple[float, int]]) -> list[tuple[float, int]]:
        found, skip = list[tuple[float, int]](), 0
        for octet in octets:
            skip = skip - 1 if skip else random.randint(1, 6) if random.random() < rate else 0
            found += [] if skip else [octet]
        return found

    site.line.taps.append(lossy)
    return []


@other_kind("one-direction", "tap-one-direction", units=(1, 10), shown=False)
def _one_direction(site: OtherSite) -> Iterable[OtherDevice]:
    role, line = site.random.choice(("request", "answer")), site.line
    line.finish.append(lambda: line.spells.__setitem__(slice(None), [s for s in line.spells if s.role == role]))
    return []


@other_kind("cut", "cut-at-length", units=(1, 6))
def _cut(site: OtherSite) -> Iterable[OtherDevice]:
    unit, length = site.one(), site.random.choice((32, 48, 64))
    site.client.polls += [OtherPoll(unit.number, read(3, 700, 60), 2), OtherPoll(unit.number, read(3, 0, 4), 2)]
    unit.seals.append(lambda data: data[:length])
    return [unit]


@other_kind("half-rate", "unit-line-settings", units=(2, 6))
def _half_rate(site: OtherSite) -> Iterable[OtherDevice]:
    unit = site.one()
    unit.seals.append(_at_half_rate)
    return [unit]


def _at_half_rate(data: bytes) -> bytes:
    bits = [bit for byte in data for bit in (0, *(byte >> i & 1 for i in range(8)), 1) for _ in (0, 1)] + [1] * 24
    found, at = bytearray(), 0
    while at < len(bits) - 10:
        if not bits[at]:
            found.append(sum(bits[at + 1 + i] << i for i in range(8)))
            at += 9
        at += 1
    return bytes(found)


# Without a word.


@other_kind("ignores-the-same", also=("cannot-serve",), units=(1, 6))
def _ignores_the_same(site: OtherSite) -> Iterable[OtherDevice]:
    unit, last = site.one(), [b""]
    at = next(i for i, poll in enumerate(site.client.polls) if poll.unit == unit.number)
    site.client.polls.insert(at + 1, OtherPoll(unit.number, site.client.polls[at].pdu))
    site.client.retries = site.random.choice((1, 2))

    def same(data: bytes, _: float) -> bool:
        again = data[0] == unit.number and data == last[0]
        last[0] = b"" if again else data
        return again

    unit.deaf.append(same)
    return [unit]


@other_kind("weak-ear", also=("unit-restarts", "bad-drop"))
def _weak_ear(site: OtherSite) -> Iterable[OtherDevice]:
    unit, share = site.one(), site.random.choice((0.05, 0.15, 0.4))
    unit.deaf.append(lambda _, __: site.random.random() < share)
    return [unit]


@other_kind("weak-ears", also=("interference", "termination", "bad-drop"), units=(3, 8))
def _weak_ears(site: OtherSite) -> Iterable[OtherDevice]:
    units, share = site.some(2), site.random.uniform(0.05, 0.3)
    for unit in units:
        unit.deaf.append(lambda _, __: site.random.random() < share)
    return units


@other_kind("wrong-check", also=("bad-drop", "same-damage", "unit-line-settings"), units=(2, 6))
def _wrong_check(site: OtherSite) -> Iterable[OtherDevice]:
    unit, share = site.one(), site.random.uniform(0.05, 0.4)
    unit.seals.append(_sometimes(site.random, share, lambda data: data[:-1] + bytes((data[-1] ^ 0x5A,))))
    return [unit]


@other_kind("deaf-after-write", also=("unit-restarts",), units=(2, 6))
def _deaf_after_write(site: OtherSite) -> Iterable[OtherDevice]:
    unit, last, long = site.one(), [-SECOND * 99], site.random.uniform(0.3, 1.5) * SECOND
    site.client.polls.append(OtherPoll(unit.number, _writes(site.random, 901), site.random.choice((3, 6))))

    def storing(data: bytes, now: float) -> bool:
        deaf = now - last[0] < long
        last[0] = now if data[:2] == bytes((unit.number, 6)) and not deaf else last[0]
        return deaf

    unit.deaf.append(storing)
    return [unit]


@other_kind("client-deaf", also=("timeout-too-short",), units=(2, 6))
def _client_deaf(site: OtherSite) -> Iterable[OtherDevice]:
    share = site.random.uniform(0.05, 0.4)
    site.client.ears.append(_sometimes(site.random, share, lambda _: b""))
    return []


@other_kind("stale", also=("duplicate-address", "values-under-wrong-registers", "same-damage"), units=(2, 6))
def _stale(site: OtherSite) -> Iterable[OtherDevice]:
    unit, before, share = site.one(), [b""], site.random.uniform(0.05, 0.3)
    site.client.polls += [OtherPoll(unit.number, read(3, 500, 3)), OtherPoll(unit.number, read(3, 520, 9))]

    def old(_: bytes, answer: bytes, __: float) -> bytes:
        kept, before[0] = before[0], answer
        return kept if kept and site.random.random() < share else answer

    unit.tampers.append(old)
    return [unit]


@other_kind("tail", also=("same-damage", "null-suffix", "driver-held", "bias"), units=(2, 6), shown=False)
def _tail(site: OtherSite) -> Iterable[OtherDevice]:
    random, unit, share = site.random, site.one(), site.random.uniform(0.1, 0.8)
    unit.seals.append(_sometimes(random, share, lambda data: data + random.randbytes(random.randint(1, 5))))
    site.client.ears.append(_whole_part)
    return [unit]


def _whole_part(data: bytes) -> bytes:
    """The first part of it with a right check value, from any byte of the beginning on."""
    parts = (data[a:b] for a in range(9) for b in range(a + 5, len(data) + 1))
    return next((part for part in parts if crc_ok(part)), data)


@other_kind("lead", also=("driver-enabled-late", "same-damage"), units=(2, 6), shown=False)
def _lead(site: OtherSite) -> Iterable[OtherDevice]:
    unit, byte, share = site.one(), bytes((site.random.choice((0, 0x80, 0xFF)),)), site.random.choice((0.5, 1))
    unit.seals.append(_sometimes(site.random, share, lambda data: byte + data))
    site.client.ears.append(_whole_part)
    return [unit]


@other_kind("refuses-by-chance", also=("unit-busy", "unit-fails"), units=(1, 6), shown=False)
def _refuses_by_chance(site: OtherSite) -> Iterable[OtherDevice]:
    unit, share, code = site.one(), site.random.uniform(0.05, 0.3), site.random.choice((1, 2, 3, 4, 11))
    _refuse(unit, code, lambda _, __: site.random.random() < share)
    return [unit]


@other_kind("silent-behind-one", units=(3, 6))
def _silent_behind_one(site: OtherSite) -> Iterable[OtherDevice]:
    unit, other, share = *site.random.sample(site.units, 2), site.random.uniform(0.6, 1)

    def behind(_: bytes, now: float) -> bool:
        answers = [each for each in site.line.spells[-6:] if each.role == "answer" and each.end < now]
        return bool(answers) and answers[-1].sender is other and site.random.random() < share

    unit.deaf.append(behind)
    return [unit]


@other_kind("signs-as-another", also=("same-damage",), units=(2, 6))
def _signs_as_another(site: OtherSite) -> Iterable[OtherDevice]:
    unit, other = site.random.sample(site.units, 2)
    unit.seals.append(_sometimes(site.random, site.random.choice((0.3, 1)), lambda data: adu(other.number, data[1:-2])))
    return [unit]


# All is well.


@other_kind("well", units=(1, 12), healthy=True)
def _well(_: OtherSite) -> Iterable[OtherDevice]:
    return []


@other_kind("well-but-for-a-few", units=(1, 10), healthy=True)
def _few_errors(site: OtherSite) -> Iterable[OtherDevice]:
    site.line.requests, random = 1200, site.random
    site.line.spoils.append(lambda spell: _hurt(random, spell.heard) if random.random() < 0.0012 else spell.heard)
    return []


@other_kind("well-scanned", also=("absent-units", "dead-unit"), units=(1, 6), healthy=True)
def _scanned(site: OtherSite) -> Iterable[OtherDevice]:
    spare = cycle(number for number in range(1, 80) if number not in site.line.devices)
    scan = OtherPoll(0, read(3, 0, 1), 5)

    def another(_: float) -> bytes:
        scan.unit = next(spare)  # the next time
        return read(3, 0, 1)

    scan.pdu, scan.unit = another, next(spare)
    site.client.polls.append(scan)
    site.client.retries = site.client.skips = 0
    return []


@other_kind("well-asleep", also=("absent-units", "dead-unit", "all-silent"), units=(3, 8), healthy=True)
def _asleep(site: OtherSite) -> Iterable[OtherDevice]:
    """Inverters, at dusk each in its own time; some captures end before dawn."""
    site.line.requests, dusk, dawn = 1200, site.random.uniform(0.35, 0.6), site.random.uniform(0.75, 2)
    for unit in site.some(2):
        own = site.random.uniform(-0.05, 0.05)
        unit.deaf.append(lambda _, __, own=own: dusk < site.line.share - own < dawn)  # type: ignore[misc]
    return []


@other_kind("well-full", units=(1, 4), healthy=True)
def _full(site: OtherSite) -> Iterable[OtherDevice]:
    client, line = site.client, site.line
    client.by_timers, client.rest_ns, client.gap_jitter = False, 0.0, 0.05
    client.gap_ns = line.rest_ns * site.random.uniform(1.05, 1.6)
    client.polls = [OtherPoll(unit.number, read(3, 0, site.random.randint(10, 40))) for unit in site.units]
    for unit in site.units:
        unit.delay_ns, unit.jitter, unit.per_byte_ns = site.random.uniform(1.1, 3) * line.rest_ns, 0.1, 0.0
    return []


@other_kind("well-slow", units=(2, 6), healthy=True)
def _slow(site: OtherSite) -> Iterable[OtherDevice]:
    random, timeout = site.random, site.client.timeout_ns
    site.one().delays.append(lambda _, delay: random.uniform(0.3, 0.8) * timeout if random.random() < 0.3 else delay)
    return []


@other_kind("well-busy-at-times", units=(1, 6), healthy=True)
def _busy_at_times(site: OtherSite) -> Iterable[OtherDevice]:
    _refuse(site.one(), 6, lambda _, __: site.random.random() < 0.01)
    return []


@other_kind("well-off-once", also=("all-silent",), units=(2, 8), healthy=True)
def _off_once(site: OtherSite) -> Iterable[OtherDevice]:
    begin = site.random.uniform(0.3, 0.5)
    for unit in site.units:
        unit.deaf.append(lambda _, __: begin < site.line.share < begin + 0.15)
    return []
