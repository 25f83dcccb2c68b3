"""Values that cannot be: words in another order than the sister units', counters that jump, values that stand still."""

from __future__ import annotations

from collections.abc import Callable
from random import Random

from ..bench import Bench, Expected, read_pdu, site
from ..master import FieldPoll
from ..registers import analog, counter, float_pair
from .registry import Site, field_case


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
