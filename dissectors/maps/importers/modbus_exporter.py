"""modbus_exporter's modules (YAML): metrics whose addresses lead with the area's digit and count from 0 behind it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from .source import ImportedMap, MapBuilder, MapSource, mappings, number_in, whole_in

NAME = "modules of modbus_exporter"
_TYPES: Final = {
    "bool": "bool", "int16": "s16", "uint16": "u16", "int32": "s32", "uint32": "u32", "int64": "s64", "uint64": "u64",
    "float32": "f32", "float64": "f64",
}  # fmt: skip
_ORDERS: Final = {"big": "ABCD", "little": "DCBA", "mixed": "BADC", "yolo": "CDAB"}
_AREAS: Final = {0: "coil", 1: "discrete", 3: "input", 4: "holding"}


def recognises(source: MapSource) -> bool:
    """`modules` whose metrics have a data type."""
    content = source.yaml
    modules = mappings(content.get("modules")) if isinstance(content, Mapping) else []
    return any("dataType" in metric for module in modules for metric in mappings(module.get("metrics")))


def read(source: MapSource) -> list[ImportedMap]:
    """A map a module."""
    charts = []
    for module in mappings(source.yaml.get("modules")):
        builder = MapBuilder(source.name, device=str(module.get("name") or ""))
        for metric in mappings(module.get("metrics")):
            _metric(builder, metric)
        charts.append(builder.built())
    return charts


def _metric(builder: MapBuilder, metric: Mapping[str, Any]) -> None:
    labels = metric.get("labels")
    extra = " ".join(str(label) for label in labels.values()) if isinstance(labels, Mapping) else ""
    name = f"{metric.get('name')} {extra}".strip()
    number, kind = whole_in(metric.get("address")), _TYPES.get(str(metric.get("dataType")))
    if number is None or kind is None:
        builder.note(f"{name}: address {metric.get('address')!r}, data type {metric.get('dataType')!r} are not known")
        return
    digit, address = divmod(number, 100_000 if number >= 100_000 else 10_000)
    area = _AREAS.get(digit)
    if area is None:
        builder.note(f"{name}: address {number} leads with no area's digit")
        return
    if kind == "bool" and area in ("input", "holding"):
        builder.add_bits(area, address, whole_in(metric.get("bitOffset")) or 0, 1, name)
        return
    if area in ("coil", "discrete") and kind != "bool":
        builder.note(f"{name}: address {number} leads with the digit of {area}s, which hold no {metric['dataType']}")
        return
    builder.add(
        {
            "area": area,
            "address": address,
            "name": name,
            "type": kind,
            "order": _ORDERS.get(str(metric.get("endianness") or "big"))
            if kind not in ("bool", "s16", "u16")
            else None,
            "scale": f"{number_in(metric, 'factor', 1.0) or 1.0:.10g}" if kind != "bool" else None,
            "description": metric.get("help"),
        },
        name,
    )
