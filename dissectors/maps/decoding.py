"""What registers mean by a map, one value at a time: the number in its unit of measure, or the words for it.

And units of measure: what a number in one is in another, where prefixes alone make the difference.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any, Final, cast

from ..values import Order, floating, integer, ordered
from .model import MappedValue, RegisterMap

Meaning = int | float | str | None


@dataclass(frozen=True, slots=True)
class MappedReading:
    """A value of a map as it was read: `raw` as the registers hold it, `value` in the unit of measure (None: no number,
    or a scale that is not known), `text` for people."""

    row: MappedValue
    raw: int | float | str
    value: Meaning
    text: str

    def to_json(self) -> dict[str, Any]:
        """The object that JSON lines carry."""
        row = self.row
        return {
            "area": row.area,
            "address": row.address,
            "name": row.name,
            "raw": _plain(self.raw),
            "value": _plain(self.value),
            "unit_of_measure": row.unit,
            "text": self.text,
        }


def readings_by_map(chart: RegisterMap, area: str, words: Mapping[int, int]) -> list[MappedReading]:
    """The values of a map that registers (by address) hold whole, by address."""
    readings = []
    for row in chart.rows:
        if row.area == area and all(address in words for address in range(row.address, row.end)):
            power = words.get(row.scale_address) if row.scale_address is not None else 0
            readings.append(read_mapped(row, [words[address] for address in range(row.address, row.end)], power))
    return sorted(readings, key=lambda reading: reading.row.address)


def read_mapped(row: MappedValue, words: Sequence[int], power: int | None = 0) -> MappedReading:
    """One value from its registers; `power` is what its scale register holds, None where that is not known."""
    order = cast(Order, row.order)
    if row.area in ("coil", "discrete"):
        return MappedReading(row, words[0], words[0], row.values.get(words[0], "on" if words[0] else "off"))
    if row.type == "text":
        data = ordered(words, "BADC" if order in ("BADC", "DCBA") else "ABCD")
        text = data.split(b"\0")[0].decode("latin-1").strip()
        return MappedReading(row, text, text, text)
    if row.is_float:
        raw: int | float = floating(words, order)
        if row.length == 2 and math.isfinite(raw):
            raw = float(f"{raw:.8g}")
    else:
        raw = integer(words, order, signed=row.is_signed)
    match row.type:
        case "enum":
            return MappedReading(row, raw, raw, row.values.get(int(raw), f"{raw} (a state without a name)"))
        case "bits":
            return MappedReading(row, raw, raw, _bit_names(row, int(raw)))
        case "time":
            moment = datetime.fromtimestamp(raw, UTC).isoformat() if 0 < raw < 1e11 else str(raw)
            return MappedReading(row, raw, raw, moment)
        case "bcd16" | "bcd32":
            digits = f"{int(raw):x}"
            if not digits.isdigit():
                return MappedReading(row, raw, None, f"0x{int(raw):X} (no BCD)")
            raw = int(digits)
    if row.scale_address is not None:
        power = None if power is None else power - 0x10000 if power & 0x8000 else power
        if power is None or abs(power) > 10:
            return MappedReading(row, raw, None, f"{raw} (its scale, register {row.scale_address}, is not known)")
        value = _scaled(raw, row.scale * 10.0**power, row.offset)
    else:
        value = _scaled(raw, row.scale, row.offset)
    return MappedReading(row, raw, value, f"{_digits(value)} {row.unit}".rstrip())


def _scaled(raw: float, scale: float, offset: float) -> int | float:
    if scale == 1 and offset == 0:
        return raw
    value = raw * scale + offset
    return float(f"{value:.12g}") if math.isfinite(value) else value


def _digits(value: float) -> str:
    return f"{value:.7g}" if isinstance(value, float) else str(value)


def _bit_names(row: MappedValue, raw: int) -> str:
    names = [row.values.get(bit, f"bit {bit}") for bit in range(16 * row.length) if raw >> bit & 1]
    return ", ".join(names) if names else "none"


def _plain(value: Meaning) -> Meaning:
    """JSON has no infinity and no NaN."""
    return None if isinstance(value, float) and not math.isfinite(value) else value


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
