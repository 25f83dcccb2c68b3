"""What values say of trouble: frozen ones, counters that fall for a moment, word orders against sister units, numbers
out of a map's limits. Plain records of evidence; whether it is a cause is judged elsewhere.

Said only of what a healthy device does not do. A tank that empties, a daily counter that begins anew, a machine at
rest: none of these is told from a fault by its values alone, so none is named.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, cast

import numpy as np
from numpy.typing import NDArray

from dissectors.maps.model import RegisterMap
from dissectors.values import Order

from .checking import check_map
from .hypotheses import numbers
from .inference import infer
from .readings import BlockReadings, RegisterReadings
from .values import RegisterValue

Floats = NDArray[np.float64]
_LEAST_ROWS: Final = 60  # of a block, before anything is said
_LIVELY: Final = 0.6  # share of the readings at which a value changed while it lived
_STILL_ROWS: Final = 24
_STILL_SHARE: Final = 0.15  # of the time
_TOGETHER: Final = 3  # lively registers of a unit that stop at once
_RISES: Final = 40  # of a counter
_FALLS: Final = 3
_FALLS_FOR: Final = 2  # readings
_STEEP: Final = 8.0  # times the greatest rise
_SURE: Final = 0.95
_SAME_VALUES: Final = 2  # values of a unit in the other order
_TORN: Final = 1 << 16
_CARRIES: Final = 20


@dataclass(frozen=True, slots=True)
class ValueTrouble:
    """Evidence of one trouble. `kind`: frozen, falls, word-order or limits; `units` the one concerned first; `count`
    readings or registers that show it, of `looked`; `bits` how much likelier they are with the trouble than without;
    `since_ns` when it began, None where that is not known; `text` for people."""

    kind: str
    units: tuple[int, ...]
    area: str
    address: int
    words: int
    count: int
    looked: int
    bits: float
    since_ns: int | None
    text: str


def value_troubles(
    readings: RegisterReadings,
    charts: Mapping[int, RegisterMap] | None = None,
    values: Sequence[RegisterValue] | None = None,
) -> list[ValueTrouble]:
    """The troubles that values show, by unit; `values` are what was inferred, where that is known already."""
    found = list(_frozen(list(readings)))
    values = infer(readings, charts=charts) if values is None else values
    found += _falls(list(readings), values)
    found += _orders(values)
    for remark in check_map(readings, charts or {}):
        if remark.kind == "contradiction" and ("least value" in remark.text or "greatest value" in remark.text):
            text = f"unit {remark.unit}: {remark.name}: {remark.text}"
            found.append(
                ValueTrouble(
                    "limits", (remark.unit,), remark.area, remark.address, remark.words, 1, 1, 30.0, None, text
                )
            )
    return sorted(found, key=lambda trouble: (trouble.units, trouble.area, trouble.address, trouble.kind))


def _frozen(blocks: Sequence[BlockReadings]) -> Iterator[ValueTrouble]:
    """Units all of whose lively registers stop at one moment, at values that are no zeros, and are still read."""
    for unit in sorted({block.unit for block in blocks}):
        stops: list[tuple[int, BlockReadings, int, int]] = []  # since, block, column, rows still
        alive = 0
        for block in blocks:
            if block.unit != unit or block.written or block.area not in ("input", "holding"):
                continue
            for column, last, lively in _lives(block):
                rows = len(block.apart) - 1 - last
                still = rows >= max(_STILL_ROWS, _STILL_SHARE * len(block.apart))
                alive += lively and not still
                if lively and still:
                    stops.append((int(block.times[last]), block, column, rows))
        if alive or len(stops) < _TOGETHER:
            continue
        since = min(stop[0] for stop in stops)
        cycle = max(int(np.median(np.diff(stop[1].times))) for stop in stops)
        held = [stop for stop in stops if stop[1].last[stop[2]] not in (0, 0xFFFF, 0x7FFF, 0x8000)]
        until = max(stop[0] for stop in stops)
        if until - since > 3 * cycle or len(held) < _TOGETHER:
            continue
        _, block, column, rows = held[0]
        text = (
            f"unit {unit}: {len(stops)} registers that changed at nearly every reading stopped at one moment and have "
            f"been the same for {rows} readings"
        )
        address = block.address + column
        yield ValueTrouble(
            "frozen", (unit,), block.area, address, 1, len(stops), len(stops), float(min(rows, 60)), until, text
        )


def _lives(block: BlockReadings) -> Iterator[tuple[int, int, bool]]:
    """Of each register that moved: its column, the row of its last change, whether it was lively until then."""
    if len(block.apart) < _LEAST_ROWS:
        return
    moves = block.apart[1:] != block.apart[:-1]
    for column in np.flatnonzero(moves.any(axis=0)).tolist():
        last = int(np.flatnonzero(moves[:, column])[-1]) + 1
        yield column, last, last >= _STILL_ROWS and float(moves[:last, column].mean()) >= _LIVELY


def _falls(blocks: Sequence[BlockReadings], values: Sequence[RegisterValue]) -> Iterator[ValueTrouble]:
    """Counters that fall for a reading or two and go on from where they were: torn reads, or another's answer."""
    torn = {(one.units[0], one.area, one.address + n): one for block in blocks for one in _torn(block) for n in (0, 1)}
    yield from dict.fromkeys(torn.values())
    for value in values:
        if value.kind not in ("int", "float") or value.changes < _RISES or value.confidence < _SURE:
            continue
        if any((value.unit, value.area, value.address + n) in torn for n in range(value.words)):
            continue
        inside = [
            b for b in blocks
            if (b.unit, b.area, b.written) == (value.unit, value.area, False)
            and b.address <= value.address and value.address + value.words <= b.address + b.quantity
        ]  # fmt: skip
        block = max(inside, key=lambda b: b.count, default=None)
        if block is None or len(block.apart) < _LEAST_ROWS:
            continue
        at = value.address - block.address
        words, order = block.apart[:, at : at + value.words], cast(Order, value.order or "ABCD")
        series = numbers(words, order, is_float=value.kind == "float", signed=value.signed)
        falls = _momentary_falls(series)
        if falls:
            yield _fall(block, at, value.words, series, falls, value.name, "")


