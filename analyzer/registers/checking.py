"""A map against a capture: what is polled and not mapped, mapped and never polled, and what the values contradict.

A contradiction is only what the readings cannot be under the map: a number out of its range, a state without a name, a
sign or an order or a type that another reading explains beyond doubt.

Values out of their map's limits are among these, as plain records of evidence: whether it is a cause is judged
elsewhere.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Final, cast

import numpy as np

from dissectors.maps.model import MappedValue, RegisterMap
from dissectors.values import Order

from ..languages import register_words
from .hypotheses import Floats, numbers, patterns
from .inference import hypothesis_number, infer
from .looks import float_classes, is_absent
from .readings import BlockReadings, RegisterReadings, Words
from .roles import RegisterValue, is_signed
from .telling import place_words

_SURE: Final = 0.985  # confidence of another reading that contradicts a map, of several values
_LIKELY: Final = 0.7  # of one value, which is then asked for again in the light of all other rows of the map
_SURE_OF_ONE: Final = 0.95  # and then
_SEVERAL: Final = 3
_MOST_REPEATED: Final = 32  # values that are asked for again
_STEPS: Final = 4  # different readings, before their steps are judged
_ENOUGH: Final = 8  # changes, before a type is judged


KINDS: Final = ("contradiction", "request", "partial", "unmapped", "unpolled")
"""Of remarks; the worst first."""


@dataclass(frozen=True, slots=True)
class MapRemark:
    """Something about a map and a capture. `kind`: contradiction, request (that the device does not take), partial
    (asked for in part), unmapped (asked for, not in the map) or unpolled; `text` says it in the language in use."""

    kind: str
    unit: int
    area: str
    address: int
    words: int
    name: str
    text: str

    def to_json(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in self.__slots__}


def overlaps(chart: RegisterMap) -> list[str]:
    """Values of a map that share registers, in words; what reads the same ones in another way is another view."""
    lines = []
    rows = sorted((row for row in chart.rows), key=lambda row: (row.area, row.address, row.length))
    for low, after in pairwise(rows):
        if low.area == after.area and after.address < low.end and (low.address, low.end) != (after.address, after.end):
            place = place_words(low.area, after.address)
            words = "{place}: {inner!r} lies within {outer!r} ({first} to {last})"
            within = {"inner": after.name, "outer": low.name, "first": low.address, "last": low.end - 1}
            lines.append(register_words(words, place=place, **within))
        elif _reading_of(low) == _reading_of(after):
            words, place = "{place}: both {first!r} and {second!r}", place_words(low.area, low.address)
            lines.append(register_words(words, place=place, first=low.name, second=after.name))
    return lines


def _reading_of(row: MappedValue) -> tuple[object, ...]:
    """What is read, and how, whatever it is called."""
    return row.area, row.address, row.type, row.length, row.order, row.scale, row.offset, row.values, row.written_by


def check_map(readings: RegisterReadings, charts: Mapping[int, RegisterMap]) -> list[MapRemark]:
    """Remarks on the maps of these units, contradictions first."""
    remarks: list[MapRemark] = []
    for unit, chart in charts.items():
        blocks = [block for block in readings if block.unit == unit]
        if not blocks:
            continue
        for row in chart.rows:
            remarks += _contradictions(unit, row, blocks)
        remarks += _wrong_types(readings, unit, chart, blocks)
        remarks += _cuts(unit, chart, blocks)
        remarks += _coverage(unit, chart, blocks)
    return sorted(remarks, key=lambda remark: (KINDS.index(remark.kind), remark.unit, remark.area, remark.address))


def _contradictions(unit: int, row: MappedValue, blocks: Sequence[BlockReadings]) -> Iterator[MapRemark]:
    mine = _readings_of(row, blocks)
    if mine is not None:
        for text in _wrong(row, mine):
            yield MapRemark("contradiction", unit, row.area, row.address, row.length, row.name, text)


def _readings_of(row: MappedValue, blocks: Sequence[BlockReadings]) -> Words | None:
    """The readings (n, length) of a value, of the block that has most of it; None where none holds it whole."""
    block = max(
        (b for b in blocks if b.area == row.area and b.address <= row.address and row.end <= b.address + b.quantity),
        key=lambda b: b.count,
        default=None,
    )
    if block is None:
        return None
    at = row.address - block.address
    return block.series[0][:, at : at + row.length]


def _wrong(row: MappedValue, mine: Words) -> Iterator[str]:
    order = cast(Order, row.order)
    if row.area in ("coil", "discrete") or is_absent(mine):
        return
    if row.type == "text":
        octets = mine[-1].byteswap().tobytes().rstrip(b"\0 \xff")
        strange = sum(byte < 0x20 for byte in octets)
        if len(octets) > 3 and strange > len(octets) / 3:
            yield register_words("a text, but it holds {held}", held=" ".join(f"{word:04X}" for word in mine[-1][:4]))
        return
    if row.type == "enum":
        if row.values:
            states = {int(state) for state in np.unique(patterns(mine, order))}
            if strange_states := sorted(states - set(row.values))[:4]:
                yield register_words("states without a name: {states}", states=tuple(strange_states))
        return
    if row.type.startswith("bcd"):
        shifts = np.arange(0, 16 * row.length, 4, dtype=np.uint64)
        digits = patterns(mine, order)[:, None] >> shifts & np.uint64(15)
        if (digits > 9).any():
            yield register_words("BCD, but not all digits are decimal")
        return
    values = _scaled(row, mine)
    if row.is_float and not np.isfinite(values).all() and not np.isnan(values).all():
        yield register_words("a float that is infinite or not a number, now and then")
    yield from _beyond_limits(row, values)
    yield from _wrong_sign(row, mine)
    yield from _absurd(row, mine)


def _is_number(row: MappedValue, mine: Words) -> bool:
    """Whether readings are a number that has limits."""
    named = row.area in ("coil", "discrete") or row.type in ("text", "enum") or row.type.startswith("bcd")
    return not named and not is_absent(mine)


def _scaled(row: MappedValue, mine: Words) -> Floats:
    """Readings in the map's unit of measure."""
    values = numbers(mine, cast(Order, row.order), is_float=row.is_float, signed=row.is_signed)
    with np.errstate(all="ignore"):
        return values * row.scale + row.offset


