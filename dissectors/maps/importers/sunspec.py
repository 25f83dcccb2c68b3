"""Where the points of a SunSpec model stand.

A model says nothing of where it is: the common model (1) is put at 40002, any other at 40070, as devices whose chain is
these two have it; `moved` puts it elsewhere.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any, Final

from .source import ImportedMap, MapSource, mappings, whole_in

_BASES: Final = {1: 40002}
_AFTER_COMMON: Final = 40070
_LAST: Final = 0xFFFF
_DEEPEST: Final = 500  # characters of the names of groups in groups


def adapted(source: MapSource, records: Iterator[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    """The points of the model at its usual address."""
    number = whole_in(source.json["id"]) or 0
    base = _BASES.get(number, _AFTER_COMMON)
    for group in records:
        device = {"device": f"SunSpec model {number}: {group.get('label') or group.get('name', '')}"}
        words = f"placed at {base}: the device's SunS chain gives the actual address"
        points: list[dict[str, Any]] = []
        _group(points, group, base, "")
        for at, point in enumerate(points):
            yield {**device, **point, "of file": [words] * (at == 0)}


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


def _group(points: list[dict[str, Any]], group: Mapping[str, Any], at: int, prefix: str) -> int:
    """Add the points of a group from an address on; the address behind it."""
    places: dict[str, int] = {}
    own: list[tuple[Mapping[str, Any], int]] = []
    for point in mappings(group.get("points")):
        places[str(point.get("name"))] = at
        own.append((point, at))
        at += _size(point)
    points += [_placed(point, place, places, prefix) for point, place in own if point.get("type") != "pad"]
    for inner in mappings(group.get("groups")):
        count, name = inner.get("count", 1), inner.get("label") or inner.get("name")
        if not isinstance(count, int) or count < 1:
            words = "repeats as often as the device says: one of it is listed"
            points.append({"shown": f"group {inner.get('name')}", "notes": [words], "skipped": True})
            count = 1
        for turn in range(count):
            before = at
            if at > _LAST or len(prefix) > _DEEPEST:
                break
            at = _group(points, inner, at, f"{prefix}{name} {turn + 1} " if count > 1 else f"{prefix}{name} ")
            if at == before:
                break
    return at


def _size(point: Mapping[str, Any]) -> int:
    """Registers of a point, by its type's bits where it does not say them; a text has one then."""
    size = point.get("size")
    digits = re.search(r"\d+$", str(point.get("type")))
    return size if isinstance(size, int) and size > 0 else max(1, int(digits[0]) // 16) if digits else 1


def _placed(point: Mapping[str, Any], place: int, places: Mapping[str, int], prefix: str) -> dict[str, Any]:
    scale = point.get("sf")
    states = {one.get("value"): one.get("label") or one.get("name", "") for one in mappings(point.get("symbols"))}
    return {
        **point,
        "shown": prefix + str(point.get("label") or point.get("name")),
        "place": place,
        "registers": _size(point),
        "factor": 10.0**scale if isinstance(scale, int) and abs(scale) <= 10 else None,
        "scale place": places.get(scale) if isinstance(scale, str) else None,
        "states": states,
    }
