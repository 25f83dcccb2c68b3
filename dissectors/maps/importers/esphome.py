"""What ESPHome means beyond its keys: variables of the file, octets behind an address, masks, filters."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any, Final

from .source import MapSource, mappings, number_in, whole_in

_BITS: Final = ("binary_sensor", "switch")
_VARIABLE: Final = re.compile(r"\$(?:\{(\w+)\}|(\w+))")
_FACTOR: Final = re.compile(r"\s*return\s*\(?\s*(?:\(float\)\s*)?x\s*(?:([*/])\s*(\d+\.?\d*|\.\d+)f?)?\s*\)?\s*;?\s*")
_POINT: Final = re.compile(r"\s*(-?[\d.]+)\s*->\s*(-?[\d.]+)\s*")
_IGNORED: Final = frozenset({"multiply", "offset", "calibrate_linear", "calibrate_polynomial"})


def adapted(source: MapSource, records: Iterator[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    """The records, with the file's own variables in place."""
    known = source.yaml.get("substitutions")
    words = {str(key): str(word) for key, word in known.items()} if isinstance(known, Mapping) else {}
    for raw in records:
        record = {key: _substituted(value, words) for key, value in raw.items()}
        record["notes"] = []
        _place(record)
        _mask(record)
        if record["^@"] == "text_sensor":
            octets = whole_in(record.get("response_size")) or 2
            record |= {"kind": "text", "length": whole_in(record.get("register_count")) or (octets + 1) // 2}
        record["scale"], record["added"] = _filters(record)
        yield record


def _substituted(value: Any, words: Mapping[str, str]) -> Any:
    if not isinstance(value, str):
        return value
    return _VARIABLE.sub(lambda found: words.get(found[1] or found[2], found[0]), value)


def _place(record: dict[str, Any]) -> None:
    """Count the octets of an offset as registers."""
    behind, address = whole_in(record.get("offset")) or 0, whole_in(record.get("address"))
    registers, half = divmod(behind, 2)
    if half:
        record["notes"].append(f"an offset of {behind} octets begins within a register")
        record["skipped"] = True
    if address is not None and record.get("register_type") not in ("coil", "discrete_input"):
        record["address"] = address + registers


def _mask(record: dict[str, Any]) -> None:
    """Take a mask for the bits that it leaves."""
    is_bit = record["^@"] in _BITS
    mask = whole_in(record.get("bitmask")) or int(is_bit)
    if is_bit or mask.bit_count() == 1:
        first = (mask & -mask).bit_length() - 1
        record |= {"bit": first, "width": mask.bit_length() - first}
    elif mask and record["^@"] != "text_sensor":
        record["notes"].append(f"bitmask {mask:#x} is not carried")


def _filters(record: dict[str, Any]) -> tuple[float, float]:
    """What the filters make of a raw number, as scale and offset."""
    scale, offset = 1.0, 0.0
    own = {"lambda": record["lambda"]} if "lambda" in record else {}
    for step in (own, *mappings(record.get("filters"))):
        for key, value in step.items():
            line = _factor_and_offset(key, step)
            if line is not None:
                scale, offset = scale * line[0], offset * line[0] + line[1]
            elif key == "lambda":
                record["notes"].append("what its lambda computes is not carried")
            elif key in _IGNORED:
                record["notes"].append(f"{key} {str(value)[:60]} is not carried")
    return scale, offset


def _factor_and_offset(key: object, step: Mapping[str, Any]) -> tuple[float, float] | None:
    """Factor and offset of one filter, None where it is no straight line."""
    match key, number_in(step, str(key), float("nan")):
        case "multiply", number if number == number:
            return number, 0.0
        case "offset", number if number == number:
            return 1.0, number
        case "lambda", _:
            found = _FACTOR.fullmatch(str(step[key]))
            factor = float(found[2] or 1) if found else 0.0
            return (1 / factor if found and found[1] == "/" else factor, 0.0) if factor else None
        case "calibrate_linear", _:
            return _line(step[key].get("datapoints") if isinstance(step[key], Mapping) else step[key])
    return None


def _line(listed: Any) -> tuple[float, float] | None:
    """The line through two points `from -> to`."""
    points = [_POINT.fullmatch(str(one)) for one in listed] if isinstance(listed, list) else []
    numbers = [(float(point[1]), float(point[2])) for point in points if point]
    if len(numbers) != 2 or numbers[0][0] == numbers[1][0]:
        return None
    (x, y), (x2, y2) = numbers
    return (y2 - y) / (x2 - x), y - x * (y2 - y) / (x2 - x)
