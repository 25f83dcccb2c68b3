"""A frame that nobody was heard to ask for, alone, with stray bytes beside it."""

from __future__ import annotations

from collections.abc import Callable
from random import Random

from edges.frames import adu, answer, request, short_answer, some, strays
from edges.registry import Edge, edge
from edges.wires import Bus


@edge("one-register answer alone, 00 behind", count=50)
def _alone_then_zero(random: Random) -> tuple[Bus, dict[str, str]]:
    bus = Bus(random)
    bus.send("u", adu(random.randint(1, 247), random.choice((3, 4)), 2, *some(random, 2)))
    bus.stray(b"\0")
    return bus, {}


def _stray_alone(least: int, most: int, kind: str, made: Callable[[Random], tuple[str, bytes]]) -> Edge:
    def make(random: Random) -> tuple[Bus, dict[str, str]]:
        bus = Bus(random)
        for side in (0, 1):
            bus.stray(strays(random, random.randint(least, most), kind))
            if not side:
                bus.send(*made(random))
        return bus, {}

    return make


def any_legal(random: Random) -> tuple[str, bytes]:
    asked = request(random, random.randint(1, 247))
    return ("q", asked) if random.random() < 0.5 else ("u", answer(random, asked))


for _kind in ("random", "glitch"):
    edge(f"short answer alone, 1-3 {_kind} bytes on both sides", count=50)(
        _stray_alone(1, 3, _kind, lambda random: ("u", short_answer(random)))
    )
    edge(f"short answer alone, 4-8 {_kind} bytes on both sides", count=50)(
        _stray_alone(4, 8, _kind, lambda random: ("u", short_answer(random)))
    )
    edge(f"any frame alone, 0-8 {_kind} bytes on both sides", count=50)(_stray_alone(0, 8, _kind, any_legal))
