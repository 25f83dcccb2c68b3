"""The memory of an array: values in a memoryview, integers wrapped as C wraps them."""

from __future__ import annotations

import array
from collections.abc import Sequence
from typing import Any

from .types import dtype

Memory = Any  # a memoryview of whatever format


def stored(kind: dtype, values: Sequence[Any]) -> Memory:
    """New memory with these values, integers wrapped as C wraps them."""
    if kind.format == "?":
        return memoryview(bytearray(map(bool, values))).cast("?")
    try:
        return memoryview(array.array(kind.format, values))
    except (OverflowError, TypeError, ValueError):
        return memoryview(array.array(kind.format, [wrapped(kind, value) for value in values]))


def wrapped(kind: dtype, value: Any) -> Any:
    """A value as this type holds it."""
    if kind.kind in "fb":
        return kind.plain(value)
    if value != value or value in (float("inf"), float("-inf")):
        return 0 if kind.kind == "u" else -(1 << 8 * kind.itemsize - 1)
    bits = 8 * kind.itemsize
    value = int(value) & (1 << bits) - 1
    return value - (1 << bits) if kind.kind == "i" and value >> bits - 1 else value