def _beyond_limits(row: MappedValue, values: Floats) -> Iterator[str]:
    """What is said of numbers that lie out of the limits of the map."""
    values = values[np.isfinite(values)] if row.is_float else values
    if not len(values) or row.scale_address is not None:
        return
    slack = (
        abs(row.scale) * 0.51 if not row.is_float else 1e-6 * max(abs(row.minimum or 0), abs(row.maximum or 0), 1e-6)
    )
    if row.minimum is not None and values.min() < row.minimum - slack:
        seen = f"{values.min():g} {row.unit}".rstrip()
        yield register_words("{seen} is below its least value {limit:g}", seen=seen, limit=row.minimum)
    if row.maximum is not None and values.max() > row.maximum + slack:
        seen = f"{values.max():g} {row.unit}".rstrip()
        yield register_words("{seen} is over its greatest value {limit:g}", seen=seen, limit=row.maximum)


def _wrong_sign(row: MappedValue, mine: np.ndarray[Any, Any]) -> Iterator[str]:
    if row.is_float or row.type not in ("u16", "u32", "u64", "s16", "s32", "s64"):
        return
    series = patterns(mine, row.order)  # type: ignore[arg-type]
    top = np.uint64(1 << (16 * row.length - 1))
    over = series >= top
    if not over.any() or over.all():
        return
    if not row.is_signed and is_signed(series, row.length) and not _is_mark(series, over, top):
        below, above = int(series[over].max()) - 2 * int(top), int(series[~over].min())
        words = "unsigned, but it passes below zero ({below} and {above} were read)"
        yield register_words(words, below=below, above=above)
    if row.is_signed:
        near = np.abs(np.diff(series.astype(np.float64)))
        passes = (over[1:] != over[:-1]) & (near < float(top) / 4)
        if passes.any() and not is_signed(series, row.length):
            yield register_words("signed, but it passes {top} as if it were not", top=int(top))


def _is_mark(series: np.ndarray[Any, Any], over: np.ndarray[Any, Any], top: np.uint64) -> bool:
    """Whether what lies over the middle is all ones, once and then no more or the other way round: a counter that was
    full, a device that had no value yet."""
    ones = np.uint64(2 * int(top) - 1)
    return bool((series[over] == ones).all() and (over[1:] != over[:-1]).sum() < 2)


