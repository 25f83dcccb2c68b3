"""What modbus_exporter means beyond its keys: the digit that an address leads with, labels that tell metrics apart."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from .source import MapSource, mappings, whole_in


def adapted(_: MapSource, records: Iterator[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    """The records, with area and address apart."""
    for record in records:
        labels = [str(label) for labels in mappings(record.get("labels")) for label in labels.values()]
        record["name"] = " ".join([str(record.get("name")), *labels])
        number, kind = whole_in(record.get("address")), record.get("dataType")
        if number is not None:
            record["digit"], record["place"] = divmod(number, 100_000 if number >= 100_000 else 10_000)
            if record["digit"] not in (0, 1, 3, 4):
                record |= {"notes": [f"address {number} leads with no area's digit"], "skipped": True}
            elif record["digit"] < 2 and kind != "bool":
                area = ("coil", "discrete")[record["digit"]]
                words = f"address {number} leads with the digit of {area}s, which hold no {kind}"
                record |= {"notes": [words], "skipped": True}
        yield record
