"""Home Assistant's `modbus:` configuration (YAML): sensors, binary sensors, switches and others of hubs; before 2021
`platform: modbus` under `sensor:`, `binary_sensor:`, `switch:` and `climate:`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final

from .source import ImportedMap, MapBuilder, MapSource, mappings, number_in, scaled, whole_in

NAME = "a modbus: configuration of Home Assistant"
_LISTS: Final = {
    "sensors": "sensor", "binary_sensors": "binary_sensor", "switches": "switch", "lights": "light", "fans": "fan",
    "covers": "cover", "climates": "climate",
}  # fmt: skip
_TYPES: Final = {
    "int": "s16", "uint": "u16", "int16": "s16", "uint16": "u16", "int32": "s32", "uint32": "u32", "int64": "s64",
    "uint64": "u64", "float": "f32", "float32": "f32", "float64": "f64", "string": "text",
}  # fmt: skip
_AREAS: Final = {
    "holding": "holding", "holdings": "holding", "input": "input", "coil": "coil", "coils": "coil",
    "discrete_input": "discrete", "discrete_inputs": "discrete",
}  # fmt: skip
_MOST_TURNS: Final = 250
_OLD_NAMES: Final = {
    "register": "address",
    "coil": "address",
    "current_temp_register": "address",
    "register_type": "input_type",
}
_PACKAGES: Final = 3  # homeassistant: packages: NAME:
_ORDERS: Final = {"word": "CDAB", "byte": "BADC", "word_byte": "DCBA", "none": None}


def recognises(source: MapSource) -> bool:
    """A hub that has one of the lists."""
    return any(True for _ in _hubs(source))


def read(source: MapSource) -> list[ImportedMap]:
    """A map a hub and unit."""
    builders: dict[tuple[str, str], MapBuilder] = {}
    for hub in _hubs(source):
        for kind in _LISTS:
            for item in mappings(hub.get(kind)):
                unit = item.get("device_address", item.get("slave", hub.get("slave", 1)))
                name = str(hub.get("name") or "modbus")
                key = (name, str(unit))
                builder = builders.setdefault(key, MapBuilder(source.name, device=f"{name} unit {unit}"))
                _item(builder, kind, item)
    return [builder.built() for builder in builders.values()]


def _hubs(source: MapSource) -> Iterator[Mapping[str, Any]]:
    for content in _configurations(source.yaml):
        for hub in mappings(content):
            if any(isinstance(hub.get(kind), list) for kind in _LISTS):
                yield hub
    lone = {"sensor": source.yaml} if isinstance(source.yaml, list) else source.yaml  # a list that sensor: includes
    for configuration in _packages(lone):
        yield from _platforms(configuration)


def _configurations(content: Any) -> Iterator[Any]:
    """What stands under `modbus:`, at the top or in a package; a file that is included has the hubs alone."""
    for configuration in _packages(content):
        if "modbus" in configuration:
            yield configuration["modbus"]
    if not (isinstance(content, Mapping) and "modbus" in content):
        yield content


def _packages(content: Any, depth: int = 0) -> Iterator[Mapping[str, Any]]:
    """A configuration and those inside it, which packages are."""
    if isinstance(content, Mapping):
        yield content
        if depth < _PACKAGES and "modbus" not in content:
            for inner in content.values():
                yield from _packages(inner, depth + 1)


def _platforms(configuration: Mapping[str, Any]) -> Iterator[Mapping[str, Any]]:
    """Hubs, in today's words, of what stands under `platform: modbus`, a hub an item."""
    for kind, domain in _LISTS.items():
        for platform in mappings(configuration.get(domain)):
            if platform.get("platform") != "modbus":
                continue
            lists = [(key, mappings(platform.get(key))) for key in ("registers", "coils", "inputs")]
            for key, item in [(key, item) for key, items in lists for item in items] or [("", platform)]:
                today = {_OLD_NAMES.get(word, word): value for word, value in item.items()}
                if key == "coils":
                    today["input_type"] = "coil"
                elif key == "inputs":
                    today.setdefault("input_type", "coil")
                if item.get("reverse_order"):
                    today["swap"] = "word"
                yield {"name": item.get("hub"), kind: [today]}


def _item(builder: MapBuilder, kind: str, item: Mapping[str, Any]) -> None:
    name = item.get("name") or item.get("unique_id")
    address = whole_in(item.get("address"))
    wanted = str(item.get("input_type") or item.get("write_type") or ("coil" if "binary" in kind else "holding"))
    area = _AREAS.get(wanted)
    if address is None or area is None:
        builder.note(f"{name}: address {item.get('address')!r} of {wanted!r} is not known")
        return
    writable = kind not in ("sensors", "binary_sensors", "climates")
    if kind == "climates" and (target := item.get("target_temp_register")) is not None:
        first = target[0] if isinstance(target, list) and target else target
        same = {key: value for key, value in item.items() if key != "target_temp_register"}
        _item(builder, "targets", {**same, "address": first, "name": f"{name} target", "input_type": "holding"})
    if area in ("coil", "discrete"):
        builder.add({"area": area, "address": address, "name": name, "access": "rw" if writable else "r"}, name)
        return
    word = str(item.get("data_type") or "int16").lower()
    count = whole_in(item.get("count")) or 1
    data_type = _TYPES.get(word)
    if word in ("int", "uint", "float") and count in (2, 4):
        data_type = f"{_TYPES[word][0]}{16 * count}"
    if data_type is None:
        structure = str(item.get("structure") or "")
        data_type = {">f": "f32", ">i": "s32", ">I": "u32", ">h": "s16", ">H": "u16", ">d": "f64"}.get(structure)
        if data_type is None:
            builder.note(f"{name}: data type {word!r} with structure {structure!r} is no type of a map")
            return
    scale, offset = number_in(item, "scale", 1.0), number_in(item, "offset", 0.0)
    virtual = min(max(whole_in(item.get("virtual_count", item.get("slave_count"))) or 0, 0), _MOST_TURNS)
    length = {"u16": 1, "s16": 1, "u32": 2, "s32": 2, "f32": 2}.get(data_type, 4)
    for turn in range(virtual + 1):
        builder.add(
            {
                "area": area,
                "address": address + turn * length,
                "name": f"{name} {turn + 1}" if virtual else name,
                "type": data_type,
                "order": _ORDERS.get(str(item.get("swap") or "none").lower()),
                "length": count if data_type == "text" else None,
                **scaled(scale or 1.0, offset),
                "unit": item.get("unit_of_measurement"),
                "min": item.get("min_value"),
                "max": item.get("max_value"),
                "access": "rw" if writable else None,
                "description": item.get("device_class"),
            },
            name,
        )
