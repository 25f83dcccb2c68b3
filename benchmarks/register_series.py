"""Devices with maps and what their registers were: the truth on which inference is fitted and scored.

Layouts are the shipped maps, those in `layouts/` and those that others published (`register_layouts`); a family is a
maker, or what the header of a layout says. Each device is made anew from a layout: moved to other addresses, sometimes
with the other word order.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence, Set
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from random import Random
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray
from register_layouts import published_layouts
from register_plants import by_another_hand

from analyzer.registers.hypotheses import HYPOTHESES
from analyzer.registers.readings import RegisterReadings
from analyzer.simulation.mapped import series
from analyzer.simulation.mapped.client import MappedClient
from analyzer.simulation.mapped.device import MappedDevice
from dissectors.maps import RegisterMap, read_map, shipped_map, shipped_names
from dissectors.maps.model import MapArea, MappedValue
from dissectors.values import Order, integer, registers_of

LAYOUTS = Path(__file__).parent / "layouts"
_NEAR = 40  # registers between values that are one part of a device
_POLLS = (12, 25, 60, 60, 60, 150)
OTHER_ORDER = {"ABCD": "CDAB", "CDAB": "ABCD"}


def layouts() -> dict[str, RegisterMap]:
    """All layouts by name."""
    found = {name: shipped_map(name) for name in shipped_names()}
    return found | {path.stem: read_map(path) for path in sorted(LAYOUTS.glob("*.csv"))} | published_layouts()


def family(chart: RegisterMap) -> str:
    """The maker, or what the layout says that it is."""
    return (chart.other.get("family") or chart.vendor or chart.device).lower()


@dataclass(frozen=True, slots=True)
class MadeDevice:
    """A device of which the readings are there, and of each polled block the values that it holds."""

    name: str
    family: str
    order: str
    readings: RegisterReadings
    truth: tuple[tuple[MapArea, int, int, tuple[MappedValue, ...]], ...]  # area, address, quantity


def made_device(
    name: str,
    chart: RegisterMap,
    random: Random,
    polls: int,
    *,
    flip: float = 0.0,
    widen: float = 0.0,
    refine: float = 0.0,
    stir: float = 0.0,
    another: float = 0.0,
    move: bool = True,
    wild: float = 0.2,
    sisters: int = 0,
) -> MadeDevice:
    """A device of this layout, polled so many times; of chances `flip` has the other word order, `widen` and `refine`
    wider and finer integers, `stir` those of 32 bits go over their carries, `another` series of another hand; at other
    addresses unless told not to `move`; `wild` of its values do what nobody expects. It is unit 1; so many `sisters`
    of it, read alike, are the units behind it."""
    if random.random() < refine:
        chart = refined(chart, random)
    if random.random() < flip:
        chart = reordered(chart)
    if random.random() < widen:
        chart = widened(chart, random)
    if move:
        chart = moved(chart, random)
    client = MappedClient(random, [(1, chart)], wild)
    device = client.devices[0]
    if random.random() < another:
        by_another_hand(device, random)
    if random.random() < stir:
        stir_up(device, random)
    polled = {(poll.area, poll.address, poll.quantity): None for poll in client.polls}
    readings = RegisterReadings()
    _read(device, polled, polls, readings)
    for unit in range(2, 2 + sisters):
        level, seconds = device.response_ns, device.seconds
        sister = MappedDevice(unit, chart, level, seconds, random, wild)
        if random.random() < another:
            by_another_hand(sister, random)
        _read(sister, polled, polls, readings)
    truth = []
    for area, address, quantity in polled:
        if area in ("input", "holding"):
            rows_of_block = chart.within(area, address, quantity)
            truth.append((area, address, quantity, tuple(part for row in rows_of_block for part in _parts(row))))
    return MadeDevice(name, family(chart), chart.word_order, readings, tuple(truth))


def _read(
    device: MappedDevice, polled: Iterable[tuple[MapArea, int, int]], polls: int, readings: RegisterReadings
) -> None:
    """Enter what so many polls of a device say."""
    blocks: dict[tuple[MapArea, int, int], list[list[int]]] = {block: [] for block in polled}
    for _ in range(polls):
        device.step()
        _in_forms(device)
        for area, address, quantity in blocks:
            blocks[area, address, quantity].append(device.read(area, address, quantity))
    for (area, address, _), rows in blocks.items():
        if area in ("input", "holding"):
            readings.put(device.unit, area, address, np.array(rows, np.uint16))


def stir_up(device: MappedDevice, random: Random) -> None:
    """Let most of the integers of 32 bits move in ways that take both of their words along."""
    for at, (row, _) in enumerate(device.motions):
        if row.type in ("u32", "s32") and row.length == 2 and random.random() < 0.7:
            raw = _restless(random, signed=row.is_signed)
            device.motions[at] = row, (number * row.scale + row.offset for number in raw)


def _restless(random: Random, *, signed: bool) -> series.Series:
    """Whole numbers over 65535: walks, scatter, fast counters, and what goes to and fro over a carry or zero."""
    level = 10 ** random.uniform(4.9, 9.2)
    match random.choice(("walk", "scatter", "count", "carry", "carry")):
        case "walk":
            reach = min(level / 3, 10 ** random.uniform(4.3, 7.5))
            return series.motion(random, level, reach, wild=True)
        case "scatter":
            return series.noise(random, level, level * 10 ** random.uniform(-2.2, -0.6))
        case "count":
            return series.counter(random, level, 10 ** random.uniform(2.5, 6))
    about = 0x10000 * (0 if signed and random.random() < 0.5 else random.randrange(1, random.choice((3, 40, 4000))))
    reach = 10 ** random.uniform(0.5, 4)
    return series.motion(random, about + random.uniform(-1, 1) * reach / 2, reach, wild=True)


def _in_forms(device: MappedDevice) -> None:
    """Put the values that a layout has in a form of its own as that has them: `sign` and magnitude, or `split N` in
    two registers that count to N."""
    for row in device.chart.rows:
        form, _, base = row.other.get("form", "").partition(" ")
        if not form:
            continue
        words = [device.words[row.area, register] for register in range(row.address, row.end)]
        order = cast(Order, row.order)
        number = int(integer(words, order, signed=row.is_signed))
        if form == "sign" and number < 0:
            top = 1 << 16 * row.length - 1
            words = registers_of((top | min(-number, top - 1)).to_bytes(2 * row.length, "big"), order)
        elif form == "split":
            words = [number // int(base) & 0xFFFF, number % int(base)]
            words = words if row.order == "ABCD" else words[::-1]
        for register, word in enumerate(words, row.address):
            device.words[row.area, register] = word


def _parts(row: MappedValue) -> Iterator[MappedValue]:
    """A row, or the two registers of one that is split."""
    if not row.other.get("form", "").startswith("split"):
        yield row
        return
    for offset in range(row.length):
        yield replace(row, address=row.address + offset, name=f"{row.name} {offset}", type="u16", length=1)


def moved(chart: RegisterMap, random: Random) -> RegisterMap:
    """The same values at other addresses."""
    shifts: dict[str, int] = {}
    for area in ("input", "holding"):
        rows = [row for row in chart.rows if row.area == area]
        if rows:
            lowest, highest = min(row.address for row in rows), max(row.end for row in rows)
            shifts[area] = random.randint(-lowest, 0x10000 - highest)
    return replace(chart, rows=tuple(replace(row, address=row.address + shifts.get(row.area, 0)) for row in chart.rows))


def reordered(chart: RegisterMap) -> RegisterMap:
    """The same values with the other word order."""
    return replace(
        chart,
        word_order=OTHER_ORDER.get(chart.word_order, chart.word_order),
        rows=tuple(replace(row, order=OTHER_ORDER.get(row.order, row.order)) for row in chart.rows),
    )


def widened(chart: RegisterMap, random: Random) -> RegisterMap:
    """The same with 64-bit values in place of those of 32 bits, all or some; what follows moved up."""
    part = random.choice((0.2, 0.5, 1.0))
    rows, shift = [], {"input": 0, "holding": 0}
    wider = {"u32": "u64", "s32": "s64", "f32": "f64"}
    for row in sorted(chart.rows, key=lambda row: row.address):
        if row.area in shift:
            kind = wider.get(row.type, row.type) if random.random() < part else row.type
            moved_row = replace(row, address=row.address + shift[row.area], type=kind)
            if kind != row.type:
                moved_row = replace(moved_row, length=4)
                shift[row.area] += 2
            if moved_row.end <= 0x10000:
                rows.append(moved_row)
    return replace(chart, rows=tuple(rows))


def refined(chart: RegisterMap, random: Random) -> RegisterMap:
    """The same with 32-bit integers in finer steps, so that both of their words move."""
    rows = (
        replace(row, scale=row.scale / random.choice((10, 100, 1000)))
        if row.type in ("u32", "s32") and random.random() < 0.7 else row
        for row in chart.rows
    )  # fmt: skip
    return replace(chart, rows=tuple(rows))


def composed(charts: Sequence[RegisterMap], random: Random) -> RegisterMap:
    """A device made of parts of several others, as controllers and gateways gather them: neighbouring values of each,
    one part behind the other, mostly of one word order."""
    rows: list[MappedValue] = []
    order, end = random.choice(("ABCD", "CDAB")), 0
    for number in range(random.randint(2, 5)):
        chart = random.choice(charts)
        if chart.word_order != order and random.random() < 0.9:
            chart = reordered(chart)
        area = random.choice([row.area for row in chart.rows])
        own = sorted((row for row in chart.rows if row.area == area), key=lambda row: row.address)
        begin = random.randrange(len(own))
        near = (at for at, (row, after) in enumerate(pairwise(own[begin:]), 1) if after.address - row.end > _NEAR)
        part = own[begin : begin + min(random.randint(2, 14), next(near, len(own)))]
        shift = end + random.choice((0, 0, 0, 1, 2, 10)) - part[0].address
        rows += [
            replace(row, area="holding", address=row.address + shift, name=f"{row.name} {number}", scale_address=None)
            for row in part
        ]
        end = max(row.end for row in rows)
    return RegisterMap("composed", tuple(rows), word_order=order)


def number_of(row: MappedValue) -> int:
    """The hypothesis that is true of a value; texts and what nobody infers are single registers (0)."""
    for number, hypothesis in enumerate(HYPOTHESES):
        fits = hypothesis.words == row.length and hypothesis.is_float == row.is_float and row.type != "text"
        if fits and hypothesis.order in (None, row.order):
            return number
    return 0


def true_cut(address: int, quantity: int, rows: tuple[MappedValue, ...]) -> NDArray[np.int64]:
    """The true segments of a block: (register, hypothesis) a row; what is not listed is single registers."""
    cut, at = [], 0
    starts = {row.address - address: row for row in rows}
    while at < quantity:
        row = starts.get(at)
        number = number_of(row) if row is not None else 0
        cut.append((at, number))
        at += HYPOTHESES[number].words
    return np.array(cut)


def devices(seeds: range, polls: int, thin: int = 1, **chances: Any) -> Iterator[MadeDevice]:
    """Devices of all layouts, or of each `thin`-th, once a seed; `chances` are those of `made_device`, `flip` 0.3."""
    chances = {"flip": 0.3, **chances}
    for name, chart in list(layouts().items())[::thin]:
        for seed in seeds:
            yield made_device(name, chart, Random(f"{name} {seed}"), polls, **chances)


def composed_devices(count: int, without: Set[str] = frozenset()) -> Iterator[MadeDevice]:
    """Devices made of parts of layouts, those of some families left out, polled seldom and often."""
    charts = [chart for chart in layouts().values() if family(chart) not in without]
    charts = [chart for chart in charts if any(row.area in ("input", "holding") for row in chart.rows)]
    charts = [
        replace(chart, rows=tuple(row for row in chart.rows if row.area in ("input", "holding"))) for chart in charts
    ]
    for number in range(count):
        random = Random(f"composed {number}")
        polls = random.choice(_POLLS)
        chart = composed(charts, random)
        yield made_device(f"composed {number}", chart, random, polls, widen=0.05, stir=0.2, another=0.5)
