"""Where the points of a SunSpec model stand: a group's one behind the other, then the groups within it.

A model says nothing of where it is: the common model (1) is put at 40002, any other at 40070, as devices whose chain is
these two have it; `moved` puts it elsewhere.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any, Final

from ..cells import count_in, whole_in
from ..records import mappings
from .builder import ImportedMap
from .source import MapSource

_BASES: Final = {1: 40002}
_AFTER_COMMON: Final = 40070
_LAST: Final = 0xFFFF
_DEEPEST: Final = 500  # characters of the names of groups in groups


def adapted(source: MapSource, records: Iterator[dict[str, Any]], _: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """The points of the model at its usual address."""
    number = count_in(source.json["id"])
    own = whole_in(source.json.get("base"))
    base = _BASES.get(number, _AFTER_COMMON) if own is None else own
    words = [f"placed at {base}: the device's SunS chain gives the actual address"] * (own is None)
    for group in records:
        device = {"device": f"SunSpec model {number}: {group.get('label') or group.get('name', '')}"}
        for point in _points(group, iter(range(base, _LAST + 1)), ""):
            yield {**device, **point, "of file": words}
            words = []


def moved(chart: ImportedMap, base: int) -> ImportedMap:
    """The same model beginning at another address."""
    by = base - min(row.address for row in chart.chart.rows)
    rows = tuple(
        replace(
            row, address=row.address + by, scale_address=None if row.scale_address is None else row.scale_address + by
        )
        for row in chart.chart.rows
    )
    return replace(chart, chart=replace(chart.chart, rows=rows), notes=())


def _points(group: Mapping[str, Any], places: Iterator[int], prefix: str) -> Iterator[dict[str, Any]]:
    """The points of a group, which takes its addresses from `places`."""
    spots = [(point, [next(places, None) for _ in range(_size(point))]) for point in mappings(group.get("points"))]
    by_name = {str(point.get("name")): taken[0] for point, taken in spots}
    for point, taken in spots:
        if point.get("type") != "pad" and taken[0] is not None:
            yield _placed(point, taken, by_name, prefix)
    for inner in mappings(group.get("groups")):
        count, name = inner.get("count", 1), inner.get("label") or inner.get("name")
        turns = count if isinstance(count, int) and count > 0 else 1
        if turns != count:
            words = "repeats as often as the device says: one of it is listed"
            yield {"shown": f"group {inner.get('name')}", "notes": [words], "skipped": True}
        for turn in range(turns * (len(prefix) < _DEEPEST)):
            found = [*_points(inner, places, f"{prefix}{name} {turn + 1} " if turns > 1 else f"{prefix}{name} ")]
            yield from found
            if not found:
                break


def _size(point: Mapping[str, Any]) -> int:
    """Registers of a point, by its type's bits where it does not say them; a text has one then."""
    size, digits = point.get("size"), re.search(r"\d+$", str(point.get("type")))
    own = size if isinstance(size, int) else int(digits[0]) // 16 if digits else 1
    return min(max(1, own), _LAST)


def _placed(
    point: Mapping[str, Any], taken: list[int | None], by_name: Mapping[str, int | None], prefix: str
) -> dict[str, Any]:
    scale, symbols = point.get("sf"), point.get("symbols")
    states = {one.get("value"): one.get("label") or one.get("name", "") for one in mappings(symbols)}
    return {
        **point,
        "shown": prefix + str(point.get("label") or point.get("name")),
        "place": taken[0],
        "registers": len(taken),
        "factor": 10.0**scale if isinstance(scale, int) and abs(scale) <= 10 else None,
        "scale place": by_name.get(scale) if isinstance(scale, str) else None,
        "states": symbols if isinstance(symbols, Mapping) else states,
    }
