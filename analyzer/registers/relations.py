"""How values of a block hang together: sums, and powers of voltage and current. Said beside a reading, as its support.

A relation holds where it explains nearly all of a value's motion, by a factor that scales make (a power of ten). A
wrong reading of registers has none: so a relation is evidence that cannot come about by chance.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from .values import RegisterValue

Floats = NDArray[np.float64]
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
        key = (value.unit, value.area, value.address)
        if key in series and value.kind in ("int", "float"):
            blocks.setdefault(series[key][0], []).append(value)
    texts: dict[SeriesKey, str] = {}
    for members in blocks.values():
        members = members[:_MOST_VALUES]
        table = np.stack([series[v.unit, v.area, v.address][1] for v in members], axis=1)
        sane = np.flatnonzero(np.abs(np.nan_to_num(table, nan=np.inf)).max(axis=0) < _SANE)
        members, table = [members[at] for at in sane.tolist()], table[:, sane]
        if len(table) >= _LEAST_READINGS and len(members) > 2:
            related = {**_products(table, members), **_sums(table, members)}
            for at, text in related.items():
                texts[members[at].unit, members[at].area, members[at].address] = text
    found = []
    for value in values:
        words = texts.get((value.unit, value.area, value.address))
        found.append(replace(value, why=f"{value.why}; {words}") if words else value)
    return found


def _sums(table: Floats, members: Sequence[RegisterValue]) -> dict[int, str]:
    """Values that are the sum of neighbours of one type, but for a power of ten."""
    sums: dict[int, str] = {}
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
                sums[at] = f"the sum of {', '.join(f'r{members[n].address}' for n in parts)}"
    return sums


def _products(table: Floats, members: Sequence[RegisterValue]) -> dict[int, str]:
    """Values that go as the product of a steadier one and a livelier one."""
    size = np.abs(table)
    mean, spread = size.mean(axis=0), size.std(axis=0)
    moving = spread > 0
    steady = np.flatnonzero(moving & (spread < 0.08 * mean)).tolist()
    lively = np.flatnonzero(moving & (spread > 0.01 * mean)).tolist()
    normal = (size - mean) / np.where(moving, spread, 1.0)
    together = normal.T @ normal / len(table)
    products: dict[int, str] = {}
    for at in lively:
        for current in lively:
            if current == at or together[at, current] < _TOGETHER:
                continue
            alone = _left_of_ratio(size[:, at], size[:, current])
            for volts in steady:
                if volts not in (at, current):
                    left = _left_of_ratio(size[:, at], size[:, current] * size[:, volts])
                    if left < _PRODUCT_LEFT and left < _BETTER * alone:
                        products[at] = f"goes as r{members[volts].address} x r{members[current].address}"
    return products


def _left_of_ratio(target: Floats, driver: Floats) -> float:
    """What is left of a series' variance when it is taken as a constant times another."""
    factor = float((target * driver).sum() / max(float((driver * driver).sum()), 1e-300))
    return float(((target - factor * driver) ** 2).mean() / max(float(target.var()), 1e-300))
