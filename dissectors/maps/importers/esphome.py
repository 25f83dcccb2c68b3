"""ESPHome's `modbus_controller` components (YAML): sensors, numbers, switches, selects by platform."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any, Final

from .source import ImportedMap, MapBuilder, MapSource, mappings, number_in, whole_in

NAME = "modbus_controller components of ESPHome"
_PLATFORM: Final = "modbus_controller"
_TYPES: Final = {  # and the order of a value type, None where there is one word
    "U_WORD": ("u16", None), "S_WORD": ("s16", None), "U_DWORD": ("u32", "ABCD"), "S_DWORD": ("s32", "ABCD"),
    "U_DWORD_R": ("u32", "CDAB"), "S_DWORD_R": ("s32", "CDAB"), "U_QWORD": ("u64", "ABCD"),
    "S_QWORD": ("s64", "ABCD"), "U_QWORD_R": ("u64", "CDAB"), "S_QWORD_R": ("s64", "CDAB"), "FP32": ("f32", "ABCD"),
    "FP32_R": ("f32", "CDAB"),
}  # fmt: skip
_AREAS: Final = {"coil": "coil", "discrete_input": "discrete", "holding": "holding", "read": "input", "input": "input"}
_BITS: Final = ("binary_sensor", "switch")
_VARIABLE: Final = re.compile(r"\$(?:\{(\w+)\}|(\w+))")
_FACTOR: Final = re.compile(r"\s*return\s*\(?\s*(?:\(float\)\s*)?x\s*(?:([*/])\s*(\d+\.?\d*|\.\d+)f?)?\s*\)?\s*;?\s*")
_POINT: Final = re.compile(r"\s*(-?[\d.]+)\s*->\s*(-?[\d.]+)\s*")


def recognises(source: MapSource) -> bool:
    """Any component of the platform."""
    return any(True for _ in _components(source))


def read(source: MapSource) -> list[ImportedMap]:
    """A map a controller."""
    builders: dict[str, MapBuilder] = {}
    for component, item in _components(source):
        controller = str(item.get("modbus_controller_id") or "")
        builder = builders.setdefault(controller, MapBuilder(source.name, device=controller))
        _item(builder, component, item)
    return [builder.built() for builder in builders.values()]


def _components(source: MapSource) -> Iterator[tuple[str, Mapping[str, Any]]]:
    content = source.yaml
    if not isinstance(content, Mapping):
        return
    known = content.get("substitutions")
    words = {str(key): str(word) for key, word in known.items()} if isinstance(known, Mapping) else {}
    for component, items in content.items():
        for item in mappings(items):
            if item.get("platform") == _PLATFORM:
                yield str(component), {key: _substituted(value, words) for key, value in item.items()}


def _substituted(value: Any, words: Mapping[str, str]) -> Any:
    """A text with the file's own variables; others stay as they stand."""
    if not isinstance(value, str):
        return value
    return _VARIABLE.sub(lambda found: words.get(found[1] or found[2], found[0]), value)


def _item(builder: MapBuilder, component: str, item: Mapping[str, Any]) -> None:
    name = item.get("name") or item.get("id")
    address = whole_in(item.get("address"))
    default = "coil" if component == "switch" else "holding"
    area = _AREAS.get(str(item.get("register_type") or default).lower())
    if address is None or area is None:
        builder.note(f"{name}: address {item.get('address')!r} of {item.get('register_type')!r} is not known")
        return
    behind = whole_in(item.get("offset")) or 0  # octets from the address on
    if area in ("input", "holding"):
        if behind % 2:
            builder.note(f"{name}: an offset of {behind} octets begins within a register")
            return
        address += behind // 2
    writable = component in ("number", "switch", "select", "output")
    common: dict[str, object] = {"area": area, "address": address, "name": name}
    if area in ("coil", "discrete"):
        builder.add({**common, "access": "rw" if writable else "r"}, name)
        return
    mask = whole_in(item.get("bitmask"))
    if component in _BITS or (mask is not None and mask and mask & (mask - 1) == 0):
        mask = mask or 1
        first = (mask & -mask).bit_length() - 1
        builder.add_bits(area, address, first, mask.bit_length() - first, str(name))
        return
    if component == "text_sensor":
        octets = whole_in(item.get("response_size")) or 2
        length = whole_in(item.get("register_count")) or (octets + 1) // 2
        builder.add({**common, "type": "text", "length": length}, name)
        return
    kind, order = _TYPES.get(str(item.get("value_type") or "U_WORD").upper(), (None, None))
    if kind is None:
        builder.note(f"{name}: value type {item.get('value_type')!r} is no type of a map")
        return
    if mask:
        builder.note(f"{name}: bitmask {mask:#x} is not carried")
    scale, offset = _filters(builder, name, item)
    options = item.get("optionsmap")
    states = {number: str(text) for text, number in options.items()} if isinstance(options, Mapping) else {}
    builder.add(
        {
            **common,
            "type": "enum" if states and kind in ("u16", "s16") else kind,
            "order": order,
            "scale": f"{scale:.10g}",
            "offset": f"{offset:.10g}" if offset else None,
            "unit": item.get("unit_of_measurement"),
            "values": states,
            "min": item.get("min_value"),
            "max": item.get("max_value"),
            "access": "rw" if writable else None,
        },
        name,
    )


def _filters(builder: MapBuilder, name: object, item: Mapping[str, Any]) -> tuple[float, float]:
    """What the filters make of a raw number, as scale and offset; `multiply` of a number divides it."""
    scale, offset = 1.0, 0.0
    own = {"lambda": item["lambda"]} if "lambda" in item else {}
    for step in (own, *mappings(item.get("filters"))):
        for key, value in step.items():
            line = _factor_and_offset(key, step)
            if line is not None:
                scale, offset = scale * line[0], offset * line[0] + line[1]
            elif key == "lambda":
                builder.note(f"{name}: what its lambda computes is not carried")
            elif key in ("multiply", "offset") or str(key).startswith("calibrate"):
                builder.note(f"{name}: {key} {str(value)[:60]} is not carried")
    multiply = item.get("multiply")
    if multiply is not None:
        try:
            scale /= float(multiply)
        except (TypeError, ValueError, ZeroDivisionError):
            builder.note(f"{name}: multiply {multiply!r} is not carried")
    return scale, offset


def _factor_and_offset(key: object, step: Mapping[str, Any]) -> tuple[float, float] | None:
    """Factor and offset of one filter, None where it is no straight line."""
    number = number_in(step, str(key), float("nan"))
    if key in ("multiply", "offset") and number == number:
        return (number, 0.0) if key == "multiply" else (1.0, number)
    if key == "lambda" and (match := _FACTOR.fullmatch(str(step[key]))):
        factor = float(match[2] or 1)
        return (1 / factor if match[1] == "/" and factor else factor, 0.0)
    if key == "calibrate_linear":
        listed = step[key].get("datapoints") if isinstance(step[key], Mapping) else step[key]
        points = [_POINT.fullmatch(str(one)) for one in listed] if isinstance(listed, list) else []
        if len(points) == 2 and points[0] and points[1]:
            (x, y), (x2, y2) = ((float(point[1]), float(point[2])) for point in points if point)
            return None if x == x2 else ((y2 - y) / (x2 - x), y - x * (y2 - y) / (x2 - x))
    return None
