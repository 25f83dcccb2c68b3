"""Floats of which the bytes within each word are swapped (BADC, DCBA), as some gateways and bridges send them.

Such a float is no number as it stands, and a plausible one swapped; by chance hardly any two registers are. It is
believed where several agree, and at least twice as many as are floats as they stand.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from .readings import BlockReadings, Words
from .runs import Run
from .values import RegisterValue

_SURE: Final = 0.9
_LIKELY: Final = 0.7  # swapped, which a second one must confirm
_LEAST: Final = 3  # floats of a unit that agree
_MORE: Final = 2  # times as many as are sure as they stand
_ORDERS: Final = {"ABCD": "BADC", "CDAB": "DCBA"}
_USUAL: Final = (1e-4, 1e7)
Inferring = Callable[[Sequence[BlockReadings]], list[RegisterValue]]


def swapped_floats(
    blocks: Sequence[BlockReadings], values: Sequence[RegisterValue], inferred: Inferring
) -> list[RegisterValue]:
    """The byte-swapped floats of one unit, of which `values` is what it says as it stands; `inferred` reads blocks."""
    plain = sum(value.kind == "float" and value.changes > 0 and value.confidence >= _SURE for value in values)
    registers = [block for block in blocks if block.area in ("input", "holding") and block.quantity > 1]
    if sum(map(_candidates, registers)) < max(_LEAST, _MORE * plain):
        return []
    floats = [
        replace(value, order=_ORDERS[value.order or "ABCD"], why=f"{value.why}; the bytes of its words are swapped")
        for value in inferred([_swapped(block) for block in registers])
        if value.kind == "float" and value.words == 2 and value.changes and value.confidence >= _LIKELY
    ]
    return floats if len(floats) >= max(_LEAST, _MORE * plain) else []


def exclude(run: Run, address: int, words: int) -> None:
    """No other value than single registers stands in these."""
    begin, end = address - run.address, address - run.address + words
    if begin < 0 or end > run.length:
        return
    from .hypotheses import HYPOTHESES

    for number, hypothesis in enumerate(HYPOTHESES):
        if hypothesis.words > 1:
            run.fits[max(0, begin - hypothesis.words + 1) : end, number] = False


def _candidates(block: BlockReadings) -> int:
    """Pairs that moved and are plausible floats swapped, though not as they stand."""
    words = block.series[0]
    moved = (words != words[0]).any(axis=0)
    count = 0
    for first, second in ((slice(None, -1), slice(1, None)), (slice(1, None), slice(None, -1))):
        plain = _plausible(words[:, first], words[:, second])
        turned = words.byteswap()
        count += int((_plausible(turned[:, first], turned[:, second]) & ~plain & (moved[:-1] | moved[1:])).sum())
    return count


def _plausible(high: Words, low: Words) -> NDArray[np.bool_]:
    value = (high.astype(np.uint32) << 16 | low).view(np.float32)
    size = np.abs(np.nan_to_num(value, nan=np.inf))
    plausible: NDArray[np.bool_] = (((size >= _USUAL[0]) & (size <= _USUAL[1])) | (size == 0)).all(axis=0) & (
        size != 0
    ).any(axis=0)
    return plausible


def _swapped(block: BlockReadings) -> BlockReadings:
    """The same readings with the bytes of each word swapped; extremes are of the readings that are kept."""
    made = BlockReadings(block.unit, block.area, block.address, block.quantity, block.written, block.most)
    rows = np.concatenate([*block.first, block.apart]).byteswap()
    made.add(rows, np.full(len(rows), block.first_ns))
    made.first = [part.byteswap() for part in block.first]
    made.apart, made.times, made.stride = block.apart.byteswap(), block.times, block.stride
    made.count, made.changes, made.last = block.count, block.changes, block.last.byteswap()
    made.first_ns, made.last_ns = block.first_ns, block.last_ns
    return made
