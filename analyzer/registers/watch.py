"""The values of a bus while batches come: in brief, and what their registers mean, revised as evidence grows.

In brief is least, mean, greatest and last of each mapped value, or of what inference is sure of, in flat memory: a few
numbers a value. Numbers are in the map's unit of measure; without a map as the registers hold them.

    registers = RevisedRegisters(charts, words)
    for batch in batches:
        for revision in registers.feed(batch):
            print(revision.text)
    registers.charts                # maps of units by which values are named and read

Types are told once there is evidence, and asked for anew when there are half as many readings again, so that it costs
little however long one listens. The answer is that of the same readings in a file.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from dissectors.maps.files import UnitMaps
from dissectors.maps.model import MappedValue, RegisterMap, read_mapped

from ..languages import register_words
from ..tables.batch import Batch
from ..tables.columns import decode
from .checking import LimitBreach, limit_breaches
from .drafting import Place, drafted_map, with_own_words
from .inference import infer
from .readings import MappedColumn, RegisterReadings, is_due, limits_broken, mapped_columns
from .roles import RegisterValue
from .telling import unit_place

_SURE: Final = 0.95
_LIVE_LEAST: Final = 12  # readings of a value, before its type is told while the bus goes on
_LIVE_SURE: Final = 0.6
_NUMBERS: Final = ("int", "float", "bcd")


@dataclass(frozen=True, slots=True)
class WatchedValue:
    """One value over a capture. `minimum`, `mean`, `maximum` are None for texts and states; `last` is what people
    read; `outside` counts readings out of the map's limits; `confidence` is 1 by a map."""

    unit: int
    area: str
    address: int
    words: int
    name: str
    type: str
    unit_of_measure: str
    readings: int
    minimum: float | None
    mean: float | None
    maximum: float | None
    last: str
    outside: int
    confidence: float


class ValueWatch:
    """Fed with batches; `charts` are the maps of units, `inferred` adds what no map has and inference is sure of."""

    def __init__(self, charts: Mapping[int, RegisterMap], *, inferred: bool = False) -> None:
        self._charts = charts
        self._mapped: dict[tuple[int, str, int, str], _Running] = {}
        self._inferred = inferred
        self._readings = RegisterReadings()

    def feed(self, batch: Batch) -> None:
        """Take in what the answers of a batch say."""
        self._readings.feed(batch)
        if not self._charts:
            return
        for column in mapped_columns(batch, decode(batch), self._charts):
            row = column.row
            running = self._mapped.setdefault((column.unit, row.area, row.address, row.name), _Running(row))
            running.add(batch, column)

    def values(self) -> tuple[WatchedValue, ...]:
        """What was seen, by unit, area and address."""
        watched = [running.watched(key[0]) for key, running in self._mapped.items()]
        if self._inferred:
            covered = {(v.unit, v.area, at) for v in watched for at in range(v.address, v.address + v.words)}
            watched += [v for v in self._sure_values() if (v.unit, v.area, v.address) not in covered]
        return tuple(sorted(watched, key=lambda value: (value.unit, value.area, value.address, value.name)))

    def breaches(self) -> list[LimitBreach]:
        """Values that their maps do not allow."""
        units = {block.unit for block in self._readings}
        charts = {unit: chart for unit in units if (chart := self._charts.get(unit)) is not None}
        return limit_breaches(self._readings, charts)

    def _sure_values(self) -> list[WatchedValue]:
        return [
            WatchedValue(
                value.unit,
                value.area,
                value.address,
                value.words,
                "",
                f"{value.type} {value.order or ''}".strip(),
                "",
                value.readings,
                _as_float(value.minimum),
                None,
                _as_float(value.maximum),
                "" if value.last is None else f"{value.last:.7g}" if isinstance(value.last, float) else str(value.last),
                0,
                value.confidence,
            )
            for value in infer(self._readings)
            if value.changes and value.kind in _NUMBERS and value.confidence >= _SURE
        ]


