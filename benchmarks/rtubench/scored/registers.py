"""Registers: what the values mean. A row is a value: `unit`, `table`, `address`, `type`, and `order` of two registers.

`table` is 3 or 4, the function that reads it; `address` as it stands in requests; `type` one of TYPES; `order` is big
(the first register is the high one) or little, null for one register.
"""

from __future__ import annotations

from collections.abc import Sequence

from ..items import Row

TYPES = {"u16": 1, "i16": 1, "u32": 2, "i32": 2, "f32": 2}  # registers of each


def check(row: Row, _: int) -> str:
    """What is wrong with a row, "" if nothing."""
    if any(type(row.get(name)) is not int for name in ("unit", "table", "address")):
        return "unit, table and address must be whole numbers"
    if row.get("type") not in TYPES:
        return f"type must be one of {', '.join(TYPES)}"
    if row.get("order") not in (("big", "little") if TYPES[row["type"]] == 2 else (None,)):
        return "order must be big or little for two registers, null for one"
    return ""


def _places(row: Row) -> set[tuple[int, int, int]]:
    return {(row["unit"], row["table"], row["address"] + at) for at in range(TYPES[row["type"]])}


def registers(truth: Row, rows: Sequence[Row]) -> float:
    """F1 of values that moved. Right is the place with a type that the data allow and, of two registers, the order.

    Rows on registers that never moved, or on values that the data leave open, count neither way.
    """
    wanted = {(one["unit"], one["table"], one["address"]): one for one in truth["values"] if one["counts"]}
    counted = {place for one in wanted.values() for place in _places({**one, "type": one["types"][0]})}
    hits = given = 0
    for row in rows:
        if not _places(row) & counted:
            continue
        given += 1
        one = wanted.get((row["unit"], row["table"], row["address"]))
        hits += one is not None and row["type"] in one["types"] and row.get("order") == one["order"]
    return 2 * hits / (len(wanted) + given) if wanted else 1.0
