"""Where elements lie: what a key, or a shape that another stretches to, means for memory in C order."""

from __future__ import annotations

import operator
from collections.abc import Sequence
from itertools import pairwise
from math import prod
from typing import Any

Shape = tuple[int, ...]


def strides(shape: Shape) -> list[int]:
    """By how many elements one step along each axis goes on."""
    return [prod(shape[axis + 1 :]) for axis in range(len(shape))]


def walked(shape: Sequence[int], steps: Sequence[int], begin: int = 0) -> list[int]:
    """The places of a grid, the last axis fastest."""
    places = [begin]
    for count, step in zip(shape, steps, strict=True):
        places = [place + step * number for place in places for number in range(count)]
    return places


def lanes(shape: Shape, axis: int) -> tuple[list[slice], Shape]:
    """The elements along an axis, for each place on the others, and the shape that these have."""
    inner, count = prod(shape[axis + 1 :]), shape[axis]
    begins = [outer * count * inner + at for outer in range(prod(shape[:axis])) for at in range(inner)]
    return [slice(begin, begin + count * inner, inner) for begin in begins], (*shape[:axis], *shape[axis + 1 :])


def without_ellipsis(keys: tuple[Any, ...], ndim: int) -> tuple[Any, ...]:
    """The same key, `...` as the slices that it stands for."""
    at = next((i for i, each in enumerate(keys) if each is Ellipsis), None)
    if at is None:
        return keys
    given = sum(each is not None and each is not Ellipsis for each in keys)
    return (*keys[:at], *([slice(None)] * (ndim - given)), *keys[at + 1 :])


def grid(keys: tuple[Any, ...], shape: Shape) -> tuple[range | list[int], Shape]:
    """Where the elements of a key of slices, numbers and new axes lie, and their shape; a range where they are even."""
    whole = (*keys, *([slice(None)] * (len(shape) - sum(each is not None for each in keys))))
    steps, counts, strided, begin, axis = strides(shape), [], [], 0, 0
    for key in whole:
        if key is None:
            counts.append(1)
            strided.append(0)
            continue
        if isinstance(key, slice):
            first, last, step = key.indices(shape[axis])
            counts.append(len(range(first, last, step)))
            strided.append(step * steps[axis])
            begin += first * steps[axis]
        else:
            begin += _number(key, shape[axis], axis) * steps[axis]
        axis += 1
    found = tuple(counts)
    if not all(found):
        return range(0), found
    even = _even(found, strided, begin)
    return (walked(found, strided, begin) if even is None else even), found


def _number(key: Any, count: int, axis: int) -> int:
    number = operator.index(key)
    if not -count <= number < count:
        raise IndexError(f"index {number} is out of bounds for axis {axis} with size {count}")
    return number % count


def _even(shape: Shape, steps: list[int], begin: int) -> range | None:
    """The places as a range, where one step leads through all of them."""
    wide = [(count, step) for count, step in zip(shape, steps, strict=True) if count != 1]
    if any(step != count * inner for (_, step), (count, inner) in pairwise(wide)):
        return None
    step = wide[-1][1] if wide else 1
    return range(begin, begin + (prod(shape) - 1) * step + 1, step) if step > 0 else None


def listed(keys: tuple[Any, ...], shape: Shape) -> tuple[list[int], Shape]:
    """The same of a key with lists of numbers, `(shape, numbers)` each; slices stand before or behind them."""
    steps = strides(shape)
    whole = (*keys, *([slice(None)] * (len(shape) - len(keys))))
    first = next(axis for axis, key in enumerate(whole) if not isinstance(key, slice))
    wide = broadcast_shape([key[0] for key in whole if not isinstance(key, slice)])
    picked = [0] * prod(wide)
    before: list[tuple[range, int]] = []
    behind: list[tuple[range, int]] = []
    for axis, key in enumerate(whole):
        if isinstance(key, slice):
            (before if axis < first else behind).append((range(*key.indices(shape[axis])), steps[axis]))
            continue
        own, numbers = key
        spread = [numbers[place] for place in stretched(own, wide)]
        picked = [at + n % shape[axis] * steps[axis] for at, n in zip(picked, spread, strict=True)]
    heads, tails = _combined(before), _combined(behind)
    counts = (*(len(axis) for axis, _ in before), *wide, *(len(axis) for axis, _ in behind))
    return [head + place + tail for head in heads for place in picked for tail in tails], counts


def _combined(axes: list[tuple[range, int]]) -> list[int]:
    places = [0]
    for axis, step in axes:
        places = [place + number * step for place in places for number in axis]
    return places


def broadcast_shape(shapes: list[Shape]) -> Shape:
    """The shape that all these stretch to."""
    longest = max(map(len, shapes), default=0)
    found = []
    for axis in zip(*((1,) * (longest - len(shape)) + shape for shape in shapes), strict=True):
        wide = {each for each in axis if each != 1}
        if len(wide) > 1:
            raise ValueError(f"shapes do not go together: {shapes}")
        found.append(wide.pop() if wide else 1)
    return tuple(found)


def stretched(own: Shape, shape: Shape) -> list[int]:
    """Which element of an array of one shape stands at each place of the other."""
    full = (1,) * (len(shape) - len(own)) + own
    if broadcast_shape([full, shape]) != shape:
        raise ValueError(f"{own} does not go into {shape}")
    return walked(shape, [0 if count == 1 else step for count, step in zip(full, strides(full), strict=True)])
