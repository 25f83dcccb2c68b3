"""What ha-solarman means beyond its keys: registers low word first, rules, the request that says the function."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final

from .source import MapSource, mappings, number_in, whole_in

_RULES: Final = {1: "u", 2: "s", 3: "u", 4: "s", 5: "text", 6: "bits", 7: "u", 10: "u"}


def adapted(source: MapSource, records: Iterator[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    """The records, with where they stand and what they are."""
    info, default = (_mapping(source.yaml.get(key)) for key in ("info", "default"))
    for record in records:
        record = {**{key: info.get(key) or "" for key in ("model", "manufacturer")}, **record}
        places = [whole_in(register) for register in record.get("registers") or [] if not isinstance(register, Mapping)]
        listed = [place for place in places if place is not None]
        first = min(listed, default=0)
        rising = list(range(first, first + len(listed)))
        kind = _RULES.get(whole_in(record.get("rule", 1)) or 0)
        why = (
            ("computed from other values, has no registers of its own", not listed or None in places),
            (f"rule {record.get('rule')}: no type of a map says this", kind is None),
            (f"registers {listed} do not lie side by side: no type of a map says this",
             listed not in (rising, rising[::-1])),
        )  # fmt: skip
        record["notes"] = [words for words, holds in why if holds][:1]
        record |= {"skipped": True} if record["notes"] else {}
        code = _mapping(record.get("code")).get("read", record.get("code"))
        record["code"] = whole_in(code) or _code_of(source.yaml, first) or whole_in(default.get("code")) or 3
        record |= {"first": first, "count": len(listed), "listed": "rising" if listed == rising else "falling"}
        record["rule"] = kind
        scale = number_in(record, "scale", 1.0) / (number_in(record, "divide", 1.0) or 1.0)
        record["added"] = -number_in(record, "offset", 0.0) * scale
        yield {**record, **{key: _mapping(record.get("validation")).get(key) for key in ("min", "max")}}


def _mapping(value: Any) -> Mapping[str, Any]:
    return value if isinstance(value, Mapping) else {}


def _code_of(content: Mapping[str, Any], address: int) -> int | None:
    """The function code of the request that reads this address."""
    for request in mappings(content.get("requests")):
        begin, end = (whole_in(request.get(key)) for key in ("start", "end"))
        if begin is not None is not end and begin <= address <= end:
            return whole_in(request.get("mb_functioncode"))
    return None
