"""Devices that answer wrongly or hold values that cannot be, lists that ask amiss, traffic that only looks odd."""

from __future__ import annotations

import struct
from collections.abc import Callable
from random import Random

from dissectors.crc import VARIANTS

from ..bench import SECOND, Bench, Expected, read_pdu, site, write_pdu
from ..master import FieldPoll
from ..units import FieldUnit, Tamper, Word, analog, counter, float_pair
from .registry import Site, field_case


@field_case("crc-convention")
def crc_convention(random: Random, tap: str) -> Site:
    """A unit's firmware makes its check value by another convention."""
    bench = site(random, tap, seconds=(30, 300))
    unit = bench.unit()
    variant = random.choice(VARIANTS)

    def seal(number: int, pdu: bytes) -> bytes:
        body = bytes((number,)) + pdu
        return body + variant.made(body)

    unit.seal = seal
    return bench, Expected("crc-convention", (unit.unit,))


@field_case("byte-count")
def byte_count(random: Random, tap: str) -> Site:
    """A unit's firmware counts its bytes wrongly."""
    bench = site(random, tap, seconds=(30, 300))
    unit = bench.unit()
    kind = random.choice(("words", "zero", "one-more", "one-less"))

    def miscount(request: bytes, answer: bytes, _: float) -> bytes:
        if request[0] > 4 or answer[0] & 0x80:
            return answer
        wrong = {"words": answer[1] // 2, "zero": 0, "one-more": answer[1] + 1, "one-less": answer[1] - 1}[kind]
        return bytes((answer[0], wrong & 0xFF)) + answer[2:]

    unit.tampers.append(miscount)
    return bench, Expected("byte-count", (unit.unit,))


def _within(begin: int, end: int) -> Tamper:
    """A map of words from one address to another, the last not included."""

    def check(request: bytes, answer: bytes, _: float) -> bytes:
        function = request[0]
        address = int.from_bytes(request[1:3])
        quantity = 1 if function in (5, 6) else int.from_bytes(request[3:5])
        return answer if begin <= address and address + quantity <= end else bytes((function | 0x80, 2))

    return check


def _own_polls(unit: FieldUnit, polls: list[FieldPoll], pdus: list[Callable[[float], bytes]]) -> list[FieldPoll]:
    """The list with the polls of one unit replaced by these."""
    remaining = [poll for poll in polls if poll.unit != unit.unit]
    return remaining + [FieldPoll(unit.unit, pdu) for pdu in pdus]


@field_case("off-by-one")
def off_by_one(random: Random, tap: str) -> Site:
    """The client's list counts from one, the device from zero, or the other way round."""
    bench = site(random, tap, seconds=(30, 300))
    unit = bench.unit()
    function, begin = random.choice((3, 3, 4)), random.choice((1, 1, 100, 1000))
    size, many = random.choice((1, 2, 4, 10, 16)), random.randint(2, 6)
    shift = random.choice((-1, 1))
    pdus = [read_pdu(function, begin + shift + k * size, size) for k in range(many)]
    unit.tampers.append(_within(begin, begin + many * size))
    bench.master.polls = _own_polls(unit, bench.master.polls, pdus)
    return bench, Expected("off-by-one", (unit.unit,), ("missing-registers",))


@field_case("missing-registers")
def missing_registers(random: Random, tap: str) -> Site:
    """The client's list holds registers that the device does not have."""
    bench = site(random, tap, seconds=(30, 300))
    unit = bench.unit()
    function = random.choice((3, 3, 4))
    pdus = [read_pdu(function, at, random.choice((2, 8, 10))) for at in random.sample(range(0, 200, 20), 3)]
    pdus += [
        read_pdu(function, at, random.choice((1, 2, 10)))
        for at in random.sample((400, 1000, 4000, 30000), random.randint(1, 3))
    ]
    unit.tampers.append(_within(0, 230))
    bench.master.polls = _own_polls(unit, bench.master.polls, pdus)
    return bench, Expected("missing-registers", (unit.unit,))


@field_case("read-only")
def read_only(random: Random, tap: str) -> Site:
    """The client writes registers that the device lets nobody write, though it reads them well."""
    bench = site(random, tap, seconds=(40, 300))
    unit = bench.unit()
    address, code = random.choice((0, 10, 100)), random.choice((2, 3, 4, 1))
    code = random.choice((2, 3)) if code in (1, 4) and random.random() < 0.7 else code

    def refuse(request: bytes, answer: bytes, _: float) -> bytes:
        return bytes((request[0] | 0x80, code)) if request[0] in (6, 16) else answer

    unit.tampers.append(refuse)
    pdus = [read_pdu(3, address, 10), read_pdu(3, address + 40, 6)]
    bench.master.polls = _own_polls(unit, bench.master.polls, pdus)
    write = write_pdu(random, random.choice((6, 16)), address + random.randrange(6), 2)
    bench.master.polls.append(FieldPoll(unit.unit, write, random.uniform(1, 4) * SECOND))
    return bench, Expected("read-only", (unit.unit,))


@field_case("vendor-transfer")
def vendor_transfer(random: Random, tap: str) -> Site:
    """A long transfer by a user-defined function; nothing is wrong."""
    bench = site(random, tap, units=(1, 5), seconds=(20, 120))
    unit = bench.unit()
    function, size = random.choice((65, 66, 70, 100, 105)), random.choice((16, 64, 128, 200))
    block = [0]

    def pdu(_: float) -> bytes:
        block[0] += 1
        return struct.pack(">BHB", function, block[0] & 0xFFFF, size) + random.randbytes(size)

    def confirm(request: bytes, answer: bytes, _: float) -> bytes:
        return request[:3] + b"\0" if request[0] == function else answer

    unit.tampers.append(confirm)
    unit.lenient = False
    for poll in bench.master.polls:
        poll.period_ns = random.uniform(3, 9) * SECOND
    bench.master.polls.append(FieldPoll(unit.unit, pdu))
    bench.master.manners.cycle_ms = 0.0
    bench.master.manners.timeout_ms += 300
    return bench, Expected("vendor-transfer", (unit.unit,))


def _sisters(random: Random, tap: str) -> tuple[Bench, list[int]]:
    """Units of one kind: floats, counters and measured words at the same addresses."""
    bench = site(random, tap, units=(3, 8), seconds=(60, 300))
    numbers = sorted(bench.units)
    bench.master.polls = [FieldPoll(number, read_pdu(3, 0, 12)) for number in numbers]
    bench.master.manners.cycle_ms = random.choice((0.0, 500.0, 1000.0))
    for number in numbers:
        words = bench.units[number].holdings.words
        for at in (0, 2, 4):
            words[at], words[at + 1] = float_pair(random)
        words[6], words[7] = counter(random)
        for at in range(8, 12):
            words[at] = analog(random)
    return bench, numbers


@field_case("word-order")
def word_order(random: Random, tap: str) -> Site:
    """One of several units of a kind sends its floats with the words exchanged."""
    bench, numbers = _sisters(random, tap)
    wrong = random.choice(numbers)
    words = bench.units[wrong].holdings.words
    for at in (0, 2, 4, 6):
        words[at], words[at + 1] = words[at + 1], words[at]
    return bench, Expected("word-order", (wrong,))


@field_case("counter-jumps")
def counter_jumps(random: Random, tap: str) -> Site:
    """A counter falls back or leaps now and then."""
    bench, numbers = _sisters(random, tap)
    wrong = random.choice(numbers)
    words = bench.units[wrong].holdings.words
    high, low = words[6], words[7]
    leaps = sorted(
        (bench.clock(), random.choice((-1, -1, 1)) * random.randrange(5_000, 3_000_000))
        for _ in range(random.randint(2, 6))
    )

    def value(t: float) -> int:
        shift = sum(by for at, by in leaps if at <= t)
        return max(0, (high(t) << 16 | low(t)) + shift)

    words[6], words[7] = (lambda t: value(t) >> 16), (lambda t: value(t) & 0xFFFF)
    return bench, Expected("counter-jumps", (wrong,))


def _held(word: Callable[[float], int], since: float) -> Callable[[float], int]:
    """A value that stands still from a moment on."""
    last = word(since)
    return lambda t: word(t) if t < since else last


@field_case("frozen-values")
def frozen_values(random: Random, tap: str) -> Site:
    """A unit answers, but its values stand still from some time on while its sisters' move."""
    bench, numbers = _sisters(random, tap)
    wrong = random.choice(numbers)
    words = bench.units[wrong].holdings.words
    since = random.choice((0.0, random.uniform(0.1, 0.5) * bench.duration_ns))
    for at, word in list(words.items()):
        words[at] = _held(word, since)
    return bench, Expected("frozen-values", (wrong,))


@field_case("values-stall")
def values_stall(random: Random, tap: str) -> Site:
    """The values of a unit stand still for a while, now and then, and leap to where they would be."""
    bench, numbers = _sisters(random, tap)
    wrong = random.choice(numbers)
    words = bench.units[wrong].holdings.words
    begins = [random.uniform(low, low + 0.1) * bench.duration_ns for low in random.choice(((0.4,), (0.2, 0.6)))]
    spans = [(begin, begin + random.uniform(0.15, 0.25) * bench.duration_ns) for begin in begins]
    for at, word in list(words.items()):
        words[at] = _stalled(word, spans)
    return bench, Expected("frozen-values", (wrong,))


def _stalled(word: Word, spans: list[tuple[float, float]]) -> Word:
    held = {begin: word(begin) for begin, _ in spans}
    return lambda t: held[begin] if (begin := next((b for b, e in spans if b <= t < e), -1.0)) in held else word(t)


@field_case("value-lost")
def value_lost(random: Random, tap: str) -> Site:
    """A sensor's wire is loose: a code stands in the place of its value now and then, or for good from some time on."""
    bench, numbers = _sisters(random, tap)
    wrong, at = random.choice(numbers), random.randrange(8, 12)
    words, code = bench.units[wrong].holdings.words, random.choice((0x7FFF, 0x8000, 0xFFFF))
    begins = [random.uniform(low, low + 0.1) * bench.duration_ns for low in (0.1, 0.35, 0.6)]
    spans = [(begin, begin + random.uniform(0.05, 0.2) * bench.duration_ns) for begin in begins]
    spans = random.choice((spans, [(begins[-1], bench.duration_ns)]))
    word = analog(random)
    words[at] = lambda t: code if any(begin <= t < end for begin, end in spans) else word(t)
    return bench, Expected("value-lost", (wrong,))


@field_case("values-changed")
def values_changed(random: Random, tap: str) -> Site:
    """From some time on the registers of a unit hold what belongs one register further on."""
    bench, numbers = _sisters(random, tap)
    wrong, since = random.choice(numbers), random.uniform(0.3, 0.6) * bench.duration_ns
    words = bench.units[wrong].holdings.words
    kept = dict(words)
    for at in range(11):
        words[at] = _from(since, kept[at], kept[at + 1])
    return bench, Expected("values-changed", (wrong,))


def _from(since: float, word: Word, then: Word) -> Word:
    """One value till a moment, another from it on."""
    return lambda t: word(t) if t < since else then(t)
