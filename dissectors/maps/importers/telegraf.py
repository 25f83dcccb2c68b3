"""What Telegraf means beyond its keys: addresses one by one, in either order; integers by a scale."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from .source import MapSource, whole_in


def adapted(_: MapSource, records: Iterator[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    """The records but for those that are left out."""
    for record in records:
        if record.get("omit") is True:
            continue
        listed = record.get("address")
        if isinstance(listed, list):
            places = [place for place in map(whole_in, listed) if place is not None]
            first = min(places, default=0)
            rising = list(range(first, first + len(listed)))
            if places not in (rising, rising[::-1]) or not places:
                record |= {"notes": [f"address {listed!r} is not contiguous"], "skipped": True}
            record |= {"first": first, "count": len(listed)}
            record["fixed"] = f"{record.get('data_type')} {len(listed)}" if "data_type" in record else None
            if places != rising:  # the last word is listed first
                order = str(record.get("byte_order") or "ABCD").upper()
                record["byte_order"] = order[2:] + order[:2]
        if str(record.get("type")).upper() == "BIT":
            record.setdefault("bit", 0)
        yield record
