"""What a wire does to one frame's bytes: a function a fault, from what was sent to what arrives.

A byte that is lost is None in its place, since its time passes all the same.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from random import Random
from types import MappingProxyType

_COLLISION = 16  # bytes: no longer do two servers talk at once

Spoilt = list[int | None]


def _flip(random: Random, sent: bytes) -> Spoilt:
    data: Spoilt = list(sent)
    at = random.randrange(len(sent))
    data[at] = sent[at] ^ 1 << random.randrange(8)
    return data


def _drop(random: Random, sent: bytes) -> Spoilt:
    data: Spoilt = list(sent)
    data[random.randrange(len(sent))] = None
    return data


def _truncate(random: Random, sent: bytes) -> Spoilt:
    return list(sent[: random.randint(1, len(sent) - 1)])


def _collide(random: Random, sent: bytes) -> Spoilt:
    # A bit is 0 where either of the two sends 0.
    noise = random.randbytes(min(len(sent), _COLLISION))
    return [ours & theirs for ours, theirs in zip(sent, noise, strict=False)] + list[int | None](sent[_COLLISION:])


FAULTS: Mapping[str, Callable[[Random, bytes], Spoilt]] = MappingProxyType(
    {"flip": _flip, "drop": _drop, "trunc": _truncate, "collide": _collide}
)
