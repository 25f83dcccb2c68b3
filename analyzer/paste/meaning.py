"""Frames, as JSON objects, by a register map: the names and values of what they carry."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, Final

from dissectors.maps import RegisterMap
from dissectors.maps.model import MappedReading, readings_by_map

from ..languages import tr
from ..registers.telling import place_words

_AREAS: Final = {
    1: "coil", 5: "coil", 15: "coil", 2: "discrete", 3: "holding", 6: "holding", 16: "holding", 22: "holding",
    23: "holding", 4: "input",
}  # fmt: skip
_SINGLE: Final = ("register", "output")  # what functions 06 and 05 write: fields _address and _value
_ON: Final = 0xFF00


def mapped_readings(
    line: Mapping[str, Any], chart: RegisterMap, known: dict[tuple[str, int], int] | None = None
) -> list[MappedReading]:
    """What a frame (its JSON object) carries by a map; registers of which the address is not known are left out.

    `known`: registers of the same unit that earlier frames carried, from which values may be computed; what this frame
    carries is added.
    """
    area = _AREAS.get(line.get("function") or 0)
    if area is None or line.get("exception") is not None:
        return []
    words = dict(_words(line.get("fields") or ()))
    readings = readings_by_map(chart, area, words, known)
    if known is not None:
        known.update({(area, address): word for address, word in words.items()})
    return readings


def _words(fields: Sequence[Mapping[str, Any]]) -> Iterator[tuple[int, int]]:
    """Addresses and values of a frame's registers and bits."""
    by_name = {field["name"]: field.get("value") for field in fields}
    for what in _SINGLE:
        address, value = by_name.get(f"{what}_address"), by_name.get(f"{what}_value")
        if isinstance(address, int) and isinstance(value, int):
            yield address, int(value == _ON) if what == "output" else value
    for field in fields:
        address, value = field.get("address"), field.get("value")
        if isinstance(address, int) and isinstance(value, int) and field["name"] not in ("address", "start"):
            yield address, int(value)
        yield from _words(field.get("fields") or ())


def refused_requests(lines: Iterable[Mapping[str, Any]]) -> frozenset[int]:
    """Where the requests begin that were answered by an exception: what they would write was not written."""
    refusals = [line for line in lines if line.get("exception") is not None]
    return frozenset(line["request_start"] for line in refusals if line.get("request_start") is not None)


def meaning_text(lines: Iterable[Mapping[str, Any]], chart_of: Mapping[int, RegisterMap]) -> str:
    """The values of some frames as text, a heading a frame."""
    lines, parts = list(lines), []
    refused = refused_requests(lines)
    known: dict[int, dict[tuple[str, int], int]] = {}
    for line in lines:
        chart, unit = chart_of.get(line.get("unit") or 0), line.get("unit") or 0
        registers = known.setdefault(unit, {}) if line.get("start") not in refused else {}
        readings = mapped_readings(line, chart, registers) if chart is not None else []
        if readings:
            width = max(len(reading.row.name) for reading in readings)
            unit, start = line["unit"], line["start"]
            if start in refused:
                parts.append(
                    tr("asked of unit {unit} at byte {start} and refused, by the map:", unit=unit, start=start)
                )
            else:
                parts.append(tr("by the map, unit {unit} at byte {start}:", unit=unit, start=start))
            for reading in readings:
                place = place_words(reading.row.area, reading.row.address, reading.row.length)
                parts.append(f"  {reading.row.name:<{width}}  {reading.text}  ({place})")
    return "".join(f"{part}\n" for part in parts)
