"""Inverter definitions of ha-solarman (YAML): groups of items with registers, a rule that is the type, scale and unit.

The registers of a wide value are listed low word first, whatever their addresses.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from .source import ImportedMap, MapBuilder, MapSource, mappings, number_in, scaled, whole_in

NAME = "an inverter definition of ha-solarman"
_RULES: Final = {1: "u", 2: "s", 3: "u", 4: "s", 5: "text", 6: "bits", 7: "u", 10: "u"}
_AREAS: Final = {1: "coil", 2: "discrete", 3: "holding", 4: "input"}


def recognises(source: MapSource) -> bool:
    """`parameters`: a list of groups whose items have registers or a rule."""
    content = source.yaml
    groups = mappings(content.get("parameters")) if isinstance(content, Mapping) else []
    return any("rule" in item or "registers" in item for group in groups for item in mappings(group.get("items")))


def read(source: MapSource) -> list[ImportedMap]:
    """The items, in groups."""
    content: Mapping[str, Any] = source.yaml
    info = content.get("info") if isinstance(content.get("info"), Mapping) else {}
    builder = MapBuilder(source.name, order="CDAB")
    if isinstance(info, Mapping):
        builder.device, builder.vendor = str(info.get("model") or ""), str(info.get("manufacturer") or "")
    default = content.get("default")
    code = whole_in(default.get("code")) if isinstance(default, Mapping) else None
    for group in mappings(content.get("parameters")):
        for item in mappings(group.get("items")):
            _item(builder, item, str(group.get("group") or ""), content, code or 3)
    return [builder.built()]


def _item(builder: MapBuilder, item: Mapping[str, Any], group: str, content: Mapping[str, Any], code: int) -> None:
    name = str(item.get("name") or "")
    registers = [whole_in(register) for register in item.get("registers") or [] if not isinstance(register, Mapping)]
    if not registers or None in registers:
        builder.note(f"{name}: computed from other values, has no registers of its own")
        return
    listed = [register for register in registers if register is not None]
    rule = whole_in(item.get("rule", 1)) or 0
    kind, low = _RULES.get(rule), min(listed)
    ascending = listed == list(range(low, low + len(listed)))
    if kind is None or not (ascending or listed[::-1] == list(range(low, low + len(listed)))):
        why = f"rule {rule}" if kind is None else f"registers {listed} do not lie side by side"
        builder.note(f"{name}: {why}: no type of a map says this")
        return
    chosen = item.get("code")
    chosen = chosen.get("read") if isinstance(chosen, Mapping) else chosen
    area = _AREAS.get(whole_in(chosen) or _code_of(content, low) or code, "holding")
    length = len(listed)
    states = _states(item)
    if kind in ("u", "s"):
        kind = "enum" if states else f"{kind}{16 * length}"
    bit = whole_in(item.get("bit"))
    if bit is not None and length == 1:
        builder.add_bits(area, low, bit, 1, name)
        return
    scale = number_in(item, "scale", 1.0) or 1.0
    scale /= number_in(item, "divide", 1.0) or 1.0
    limits = item.get("validation") if isinstance(item.get("validation"), Mapping) else {}
    builder.add(
        {
            "area": area,
            "address": low,
            "name": name,
            "type": kind,
            "order": None if length == 1 or kind == "text" else "CDAB" if ascending else "ABCD",
            "length": length if kind in ("text", "bits", "enum") else None,
            **({} if states or kind in ("text", "bits") else scaled(scale, -number_in(item, "offset", 0.0) * scale)),
            "unit": item.get("uom"),
            "values": states,
            "min": limits.get("min") if isinstance(limits, Mapping) else None,
            "max": limits.get("max") if isinstance(limits, Mapping) else None,
            "description": item.get("description"),
            "group": group,
        },
        name,
    )


def _states(item: Mapping[str, Any]) -> dict[int, str]:
    """Names of states; one may serve several keys."""
    states: dict[int, str] = {}
    for entry in mappings(item.get("lookup")):
        key = entry.get("key")
        for one in key if isinstance(key, list) else [key]:
            if (state := whole_in(one)) is not None:
                states[state] = _word(entry.get("value"))
    return states


def _code_of(content: Mapping[str, Any], address: int) -> int | None:
    """The function code of the request that reads this address."""
    for request in mappings(content.get("requests")):
        begin, end = whole_in(request.get("start")), whole_in(request.get("end"))
        if begin is not None and end is not None and begin <= address <= end:
            return whole_in(request.get("mb_functioncode"))
    return None


def _word(text: object) -> str:
    """A state's name; YAML reads On and Off as truth."""
    return {True: "On", False: "Off"}[text] if isinstance(text, bool) else str(text)
