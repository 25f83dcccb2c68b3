"""Legal frames by chance, and what stands beside them."""

from __future__ import annotations

from collections.abc import Sequence
from random import Random

from dissectors.crc import crc_bytes


def adu(*body: int) -> bytes:
    octets = bytes(body)
    return octets + crc_bytes(octets)


def some(random: Random, count: int) -> bytes:
    return bytes(random.getrandbits(8) for _ in range(count))


def request(random: Random, unit: int, functions: Sequence[int] = (1, 2, 3, 4, 5, 6, 15, 16, 22)) -> bytes:
    """A legal request of a common function."""
    function = random.choice(functions)
    head = unit, function, *some(random, 2)
    if function in (1, 2):
        return adu(*head, 0, random.randint(1, 200))
    if function in (3, 4):
        return adu(*head, 0, random.randint(1, 125))
    if function == 5:
        return adu(*head, random.choice((0, 0xFF)), 0)
    if function == 6:
        return adu(*head, *some(random, 2))
    if function == 22:
        return adu(*head, *some(random, 4))
    if function == 15:
        quantity = random.randint(1, 64)
        return adu(*head, 0, quantity, (quantity + 7) // 8, *some(random, (quantity + 7) // 8))
    quantity = random.randint(1, 20)
    return adu(*head, 0, quantity, 2 * quantity, *some(random, 2 * quantity))


def answer(random: Random, asked: bytes, refuse: float = 0.03) -> bytes:
    """A legal answer to a request."""
    unit, function, quantity = asked[0], asked[1], int.from_bytes(asked[4:6])
    if random.random() < refuse:
        return adu(unit, function | 0x80, random.choice((1, 2, 3, 4, 6)))
    if function in (1, 2):
        count = (quantity + 7) // 8
        return adu(unit, function, count, *some(random, count))
    if function in (3, 4):
        return adu(unit, function, 2 * quantity, *some(random, 2 * quantity))
    return asked if function in (5, 6, 22) else adu(*asked[:6])


def short_answer(random: Random) -> bytes:
    """6 or 7 bytes: one byte of bits, or one register."""
    if random.random() < 0.5:
        return adu(random.randint(1, 247), random.choice((1, 2)), 1, *some(random, 1))
    return adu(random.randint(1, 247), random.choice((3, 4)), 2, *some(random, 2))


def strays(random: Random, count: int, kind: str) -> bytes:
    return some(random, count) if kind == "random" else bytes(random.choice((0, 0, 0xFF, 0xFE)) for _ in range(count))


def vendor(random: Random, unit: int, function: int, least: int = 0) -> bytes:
    return adu(unit, function, *some(random, random.randint(least, 40)))
