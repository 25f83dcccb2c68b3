"""Layouts of devices as files list them: of which type registers are, which stand for nothing, what each holds.

Two files in one notation: `layouts/published.txt` has devices that people have, as published tables and open libraries
list them (no map to read a device by: values have the names of their quantities only); `layouts/physics.txt` has those
that plants fill (`register_makers`).

A line is `name; maker; word order; stretch; stretch; ...`; behind the word order that of floats, where it is another
one. A stretch is `area address token token ...`, with `-` for an address that is drawn. A token is a quantity, with
what it belongs to behind a slash, and type, factor (`x0.1`, `x1/3600`) or unit of measure behind colons where they are
others than those of the quantity (`power/PV1` is `P/PV1`, in tenths of a kilowatt `P/PV1:x0.1:kW`); `*3` is three of
them in a row; `_2` are two registers that nobody lists.
"""

from __future__ import annotations

import re
from fractions import Fraction
from functools import lru_cache
from pathlib import Path
from typing import Final, NamedTuple, cast

from dissectors.maps import RegisterMap
from dissectors.maps.model import VALUE_TYPES, MapArea, MappedValue

_FOLDER: Final = Path(__file__).parent / "layouts"
_TOKEN: Final = re.compile(r"([A-Za-z]+\d*)(?:/([\w-]+))?((?::[^:*]+)*)(?:\*(\d+))?")
_ADDRESS_DRAWN: Final = "-"
QUANTITIES: Final[dict[str, tuple[str, str, float, str]]] = {  # name, type, factor, unit of measure
    "V": ("voltage", "u16", 0.1, "V"), "A": ("current", "u16", 0.1, "A"), "F": ("frequency", "u16", 0.01, "Hz"),
    "P": ("power", "s32", 1, "W"), "p": ("power", "u16", 1, "W"), "Q": ("reactive power", "s32", 1, "var"),
    "S": ("apparent power", "u32", 1, "VA"), "PF": ("power factor", "s16", 0.001, ""),
    "T": ("temperature", "s16", 0.1, "°C"), "E": ("energy", "u32", 0.1, "kWh"), "H": ("hours", "u32", 1, "h"),
    "e": ("energy today", "u16", 0.1, "kWh"), "time": ("time", "u32", 1, "s"), "N": ("count", "u32", 1, ""),
    "share": ("share", "u16", 1, "%"), "state": ("state", "enum", 1, ""), "bits": ("fault bits", "bits", 1, ""),
    "set": ("setpoint", "u16", 1, ""), "n": ("number", "u16", 1, ""),
}  # fmt: skip
"""What the codes of published layouts are; those of physical ones are the plants' (`register_physics`)."""


class LayoutToken(NamedTuple):
    """`times` values of a kind in a row; where `code` is None, so many registers that nobody lists. None is what the
    token does not say."""

    code: str | None
    of: str | None = None
    type: str | None = None
    scale: Fraction | None = None
    unit: str | None = None
    times: int | None = None


class LayoutStretch(NamedTuple):
    """Registers in a row; `address` is None where it is drawn."""

    area: MapArea
    address: int | None
    tokens: tuple[LayoutToken, ...]


class DeviceLayout(NamedTuple):
    """A maker's layout."""

    name: str
    maker: str
    order: str
    float_order: str
    stretches: tuple[LayoutStretch, ...]


@lru_cache(maxsize=2)
def listed_layouts(name: str) -> dict[str, DeviceLayout]:
    """The layouts of a file, by name."""
    found = {}
    for line in (_FOLDER / f"{name}.txt").read_text(encoding="utf-8").splitlines():
        if line and not line.startswith("#"):
            device, maker, orders, *stretches = (part.strip() for part in line.split(";"))
            order, _, float_order = orders.partition(" ")
            listed = tuple(map(stretch_of, stretches))
            found[device] = DeviceLayout(device, maker, order, float_order or order, listed)
    return found


def stretch_of(text: str) -> LayoutStretch:
    """The stretch of `area address token token ...`. Raises ValueError where a token is none."""
    area, address, *tokens = text.split()
    begin = None if address == _ADDRESS_DRAWN else int(address)
    return LayoutStretch(cast(MapArea, area), begin, tuple(map(_token, tokens)))


def _token(text: str) -> LayoutToken:
    if text[0] == "_":
        return LayoutToken(None, times=int(text[1:]))
    match = _TOKEN.fullmatch(text)
    if match is None:
        raise ValueError(f"{text!r} is no token")
    code, of, others, times = match.groups()
    kind = scale = unit = None
    for other in others.split(":")[1:]:
        if re.fullmatch(r"[usf]\d\d", other):
            kind = other
        elif re.fullmatch(r"x[\d.e/-]+", other):
            scale = Fraction(other[1:])
        else:
            unit = other
    return LayoutToken(code, of, kind, scale, unit, None if times is None else int(times))


@lru_cache(maxsize=1)
def published_layouts() -> dict[str, RegisterMap]:
    """The published ones as maps, by name."""
    return {
        name: RegisterMap(
            name,
            tuple(row for stretch in layout.stretches for row in stretch_values(stretch, layout.order)),
            vendor=layout.maker,
            word_order=layout.order,
        )
        for name, layout in listed_layouts("published").items()
    }


def stretch_values(stretch: LayoutStretch, order: str) -> list[MappedValue]:
    """The values of a stretch of a published layout."""
    assert stretch.address is not None
    at, rows = stretch.address, []
    for token in stretch.tokens:
        if token.code is None:
            at += token.times or 0
            continue
        for row in _values(token, stretch.area, at, order):
            rows.append(row)
            at = row.end
    return rows


def _values(token: LayoutToken, area: MapArea, at: int, order: str) -> list[MappedValue]:
    name, kind, scale, unit = QUANTITIES[token.code or ""]
    kind = token.type or kind
    scale = scale if token.scale is None else float(token.scale)
    unit = unit if token.unit is None else token.unit
    length = VALUE_TYPES[kind]
    values = []
    for number in range(1 if token.times is None else token.times):
        mine = token.of if token.times is None else f"{token.of or 'L'}{number + 1}"
        values.append(
            MappedValue(
                area, at + number * length, f"{name} {mine}" if mine else name, kind,
                order if length > 1 else "ABCD", length, scale, unit=unit,
            )
        )  # fmt: skip
    return values