def _torn(block: BlockReadings) -> Iterator[ValueTrouble]:
    """Pairs of registers that are one counter of which the words were now and then read at two moments."""
    rows = block.apart
    if len(rows) < _LEAST_ROWS or block.written or block.area not in ("input", "holding"):
        return
    changes = (rows[1:] != rows[:-1]).sum(axis=0)
    for at in range(block.quantity - 1):
        for order in ("ABCD", "CDAB"):
            high, low = (at, at + 1) if order == "ABCD" else (at + 1, at)
            if not 1 <= changes[high] <= _CARRIES or changes[low] < _RISES:
                continue
            series = numbers(rows[:, at : at + 2], order, is_float=False)
            falls = _momentary_falls(series)
            if falls and all(abs(series[n] - series[n + 1] - _TORN) < 0.05 * _TORN for n in falls):
                yield _fall(block, at, 2, series, falls, None, f": its words ({order}) are of two moments")


def _fall(
    block: BlockReadings, at: int, words: int, series: Floats, falls: list[int], name: str | None, why: str
) -> ValueTrouble:
    address, place = block.address + at, falls[0]
    called = name or f"{block.area} {address}"
    text = (
        f"unit {block.unit}: {called} only rises, but fell from {series[place]:.10g} to {series[place + 1]:.10g} "
        f"for a moment{why}"
    )
    moment = int(block.times[place + 1])
    return ValueTrouble("falls", (block.unit,), block.area, address, words, len(falls), len(series), 30.0, moment, text)


def _momentary_falls(series: Floats) -> list[int]:
    """Places before falls of a series that rises but for a few readings; empty where it is no such series."""
    steps = np.diff(series)
    falls = np.flatnonzero(steps < 0)
    rises = steps[steps > 0]
    if not 1 <= len(falls) <= _FALLS or len(rises) < _RISES:
        return []
    back = [int(np.argmax(series[fall + 1 :] >= series[fall])) if (series[fall + 1 :] >= series[fall]).any() else -1
            for fall in falls.tolist()]  # fmt: skip
    if any(not 1 <= rows <= _FALLS_FOR for rows in back):
        return []
    kept = np.ones(len(series), np.bool_)
    for fall, rows in zip(falls.tolist(), back, strict=True):
        kept[fall + 1 : fall + 1 + rows] = False
    usual = np.diff(series[kept])
    steep = all(-steps[fall] > _STEEP * max(float(usual.max()), 1e-12) for fall in falls.tolist())
    return falls.tolist() if steep and (usual >= 0).all() else []


def _orders(values: Sequence[RegisterValue]) -> Iterator[ValueTrouble]:
    """Units whose values have the other word order than those of sisters that are asked for the same."""
    sure = [v for v in values if v.order and v.changes and v.confidence >= _SURE and v.kind in ("int", "float")]
    of_unit: dict[int, dict[tuple[str, int, int, str], RegisterValue]] = {}
    for value in sure:
        of_unit.setdefault(value.unit, {})[value.area, value.address, value.words, value.kind] = value
    for unit, mine in of_unit.items():
        against: dict[int, int] = {}
        for sister, others in of_unit.items():
            both = [key for key in mine if key in others]
            different = [key for key in both if mine[key].order != others[key].order]
            if sister != unit and len(both) >= _SAME_VALUES and len(different) == len(both):
                against[sister] = len(different)
        alike = sum(
            1 for sister, others in of_unit.items()
            if sister != unit and any(key in others and mine[key].order == others[key].order for key in mine)
        )  # fmt: skip
        if len(against) < 2 or alike:  # of two alone nobody can say which is wrong
            continue
        first = min(mine.values(), key=lambda value: (value.area, value.address))
        other = "CDAB" if first.order == "ABCD" else "ABCD"
        count = min(against.values())
        text = (
            f"unit {unit} gives its 32-bit values in word order {first.order}, units "
            f"{', '.join(map(str, sorted(against)))} the same registers in {other}"
        )
        yield ValueTrouble(
            "word-order", (unit, *sorted(against)), first.area, first.address, first.words, count, len(mine),
            12.0 * count, None, text,
        )  # fmt: skip