def _absurd(row: MappedValue, mine: Words) -> Iterator[str]:
    """What no value of this type does."""
    if hypothesis_number(row) is None or row.type in ("bits", "time") or not (mine != mine[0]).any():
        return
    order = cast(Order, row.order)
    if row.is_float:
        values = np.abs(numbers(mine, order, is_float=True))
        absurd = np.isfinite(values) & (values != 0) & ((values < 1e-15) | (values > 1e20))
        if absurd.sum() > 0.2 * np.count_nonzero(values):  # 0 is any type's
            words = "a float {order}, but it would be {value:.3g}"
            yield register_words(words, order=row.order, value=values[absurd][0])
        ways = len(np.unique(patterns(mine, order)[np.isnan(values)]))
        if ways >= _STEPS:  # a device that has no value says so in one way
            words = "a float {order}, but it would be no number in {ways} ways"
            yield register_words(words, order=row.order, ways=ways)
    elif row.length > 1:
        low = patterns(mine, order) & np.uint64(0xFFFF)
        if len(np.unique(patterns(mine, order))) >= _STEPS and (low == low[0]).all():
            words = "{mapped}, but it would move in steps of 65536 alone"
            yield register_words(words, mapped=f"{row.type} {row.order}")


def _wrong_types(
    readings: RegisterReadings, unit: int, chart: RegisterMap, blocks: Sequence[BlockReadings]
) -> Iterator[MapRemark]:
    """Values that are read otherwise beyond doubt: by themselves where several are, else with the rest of the map taken
    for right."""
    free = infer(readings, units=[unit], alone=True)
    doubtful = []
    for row in chart.rows:
        mine = None if hypothesis_number(row) is None else _readings_of(row, blocks)
        if mine is None or row.type in ("bits", "time", "enum") or row.area in ("coil", "discrete"):
            continue
        if int((mine[1:] != mine[:-1]).any(axis=1).sum()) < _ENOUGH or any(_absurd(row, mine)):
            continue
        rival = _rival_reading(row, free)
        if rival is None or rival.confidence < _LIKELY or _same_numbers(row, rival, blocks):
            continue
        if not _is_possible(row, rival, mine):
            doubtful.append((row, rival))
    sure = [pair for pair in doubtful if pair[1].confidence >= _SURE]
    for row, rival in doubtful[:_MOST_REPEATED] if len(sure) < _SEVERAL else sure:
        if len(sure) < _SEVERAL:
            rest = [
                one for one in chart.rows if one.area != row.area or one.end <= row.address or one.address >= row.end
            ]
            others = {unit: replace(chart, rows=tuple(rest))}
            again = infer(readings, units=[unit], charts=others, alone=True)
            confirmed = _rival_reading(row, again)
            if confirmed is None or confirmed.confidence < _SURE_OF_ONE:
                continue
            rival = confirmed
        mapped = f"{row.type} {row.order}" if row.length > 1 else row.type
        read = f"{rival.type} {rival.order}" if rival.order else rival.type
        words = "{mapped}, but the readings are those of a {read} at {at} ({sure:.1%})"
        text = register_words(words, mapped=mapped, read=read, at=rival.address, sure=rival.confidence)
        yield MapRemark("contradiction", unit, row.area, row.address, row.length, row.name, text)


def _rival_reading(row: MappedValue, values: Sequence[RegisterValue]) -> RegisterValue | None:
    """The first value that shares a register with a mapped one and is not read as the map has it."""
    for value in values:
        if value.area != row.area or value.address >= row.end or value.address + value.words <= row.address:
            continue
        same = (value.address, value.words, value.kind == "float") == (row.address, row.length, row.is_float)
        if same and value.order in (None, row.order):
            return None
        if value.name is None and value.changes >= _ENOUGH and max(value.words, row.length) > 1:
            return value
    return None


def _is_possible(row: MappedValue, rival: RegisterValue, mine: Words) -> bool:
    """Whether the readings (n, length) can well be what the map has, however likely a rival is.

    A whole number whose low word alone moved, without running over, is told from a register of its own by what is usual
    only, also where all of it goes back to nothing; so is a float of sizes that people measure from a whole number in
    the same registers.
    """
    if rival.kind == "float":
        return False
    if row.is_float:
        value = numbers(mine, cast(Order, row.order), is_float=True)[:, None]
        return (rival.address, rival.words, rival.order) == (row.address, row.length, row.order) and bool(
            float_classes(value)[0] <= 1
        )
    ordered = mine if row.order in ("ABCD", "BADC") else mine[:, ::-1]
    goes_on = ordered[1:].any(axis=1)  # else it begins again
    still = (ordered[1:] == ordered[:-1])[goes_on].all(axis=0)
    steps = np.abs(np.diff(ordered[:, -1].astype(np.int64)))[goes_on]
    return bool(still[:-1].all() and not still[-1] and (steps < 0x8000).all())


