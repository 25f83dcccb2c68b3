"""Modbus Schema (YAML): blocks of fields, each with an expression over registers.

Expressions that read registers as one value, by a factor, are values of a map; what is computed from other fields is
not, and is noted.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, Final

from dissectors.values import ValueFormError, physical

from .source import ImportedMap, MapBuilder, MapSource, mappings

NAME = "a Modbus Schema"
_TYPES: Final = {
    "int16": "s16", "uint16": "u16", "int32": "s32", "uint32": "u32", "int64": "s64", "uint64": "u64",
    "ieee754_32": "f32", "ieee754_64": "f64", "utf8": "text", "enum": "enum", "bitset": "bits", "boolean": "bool",
    "ipv4addr": "u32",
}  # fmt: skip
_AREAS: Final = {
    "hr": "holding", "holding-register": "holding", "ir": "input", "input-register": "input", "c": "coil",
    "coil": "coil", "di": "discrete", "discrete-input": "discrete",
}  # fmt: skip
_DIGITS: Final = {"0x": "coil", "1x": "discrete", "3x": "input", "4x": "holding"}
_CALL: Final = re.compile(
    r"\s*(?:(?P<function>\w+)\(\s*)(?:(?P<swap>swap\w+)\(\s*)?(?P<address>[\w-]+:\d+|\d+x\d+|\d+)\s*"
    r"(?:#\s*(?P<count>\d+)|\.\.\s*(?P<last>[\w-]+:\d+|\d+x\d+|\d+))?\s*\)?\s*(?:;(?P<rest>.*))?\)\s*"
    r"(?:(?P<operator>[*/])\s*(?P<factor>[\d.]+))?\s*",
    re.DOTALL,
)
_STATE: Final = re.compile(r"(\d+)\s*->\s*'([^']*)'")
_LONGEST: Final = 2000  # characters of an expression
_SWAPS: Final = {"swapendian": "DCBA", "swapbytes": "BADC"}


def recognises(source: MapSource) -> bool:
    """`blocks` whose fields have expressions."""
    content = source.yaml
    blocks = mappings(content.get("blocks")) if isinstance(content, Mapping) else []
    return any("expression" in field for block in blocks for field in mappings(block.get("fields")))


def read(source: MapSource) -> list[ImportedMap]:
    """The fields of all blocks."""
    builder = MapBuilder(source.name, device=str(source.yaml.get("description") or ""))
    for block in mappings(source.yaml.get("blocks")):
        for field in mappings(block.get("fields")):
            _field(builder, field, str(block.get("id") or ""))
    return [builder.built()]


def _field(builder: MapBuilder, field: Mapping[str, Any], group: str) -> None:
    name, expression = field.get("id"), str(field.get("expression") or "")[:_LONGEST]
    call = _CALL.fullmatch(expression)
    kind = _TYPES.get(call["function"]) if call else None
    spot = _spot(call["address"]) if call else None
    if call is None or kind is None or spot is None:
        builder.note(f"{name}: {expression!r} is computed, or no type of a map")
        return
    area, address = spot
    length = int(call["count"]) if call["count"] else 1
    if call["last"]:
        last = _spot(call["last"])
        length = last[1] - address + 1 if last is not None else 1
    factor = float(call["factor"]) if call["factor"] else 1.0
    scale = 1 / factor if call["operator"] == "/" and factor else factor
    builder.add(
        {
            "area": area,
            "address": address,
            "name": name,
            "type": kind,
            "order": _SWAPS.get(call["swap"] or ""),
            "length": length if kind in ("text", "enum", "bits") else None,
            "scale": f"{scale:.10g}" if scale not in (0.0, 1.0) else None,
            "unit": field.get("unit"),
            "values": {int(state): text for state, text in _STATE.findall(call["rest"] or "")},
            "description": field.get("description"),
            "group": group,
        },
        name,
    )


def _spot(text: str) -> tuple[str, int] | None:
    word, colon, number = text.partition(":")
    if colon:
        area = _AREAS.get(word.lower())
        return None if area is None else (area, int(number))
    try:
        digit, address = physical(re.sub(r"x0+(?=\d)", "x", text))
    except ValueFormError:
        return None
    return _DIGITS[digit], address
