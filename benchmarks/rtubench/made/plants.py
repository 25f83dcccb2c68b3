"""Devices whose registers mean something, polled while a plant runs, for the track registers."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Iterator
from random import Random
from typing import NamedTuple

from ..items import Item, Row
from ..line import Client, Line, Unit, wire_of
from ..modbus import Memory, read
from ..taps import TAPS

Process = Callable[[int], float]  # a quantity at a turn of the poll


def measured(random: Random, scale: float) -> Process:
    """A measured quantity: a slow wave, drift and noise."""
    base, swing, period = random.uniform(0.3, 1.0), random.uniform(0.02, 0.3), random.uniform(20, 120)
    return lambda turn: scale * (base + swing * math.sin(turn / period) + random.gauss(0, 0.004))


def signed(random: Random, scale: float) -> Process:
    """A quantity of both signs: power that flows either way, a temperature in winter."""
    swing, period = random.uniform(0.3, 1.0), random.uniform(8, 40)
    return lambda turn: scale * (swing * math.sin(turn / period) + random.gauss(0, 0.02))


def counter(random: Random, scale: float) -> Process:
    """A counter that runs on at a rate that changes a little."""
    begin, rate = random.uniform(0.5, 1.0), random.uniform(0.0005, 0.005)
    return lambda turn: scale * (begin + rate * (turn + 0.3 * math.sin(turn / 9)))


def steps(random: Random, scale: float) -> Process:
    """A set point or a state, changed by hand now and then."""
    values = [round(scale * random.random()) for _ in range(4)]
    spans = sorted(random.sample(range(5, 110), 3))
    return lambda turn: values[sum(turn >= span for span in spans)]


class Kind(NamedTuple):
    """A type with what it often holds: the process and its scale."""

    type: str
    process: Callable[[Random, float], Process]
    scales: tuple[float, ...]


KINDS = (
    Kind("u16", measured, (240, 2500, 60000)), Kind("u16", steps, (9, 400)), Kind("i16", signed, (300, 9000)),
    Kind("u32", counter, (4e5, 3e7, 2e9)), Kind("i32", signed, (4e5, 3e6)), Kind("f32", measured, (1.0, 50.0, 4e4)),
    Kind("f32", signed, (10.0, 5000.0)), Kind("f32", counter, (900.0, 6e5)),
)  # fmt: skip
_LIMITS = {"u16": (0, 65535), "i16": (-32768, 32767), "u32": (0, 2**32 - 1), "i32": (-(2**31), 2**31 - 1)}


def words(kind: str, value: float, order: str) -> tuple[int, ...]:
    """A value as it stands in registers; `order` is big where the high one comes first."""
    if kind == "f32":
        octets = struct.pack(">f", value)
    else:
        low, high = _LIMITS[kind]
        octets = struct.pack(">i" if kind == "i32" else ">I" if kind == "u32" else ">h" if kind == "i16" else ">H",
                             min(max(round(value), low), high))  # fmt: skip
    told = struct.unpack(f">{len(octets) // 2}H", octets)
    return told if order == "big" else told[::-1]


def truth_of(unit: int, table: int, address: int, kind: str, order: str, seen: list[tuple[int, ...]]) -> Row:
    """What may be said of a value that showed these registers.

    It counts where it moved; of two registers, where the high one did, since else the data do not show that they belong
    together. An integer that was never negative may be of either sign.
    """
    one = len(seen[0]) == 1
    high = [told[0 if order == "big" else -1] for told in seen]
    types = {kind}
    if kind != "f32" and all(word < 0x8000 for word in high):
        types |= {"u16", "i16"} if one else {"u32", "i32"}
    return {"unit": unit, "table": table, "address": address, "types": sorted(types), "order": None if one else order,
            "counts": len(set(high)) > 1}  # fmt: skip


def items(seed: int, turns: int, devices: int) -> Iterator[Item]:
    """So many devices, each polled so many times."""
    for number in range(devices):
        random = Random(f"{seed} plant {number}")
        line, address, turn = Line(random, baud=19200), random.randint(1, 60), [0]
        order, table = random.choice(("big", "big", "little")), random.choice((3, 4))
        first = random.choice((0, 100, 1000, 4096))
        layout, at = list[tuple[int, Kind, Process]](), first
        while at < first + random.randint(16, 40):
            kind = random.choice(KINDS)
            layout.append((at, kind, kind.process(random, random.choice(kind.scales))))
            at += len(words(kind.type, 0, order)) + random.choice((0, 0, 0, 0, 1))
        shown: dict[int, list[tuple[int, ...]]] = {place: [] for place, _, _ in layout}
        memory = Memory(lambda _: 0)
        line.units = {address: Unit(address, memory)}

        def poll(_: Random, layout=layout, shown=shown, memory=memory, order=order, table=table, first=first,
                 size=at - first, turn=turn) -> bytes:  # fmt: skip
            turn[0] += 1
            for place, kind, process in layout:
                shown[place].append(words(kind.type, process(turn[0]), order))
                memory.written.update(enumerate(shown[place][-1], place))
            return read(table, first, size)

        sent = line.run([Client([(address, poll)], rest_ms=(900.0, 1000.0))], turns)
        if sent[-1].role == "request":  # its answer was not waited for
            for told in shown.values():
                told.pop()
        wire = list(wire_of(sent, line.char_ns))
        values = [truth_of(address, table, place, kind.type, order, shown[place]) for place, kind, _ in layout]
        yield Item(f"plant-{number}", "registers", "made", ("registers",), {"values": values}, line.baud,
                   line.char_bits, "fifo", {"reads": list(TAPS["fifo"](wire, random, line.char_ns))})  # fmt: skip
