"""What the rows of modpoll mean together: each `ref` belongs to the `poll` and the `device` above it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Final

from .source import MapSource, whole_in

_AREAS: Final = {"coil": 1, "discrete_input": 10001, "input_register": 30001, "holding_register": 40001}
"""The first logical number of each."""
_ORDERS: Final = frozenset({"BE_BE", "BE_LE", "LE_BE", "LE_LE"})


def adapted(_: MapSource, records: Iterator[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    """The references, with what is said above them."""
    poll: dict[str, Any] = {"area": "holding_register", "logical": True}
    for row in records:
        cells = [row.get(str(at), "") for at in range(8)]
        match cells[0].lower():
            case "device":
                poll["device"] = cells[1]
            case "poll":  # poll,AREA,START,COUNT,ORDER; once poll,NAME,UNIT,START,COUNT,AREA,ORDER
                poll |= _polled(cells, poll["area"])
            case "ref":
                yield {**poll, **_reference(cells, poll), "what": f"row {row['row']}: {cells[1]}"}


def _polled(cells: Sequence[str], before: str) -> dict[str, Any]:
    area = next((cell.lower() for cell in cells if cell.lower() in _AREAS), before)
    order = next((cell.upper() for cell in cells if cell.upper() in _ORDERS), "BE_BE")
    start = next((number for number in map(whole_in, cells[1:]) if number is not None and number >= 0x100), 0)
    named = {} if cells[1].lower() in _AREAS else {"device": cells[1]}
    is_logical = area != "coil" and not 0x100 <= start < _AREAS[area]  # from 40000 on: 40001 is no 0
    return {"area": area, "order": order, "logical": is_logical, **named}


def _reference(cells: list[str], poll: dict[str, Any]) -> dict[str, Any]:
    if not cells[2]:  # ref,NAME,UNIT,ADDRESS,TYPE,ACCESS: a unit of measure before the address, once
        cells = [cells[0], cells[1], cells[3], cells[4], cells[5], cells[2], *cells[6:]]
    names = ("name", "place", "type", "access", "unit", "scale")
    reference: dict[str, Any] = dict(zip(names, cells[1:], strict=False))
    first, number = _AREAS[poll["area"]], whole_in(reference["place"])
    if number is not None and number >= first and poll["logical"]:
        reference["place"] = number - first
    word = reference["type"].lower()
    kind = next((kind for kind in ("string", "bool") if word.startswith(kind)), word)
    octets = whole_in(word.removeprefix("string")) or 2
    return {**reference, "type": kind, "length": max(1, octets // 2)}
