"""A site of this hand, and captures of it; what is done to one are kinds (`kinds`).

A kind is a function of a site that does something to it and gives the units at fault; beside it stand the causes that
name it (none: it has no word), and those that may be said as well.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from random import Random
from struct import pack
from typing import NamedTuple

from captures.chunks import Chunk
from captures.line import LineSettings

from .line import MS, SECOND, OtherBus, OtherClient, OtherDevice, OtherPoll, patience

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
        polls.append(OtherPoll(random.choice(numbers), writes(random, 900), random.choice((2, 10, 30))))
    if random.random() < 0.12:
        polls.append(OtherPoll(0, writes(random, 5), random.choice((5, 20))))
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


def writes(random: Random, address: int) -> Callable[[float], bytes]:
    """The PDU of a write of one register, another number each time."""
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
