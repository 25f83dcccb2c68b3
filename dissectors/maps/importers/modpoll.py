"""modpoll's configuration (CSV): rows `device`, `poll` and `ref`; addresses as 40001, or counting from 0."""

from __future__ import annotations

from typing import Final

from ..table import csv_rows
from .source import ImportedMap, MapBuilder, MapSource, whole_in

NAME = "a configuration of modpoll"
_AREAS: Final = {
    "coil": "coil", "discrete_input": "discrete", "input_register": "input", "holding_register": "holding"
}  # fmt: skip
_FIRST: Final = {"coil": 1, "discrete": 10001, "input": 30001, "holding": 40001}
_TYPES: Final = {
    "uint16": "u16", "int16": "s16", "uint32": "u32", "int32": "s32", "uint64": "u64", "int64": "s64",
    "float16": None, "float32": "f32", "float64": "f64", "bool": "bool",
}  # fmt: skip
_DELIMITERS: Final = (",", ";", "\t")
_ORDERS: Final = {"BE_BE": "ABCD", "BE_LE": "CDAB", "LE_BE": "BADC", "LE_LE": "DCBA"}


def recognises(source: MapSource) -> bool:
    """Rows that begin with poll and ref."""
    if not source.is_text:
        return False
    return any({"poll", "ref"} <= _heads(source, delimiter) for delimiter in _DELIMITERS)


def read(source: MapSource) -> list[ImportedMap]:
    """A map a device."""
    builders: dict[str, MapBuilder] = {}
    builder = builders.setdefault("", MapBuilder(source.name))
    area, order, is_logical = "holding", "ABCD", True
    delimiter = next(one for one in _DELIMITERS if {"poll", "ref"} <= _heads(source, one))
    for number, row in csv_rows(source.text.splitlines(), delimiter, source.name):
        cells = [cell.strip() for cell in row] + [""] * 8
        match cells[0].lower():
            case "device":
                builder = builders.setdefault(cells[1], MapBuilder(source.name, device=cells[1]))
            case "poll":  # poll,AREA,START,COUNT,ORDER; once poll,NAME,UNIT,START,COUNT,AREA,ORDER
                words = [cell.lower() for cell in cells]
                area = next((_AREAS[word] for word in words if word in _AREAS), area)
                order = next((_ORDERS[word.upper()] for word in words if word.upper() in _ORDERS), order)
                start = next((one for one in map(whole_in, cells[1:]) if one is not None and one >= 0x100), 0)
                is_logical = area != "coil" and not 0x100 <= start < _FIRST[area]  # from 40000 on: 40001 is no 0
                if cells[1].lower() not in _AREAS:
                    builder = builders.setdefault(cells[1], MapBuilder(source.name, device=cells[1]))
            case "ref":
                _reference(builder, cells, area, order, number, is_logical=is_logical)
    return [one.built() for one in builders.values()]


def _heads(source: MapSource, delimiter: str) -> set[str]:
    return {line.partition(delimiter)[0].strip().strip('"').lower() for line in source.text.splitlines()[:400]}


def _reference(builder: MapBuilder, cells: list[str], area: str, order: str, number: int, *, is_logical: bool) -> None:
    if not cells[2]:  # ref,NAME,UNIT,ADDRESS,TYPE,ACCESS: a unit of measure before the address, once
        cells = [cells[0], cells[1], cells[3], cells[4], cells[5], cells[2], *cells[6:]]
    name, position, word, access, unit, scale = cells[1], cells[2], cells[3].lower(), cells[4], cells[5], cells[6]
    address = whole_in(position)
    if address is not None and address >= _FIRST[area] and is_logical:
        address -= _FIRST[area]
    if address is None:
        builder.note(f"row {number}: {name}: address {position!r} is not known")
        return
    kind = _TYPES.get(word)
    length = None
    if word.startswith("string"):
        kind, length = "text", max(1, (whole_in(word.removeprefix("string") or "2") or 2) // 2)
    elif word.startswith("bool"):
        kind = "bool" if area in ("coil", "discrete") else "bits"
    if kind is None:
        builder.note(f"row {number}: {name}: type {word!r} is no type of a map")
        return
    if area in ("coil", "discrete"):
        kind, scale = "bool", ""
    builder.add(
        {
            "area": area,
            "address": address,
            "name": name,
            "type": kind,
            "order": order if kind not in ("u16", "s16", "bool", "bits", "text") else None,
            "length": length,
            "scale": scale or None,
            "unit": unit,
            "access": access if access in ("r", "w", "rw") else None,
        },
        f"row {number}: {name}",
    )
