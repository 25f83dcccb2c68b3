"""Telegraf's inputs.modbus (TOML) in its three styles: registers, requests and metrics."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final

from .source import ImportedMap, MapBuilder, MapSource, mappings, number_in, whole_in

NAME = "a modbus input of Telegraf"
_LISTS: Final = {
    "holding_registers": "holding", "input_registers": "input", "coils": "coil", "discrete_inputs": "discrete"
}  # fmt: skip
_TYPES: Final = {
    "INT16": "s16", "UINT16": "u16", "INT32": "s32", "UINT32": "u32", "INT64": "s64", "UINT64": "u64",
    "FLOAT32": "f32", "FLOAT64": "f64", "FLOAT32-IEEE": "f32", "FLOAT64-IEEE": "f64", "STRING": "text",
}  # fmt: skip
_FIXED: Final = {"FIXED": "s", "UFIXED": "u", "FLOAT32": "u"}  # of the register style: integers by a scale
_SHORT: Final = {
    "AB": None,
    "BA": "BADC",
    "ABCDEFGH": "ABCD",
    "GHEFCDAB": "CDAB",
    "BADCFEHG": "BADC",
    "HGFEDCBA": "DCBA",
}


def recognises(source: MapSource) -> bool:
    """A table inputs.modbus."""
    return any(True for _ in _plugins(source))


def read(source: MapSource) -> list[ImportedMap]:
    """A map a plug-in and unit."""
    builders: dict[tuple[str, object], MapBuilder] = {}
    for plugin in _plugins(source):
        for unit, order, area, field in _fields(plugin):
            name = str(plugin.get("name") or "modbus")
            builder = builders.setdefault((name, unit), MapBuilder(source.name, device=f"{name} unit {unit}"))
            _field(builder, area, order, field)
    return [builder.built() for builder in builders.values()]


def _plugins(source: MapSource) -> Iterator[Mapping[str, Any]]:
    content = source.toml
    inputs = content.get("inputs") if isinstance(content, Mapping) else None
    if isinstance(inputs, Mapping):
        yield from mappings(inputs.get("modbus"))


def _fields(plugin: Mapping[str, Any]) -> Iterator[tuple[object, str | None, str, Mapping[str, Any]]]:
    """(unit, order, area, field) of every style."""
    for key, area in _LISTS.items():
        for field in mappings(plugin.get(key)):
            yield plugin.get("slave_id", 1), None, area, field
    for request in mappings(plugin.get("request")):
        for field in mappings(request.get("fields")):
            yield (
                request.get("slave_id", 1),
                request.get("byte_order"),
                str(request.get("register") or "holding"),
                field,
            )
    for metric in mappings(plugin.get("metric")):
        for field in mappings(metric.get("fields")):
            yield metric.get("slave_id", 1), metric.get("byte_order"), str(field.get("register") or "holding"), field


def _field(builder: MapBuilder, area: str, order: str | None, field: Mapping[str, Any]) -> None:
    name, address = field.get("name"), field.get("address")
    if field.get("omit") is True:
        return
    listed = [whole_in(one) for one in address] if isinstance(address, list) else [whole_in(address)]
    if not listed or listed[0] is None:
        builder.note(f"{name}: address {address!r} is not known")
        return
    places = [place for place in listed if place is not None]
    first = min(places)
    turned = len(places) > 1 and places == list(range(places[0], first - 1, -1))
    if len(places) != len(listed) or not (turned or places == list(range(first, first + len(places)))):
        builder.note(f"{name}: address {address!r} does not lie side by side")
        return
    common: dict[str, object] = {"area": area, "address": first, "name": name}
    if area in ("coil", "discrete"):
        builder.add(common, name)
        return
    word = str(field.get("type") or field.get("data_type") or "UINT16").upper()
    kind = _TYPES.get(word)
    if isinstance(address, list) and word in _FIXED and "data_type" in field:
        kind = f"{_FIXED[word]}{16 * len(listed)}"
    if word in ("BIT",) or kind is None:
        if word == "BIT":
            builder.add_bits(area, first, whole_in(field.get("bit")) or 0, 1, str(name))
        else:
            builder.note(f"{name}: type {word} is no type of a map")
        return
    byte_order = str(field.get("byte_order") or order or "ABCD").upper()
    wide = kind not in ("u16", "s16", "text")
    chosen = _SHORT.get(byte_order, byte_order) or "ABCD"
    chosen = chosen[2:] + chosen[:2] if turned else chosen  # the registers are listed last word first
    builder.add(
        {
            **common,
            "type": kind,
            "order": chosen if wide else None,
            "length": field.get("length", len(listed)) if kind == "text" else None,
            "scale": f"{number_in(field, 'scale', 1.0) or 1.0:.10g}" if kind != "text" else None,
        },
        name,
    )
