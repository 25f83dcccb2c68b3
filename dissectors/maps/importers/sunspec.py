"""SunSpec information models as JSON: points by their offsets in a model.

A model says nothing of where it stands: the common model (1) is put at 40002, any other at 40070, as devices whose
chain is these two have it; `moved` puts it elsewhere.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final

from .source import ImportedMap, MapBuilder, MapSource, mappings, whole_in

NAME = "a SunSpec model"
_BASES: Final = {1: 40002}
_AFTER_COMMON: Final = 40070
_LAST: Final = 0xFFFF
_DEEPEST: Final = 500  # characters of the names of groups in groups
_TYPES: Final = {
    "int16": "s16", "uint16": "u16", "count": "u16", "acc16": "u16", "enum16": "enum", "bitfield16": "bits",
    "int32": "s32", "uint32": "u32", "acc32": "u32", "enum32": "enum", "bitfield32": "bits", "ipaddr": "u32",
    "int64": "s64", "uint64": "u64", "acc64": "u64", "float32": "f32", "float64": "f64", "string": "text",
    "sunssf": "s16", "raw16": "u16", "eui48": "u64", "bitfield64": "u64", "ipv6addr": "text",
}  # fmt: skip


def recognises(source: MapSource) -> bool:
    """An object with an id and a group of points."""
    content = source.json
    return isinstance(content, Mapping) and "id" in content and isinstance(content.get("group"), Mapping)


def read(source: MapSource) -> list[ImportedMap]:
    """The model at its usual address."""
    model = source.json
    number = whole_in(model["id"]) or 0
    base = _BASES.get(number, _AFTER_COMMON)
    group = model["group"]
    builder = MapBuilder(source.name, device=f"SunSpec model {number}: {group.get('label') or group.get('name', '')}")
    builder.vendor = "SunSpec"
    builder.note(f"put at {base}: where a device has the model is said by the chain that begins with SunS")
    _group(builder, group, base, "")
    return [builder.built()]


def moved(chart: ImportedMap, base: int) -> ImportedMap:
    """The same model beginning at another address."""
    first = min(row.address for row in chart.chart.rows)
    rows = tuple(
        replace(
            row,
            address=row.address - first + base,
            scale_address=None if row.scale_address is None else row.scale_address - first + base,
        )
        for row in chart.chart.rows
    )
    return replace(chart, chart=replace(chart.chart, rows=rows), notes=())


def _group(builder: MapBuilder, group: Mapping[str, Any], at: int, prefix: str) -> int:
    """The rows of a group from an address on; the address behind it."""
    addresses: dict[str, int] = {}
    points = []
    for point in mappings(group.get("points")):
        size = point.get("size")
        size = size if isinstance(size, int) and size > 0 else _usual_size(point)
        addresses[str(point.get("name"))] = at
        points.append((point, at, size))
        at += size
    for point, address, size in points:
        _point(builder, point, address, size, addresses, prefix)
    for inner in mappings(group.get("groups")):
        if at > _LAST or len(prefix) > _DEEPEST:
            break
        count = inner.get("count", 1)
        if not isinstance(count, int) or count < 1:
            builder.note(f"group {inner.get('name')}: repeats as often as the device says: one of it is listed")
            count = 1
        for turn in range(count):
            before = at
            name = f"{inner.get('label') or inner.get('name')}" + (f" {turn + 1}" if count > 1 else "")
            at = _group(builder, inner, at, f"{prefix}{name} ")
            if at > _LAST or at == before:
                break
    return at


def _usual_size(point: Mapping[str, Any]) -> int:
    """Registers of a point that does not say them: its type's bits; a text has one."""
    digits = re.search(r"\d+$", str(point.get("type")))
    return max(1, int(digits[0]) // 16) if digits else 1


def _point(
    builder: MapBuilder, point: Mapping[str, Any], address: int, size: int, places: Mapping[str, int], prefix: str
) -> None:
    kind = _TYPES.get(str(point.get("type")))
    if kind is None:
        if point.get("type") != "pad":
            builder.note(f"{point.get('name')}: type {point.get('type')} is not known")
        return
    scale = point.get("sf")
    symbols = {
        s["value"]: str(s.get("label") or s.get("name", ""))
        for s in mappings(point.get("symbols"))
        if isinstance(s.get("value"), int)
    }
    builder.add(
        {
            "area": "holding",
            "address": address,
            "name": prefix + str(point.get("label") or point.get("name")),
            "type": kind,
            "length": size if kind in ("text", "enum", "bits") else None,
            "scale": f"{10.0**scale:g}" if isinstance(scale, int) and abs(scale) <= 10 else None,
            "scale_register": places.get(scale) if isinstance(scale, str) else None,
            "unit": point.get("units"),
            "values": symbols,
            "access": "rw" if str(point.get("access")).upper() == "RW" else "r",
            "description": point.get("desc"),
        },
        point.get("name"),
    )
