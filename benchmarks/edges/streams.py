"""Frames amid stray bytes: a frame that nobody was heard to ask for, alone; streams of frames; and taps that hear one
direction only.
"""

from __future__ import annotations

from collections.abc import Callable
from random import Random

from edges.frames import adu, answer, request, short_answer, some, strays
from edges.lines import healthy
from edges.registry import Bus, Edge, edge


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


def _stray_stream(least: int, most: int, kind: str, made: Callable[[Random], tuple[str, bytes]]) -> Edge:
    def make(random: Random) -> tuple[Bus, dict[str, str]]:
        bus = Bus(random)
        for _ in range(60):
            for side in (0, 1):
                bus.stray(strays(random, random.randint(least, most), kind))
                if not side:
                    bus.send(*made(random))
            bus.wait(random.uniform(5, 60))
        return bus, {}

    return make


def _own_unit(make: Callable[[Random], bytes]) -> Callable[[Random], tuple[str, bytes]]:
    return lambda random: ("u", make(random))


for _kind in ("random", "glitch"):
    edge(f"short answers in a stream, 1-3 {_kind} bytes on both sides")(
        _stray_stream(1, 3, _kind, _own_unit(short_answer))
    )
    edge(f"any frames in a stream, 0-3 {_kind} bytes on both sides")(_stray_stream(0, 3, _kind, any_legal))


def _amid_healthy(kind: str, own: bool) -> Edge:
    def make(random: Random) -> tuple[Bus, dict[str, str]]:
        bus, units = Bus(random), random.sample(range(1, 248), 3)
        polls = [request(random, random.choice(units)) for _ in range(8)]
        for i in range(150):
            healthy(bus, random, polls)
            if i < 30 or i % 5:
                continue
            unit = random.choice(units) if own else random.randint(1, 247)
            for side in (0, 1):
                bus.stray(strays(random, random.randint(0, 3), kind))
                if not side:
                    asked = request(random, unit)
                    bus.send(*random.choice((("q", asked), ("u", answer(random, asked)))))
            bus.asked = None
            bus.wait(random.uniform(20, 60))
        return bus, {}

    return make


for _kind in ("random", "glitch"):
    edge(f"amid a healthy bus, own units, 0-3 {_kind} bytes on both sides")(_amid_healthy(_kind, True))
    edge(f"amid a healthy bus, strange units, 0-3 {_kind} bytes on both sides")(_amid_healthy(_kind, False))


def _answers_only(behind: bytes | None) -> Edge:
    def make(random: Random) -> tuple[Bus, dict[str, str]]:
        bus, units = Bus(random), random.sample(range(1, 248), 3)
        polls = [request(random, random.choice(units), (1, 2, 3, 4, 3, 4, 6, 16)) for _ in range(8)]
        for i in range(100):
            bus.send("u", answer(random, polls[i % len(polls)]))
            bus.stray(some(random, random.randint(1, 3)) if behind is None else behind)
            bus.wait(random.uniform(15, 60))
        return bus, {}

    return make


edge("answers only")(_answers_only(b""))
edge("answers only, 00 behind each")(_answers_only(b"\0"))
edge("answers only, 1-3 random bytes behind each")(_answers_only(None))


@edge("one-register answers only, 00 behind each")
def _one_register_only(random: Random) -> tuple[Bus, dict[str, str]]:
    bus = Bus(random)
    for _ in range(100):
        bus.send("u", adu(random.choice((1, 2, 9)), 3, 2, *some(random, 2)))
        bus.stray(b"\0")
        bus.wait(random.uniform(15, 60))
    return bus, {}


@edge("requests only")
def _requests_only(random: Random) -> tuple[Bus, dict[str, str]]:
    bus = Bus(random)
    polls = [request(random, random.randint(1, 9)) for _ in range(8)]
    for i in range(100):
        bus.send("q", polls[i % len(polls)])
        bus.wait(random.uniform(60, 100))
    return bus, {}
