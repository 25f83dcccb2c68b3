"""Damage done on purpose to frames of a simulated conversation, and what an autopsy has to say of it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from random import Random

from analyzer.diagnosis.damage import DamagedFrame, Explanation
from analyzer.simulation.conversation import Client, Habits
from dissectors.crc import VARIANTS, crc16
from dissectors.length_rules import Role


@dataclass(frozen=True)
class Damaged:
    """A case with the truth about it; `at` is where, `detail` what else there is to know."""

    code: str
    case: DamagedFrame
    sent: bytes
    at: int = -1
    detail: int | str = -1

    def told(self, verdict: Explanation) -> bool:
        """Whether the place (and bit, value, variant) is right, or among those that the verdict gives as equal."""
        if self.code == "bit-flip":
            return (verdict.byte, verdict.bit) == (self.at, self.detail)
        if self.code in ("byte-missing", "byte-extra"):
            return any(p.first <= self.at <= p.last and p.value == self.detail for p in verdict.places)
        if self.code == "crc-variant":
            return verdict.variant == self.detail
        if self.code == "truncated":
            return verdict.length == len(self.sent) or (verdict.at_least and (verdict.length or 0) < len(self.sent))
        if self.code in ("bytes-repeated", "flow-control-loss"):
            return verdict.repaired == self.sent
        return True


def _flip(random: Random, sent: bytes) -> tuple[bytes, int, int]:
    at, bit = random.randrange(len(sent)), random.randrange(8)
    return sent[:at] + bytes((sent[at] ^ 1 << bit,)) + sent[at + 1 :], at, bit


def _lose(random: Random, sent: bytes) -> tuple[bytes, int, int]:
    at = random.randrange(len(sent))
    return sent[:at] + sent[at + 1 :], at, sent[at]


def _add(random: Random, sent: bytes) -> tuple[bytes, int, int]:
    at, value = random.randint(1, len(sent) - 1), random.randrange(256)
    return sent[:at] + bytes((value,)) + sent[at:], at, value


def _repeat(random: Random, sent: bytes) -> tuple[bytes, int, int]:
    length = random.choice((2, 3, 4, 8, 22))
    length = min(length, len(sent) - 2)
    at = random.randint(0, len(sent) - length)
    return sent[: at + length] + sent[at:], at, length


def _cut(random: Random, sent: bytes) -> tuple[bytes, int, int]:
    length = random.randint(min(3, len(sent) - 2), len(sent) - 2)
    return sent[:length], length, len(sent)


def _eat(_: Random, sent: bytes) -> tuple[bytes, int, int]:
    return sent.translate(None, b"\x11\x13"), -1, -1


def _other_crc(random: Random, sent: bytes) -> tuple[bytes, int, str]:
    variant = random.choice(VARIANTS)
    return sent[:-2] + variant.made(sent[:-2]), -1, variant.name


def _many(random: Random, sent: bytes) -> tuple[bytes, int, int]:
    data = bytearray(sent)
    if random.random() < 0.5:
        data[-2:] = random.randbytes(2)
    else:
        for bit in random.sample(range(8 * len(data)), random.randint(2, 4)):
            data[bit // 8] ^= 1 << bit % 8
    return bytes(data), -1, -1


def _overlap(random: Random, sent: bytes) -> tuple[bytes, int, int]:
    other = random.randbytes(random.choice((len(sent), len(sent) + random.randint(2, 9))))
    both = bytes(a & b for a, b in zip(sent, other, strict=False)) + other[len(sent) :]
    return both, -1, -1


DAMAGES: dict[str, Callable[[Random, bytes], tuple[bytes, int, int | str]]] = {
    "bit-flip": _flip,
    "byte-missing": _lose,
    "byte-extra": _add,
    "bytes-repeated": _repeat,
    "truncated": _cut,
    "flow-control-loss": _eat,
    "crc-variant": _other_crc,
    "crc-error": _many,
    "collision": _overlap,
}


def damaged(code: str, seed: int, count: int, *, public: bool = True, vendor: int = 0) -> Iterator[Damaged]:
    """`count` cases of one damage on frames of all functions, requests and answers, as a bus would have them."""
    random = Random(f"{code} {seed}")
    client = Client(random, Habits(public, vendor, 0.0, 0.0), 6)
    warm = [client.exchange() for _ in range(60)]
    known = {exchange.request for exchange in warm}
    units = {exchange.request[0] for exchange in warm}
    flow_free = 4000 if code == "flow-control-loss" else 0
    while count:
        exchange = client.exchange()
        answer = random.random() < 0.6 or code == "collision"
        sent = exchange.response if answer else exchange.request
        if sent is None:
            continue
        data, at, detail = DAMAGES[code](random, sent)
        if data == sent or not data or not crc16(data):
            continue
        case = DamagedFrame(
            data,
            Role.RESPONSE if answer else Role.REQUEST,
            request=exchange.request if answer else None,
            known=known,
            units=units,
            flow_free=flow_free,
        )
        yield Damaged(code, case, sent, at, detail)
        count -= 1
