"""What templates of wb-mqtt-serial mean beyond their keys: devices within devices, parts of registers, parameters."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final

from .source import MapSource, mappings, whole_in

_DEEPEST: Final = 200  # characters of the names of devices in devices
_SET: Final = ("switch", "range", "text", "rgb", "pushbutton")
_UNITS: Final = {
    "voltage": "V", "current": "A", "power": "W", "power_consumption": "kWh", "temperature": "°C", "rel_humidity": "%",
    "atmospheric_pressure": "mbar", "resistance": "Ohm", "lux": "lx", "sound_level": "dB", "concentration": "ppm",
}  # fmt: skip


def adapted(source: MapSource, records: Iterator[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    """The channels and the parameters of the device."""
    for device in records:
        title = {"^title": next(filter(None, (device.get("^title"), device.get("name"), source.stem)))}
        inner = {str(one.get("title")): one.get("device") for one in mappings(device.get("subdevices"))}
        for channel in (*_channels(device, inner, "", 0), *_parameters(device.get("parameters"))):
            yield _completed({**title, **channel})


def _channels(device: Mapping[str, Any], inner: Mapping[str, Any], prefix: str, shift: int) -> Iterator[dict[str, Any]]:
    """The channels of a device; one may be a device within it, `shift` addresses further."""
    for channel in mappings(device.get("channels")):
        within = inner.get(str(channel.get("device_type")))
        if isinstance(within, Mapping) and len(prefix) < _DEEPEST:
            further = shift + (whole_in(channel.get("shift")) or 0)
            yield from _channels(within, inner, f"{prefix}{channel.get('name')} ", further)
            continue
        for item in mappings(channel.get("consists_of")) or [channel]:
            named = f"{prefix}{item.get('name') or ''}"
            yield {**item, "name": named, "group": str(channel.get("group") or ""), "shift": shift}


def _parameters(listed: Any) -> Iterator[dict[str, Any]]:
    named = listed.items() if isinstance(listed, Mapping) else [(one.get("id"), one) for one in mappings(listed)]
    for name, parameter in named:
        if isinstance(parameter, Mapping):
            yield {**parameter, "name": parameter.get("title") or name, "readonly": False}


def _completed(item: dict[str, Any]) -> dict[str, Any]:
    """A channel with its place, its rights and the names of its states."""
    address = item.get("address")
    first, *bits = str(item.get("write_address") if address is None else address).split(":")
    place = whole_in(first)
    item["first"] = first if place is None else place + item.get("shift", 0)
    item |= dict(zip(("bit", "width"), bits, strict=False)) if len(bits) == 2 else {}
    item["order"] = " ".join(str(item.get(key) or "big_endian") for key in ("word_order", "byte_order"))
    fixed = item.get("readonly", False) or item.get("reg_type") in ("input", "discrete")
    writable = item.get("type") in _SET or item.get("readonly") is False
    item["access"] = "rw" if writable > bool(fixed) else "r"
    item["usual unit"] = _UNITS.get(str(item.get("type")))
    item |= {key: None for key in ("min", "max") if not isinstance(item.get(key), int | float)}
    numbers, titles = (_listed(item.get(key)) for key in ("enum", "enum_titles"))
    named = [*titles, *numbers[len(titles) :]]
    item["states"] = {number: str(title) for number, title in zip(numbers, named, strict=False)}
    return item


def _listed(value: Any) -> list[Any]:
    return value if isinstance(value, list) else []
