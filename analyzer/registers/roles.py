"""What is said of a value whose registers stand: its place, its reading, its kind and role, how sure, and why.

Kind and role are what its readings look like to an engineer. Relations are sums, and powers of voltage and current,
within a block; said beside a reading, as its support. A relation holds where it explains nearly all of a value's
motion, by a factor that scales make (a power of ten). A wrong reading of registers has none: so a relation is evidence
that cannot come about by chance.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from dissectors.maps.model import MapArea, json_number

from ..languages import register_words
from .hypotheses import HYPOTHESES
from .runs import Cut

Number = int | float | str | None


@dataclass(frozen=True, slots=True)
class OtherReading:
    """What else it may be: a reading that shares a register with the answer."""

    address: int
    words: int
    kind: str
    order: str | None
    confidence: float

    @property
    def called(self) -> str:
        """Type and order, as `u32 ABCD`; of an integer the unsigned type."""
        return f"{'f' if self.kind == 'float' else 'u'}{16 * self.words} {self.order or ''}".strip()

    def to_json(self) -> dict[str, Any]:
        return {name: json_number(getattr(self, name)) for name in self.__slots__}


@dataclass(frozen=True, slots=True)
class RegisterValue:
    """A value of `words` registers from `address` on (zero-based).

    `kind` is int, float, bits, enum, text, time, bcd, constant or unknown; `order` None of one register; `confidence`
    from 0 to 1; `bits` the log2 odds over `runner_up`; `minimum`, `maximum` and `last` are numbers as the registers
    hold them, or a text. `name`, `scale` and `unit_of_measure` come from a map. `related` are the addresses of those
    whose sum or product it is; `why` says which of the two. `same_number` are readings of another width that give the
    same numbers, likeliest first: their further high words have always been zero.
    """

    unit: int
    area: MapArea
    address: int
    words: int
    kind: str
    signed: bool
    order: str | None
    role: str | None
    confidence: float
    bits: float
    why: str
    readings: int
    changes: int
    minimum: Number
    maximum: Number
    last: Number
    runner_up: OtherReading | None = None
    name: str | None = None
    scale: float | None = None
    unit_of_measure: str | None = None
    related: tuple[int, ...] = ()
    same_number: tuple[OtherReading, ...] = ()

    @property
    def number_confidence(self) -> float:
        """How sure its numbers are, whatever its width is."""
        return min(1.0, self.confidence + sum(other.confidence for other in self.same_number))

    @property
    def type(self) -> str:
        """The type as a map names it: u16, s32, f32, text ..."""
        width = 16 * self.words
        match self.kind:
            case "float":
                return f"f{width}"
            case "bcd":
                return f"bcd{width}"
            case "bits" if self.area in ("coil", "discrete"):
                return "bool"
            case "bits" | "enum" | "text" | "time":
                return self.kind
            case _:
                return f"{'s' if self.signed else 'u'}{width}"

    @property
    def key(self) -> tuple[int, str, int]:
        """Where it is: unit, area, address."""
        return self.unit, self.area, self.address

    def to_json(self) -> dict[str, Any]:
        """The line of `rtuscope registers --json`."""
        line: dict[str, Any] = {}
        for slot in self.__slots__:
            value = getattr(self, slot)
            if isinstance(value, OtherReading):
                value = value.to_json()
            elif slot == "same_number":
                value = [other.to_json() for other in self.same_number]
            line[{"minimum": "min", "maximum": "max"}.get(slot, slot)] = json_number(value)
        return line


Floats = NDArray[np.float64]
_ENOUGH: Final = 20  # readings, before states are told from numbers
_STATES: Final = 8
EPOCH: Final = (1.0e9, 4.2e9)  # seconds since 1970 that a clock may say
_YEAR_S: Final = 366 * 86_400.0
_UNDATED_S: Final = 120.0
_RATE: Final = (0.99, 1.01)


def is_signed(series: NDArray[np.uint64], words: int) -> bool:
    """Whether readings are more narrow about zero as signed numbers, or are all slightly below it."""
    width = 16 * words
    top = np.uint64(1 << (width - 1))
    over = series >= top
    if not over.any():
        return False
    if over.all():
        return bool(series.min() >= np.uint64((1 << width) - (1 << (width - 4))))
    half = 1 << (width - 2)
    return bool((series[over] >= np.uint64((1 << width) - half)).all() and (series[~over] < np.uint64(half)).all())


def is_bits(series: NDArray[np.uint64]) -> bool:
    """Whether single bits were set and cleared, high ones among them, or each by itself among states far apart."""
    flips = series[1:] ^ series[:-1]
    flips = flips[flips > 0]
    if len(flips) < 3 or len(flips) > 0.5 * len(series):
        return False
    single = (flips & (flips - np.uint64(1))) == 0
    high = single & (flips >= np.uint64(8))
    states = np.unique(series)
    apart = high.mean() >= 0.5 or _are_combined(states)
    return bool(single.mean() >= 0.9 and apart and len(states) <= 2 * _STATES)


def _are_combined(states: NDArray[np.uint64]) -> bool:
    """Whether a state is two others at once, in states that are no count from 0 on."""
    some = states[states > 0]
    both = (some[:, None] | some)[(some[:, None] & some) == 0]
    return bool((states[-1] >= 2 * len(states)) & np.isin(both, some).any())


def is_enum(series: NDArray[np.uint64]) -> bool:
    """Whether it holds one of a few small states and jumps between them."""
    if len(series) < _ENOUGH:
        return False
    states = np.unique(series)
    steps = np.abs(np.diff(series.astype(np.int64)))
    changed = steps > 0
    if len(states) > _STATES or states[-1] >= 64 or changed.mean() > 0.35:
        return False
    return bool(changed.sum() >= 3 and (steps[changed] > 1).mean() >= 0.4)


def is_bcd(series: NDArray[np.uint64], words: int) -> bool:
    """Whether all digits are decimal, and the readings run more smoothly when read so."""
    digits = (series[:, None] >> np.arange(0, 16 * words, 4, dtype=np.uint64)) & np.uint64(15)
    if (digits > 9).any() or len(np.unique(series)) < 12 or series.max() < 16:
        return False
    decimal = (digits * np.array([10**digit for digit in range(4 * words)], np.uint64)).sum(axis=1)
    jumps, smooth = np.abs(np.diff(series.astype(np.float64))), np.abs(np.diff(decimal.astype(np.float64)))
    crossed = (digits[1:, 1:] != digits[:-1, 1:]).any(axis=1)
    return bool(crossed.sum() >= 3 and jumps.sum() > 1.25 * smooth.sum())


def is_clock(series: NDArray[np.uint64], begin_ns: int, end_ns: int) -> bool:
    """Whether it counts seconds since 1970, as fast as the time passes from `begin_ns` to `end_ns`.

    Many a counter grows by about one a second for a while: where the capture knows the date itself, a clock is within
    a year of it; where it does not, some minutes tell.
    """
    first, last = float(series[0]), float(series[-1])
    seconds = (end_ns - begin_ns) / 1e9
    if not (EPOCH[0] <= first <= EPOCH[1] and seconds > 0):
        return False
    dated = begin_ns / 1e9 >= EPOCH[0]
    if (dated and abs(first - begin_ns / 1e9) > _YEAR_S) or (not dated and seconds < _UNDATED_S):
        return False
    return _RATE[0] * seconds - 2 <= last - first <= _RATE[1] * seconds + 2


def is_counter(numbers: Floats) -> bool:
    """Whether it only grows, a fall to nothing or a turn over excepted."""
    steps = np.diff(numbers)
    up, down = (steps > 0).sum(), (steps < 0).sum()
    return bool(up >= 3 and down <= up // 50)


def role_of(kind: str, numbers: Floats, *, moved: bool, written: bool) -> str | None:
    """measurement, counter, setpoint, status; None where nothing can be said."""
    if written:
        return "setpoint"
    if not moved:
        return None
    if kind in ("bits", "enum"):
        return "status"
    if kind in ("text", "time"):
        return None
    return "counter" if is_counter(numbers) else "measurement"


SeriesKey = tuple[int, str, int]  # unit, area, address
_LEAST_READINGS: Final = 12
_MOST_VALUES: Final = 80  # of a block
_SANE: Final = 1e15  # beyond this no reading is a quantity
_LEFT: Final = 1e-3  # share of a value's variance that a sum may leave
_PRODUCT_LEFT: Final = 0.02
_BETTER: Final = 0.2  # of what the current alone leaves, a product may leave
_TOGETHER: Final = 0.97  # correlation of a power and its current
_TERMS: Final = (2, 3)


def with_relations(
    values: Sequence[RegisterValue], series: Mapping[SeriesKey, tuple[int, Floats]]
) -> list[RegisterValue]:
    """The values, those with a relation saying so; `series` are readings of values that moved, with their block."""
    blocks: dict[int, list[RegisterValue]] = {}
    for value in values:
        key = value.key
        if key in series and value.kind in ("int", "float"):
            blocks.setdefault(series[key][0], []).append(value)
    relations: dict[SeriesKey, _Relation] = {}
    for members in blocks.values():
        members = members[:_MOST_VALUES]
        table = np.stack([series[v.key][1] for v in members], axis=1)
        sane = np.flatnonzero(np.abs(np.nan_to_num(table, nan=np.inf)).max(axis=0) < _SANE)
        members, table = [members[at] for at in sane.tolist()], table[:, sane]
        if len(table) >= _LEAST_READINGS and len(members) > 2:
            related = {**_products(table, members), **_sums(table, members)}
            relations.update((members[at].key, relation) for at, relation in related.items())
    found = []
    for value in values:
        relation = relations.get(value.key)
        if relation is not None:
            value = replace(value, why=f"{value.why}; {relation.words}", related=relation.addresses)
        found.append(value)
    return found


@dataclass(frozen=True, slots=True)
class _Relation:
    """Of which other values (by address) a value is the sum or the product, and that in words."""

    addresses: tuple[int, ...]
    words: str


def _sums(table: Floats, members: Sequence[RegisterValue]) -> dict[int, _Relation]:
    """Values that are the sum of neighbours of one type, but for a power of ten."""
    sums: dict[int, _Relation] = {}
    variance = table.var(axis=0)
    moving = variance > 0
    for terms in _TERMS:
        for first in range(len(members) - terms + 1):
            parts = list(range(first, first + terms))
            if len({(members[n].words, members[n].kind) for n in parts}) > 1 or not moving[parts].all():
                continue
            total = table[:, parts].sum(axis=1)
            if not total.std():
                continue
            with np.errstate(divide="ignore"):
                power = 10.0 ** np.clip(np.round(np.log10(np.sqrt(variance) / total.std())), -9, 9)
            left = ((table - total[:, None] * power) ** 2).mean(axis=0) / np.where(moving, variance, 1.0)
            left[parts] = 1.0
            for at in np.flatnonzero(moving & (left < _LEFT)).tolist():
                addresses = tuple(members[n].address for n in parts)
                words = register_words("the sum of {parts}", parts=", ".join(map(_named, addresses)))
                sums[at] = _Relation(addresses, words)
    return sums


def _products(table: Floats, members: Sequence[RegisterValue]) -> dict[int, _Relation]:
    """Values that go as the product of a steadier one and a livelier one."""
    size = np.abs(table)
    mean, spread = size.mean(axis=0), size.std(axis=0)
    moving = spread > 0
    steady = np.flatnonzero(moving & (spread < 0.08 * mean)).tolist()
    lively = np.flatnonzero(moving & (spread > 0.01 * mean)).tolist()
    normal = (size - mean) / np.where(moving, spread, 1.0)
    together = normal.T @ normal / len(table)
    products: dict[int, _Relation] = {}
    for at in lively:
        for current in lively:
            if current == at or together[at, current] < _TOGETHER:
                continue
            alone = _left_of_ratio(size[:, at], size[:, current])
            for volts in steady:
                if volts not in (at, current):
                    left = _left_of_ratio(size[:, at], size[:, current] * size[:, volts])
                    if left < _PRODUCT_LEFT and left < _BETTER * alone:
                        addresses = members[volts].address, members[current].address
                        words = register_words("goes as {product}", product=" x ".join(map(_named, addresses)))
                        products[at] = _Relation(addresses, words)
    return products


def _named(address: int) -> str:
    return f"r{address}"


def _left_of_ratio(target: Floats, driver: Floats) -> float:
    """What is left of a series' variance when it is taken as a constant times another."""
    factor = float((target * driver).sum() / max(float((driver * driver).sum()), 1e-300))
    return float(((target - factor * driver) ** 2).mean() / max(float(target.var()), 1e-300))


