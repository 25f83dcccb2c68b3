"""Which register is it? Found by a number that somebody saw on a panel, or by a table of times and numbers.

Every register and every pair of a polled block is read in every way; a reading counts where it shows the number, by a
scale of a power of ten. Of many that could show it, those stand first that showed it most exactly, that inference reads
the same way, and that moved. A table of times and values is laid over each reading with every lag.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from captures.ragged import Ints

from .hypotheses import HYPOTHESES, numbers
from .panel import Floats, PanelError, PanelTable, best_place, clock_difference
from .readings import BlockReadings, RegisterReadings
from .roles import RegisterValue

_SCALES: Final = (1.0, 0.1, 0.01, 0.001, 10.0, 100.0, 0.0001, 1000.0)
_LIKELY: Final = (1.0, 0.9, 0.8, 0.6, 0.4, 0.3, 0.3, 0.3)  # how usual each scale is
_LAGS: Final = 241
_LAG_S: Final = 60.0
_STEEPEST: Final = 1e10  # units of measure a step: no device has more, nor less than its inverse
_FARTHEST: Final = 1e100  # beyond it a reading is nothing that anybody measures, and has no square
_INSIDE: Final = 0.6  # of the table, or of as much of it as the capture can hold
_LOOSE: Final = 0.05  # share of the table's variance: where more is left, its clock may be another one


@dataclass(frozen=True, slots=True)
class Match:
    """A reading that showed the number: value = raw * `scale` + `offset`.

    Of a table `lag_s` says how much later than on the panel, None where that cannot be told from the clocks; `clock_s`
    by how much the panel's clock is ahead of the capture's, None where both agree or one of them is none.
    """

    unit: int
    area: str
    address: int
    words: int
    kind: str
    signed: bool
    order: str | None
    scale: float
    offset: float
    value: float
    t_ns: int
    lag_s: float | None
    score: float
    clock_s: float | None = None

    def to_json(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in self.__slots__}

    @property
    def type(self) -> str:
        return f"{'f' if self.kind == 'float' else 's' if self.signed else 'u'}{16 * self.words}"


@dataclass(frozen=True, slots=True, eq=False)
class _SoughtReading:
    block: BlockReadings
    at: int
    words: int
    is_float: bool
    signed: bool
    order: str | None
    series: Floats


def matches_of_value(
    readings: RegisterReadings, text: str, inferred: Sequence[RegisterValue], units: Sequence[int] | None = None
) -> list[Match]:
    """Readings that showed this number, best first. ValueError where `text` is no number."""
    number = float(text.replace(",", "."))
    decimals = len(re.split(r"[.,]", text.lower().partition("e")[0])[1]) if re.search(r"[.,]", text) else 0
    close = 0.5 * 10.0**-decimals
    agreed = _agreement(inferred)
    best: dict[tuple[Any, ...], Match] = {}
    for reading in _readings(readings, units):
        for scale, likely in zip(_SCALES, _LIKELY, strict=True):
            if reading.is_float and scale != 1.0:
                continue
            apart = np.abs(reading.series * scale - number)
            row = int(np.argmin(apart))
            if not apart[row] <= close * 1.0001:
                continue
            step = 0.0 if reading.is_float else scale
            chance = max(step, 2 * close) / max(abs(number), 1.0) if number else 1.0
            moved = bool(np.ptp(reading.series) > 0)
            agreement = agreed.get(_key(reading), 0.05)
            nearness = 1 - float(apart[row]) / (2 * close)
            score = likely * agreement * (1.0 if moved else 0.5) * (0.5 + 0.5 * nearness) * min(1.0, 0.2 / chance + 0.2)
            key = _key(reading)
            if key not in best or score > best[key].score:
                best[key] = _match(reading, scale, 0.0, float(reading.series[row] * scale), row, None, score)
    return sorted(best.values(), key=lambda match: -match.score)


def matches_of_series(
    readings: RegisterReadings,
    table: PanelTable,
    inferred: Sequence[RegisterValue],
    units: Sequence[int] | None = None,
) -> list[Match]:
    """Readings that moved as this table did, best first. Where its clock is not the capture's, that is found first."""
    if float(table.values.std()) == 0:
        raise PanelError("the values of the table never change: use --like VALUE to find a constant")
    agreed = _agreement(inferred)
    begin_s = min((float(block.times[0]) / 1e9 for block in readings if len(block.times)), default=0.0)
    table = table.dated_as(begin_s)
    found = _laid_over(readings, table, 0.0, agreed, units)
    left = 1 - max((fit for fit, _ in found), default=0.0)
    if left > _LOOSE:
        likely = [
            (reading.block.times / 1e9, reading.series)
            for reading in _readings(readings, units)
            if _key(reading) in agreed and _moves(reading)
        ]
        place = best_place(table.times_s, table.values, likely)
        if place is not None and place[1] < _LOOSE + 0.5 * left:
            clocks = table.is_of_clock(begin_s)
            shift = clock_difference(place[0], _LAG_S) if clocks else place[0]
            elsewhere = _laid_over(readings, table, shift, agreed, units)
            if 1 - max((fit for fit, _ in elsewhere), default=0.0) < 0.5 * left:
                split = clocks and shift != place[0]  # only half hours of a zone leave a lag of its own
                lag = 0.0 if split else max(elsewhere, key=lambda one: one[1].score)[1].lag_s or 0.0
                told = -round(shift + lag, 3) if clocks and shift else None
                found = [
                    (fit, replace(match, clock_s=told, lag_s=match.lag_s if split else None))
                    for fit, match in elsewhere
                ]
    return sorted((match for _, match in found), key=lambda match: -match.score)


