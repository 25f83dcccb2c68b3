"""What Home Assistant means beyond its keys: structures, copies of a value side by side, the target of a climate."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final

from .source import MapSource, whole_in

_MOST_TURNS: Final = 250
_LENGTHS: Final = {"uint32": 2, "int32": 2, "float32": 2, "float": 2, "uint64": 4, "int64": 4, "float64": 4}


def adapted(_: MapSource, records: Iterator[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    """The values that each record is."""
    for record in records:
        if record.get("data_type") == "custom":
            structure = str(record.get("structure") or "")
            record["data_type"] = f"custom {structure}{' u' * structure.isupper()}"
        if record.get("reverse_order"):
            record["reversed"] = "word"
        target = record.get("target_temp_register")
        if target is not None:
            first = target[0] if isinstance(target, list) and target else target
            yield {**record, "address": first, "name": f"{record.get('name')} target", "input_type": "holding",
                   "^@": "targets"}  # fmt: skip
        copies = whole_in(record.get("virtual_count", record.get("slave_count"))) or 0
        copies = min(max(copies, 0), _MOST_TURNS)
        yield from _copies(record, copies) if copies else [record]


def _copies(record: dict[str, Any], count: int) -> Iterator[dict[str, Any]]:
    """A value and the copies behind it."""
    first, length = whole_in(record.get("address")) or 0, _LENGTHS.get(str(record.get("data_type")), 1)
    for turn in range(count + 1):
        yield {**record, "address": first + turn * length, "name": f"{record.get('name')} {turn + 1}"}
