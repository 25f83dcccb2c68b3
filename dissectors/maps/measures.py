"""Units of measure: what a number in one is in another, where prefixes alone make the difference."""

from __future__ import annotations

from typing import Final

_PREFIXES: Final = {"": 1.0, "n": 1e-9, "u": 1e-6, "µ": 1e-6, "μ": 1e-6, "m": 1e-3, "k": 1e3, "M": 1e6, "G": 1e9}
_BASES: Final = (
    "V", "A", "W", "Wh", "VA", "VAh", "var", "VAr", "varh", "VArh", "Hz", "Ohm", "Ω", "F", "Pa", "bar", "g", "m", "l",
    "L", "s", "J", "N", "C", "Ah",
)  # fmt: skip
_SAME: Final = {"degc": "°c", "celsius": "°c", "degf": "°f", "percent": "%", "ohms": "ohm", "ω": "ohm", "pct": "%"}


def factor_between(one: str, other: str) -> float | None:
    """What a number in unit `one` is multiplied by to be in `other`; None where they do not measure the same."""
    if _spelled(one) == _spelled(other) and not (_split(one) and _split(other)):
        return 1.0
    left, right = _split(one), _split(other)
    if left is None or right is None or left[1] != right[1]:
        return None
    return left[0] / right[0]


def _spelled(unit: str) -> str:
    word = unit.strip().casefold()
    return _SAME.get(word, word)


def _split(unit: str) -> tuple[float, str] | None:
    """The prefix's factor and the unit without it: 1000 and W of kW."""
    text = unit.strip()
    for base in sorted(_BASES, key=len, reverse=True):
        if text.endswith(base) and text[: -len(base)] in _PREFIXES:
            return _PREFIXES[text[: -len(base)]], _spelled(base) if base in ("Ω", "Ohm") else base.replace("VAr", "var")
    for base in _BASES:  # kw, KWH: as people type; prefixes m and M are told apart by their case alone
        if text.casefold() == base.casefold():
            return 1.0, base
        if text[:1] in "kK" and text[1:].casefold() == base.casefold():
            return 1e3, base
    return None