class _Running:
    """What is kept of one mapped value."""

    def __init__(self, row: MappedValue) -> None:
        self.row = row
        self.count = self.outside = 0
        self.known, self.total = 0, 0.0
        self.least, self.greatest = np.inf, -np.inf
        self.newest = -1
        self.last = ""

    def add(self, batch: Batch, column: MappedColumn) -> None:
        values = column.values[np.isfinite(column.values)]
        self.count += len(column.answers)
        if len(values):
            self.known += len(values)
            self.total += float(values.sum())
            self.least = min(self.least, float(values.min()))
            self.greatest = max(self.greatest, float(values.max()))
        self.outside += int(np.count_nonzero(limits_broken(column)))
        times = batch.rows.t_end_ns[column.answers]
        newest_at = int(np.argmax(times))
        if int(times[newest_at]) >= self.newest:
            self.newest = int(times[newest_at])
            words = column.words[newest_at].tolist()
            reading = read_mapped(self.row, words, None if self.row.scale_address is not None else 0)
            number = float(column.values[newest_at])
            scaled = self.row.scale_address is not None and np.isfinite(number)
            self.last = f"{number:.7g} {self.row.unit}".rstrip() if scaled else reading.text

    def watched(self, unit: int) -> WatchedValue:
        row = self.row
        plain = self.known and row.type not in ("text", "enum", "bits", "time", "bool")
        kind = f"{row.type} {row.order}" if row.length > 1 and row.type != "text" else row.type
        return WatchedValue(
            unit,
            row.area,
            row.address,
            row.length,
            row.name,
            kind,
            row.unit,
            self.count,
            _nine_digits(self.least) if plain else None,
            _nine_digits(self.total / self.known) if plain else None,
            _nine_digits(self.greatest) if plain else None,
            self.last,
            self.outside,
            1.0,
        )


def _nine_digits(number: float) -> float:
    return float(f"{number:.9g}")


def _as_float(value: object) -> float | None:
    return float(value) if isinstance(value, int | float) else None


@dataclass(frozen=True, slots=True)
class Revision:
    """A value that is told for the first time (`before` None), or read otherwise than before."""

    before: RegisterValue | None
    value: RegisterValue

    @property
    def text(self) -> str:
        """`unit 1 input 100-101 is f32 ABCD, was u32 ABCD (98%: ...)`."""
        value = self.value
        return register_words(
            "{place} is {type}[, {role}][, was {before}] ({sure:.0%}: {why})",
            place=unit_place(value.unit, value.area, value.address, value.words), type=typed(value),
            role=register_words(value.role) if value.role else "", sure=value.confidence, why=value.why,
            before=typed(self.before) if self.before is not None else "",
        )  # fmt: skip

    def to_json(self) -> dict[str, Any]:
        """A line of kind `register` that holds the value as `rtuscope registers --json` writes it."""
        return {"kind": "register", "register": self.value.to_json()}


class RevisedRegisters:
    """The values of a live bus. `values` are those of the last time that they were asked for."""

    def __init__(
        self, charts: Mapping[int, RegisterMap] | None = None, words: Mapping[Place, str] | None = None
    ) -> None:
        self._declared = charts or {}
        self._words = dict(words or {})
        self._readings = RegisterReadings()
        self._revised_at = 0
        self._reported: dict[Place, RegisterValue] = {}
        self.values: list[RegisterValue] = []
        self.charts = UnitMaps()

    def feed(self, batch: Batch) -> list[Revision]:
        """Take in a batch; what is told for the first time or otherwise now, mostly nothing."""
        self._readings.feed(batch)
        return self.revise() if is_due(self._revised_at, self._readings.frames) else []

    def say_type(self, place: Place, type_words: str) -> list[Revision]:
        """The user's own word (empty: taken back), which overrules; what else it changes."""
        if type_words:
            self._words[place] = type_words
        else:
            self._words.pop(place, None)
        return self.revise()

    def revise(self) -> list[Revision]:
        """Ask anew, and say what changed."""
        self._revised_at = self._readings.frames
        units = sorted({block.unit for block in self._readings})
        declared = self._declared.of(units) if isinstance(self._declared, UnitMaps) else self._declared
        settled = with_own_words(declared, self._words)
        self.values = infer(self._readings, charts=settled)
        fresh = [value for value in self.values if is_sure(value)]
        self.charts = UnitMaps({**{unit: _readable(fresh, unit) for unit in units if unit not in declared}, **declared})
        revisions = [Revision(self._reported.get(value.key), value) for value in fresh]
        revisions = [one for one in revisions if one.before is None or typed(one.before) != typed(one.value)]
        self._reported = {value.key: value for value in fresh}
        return revisions


def typed(value: RegisterValue) -> str:
    """`f32 CDAB`."""
    return f"{value.type} {value.order}" if value.order else value.type


def is_sure(value: RegisterValue) -> bool:
    """Whether enough is known of a value: that it moved, and how it is read; or somebody said so."""
    if value.area in ("coil", "discrete") or value.confidence < _LIVE_SURE:
        return False
    said = value.scale is not None  # by a map, or the user
    return said or (value.readings >= _LIVE_LEAST and (value.changes > 0 or value.kind == "text"))


def _readable(values: Sequence[RegisterValue], unit: int) -> RegisterMap:
    return drafted_map([value for value in values if value.unit == unit], f"unit {unit}", "told live")
