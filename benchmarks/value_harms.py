"""What harms the values of one device, from the beginning, from a moment on, or in between: sixteen kinds."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from random import Random
from typing import Final

from value_devices import (
    LONG,
    SHORT,
    Channel,
    ValueDevice,
    ValueSite,
    counter_channel,
    drawn_site,
    float_channel,
    measured_channel,
    read_pdu,
    walk,
)


def _swapped(word: int) -> int:
    return (word & 0xFF) << 8 | word >> 8


def _each_pair(device: ValueDevice, words: list[int]) -> list[int]:
    found, at = list(words), 0
    for each in device.channels:
        if each.width == 2:
            found[at], found[at + 1] = found[at + 1], found[at]
        at += each.width
    return found


Harm = Callable[[Random], tuple[ValueSite, tuple[str, ...], tuple[str, ...]]]


def _from(device: ValueDevice, since: float, change: Callable[[list[int]], list[int]], until: float = math.inf) -> None:
    device.harms.append(lambda t, words: change(words) if since <= t < until else words)


def _words_of_one(random: Random) -> tuple[ValueSite, tuple[str, ...], tuple[str, ...]]:
    site = drawn_site(random, random.choice((3, 4, 6)), ("float", "float"))
    _from(site.victim, -1, lambda words: _each_pair(site.victim, words))
    return site, ("word-order",), ()


def _words_since(random: Random) -> tuple[ValueSite, tuple[str, ...], tuple[str, ...]]:
    site = drawn_site(random, None, ("float", "float"))
    _from(site.victim, site.since(), lambda words: _each_pair(site.victim, words))
    return site, ("word-order",), ("counter-jumps",)


def _bytes_of_one(random: Random) -> tuple[ValueSite, tuple[str, ...], tuple[str, ...]]:
    site = drawn_site(random, random.choice((3, 4, 6)), ("measured", "float"))
    _from(site.victim, -1, lambda words: [_swapped(word) for word in words])
    return site, ("word-order",), ()


def _bytes_since(random: Random) -> tuple[ValueSite, tuple[str, ...], tuple[str, ...]]:
    site = drawn_site(random, None, ("measured", "float"))
    _from(site.victim, site.since(), lambda words: [_swapped(word) for word in words])
    return site, ("word-order",), ("counter-jumps",)


def _torn(random: Random, kind: str) -> tuple[ValueSite, tuple[str, ...], tuple[str, ...]]:
    """The high word is of an earlier moment than the low one."""
    site = drawn_site(random, None, (kind,))
    device = site.victim
    index = next(i for i, each in enumerate(device.channels) if each.kind == kind)
    late = random.uniform(0.5, 3.0)
    if kind == "counter":
        begin, rate = random.randrange(1 << 24), random.choice((2000, 5000, 9000))
        device.channels[index].words = lambda t: [
            int(begin + rate * max(t - late, 0)) >> 16,
            int(begin + rate * t) % SHORT,
        ]
    else:
        value = walk(random, 0, random.choice((300, 3000)), 0.0)
        device.channels[index].words = lambda t: [round(value(t - late)) % LONG >> 16, round(value(t)) % SHORT]
    return site, ("counter-jumps",), ()


def _torn_counter(random: Random) -> tuple[ValueSite, tuple[str, ...], tuple[str, ...]]:
    return _torn(random, "counter")


def _torn_signed(random: Random) -> tuple[ValueSite, tuple[str, ...], tuple[str, ...]]:
    return _torn(random, "signed")


def _split_read(random: Random) -> tuple[ValueSite, tuple[str, ...], tuple[str, ...]]:
    """The client reads the two words of a fast counter in two requests."""
    site = drawn_site(random, None, ())
    device = site.victim
    begin, rate = random.randrange(1 << 24), random.choice((8000, 15000, 30000))
    fast = Channel("counter", 2, lambda t: list(divmod(int(begin + rate * t) % LONG, SHORT)))
    device.channels.append(fast)
    at = device.base + device.place(len(device.channels) - 1)
    for area in device.areas:
        device.areas[area] = [(device.base, at + 2)]
    two = [(device.unit, read_pdu(site.function, at + i, 1)) for i in (0, 1)]
    site.polls = [two[0], *site.polls, two[1]] if random.random() < 0.5 else [two[1], *site.polls, two[0]]
    return site, ("counter-jumps",), ()


def _stalls(device: ValueDevice, spans: list[tuple[float, float]]) -> None:
    words = device.words

    def held(t: float) -> list[int]:
        return words(next((begin for begin, end in spans if begin <= t < end), t))

    device.words = held  # type: ignore[method-assign]


def _unit_stalls(random: Random) -> tuple[ValueSite, tuple[str, ...], tuple[str, ...]]:
    """A unit whose values stand still at times, and go on."""
    site = drawn_site(random, None, ("measured", "float", "counter"))
    begin = random.uniform(0.15, 0.3) * site.long_s
    spans = []
    for _ in range(random.choice((1, 2, 3))):
        spans.append((begin, begin + random.uniform(0.12, 0.2) * site.long_s))
        begin = spans[-1][1] + random.uniform(0.05, 0.1) * site.long_s
    _stalls(site.victim, spans)
    return site, ("frozen-values",), ()


def _unit_freezes(random: Random) -> tuple[ValueSite, tuple[str, ...], tuple[str, ...]]:
    site = drawn_site(random, None, ("measured", "float", "counter"))
    _stalls(site.victim, [(site.since(), math.inf)])
    return site, ("frozen-values",), ()


def _counter_of(site: ValueSite) -> Channel:
    return next(each for each in site.victim.channels if each.kind == "counter")


def _counter_restarts(random: Random) -> tuple[ValueSite, tuple[str, ...], tuple[str, ...]]:
    """A counter is lost again and again: it begins at 0, or at what was last saved."""
    site = drawn_site(random, None, ("counter",))
    counter, saved = _counter_of(site), random.random() < 0.5
    value = counter.value or float
    moments = sorted(random.uniform(0.1, 0.9) * site.long_s for _ in range(random.randint(2, 5)))
    back = random.uniform(0.05, 0.2) * site.long_s

    def lost(t: float) -> float:
        last = max((each for each in moments if each <= t), default=None)
        if last is None:
            return value(t)
        if not saved:
            return value(t) - value(last)
        return value(t) - sum(value(each) - value(each - back) for each in moments if each <= t)

    counter.words = lambda t: list(divmod(int(lost(t)) % LONG, SHORT))
    return site, ("counter-jumps",), ()


def _counter_leaps(random: Random) -> tuple[ValueSite, tuple[str, ...], tuple[str, ...]]:
    site = drawn_site(random, None, ("counter",))
    counter, value = _counter_of(site), _counter_of(site).value or float
    leaps = [
        (random.uniform(0.1, 0.9) * site.long_s, random.choice((-1, 1, 1)) * random.randrange(20_000, 3_000_000))
        for _ in range(random.randint(2, 5))
    ]
    counter.words = lambda t: list(divmod(int(max(value(t) + sum(by for at, by in leaps if at <= t), 0)) % LONG, SHORT))
    return site, ("counter-jumps",), ()


def _scale(random: Random) -> tuple[ValueSite, tuple[str, ...], tuple[str, ...]]:
    """Somebody changes the number of decimals: all measured values are ten times as large, or a tenth."""
    site = drawn_site(random, None, ("measured", "measured", "measured"))
    device, since, by = site.victim, site.since(), random.choice((10, 10, 100, 0.1, 0.01))
    for each in device.channels:
        if each.kind == "measured" and each.value is not None:
            each.words = lambda t, value=each.value: [round(value(t) * (by if t >= since else 1)) % SHORT]  # type: ignore[misc]
    return site, ("values-changed",), ()


def _code(random: Random) -> tuple[ValueSite, tuple[str, ...], tuple[str, ...]]:
    """A sensor is lost: its value is an error code from then on, or at times."""
    site = drawn_site(random, None, ("measured", "float"))
    device = site.victim
    index = random.choice([i for i, each in enumerate(device.channels) if each.kind in ("measured", "float")])
    words = device.channels[index].words
    code = random.choice((0x7FFF, 0x8000, 0xFFFF, 0x7FFF))
    codes = [code] if device.channels[index].width == 1 else random.choice(([0x7FC0, 0], [0xFFFF, 0xFFFF], [0xFFC0, 0]))
    spans = [(site.since(), math.inf)]
    if random.random() < 0.5:
        spans = [
            (b, b + random.uniform(0.03, 0.1) * site.long_s)
            for b in (0.2 * site.long_s, 0.5 * site.long_s, 0.8 * site.long_s)
        ]
    device.channels[index].words = lambda t: codes if any(b <= t < e for b, e in spans) else words(t)
    return site, ("value-lost",), ()


def _neighbour(random: Random) -> tuple[ValueSite, tuple[str, ...], tuple[str, ...]]:
    """From a moment on, or among sisters always, a unit answers by the registers one further."""
    among = random.random() < 0.5
    site = drawn_site(random, random.choice((3, 4, 6)) if among else None, ("measured", "float", "measured"))
    by = random.choice((1, 1, -1))
    _from(site.victim, -1 if among else site.since(), lambda words: words[by:] + words[:by])
    return site, ("values-changed",), ("word-order", "counter-jumps")


def _stale(random: Random) -> tuple[ValueSite, tuple[str, ...], tuple[str, ...]]:
    """A unit answers by what it had ready for the request before, in spells."""
    site = drawn_site(random, random.choice((1, 2, 3)))
    device = site.victim
    count = random.randint(4, 10)
    kinds = (measured_channel, measured_channel, counter_channel, float_channel, float_channel, counter_channel) * 8
    device.channels = [kind(random, random, 0.0) for kind in kinds][: 4 * count]
    size = sum(each.width for each in device.channels)
    for area in device.areas:
        device.areas[area] = [(device.base, device.base + size)]
    some = min(size // 3, 10)
    mine = [
        (device.unit, read_pdu(site.function, device.base + first, some)) for first in range(0, size - some + 1, some)
    ]
    site.polls = [poll for poll in site.polls if poll[0] != device.unit] + mine
    last = [b""]
    spans = [(b * site.long_s, (b + random.uniform(0.05, 0.15)) * site.long_s) for b in (0.2, 0.45, 0.7)]

    def stale(t: float, _: bytes, answer: bytes) -> bytes:
        before, last[0] = last[0], answer
        return before if any(b <= t < e for b, e in spans) and len(before) == len(answer) else answer

    device.tampers.append(stale)
    return site, ("values-under-wrong-registers",), ("two-masters",)


def _short(random: Random) -> tuple[ValueSite, tuple[str, ...], tuple[str, ...]]:
    """A unit gives fewer registers than it is asked for, with a byte count that is right for them."""
    site = drawn_site(random, None, ("measured", "float", "measured"))
    most = random.choice((3, 4, 5))
    site.polls.append((site.victim.unit, read_pdu(site.function, site.victim.base, most + random.randint(1, 2))))

    def cut(_t: float, _pdu: bytes, answer: bytes) -> bytes:
        return answer[:1] + bytes((min(answer[1], 2 * most),)) + answer[2 : 2 + 2 * most]

    site.victim.tampers.append(cut)
    return site, ("byte-count", "cannot-serve"), ()


HARMS: Final[Mapping[str, Harm]] = {
    "words-of-one": _words_of_one, "words-since": _words_since, "bytes-of-one": _bytes_of_one,
    "bytes-since": _bytes_since, "torn-counter": _torn_counter, "torn-signed": _torn_signed, "split-read": _split_read,
    "unit-stalls": _unit_stalls, "unit-freezes": _unit_freezes, "counter-restarts": _counter_restarts,
    "counter-leaps": _counter_leaps, "scale": _scale, "code": _code, "neighbour": _neighbour,
    "stale": _stale, "short": _short,
}  # fmt: skip