_SHOWN = 0.6  # below this confidence two readings are shown
_NAMED = 4  # units


def type_words(number: int) -> str:
    """A hypothesis in words: `32-bit float ABCD`."""
    hypothesis = HYPOTHESES[number]
    words = register_words("{width}-bit float" if hypothesis.is_float else "{width}-bit", width=16 * hypothesis.words)
    return f"{words} {hypothesis.order}" if hypothesis.order else words


def reasons(cut: Cut, words: list[list[int]], *, shared: str | None, sisters: Sequence[int] = ()) -> str:
    """One line about a value that moved; `words` are the first and the last reading of its registers, `sisters` the
    units that speak for it too."""
    hypothesis = HYPOTHESES[cut.number]
    first, last = words
    lines = []
    if hypothesis.words > 1:
        quiet = [offset for offset in range(hypothesis.words) if not cut.run.moved[cut.at + offset]]
        if quiet:
            names = ", ".join(_named(cut.run.address + cut.at + offset) for offset in quiet)
            held = "/".join(f"{first[offset]:04X}" for offset in quiet)
            lines.append(register_words("{names} has been {held} all the time", names=names, held=held))
        elif hypothesis.is_float:
            lines.append(register_words("the registers move as one float"))
        else:
            lines.append(register_words("the low word runs through, the high word carries"))
        if shared:
            lines.append(shared)
    elif first != last or cut.moved:
        lines.append(register_words("moves by itself"))
    if sisters:
        lines.append(_weighed_with(sisters))
    if cut.second and cut.confidence < _SHOWN:
        at, number, share = cut.second
        two = {"one": type_words(cut.number), "other": type_words(number), "at": cut.run.address + at}
        either = "{one} ({sure:.0%}) or {other} at {at} ({share:.0%})"
        lines.append(register_words(either, **two, sure=cut.confidence, share=share))
    return "; ".join(lines)


def _weighed_with(units: Sequence[int]) -> str:
    if len(units) > _NAMED:
        words = "weighed together with {count} other units, asked the same and answering alike"
        return register_words(words, count=len(units))
    words = "weighed together with {units:unit|units}, asked the same and answering alike"
    return register_words(words, units=tuple(units))
