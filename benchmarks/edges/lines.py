"""Whole lines: counts that contradict a frame, two ports of one direction each, undeclared functions."""

from __future__ import annotations

from collections.abc import Sequence
from random import Random

from edges.frames import adu, answer, request, some, vendor
from edges.registry import ALL_TAPS, Bus, Edge, edge


def healthy(bus: Bus, random: Random, polls: Sequence[bytes]) -> None:
    asked = random.choice(polls)
    bus.send("q", asked, plain=True)
    bus.wait(random.uniform(3, 20))
    bus.send("a", answer(random, asked), plain=True)
    bus.wait(random.uniform(8, 40))


@edge("counts that contradict the frame, between silences")
def _contrary_counts(random: Random) -> tuple[Bus, dict[str, str]]:
    bus = Bus(random)
    polls = [request(random, random.randint(1, 5)) for _ in range(8)]
    for i in range(120):
        healthy(bus, random, polls)
        if i >= 40 and i % 4 == 0:
            unit, octets = random.randint(1, 5), random.choice((2, 4, 6, 8))
            wrong = random.choice(
                (
                    (unit, 16, 0, random.getrandbits(7), 0, octets // 2, 0),
                    (unit, 16, 0, random.getrandbits(7), 0, octets // 2 + 9, octets + 3),
                    (unit, 16, 0, random.getrandbits(7), 0, octets // 2, 255),
                    (unit, 15, 0, random.getrandbits(7), 0, 8 * octets, 0),
                )
            )
            bus.send("q", adu(*wrong, *some(random, octets)))
            bus.wait(random.uniform(60, 90))
        elif i >= 40 and i % 4 == 2:
            unit, octets = random.randint(1, 5), random.choice((2, 4, 6, 8))
            bus.send("q", adu(unit, 3, 0, random.getrandbits(7), 0, octets // 2), plain=True)
            bus.wait(random.uniform(3, 20))
            bus.send("u", adu(unit, 3, random.choice((0, octets + 2, octets // 2, 255)), *some(random, octets)))
            bus.wait(random.uniform(20, 40))
    return bus, {}


def _ports(notes: dict[str, str], functions: Sequence[int], gap: float = 1.0) -> Edge:
    def make(random: Random) -> tuple[Bus, dict[str, str]]:
        bus = Bus(random)
        first = 0 if notes else random.choice((0, 1))
        polls = [request(random, random.randint(1, 5), functions) for _ in range(12)]
        for _ in range(40):
            asked = random.choice(polls)
            if random.random() < 0.3:
                asked = request(random, random.randint(1, 5), functions)
            bus.send("q", asked, first)
            bus.wait(gap * random.uniform(4, 20))
            bus.send("a", answer(random, asked, 0.0), 1 - first)
            bus.wait(gap * random.uniform(20, 60))
        return bus, notes

    return make


_KNOWN = {"directions": "request,response"}
for _name, _notes in (("known", _KNOWN), ("not known", {})):
    edge(f"two ports, directions {_name}, echoes of 05, 06, 16h", ("precise", "irq", "ftdi16"))(
        _ports(_notes, (5, 6, 22))
    )
    edge(f"two ports, directions {_name}, all functions", ("precise", "irq", "ftdi16"))(
        _ports(_notes, (1, 2, 3, 4, 5, 6, 15, 16, 22))
    )


def _vendor_line(functions: Sequence[int], share: float, broadcasts: float, zeros: float = 0.0) -> Edge:
    def make(random: Random) -> tuple[Bus, dict[str, str]]:
        bus, units = Bus(random, 38400), random.sample(range(1, 248), 4)
        polls = [request(random, random.choice(units)) for _ in range(6)]
        for _ in range(250):
            if random.random() >= share:
                healthy(bus, random, polls)
                continue
            function = random.choice(functions)
            quiet = random.random() < broadcasts
            unit = 0 if quiet else random.choice(units)
            bus.send("q", vendor(random, unit, function))
            if random.random() < zeros:
                bus.stray(bytes(random.randint(1, 2)))
            bus.wait(random.uniform(3, 20))
            if not quiet:
                bus.send("a", vendor(random, unit, function))
                if random.random() < zeros:
                    bus.stray(bytes(random.randint(1, 2)))
                bus.wait(random.uniform(8, 40))
        return bus, {}

    return make


_USER, _OTHER = (0x41, 0x42, 0x64), (0x29, 0x2A, 0x2D, 0x50)
edge("vendor line, user-defined functions", (*ALL_TAPS, "gateway"))(_vendor_line(_USER, 0.9, 0.5))
edge("vendor line, functions 29h to 50h", (*ALL_TAPS, "gateway"))(_vendor_line(_OTHER, 0.9, 0.5))
edge("vendor line, one function", ALL_TAPS)(_vendor_line((0x41,), 0.9, 0.5))
edge("vendor line, half of it", ALL_TAPS)(_vendor_line((*_USER, *_OTHER), 0.5, 0.2))
edge("vendor line, stray zeros", ALL_TAPS)(_vendor_line(_USER, 0.9, 0.5, 0.5))
