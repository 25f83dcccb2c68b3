"""Times and sizes as people type them: `90s`, `15min`, `7d`; `500kB`, `2GB`."""

from __future__ import annotations

import re
from argparse import ArgumentTypeError
from typing import Final

_TIMES: Final = {"ms": 1e-3, "s": 1, "sec": 1, "m": 60, "min": 60, "h": 3600, "d": 86_400, "w": 604_800}
_SIZES: Final = {
    "b": 1, "k": 10**3, "kb": 10**3, "m": 10**6, "mb": 10**6, "g": 10**9, "gb": 10**9, "t": 10**12, "tb": 10**12,
    "kib": 2**10, "mib": 2**20, "gib": 2**30, "tib": 2**40,
}  # fmt: skip
_SHAPE: Final = re.compile(r"\s*(\d{1,15}(?:\.\d{1,15})?)\s*([a-zA-Z]*)\s*")


def seconds(text: str) -> float:
    """A time in seconds, which a bare number is; for argparse."""
    return _value(text, _TIMES, "s", "a time such as 90s, 15min, 12h or 7d")


def octets(text: str) -> int:
    """A size in bytes, which a bare number is; for argparse."""
    return int(_value(text, _SIZES, "b", "a size such as 500kB, 64MB or 2GB"))


def time_or_size(text: str) -> tuple[float | None, int | None]:
    """(seconds, bytes), one of them None: `7d` or `2GB`; for argparse."""
    match = _SHAPE.fullmatch(text)
    unit = match[2].lower() if match else ""
    if unit in _SIZES and unit != "m":
        return None, octets(text)
    if unit in _TIMES:
        return seconds(text), None
    raise ArgumentTypeError(f"{text!r} is neither a time such as 7d nor a size such as 2GB")


def _value(text: str, units: dict[str, float] | dict[str, int], bare: str, expected: str) -> float:
    match = _SHAPE.fullmatch(text)
    factor = units.get(match[2].lower() or bare) if match else None
    if match is None or factor is None or float(match[1]) <= 0:
        raise ArgumentTypeError(f"{text!r} is not {expected}")
    return float(match[1]) * factor
