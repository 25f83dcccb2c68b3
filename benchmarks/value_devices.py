"""Devices drawn by chance, whose values `value_harms` harms and `value_oddities` only makes look odd.

Each device has channels: measured words, floats, counters, states, settings. What a channel holds at a moment comes of
a process drawn for it, nothing of the analysis nor of its simulator.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from random import Random
from typing import Final

from ask_devices import Drawn, DrawnDevice

from captures.line import LineSettings

Words = Callable[[float], list[int]]  # of a moment (s)
SHORT, LONG = 1 << 16, 1 << 32


def walk(random: Random, middle: float, size: float, step_s: float) -> Callable[[float], float]:
    """A process that wanders about a middle: sums of a few slow waves, and a tremble that hangs on the moment."""
    waves = [(random.uniform(0.2, 1.0), random.uniform(15, 300), random.uniform(0, 6.3)) for _ in range(3)]
    every, salt = sum(each for each, _, _ in waves), random.getrandbits(30)
    shake = random.choice((0.0, 0.02, 0.1))

    def value(t: float) -> float:
        t = t // step_s * step_s if step_s else t
        slow = sum(a * math.sin(6.2832 * t / period + phase) for a, period, phase in waves) / every
        return middle + size * (slow + shake * (Random(int(t * 1000) ^ salt).random() - 0.5))

    return value


@dataclass
class Channel:
    """Some registers that are one value: what it is, and its words by the moment, most significant first."""

    kind: str
    width: int
    words: Words
    value: Callable[[float], float] | None = None


def measured_channel(make: Random, own: Random, step_s: float) -> Channel:
    middle, part = make.choice((215, 480, 2310, 5000, 12040, -35, 0)), make.uniform(0.02, 0.3)
    value = walk(own, middle * own.uniform(0.8, 1.2), max(abs(middle) * part, 6), step_s)
    return Channel("measured", 1, lambda t: [round(value(t)) % SHORT], value)


def float_channel(make: Random, own: Random, step_s: float) -> Channel:
    middle, part = make.choice((21.7, 49.98, 231.4, 0.87, 1450.0, -4.2, 6.1)), make.uniform(0.01, 0.2)
    value = walk(own, middle * own.uniform(0.8, 1.2), abs(middle) * part, step_s)
    return Channel("float", 2, lambda t: list(struct.unpack(">HH", struct.pack(">f", value(t)))), value)


def counter_channel(make: Random, own: Random, step_s: float) -> Channel:
    begin, rate = own.randrange(1000, 60_000_000), make.choice((0.3, 2.0, 15.0, 90.0, 700.0)) * own.uniform(0.5, 1.5)
    wave = own.uniform(20, 200)

    def value(t: float) -> float:
        t = t // step_s * step_s if step_s else t
        return begin + rate * (t + 0.3 * wave / 6.2832 * math.sin(6.2832 * t / wave))

    return Channel("counter", 2, lambda t: list(divmod(int(value(t)) % LONG, SHORT)), value)


def _short_counter(make: Random, own: Random, _: float) -> Channel:
    begin, rate = own.randrange(60_000), make.choice((0.5, 3.0, 20.0))
    return Channel("short counter", 1, lambda t: [int(begin + rate * t) % SHORT], lambda t: rate * t)


def _signed(make: Random, own: Random, step_s: float) -> Channel:
    """A long whole number about zero: a power that flows both ways, a position."""
    value = walk(own, 0, make.choice((300, 4000, 90_000)), step_s)
    return Channel("signed", 2, lambda t: list(divmod(round(value(t)) % LONG, SHORT)), value)


def _state(make: Random, own: Random, _: float) -> Channel:
    bits, period = make.choice((1, 3, 0x41, 0x8000, 0xFFFF)), own.uniform(10, 90)
    return Channel("state", 1, lambda t: [bits if int(t / period) % 2 else 0])


def _setting(make: Random, own: Random, _: float) -> Channel:
    value = make.choice((0, 1, 50, 300, 1500, 0x7FFF, 0xFFFF, make.randrange(SHORT)))
    value = value if own.random() < 0.7 else own.randrange(1000)
    return Channel("setting", 1, lambda _: [value])


_CHANNELS: Final = (
    *(measured_channel, measured_channel, measured_channel, float_channel, float_channel),
    *(counter_channel, _short_counter, _signed, _state, _setting),
)


class ValueDevice(DrawnDevice):
    """A device of channels; what harms it changes its words (`harms`: by the moment) or its answer (`tampers`)."""

    def __init__(self, unit: int, base: int, channels: list[Channel], *, swaps: bool) -> None:
        end = base + sum(each.width for each in channels)
        super().__init__(unit, {3, 4}, {area: [(base, end)] for area in (3, 4)}, refuses=True)
        self.base, self.channels, self.swaps, self.now = base, channels, swaps, 0.0
        self.harms: list[Callable[[float, list[int]], list[int]]] = []
        self.tampers: list[Callable[[float, bytes, bytes], bytes]] = []
        self.state = self._at

    def _at(self, t: float, _: bytes) -> int:
        self.now = t
        return 0

    def words(self, t: float) -> list[int]:
        """All of them at a moment."""
        found = [word for each in self.channels for word in self._ordered(each, t)]
        for harm in self.harms:
            found = harm(t, found)
        return found

    def _ordered(self, channel: Channel, t: float) -> list[int]:
        words = channel.words(t)
        return words[::-1] if self.swaps else words

    def place(self, index: int) -> int:
        """Where the words of a channel begin among all."""
        return sum(each.width for each in self.channels[:index])

    def answer(self, pdu: bytes) -> bytes | None:
        """The words that a read asks for."""
        address, count = int.from_bytes(pdu[1:3], "big") - self.base, int.from_bytes(pdu[3:5], "big")
        words = self.words(self.now)
        if address < 0 or address + count > len(words):
            return bytes((pdu[0] | 0x80, 2))
        body = b"".join(word.to_bytes(2, "big") for word in words[address : address + count])
        found = bytes((pdu[0], 2 * count)) + body
        for tamper in self.tampers:
            found = tamper(self.now, pdu, found)
        return found


def read_pdu(function: int, address: int, count: int) -> bytes:
    return bytes((function,)) + address.to_bytes(2, "big") + count.to_bytes(2, "big")


@dataclass
class ValueSite:
    random: Random
    devices: list[ValueDevice]
    function: int
    polls: list[tuple[int, bytes]]
    long_s: float

    @property
    def victim(self) -> ValueDevice:
        return self.devices[0]

    def since(self) -> float:
        """A moment in the middle."""
        return self.random.uniform(0.25, 0.65) * self.long_s


def drawn_site(random: Random, sisters: int | None = None, needs: tuple[str, ...] = ()) -> ValueSite:
    """One to five units of one make, or of several; each is asked for its registers in one request to three."""
    makers: dict[str, Callable[[Random, Random, float], Channel]] = {
        "measured": measured_channel,
        "float": float_channel,
        "counter": counter_channel,
        "signed": _signed,
        "state": _state,
    }
    count = sisters if sisters is not None else random.choice((1, 1, 2, 3, 5))
    one_make = sisters is not None or random.random() < 0.6
    step_s, seed, base = random.choice((0.0, 0.0, 1.0, 5.0)), random.getrandbits(30), random.choice((0, 1, 100, 3000))
    devices, polls = [], []
    function = random.choice((3, 4))
    for i, unit in enumerate(random.sample(range(1, 200), count)):
        make = Random(seed if one_make else seed + i)  # the same kinds of channels, values of its own
        kinds = make.choices(_CHANNELS, k=make.randint(5, 16)) + [makers[each] for each in needs]
        make.shuffle(kinds)
        channels = [kind(make, Random(random.getrandbits(30)), step_s) for kind in kinds]
        device = ValueDevice(unit, base, channels, swaps=make.random() < 0.4)
        devices.append(device)
        end = base + sum(each.width for each in channels)
        parts = [base + device.place(make.randrange(len(channels))) for _ in range(make.choice((0, 0, 1, 2)))]
        cuts = sorted({base, end, *parts})
        polls += [(unit, read_pdu(function, first, last - first)) for first, last in pairwise(cuts)]
    return ValueSite(random, devices, function, polls, random.uniform(80, 400))


def drawn_bus(site: ValueSite) -> Drawn:
    random = site.random
    polls = sorted(site.polls, key=lambda _: random.random()) if random.random() < 0.3 else site.polls
    rounds = max(round(site.long_s / max(0.1 * len(polls), 0.5)), 40)
    return Drawn(
        {each.unit: each for each in site.devices}, polls, timeout_s=0.3, retries=1, rounds=rounds,
        header=LineSettings(baud=random.choice((9600, 19200, 38400)), char_bits=random.choice((10, 11))),
        cycle_s=site.long_s / rounds,
    )  # fmt: skip
