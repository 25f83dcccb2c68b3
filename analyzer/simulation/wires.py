"""The wires that can be simulated: who talks on them, what goes wrong, and what that does to a frame's bytes.

What goes wrong is in shares of frames or of exchanges; a new wire is one new entry in `WIRES`. What a fault does is a
function from what was sent to what arrives; a byte that is lost is None in its place, since its time passes all the
same.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
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


@dataclass(frozen=True, slots=True)
class Wire:
    """What a wire does, as probabilities.

    Of the conversation: `public`, that its servers know all public functions and not only the common ones; `vendor`,
    the weight of an undocumented function beside a common one's 1; `hostile`, the share of register reads answered
    with a payload meant to fool a CRC scan; `broadcast`, the share of requests.

    Of each frame: `flip` of a bit, `drop` of a byte, holes inside (`slow`), stray bytes hard before it and, drawn
    apart, hard after it (`glitch`); of a response also `truncate` and `collide`, with another server's.

    Of each exchange: `silent`, no answer; `late`, the answer comes after the next request; `stray`, noise before it.
    """

    public: float = 0.5
    vendor: int = 0
    hostile: float = 0.0
    broadcast: float = 0.0
    flip: float = 0.0
    drop: float = 0.0
    truncate: float = 0.0
    collide: float = 0.0
    slow: float = 0.0
    glitch: float = 0.0
    silent: float = 0.0
    late: float = 0.0
    stray: float = 0.0


_NOISY = Wire(flip=0.018, drop=0.02, truncate=0.02, collide=0.018, silent=0.03, late=0.01, stray=0.1)

WIRES: Mapping[str, Wire] = MappingProxyType(
    {
        "clean": Wire(),
        "hard": Wire(hostile=0.36),
        "slow-slave": Wire(slow=0.3),
        "noisy": _NOISY,
        "glitch": Wire(glitch=0.3, silent=0.045),
        "vendor": Wire(public=0.0, vendor=2, flip=0.01, silent=0.02),
        "broadcast": Wire(broadcast=0.04),
        "brutal": replace(
            _NOISY,
            public=1.0,
            vendor=1,
            hostile=0.3,
            broadcast=0.01,
            flip=0.055,
            drop=0.055,
            truncate=0.05,
            collide=0.05,
            slow=0.11,
            glitch=0.15,
            silent=0.08,
            late=0.035,
            stray=0.3,
        ),
    }
)
