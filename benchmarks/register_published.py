"""Layouts of devices that people have, as published tables and open libraries list them (`layouts/published.txt`): of
which type registers are, which stand for nothing, what kind of quantity each holds. No map to read a device by: values
have the names of their quantities only.

A line is `name; maker; word order; stretch; stretch; ...`, a stretch `area address token token ...`. A token is a
quantity of the table here, with what it belongs to behind a slash, and type, factor (`x0.1`) or unit of measure behind
colons where they are others (`power/PV1` is `P/PV1`, in tenths of a kilowatt `P/PV1:x0.1:kW`); `*3` is three of them in
a row; `_2` are two registers that nobody lists.
"""

from __future__ import annotations

import re
from functools import lru_cache
from pathlib import Path
from typing import Final, cast

from dissectors.maps import RegisterMap
from dissectors.maps.model import VALUE_TYPES, MapArea, MappedValue

PUBLISHED: Final = Path(__file__).parent / "layouts" / "published.txt"
_TOKEN: Final = re.compile(r"([A-Za-z]+)(?:/([\w-]+))?((?::[^:*]+)*)(?:\*(\d+))?")
QUANTITIES: Final[dict[str, tuple[str, str, float, str]]] = {  # name, type, factor, unit of measure
    "V": ("voltage", "u16", 0.1, "V"), "A": ("current", "u16", 0.1, "A"), "F": ("frequency", "u16", 0.01, "Hz"),
    "P": ("power", "s32", 1, "W"), "p": ("power", "u16", 1, "W"), "Q": ("reactive power", "s32", 1, "var"),
    "S": ("apparent power", "u32", 1, "VA"), "PF": ("power factor", "s16", 0.001, ""),
    "T": ("temperature", "s16", 0.1, "°C"), "E": ("energy", "u32", 0.1, "kWh"), "H": ("hours", "u32", 1, "h"),
    "e": ("energy today", "u16", 0.1, "kWh"), "time": ("time", "u32", 1, "s"), "N": ("count", "u32", 1, ""),
    "share": ("share", "u16", 1, "%"), "state": ("state", "enum", 1, ""), "bits": ("fault bits", "bits", 1, ""),
    "set": ("setpoint", "u16", 1, ""), "n": ("number", "u16", 1, ""),
}  # fmt: skip


@lru_cache(maxsize=1)
def published_layouts() -> dict[str, RegisterMap]:
    """All of them, by name."""
    found = {}
    for line in PUBLISHED.read_text(encoding="utf-8").splitlines():
        if line and not line.startswith("#"):
            name, maker, order, *stretches = (part.strip() for part in line.split(";"))
            rows = [row for stretch in stretches for row in stretch_values(stretch, order)]
            found[name] = RegisterMap(name, tuple(rows), vendor=maker, word_order=order)
    return found


def stretch_values(stretch: str, order: str) -> list[MappedValue]:
    """The values of `area address token token ...`."""
    area, start, *tokens = stretch.split()
    at, rows = int(start), []
    for token in tokens:
        if token[0] == "_":
            at += int(token[1:])
            continue
        for row in _values(token, cast(MapArea, area), at, order):
            rows.append(row)
            at = row.end
    return rows


def _values(token: str, area: MapArea, at: int, order: str) -> list[MappedValue]:
    match = _TOKEN.fullmatch(token)
    if match is None:
        raise ValueError(f"{PUBLISHED.name}: {token!r} is no token")
    code, of, others, times = match.groups()
    name, kind, scale, unit = QUANTITIES[code]
    for other in others.split(":")[1:]:
        if re.fullmatch(r"[usf]\d\d", other):
            kind = other
        elif re.fullmatch(r"x[\d.e-]+", other):
            scale = float(other[1:])
        else:
            unit = other
    length = VALUE_TYPES[kind]
    values = []
    for number in range(int(times or 1)):
        mine = of if times is None else f"{of or 'L'}{number + 1}"
        values.append(
            MappedValue(
                area, at + number * length, f"{name} {mine}" if mine else name, kind,
                order if length > 1 else "ABCD", length, scale, unit=unit,
            )
        )  # fmt: skip
    return values
