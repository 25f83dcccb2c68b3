"""What ha-solarman means beyond its keys: the request that reads an address says the function."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from .source import MapSource, mappings, whole_in


def adapted(source: MapSource, records: Iterator[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    """The records, with the function of their request; those without registers are computed."""
    for record in records:
        if not record.get("registers"):
            record |= {"notes": ["computed from other values, has no registers of its own"], "skipped": True}
        yield {"rule": 1, **record, "requested": _code_of(source.yaml, record.get("first", 0))}


def _code_of(content: Mapping[str, Any], address: int) -> int | None:
    """The function code of the request that reads this address."""
    for request in mappings(content.get("requests")):
        begin, end = (whole_in(request.get(key)) for key in ("start", "end"))
        if begin is not None is not end and begin <= address <= end:
            return whole_in(request.get("mb_functioncode"))
    return None
