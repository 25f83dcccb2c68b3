"""Which register is it? Found by a number that somebody saw on a panel, or by a table of times and numbers.

Every register and every pair of a polled block is read in every way; a reading counts where it shows the number, by a
scale of a power of ten. Of many that could show it, those stand first that showed it most exactly, that inference reads
the same way, and that moved. A table of times and values is laid over each reading with every lag.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from captures.ragged import Ints

from .hypotheses import HYPOTHESES, numbers
from .panel import Floats, PanelError
from .readings import BlockReadings, RegisterReadings
from .values import RegisterValue

_SCALES: Final = (1.0, 0.1, 0.01, 0.001, 10.0, 100.0, 0.0001, 1000.0)
_LIKELY: Final = (1.0, 0.9, 0.8, 0.6, 0.4, 0.3, 0.3, 0.3)  # how usual each scale is
_LAGS: Final = 241
_LAG_S: Final = 60.0


@dataclass(frozen=True, slots=True)
class Match:
    """A reading that showed the number: value = raw * `scale` + `offset`, seen `lag_s` later than on the panel."""

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
    times_s: Floats,
    shown: Floats,
    inferred: Sequence[RegisterValue],
    units: Sequence[int] | None = None,
) -> list[Match]:
    """Readings that moved as this table did, best first. Times are seconds: since 1970, or since any beginning."""
    agreed = _agreement(inferred)
    best: dict[tuple[Any, ...], Match] = {}
    spread = float(shown.std())
    if spread == 0:
        raise PanelError("the values of the table never change: --like VALUE finds a number that stands still")
    for reading in _readings(readings, units):
        if len(reading.series) < 3 or np.ptp(reading.series) == 0 or not np.isfinite(reading.series).all():
            continue
        at_s = reading.block.times / 1e9
        lags = _lags(times_s, at_s)
        rows = np.searchsorted(at_s, times_s[None, :] + lags[:, None], side="right") - 1
        inside = (rows >= 0).mean(axis=1) > 0.6
        if not inside.any():
            continue
        rows = np.clip(rows[inside], 0, len(at_s) - 1)
        lags = lags[inside]
        scale, offset, misfit = _fitted(reading.series[rows], shown, is_float=reading.is_float)
        fits = 1 - misfit / spread**2
        which = int(np.argmax(np.round(fits, 6) - 1e-7 * np.abs(lags)))
        fit = float(fits[which])
        if fit < 0.5:
            continue
        score = fit * (0.7 + 0.3 * agreed.get(_key(reading), 0.05))
        row = int(rows[which, -1])
        value = float(reading.series[row] * scale[which] + offset[which])
        key = _key(reading)
        best[key] = _match(reading, float(scale[which]), float(offset[which]), value, row, float(lags[which]), score)
    return sorted(best.values(), key=lambda match: -match.score)


def _lags(times_s: Floats, at_s: Floats) -> Floats:
    """Lags to try: some around none where both clocks agree, else every place at which the table can lie."""
    if at_s[0] - _LAG_S <= times_s[-1] and times_s[0] <= at_s[-1] + _LAG_S:
        near = np.linspace(-_LAG_S, _LAG_S, _LAGS)
        return near[np.argsort(np.abs(near), kind="stable")]
    begin = at_s[0] - times_s[0]
    room = max((at_s[-1] - at_s[0]) - (times_s[-1] - times_s[0]), 0.0)
    return np.linspace(begin - 1, begin + room + 1, 4 * _LAGS)


def _fitted(series: Floats, shown: Floats, *, is_float: bool) -> tuple[Floats, Floats, Floats]:
    """Scale, offset and mean squared misfit of each row of `series`; a power of ten alone where that fits as well."""
    mean, target = series.mean(axis=1), shown.mean()
    centred = series - mean[:, None]
    power = (centred**2).mean(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = np.where(power > 0, (centred * (shown - target)).mean(axis=1) / power, 0.0)
    offset = target - scale * mean
    misfit = ((series * scale[:, None] + offset[:, None] - shown) ** 2).mean(axis=1)
    for plain in _SCALES[:1] if is_float else _SCALES:
        simple = ((series * plain - shown) ** 2).mean(axis=1)
        better = simple <= misfit * 1.5 + (plain * 0.5) ** 2 / 3
        scale, offset = np.where(better, plain, scale), np.where(better, 0.0, offset)
        misfit = np.where(better, np.minimum(simple, misfit), misfit * np.where(better, 1.0, 1.0))
    return scale, offset, misfit


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
