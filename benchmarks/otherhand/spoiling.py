"""What is done to bytes, to a line and to a unit, for several kinds."""

from __future__ import annotations

from bisect import bisect
from collections.abc import Callable
from random import Random

from .line import SECOND, OtherBurst, OtherDevice
from .sites import OtherSite


def flipped(random: Random, data: bytes) -> bytes:
    """One bit turned over."""
    at = random.randrange(len(data))
    return data[:at] + bytes((data[at] ^ 1 << random.randrange(8),)) + data[at + 1 :]


def hurt(random: Random, data: bytes) -> bytes:
    """Some bits turned over, a byte lost or too many, or some bytes that are anything."""
    way, at, few = random.random(), random.randrange(len(data)), random.randint(1, 4)
    if way < 0.6:
        for _ in range(random.choice((1, 1, 2, 3))):
            data = flipped(random, data)
        return data
    if way < 0.75:
        return data[:at] + data[at + 1 :]
    if way < 0.9:
        return data[:at] + random.randbytes(1) + data[at:]
    return (data[:at] + random.randbytes(few) + data[at + few :])[: len(data)]


def sometimes(random: Random, share: float, harm: Callable[[bytes], bytes]) -> Callable[[bytes], bytes]:
    """The harm to so much of what is sent."""
    return lambda data: harm(data) if random.random() < share else data


def noise(site: OtherSite, a_byte: float, when: Callable[[float], bool] = lambda _: True) -> None:
    """Bytes on the line hurt by chance, each with such a share, at such times."""
    random = site.random

    def spoil(spell: OtherBurst) -> bytes:
        hit = when(spell.begin) and random.random() < 1 - (1 - a_byte) ** len(spell.data)
        return hurt(random, spell.heard) if hit else spell.heard

    site.line.spoils.append(spoil)


def strays(site: OtherSite, rate: float, when: Callable[[float], bool] = lambda _: True) -> None:
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


def refuse(unit: OtherDevice, code: int, when: Callable[[bytes, float], bool]) -> None:
    """The unit answers by an exception, where `when` says so of a PDU and a time."""
    unit.tampers.append(lambda pdu, answer, t: bytes((pdu[0] | 0x80, code)) if when(pdu, t) else answer)