def _laid_over(
    readings: RegisterReadings,
    table: PanelTable,
    shift_s: float,
    agreed: Mapping[tuple[Any, ...], float],
    units: Sequence[int] | None,
) -> list[tuple[float, Match]]:
    """The readings that go with the table about this shift of its times, each with the share of it that it explains."""
    near = np.linspace(-_LAG_S, _LAG_S, _LAGS)
    near = near[np.argsort(np.abs(near), kind="stable")]
    times, shown = table.times_s + shift_s, table.values
    best: dict[tuple[Any, ...], tuple[float, Match]] = {}
    for reading in _readings(readings, units):
        if not _moves(reading):
            continue
        at_s = reading.block.times / 1e9
        moments = times[None, :] + near[:, None]
        inside = (moments >= at_s[0]) & (moments <= at_s[-1] + (at_s[-1] - at_s[0]) / len(at_s))
        fully = min(1.0, (at_s[-1] - at_s[0]) / max(times[-1] - times[0], 1e-9))
        enough = (inside.mean(axis=1) > _INSIDE * fully) & (inside.sum(axis=1) >= 3)
        if not enough.any():
            continue
        inside, lags = inside[enough], near[enough]
        rows = np.clip(np.searchsorted(at_s, moments[enough], side="right") - 1, 0, len(at_s) - 1)
        scale, offset, left = _fitted(reading.series[rows], shown, inside, is_float=reading.is_float)
        fits = 1 - left
        which = int(np.argmax(np.round(fits, 6) - 1e-7 * np.abs(lags)))
        fit = float(fits[which])
        if fit < 0.5 or not 1 / _STEEPEST < abs(scale[which]) < _STEEPEST:
            continue
        score = fit * (0.7 + 0.3 * agreed.get(_key(reading), 0.05))
        row = int(rows[which, np.flatnonzero(inside[which])[-1]])
        value = float(reading.series[row] * scale[which] + offset[which])
        lag = float(lags[which])
        match = _match(reading, float(scale[which]), float(offset[which]), value, row, lag, score)
        best[_key(reading)] = fit, match
    return list(best.values())


def _moves(reading: _SoughtReading) -> bool:
    series = reading.series
    return len(series) >= 3 and bool((np.abs(series) < _FARTHEST).all()) and float(np.ptp(series)) > 0


def _fitted(
    series: Floats, shown: Floats, inside: NDArray[np.bool_], *, is_float: bool
) -> tuple[Floats, Floats, Floats]:
    """Scale and offset of each row of `series`, and the share of the table's variance that they leave of the points
    `inside`; a power of ten alone where that fits as well."""
    count = inside.sum(axis=1)

    def mean(values: Floats) -> Floats:
        average: Floats = np.where(inside, values, 0.0).sum(axis=1) / count
        return average

    target, middle = mean(np.broadcast_to(shown, series.shape)), mean(series)
    apart, centred = shown - target[:, None], series - middle[:, None]
    power, spread = mean(centred**2), np.maximum(mean(apart**2), 1e-300)
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = np.where(power > 0, mean(centred * apart) / power, 0.0)
    offset = target - scale * middle
    misfit = mean((series * scale[:, None] + offset[:, None] - shown) ** 2)
    for plain in _SCALES[:1] if is_float else _SCALES:
        simple = mean((series * plain - shown) ** 2)
        better = simple <= misfit * 1.5 + (plain * 0.5) ** 2 / 3
        scale, offset = np.where(better, plain, scale), np.where(better, 0.0, offset)
        misfit = np.where(better, np.minimum(simple, misfit), misfit)
    return scale, offset, np.minimum(misfit / spread, 1.0)


def _readings(readings: RegisterReadings, units: Sequence[int] | None) -> Iterator[_SoughtReading]:
    for block in readings:
        if block.area not in ("input", "holding") or (units is not None and block.unit not in units):
            continue
        for hypothesis in HYPOTHESES:
            order = hypothesis.order or "ABCD"
            for at in range(block.quantity - hypothesis.words + 1):
                words = block.apart[:, at : at + hypothesis.words]
                for signed in (True,) if hypothesis.is_float else (False, True):
                    if signed and not hypothesis.is_float and not _has_top(words, order):
                        continue
                    series = numbers(words, order, is_float=hypothesis.is_float, signed=signed)
                    yield _SoughtReading(
                        block,
                        at,
                        hypothesis.words,
                        hypothesis.is_float,
                        signed,
                        hypothesis.order,
                        np.nan_to_num(series),
                    )


def _has_top(words: NDArray[np.uint16], order: str) -> bool:
    return bool((words[:, 0 if order == "ABCD" else -1] & 0x8000).any())


def _agreement(inferred: Sequence[RegisterValue]) -> dict[tuple[Any, ...], float]:
    return {
        (v.unit, v.area, v.address, v.words, v.kind == "float", v.order): v.confidence if v.changes else 0.3
        for v in inferred
    }


def _key(reading: _SoughtReading) -> tuple[Any, ...]:
    block = reading.block
    return block.unit, block.area, block.address + reading.at, reading.words, reading.is_float, reading.order


def _match(
    reading: _SoughtReading, scale: float, offset: float, value: float, row: int, lag: float | None, score: float
) -> Match:
    block = reading.block
    kind = "float" if reading.is_float else "int"
    times: Ints = block.times
    return Match(
        block.unit,
        block.area,
        block.address + reading.at,
        reading.words,
        kind,
        reading.signed,
        reading.order,
        float(f"{scale:.6g}"),
        float(f"{offset:.6g}"),
        float(f"{value:.7g}"),
        int(times[row]),
        None if lag is None else round(lag, 3),
        round(score, 4),
    )
