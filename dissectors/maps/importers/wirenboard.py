"""Templates of wb-mqtt-serial (JSON with comments): channels with register, format, scale, word order.

The maker's own templates bind their users to its controllers: this reads the user's own copy, none is shipped.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from .source import ImportedMap, MapBuilder, MapSource, mappings, number_in, scaled, whole_in

NAME = "a template of wb-mqtt-serial"
_TYPES: Final = {
    "u8": "u16", "s8": "s16", "u16": "u16", "s16": "s16", "u32": "u32", "s32": "s32", "u64": "u64", "s64": "s64",
    "float": "f32", "double": "f64", "bcd8": "bcd16", "bcd16": "bcd16", "bcd32": "bcd32", "string": "text",
    "u24": None, "s24": None, "bcd24": None, "char8": "u16",
}  # fmt: skip
_AREAS: Final = {
    "holding": "holding", "holding_single": "holding", "holding_multi": "holding", "input": "input", "coil": "coil",
    "discrete": "discrete",
}  # fmt: skip
_DEEPEST: Final = 200  # characters of the names of devices in devices
_UNITS: Final = {
    "voltage": "V", "current": "A", "power": "W", "power_consumption": "kWh", "temperature": "°C", "rel_humidity": "%",
    "atmospheric_pressure": "mbar", "resistance": "Ohm", "lux": "lx", "sound_level": "dB", "concentration": "ppm",
}  # fmt: skip


def recognises(source: MapSource) -> bool:
    """A device with channels."""
    content = source.json
    device = content.get("device") if isinstance(content, Mapping) else None
    return isinstance(device, Mapping) and isinstance(device.get("channels"), list)


def read(source: MapSource) -> list[ImportedMap]:
    """The channels and the parameters."""
    content = source.json
    device = content["device"]
    builder = MapBuilder(source.name, device=str(content.get("title") or device.get("name") or source.stem))
    inner = {str(one.get("title")): one.get("device") for one in mappings(device.get("subdevices"))}
    _channels(builder, device, inner)
    parameters = device.get("parameters")
    listed = parameters.items() if isinstance(parameters, Mapping) else [(p.get("id"), p) for p in mappings(parameters)]
    for name, parameter in listed:
        if isinstance(parameter, Mapping):
            title = parameter.get("title") or name
            _channel(builder, {**parameter, "name": title, "readonly": False}, str(parameter.get("group") or ""))
    return [builder.built()]


def _channels(
    builder: MapBuilder, device: Mapping[str, Any], inner: Mapping[str, Any], prefix: str = "", shift: int = 0
) -> None:
    """The channels of a device; one may be a device within it, `shift` addresses further."""
    for channel in mappings(device.get("channels")):
        parts = channel.get("consists_of")
        within = inner.get(str(channel.get("device_type")))
        if isinstance(within, Mapping) and len(prefix) < _DEEPEST:
            further = shift + (whole_in(channel.get("shift")) or 0)
            _channels(builder, within, inner, f"{prefix}{channel.get('name')} ", further)
            continue
        for item in mappings(parts) if parts else [channel]:
            named = {**item, "name": f"{prefix}{item.get('name')}"} if prefix else item
            _channel(builder, named, str(channel.get("group") or ""), shift)


def _channel(builder: MapBuilder, item: Mapping[str, Any], group: str, shift: int = 0) -> None:
    name, area = item.get("name"), _AREAS.get(str(item.get("reg_type") or "holding"))
    position = str(item.get("address") if item.get("address") is not None else item.get("write_address") or "")
    first, *bits = position.split(":")
    address = whole_in(first)
    if address is None or area is None:
        builder.note(f"{name}: {item.get('reg_type')} {position!r} is not known")
        return
    address += shift
    if len(bits) == 2 and all(bit.isdigit() for bit in bits) and area in ("input", "holding"):
        builder.add_bits(area, address, int(bits[0]), int(bits[1]), str(name))
        return
    word = str(item.get("format") or "u16").lower()
    kind = "bool" if area in ("coil", "discrete") else _TYPES.get(word)
    if kind is None:
        builder.note(f"{name}: format {word!r} is no type of a map")
        return
    states = _states(item)
    if states and kind in ("u16", "s16"):
        kind = "enum"
    words_reversed = item.get("word_order") == "little_endian"
    bytes_swapped = item.get("byte_order") == "little_endian"
    order = {(False, False): None, (True, False): "CDAB", (False, True): "BADC", (True, True): "DCBA"}
    octets = whole_in(item.get("string_data_size"))
    wide = kind not in ("bool", "u16", "s16", "enum", "bcd16")
    readonly = item.get("readonly", False) or area in ("input", "discrete")
    writable = item.get("type") in ("switch", "range", "text", "rgb", "pushbutton") or item.get("readonly") is False
    builder.add(
        {
            "area": area,
            "address": address,
            "name": name,
            "type": kind,
            "order": order[words_reversed, bytes_swapped] if wide or bytes_swapped else None,
            "length": octets if kind == "text" else None,
            **(
                {}
                if kind in ("bool", "enum", "text")
                else scaled(number_in(item, "scale", 1.0) or 1.0, number_in(item, "offset", 0.0))
            ),
            "unit": item.get("units") or _UNITS.get(str(item.get("type"))),
            "values": states,
            "min": item.get("min") if isinstance(item.get("min"), int | float) else None,
            "max": item.get("max") if isinstance(item.get("max"), int | float) else None,
            "access": "rw" if writable and not readonly else "r",
            "group": group,
        },
        name,
    )


def _states(item: Mapping[str, Any]) -> dict[int, str]:
    numbers, titles = item.get("enum"), item.get("enum_titles")
    if not isinstance(numbers, list):
        return {}
    texts = titles if isinstance(titles, list) else []
    return {n: str(texts[at]) if at < len(texts) else str(n) for at, n in enumerate(numbers) if isinstance(n, int)}