def _same_numbers(row: MappedValue, rival: RegisterValue, blocks: Sequence[BlockReadings]) -> bool:
    """Whether another reading of a whole number gives what the map has, as 16 bits beside a register at zero do."""
    order = cast(Order, {"BADC": "ABCD", "DCBA": "CDAB"}.get(rival.order or "", rival.order or "ABCD"))
    other = replace(row, address=rival.address, length=rival.words)
    mine, others = _readings_of(row, blocks), _readings_of(other, blocks)
    if row.is_float or rival.kind == "float" or mine is None or others is None or len(mine) != len(others):
        return False
    numbers_of_map = numbers(mine, cast(Order, row.order), is_float=False, signed=row.is_signed)
    return bool((numbers_of_map == numbers(others, order, is_float=False, signed=rival.signed)).all())


def _cuts(unit: int, chart: RegisterMap, blocks: Sequence[BlockReadings]) -> Iterator[MapRemark]:
    """Values of which every request that touches them asks for a part alone."""
    for row in chart.rows:
        if row.length == 1 or row.type == "text":
            continue
        touching = [
            b for b in blocks if b.area == row.area and b.address < row.end and row.address < b.address + b.quantity
        ]
        if touching and not any(b.address <= row.address and row.end <= b.address + b.quantity for b in touching):
            b = touching[0]
            words = "takes {length} registers, but it is asked for in part only ({first} to {last})"
            text = register_words(words, length=row.length, first=b.address, last=b.address + b.quantity - 1)
            yield MapRemark("partial", unit, row.area, row.address, row.length, row.name, text)


def _coverage(unit: int, chart: RegisterMap, blocks: Sequence[BlockReadings]) -> Iterator[MapRemark]:
    mapped = {(row.area, address) for row in chart.rows for address in range(row.address, row.end)}
    polled = {(b.area, address) for b in blocks for address in range(b.address, b.address + b.quantity)}
    used = {(b.area, b.address + at) for b in blocks for at in np.flatnonzero(b.greatest).tolist()}
    for area, first, last in _stretches(polled - mapped):
        always = not any((area, address) in used for address in range(first, last + 1))
        words = "asked for, but not in the map: always 0" if always else "asked for, but not in the map"
        yield MapRemark("unmapped", unit, area, first, last - first + 1, "", register_words(words))
    for row in chart.rows:
        if not any((row.area, address) in polled for address in range(row.address, row.end)):
            text = register_words("in the map, but never asked for")
            yield MapRemark("unpolled", unit, row.area, row.address, row.length, row.name, text)


def _stretches(registers: set[tuple[Any, int]]) -> Iterator[tuple[str, int, int]]:
    """Neighbouring addresses as (area, first, last)."""
    begin: tuple[str, int] | None = None
    before: tuple[str, int] | None = None
    for register in sorted(registers):
        if before is None or begin is None or register != (before[0], before[1] + 1):
            if begin is not None and before is not None:
                yield begin[0], begin[1], before[1]
            begin = register
        before = register
    if begin is not None and before is not None:
        yield begin[0], begin[1], before[1]


@dataclass(frozen=True, slots=True)
class LimitBreach:
    """A mapped value that was seen beyond its least or greatest value, in words."""

    unit: int
    text: str


def limit_breaches(readings: RegisterReadings, charts: Mapping[int, RegisterMap]) -> list[LimitBreach]:
    """The values that their maps do not allow, by unit and address."""
    return [
        LimitBreach(unit, f"{row.name}: {text}")
        for unit, chart in sorted(charts.items())
        if (blocks := [block for block in readings if block.unit == unit])
        for row in sorted(chart.rows, key=lambda row: (row.area, row.address))
        if (mine := _readings_of(row, blocks)) is not None and _is_number(row, mine)
        for text in _beyond_limits(row, _scaled(row, mine))
    ]
