"""ioBroker's modbus adapter: the tab separated table that it exports for one area, which the file may name or not."""

from __future__ import annotations

from typing import Final

from ..table import csv_rows
from .source import ImportedMap, MapBuilder, MapSource, whole_in

NAME = "a table of ioBroker.modbus"
_TYPES: Final = {  # and order
    "uint16be": ("u16", None), "uint16le": ("u16", "BADC"), "int16be": ("s16", None), "int16le": ("s16", "BADC"),
    "int8be": ("s16", None), "uint8be": ("u16", None),
    "uint32be": ("u32", "ABCD"), "uint32le": ("u32", "DCBA"), "uint32sw": ("u32", "CDAB"), "uint32sb": ("u32", "BADC"),
    "int32be": ("s32", "ABCD"), "int32le": ("s32", "DCBA"), "int32sw": ("s32", "CDAB"), "int32sb": ("s32", "BADC"),
    "uint64be": ("u64", "ABCD"), "uint64le": ("u64", "DCBA"), "int64be": ("s64", "ABCD"), "int64le": ("s64", "DCBA"),
    "floatbe": ("f32", "ABCD"), "floatle": ("f32", "DCBA"), "floatsw": ("f32", "CDAB"), "floatsb": ("f32", "BADC"),
    "doublebe": ("f64", "ABCD"), "doublele": ("f64", "DCBA"), "string": ("text", None), "stringle": ("text", "BADC"),
}  # fmt: skip
_AREAS: Final = (("dis", "discrete"), ("coil", "coil"), ("input", "input"), ("hold", "holding"))
_BASES: Final = ((400001, "holding"), (300001, "input"), (40001, "holding"), (30001, "input"), (10001, "discrete"))


def recognises(source: MapSource) -> bool:
    """A heading with `_address`, or with type, len and factor beside an address."""
    head = _heading(source)
    return "_address" in head or ({"address", "len", "factor"} <= set(head))


def read(source: MapSource) -> list[ImportedMap]:
    """The table; logical addresses (40001) name the area, else the file does, else holding registers are taken."""
    builder = MapBuilder(source.name)
    named = next((area for word, area in _AREAS if word in source.stem.lower()), None)
    if named is None:
        builder.note("the table does not say its area: where addresses do not either, holding registers are taken")
    lines = source.text.splitlines()
    rows = csv_rows(lines, "\t" if "\t" in lines[0] else ",", source.name)
    names = [name.strip().lower() for name in next(rows)[1]]
    listed = [
        (number, dict(zip(names, (cell.strip() for cell in cells), strict=False)))
        for number, cells in rows
        if any(cells)
    ]
    addresses = [whole_in(row.get("_address")) or 0 for _, row in listed if row.get("_address")]
    aliases = all(any(base <= address < base + 0x10000 for base, area in _BASES if named in (None, area))
                  for address in addresses)  # fmt: skip
    if aliases and addresses:
        builder.note("addresses were taken for aliases (40001), as all of them could be")
    for number, row in listed:
        _row(builder, row, named, number, aliases=aliases)
    return [builder.built()]


def _heading(source: MapSource) -> list[str]:
    lines = source.text.splitlines() if source.is_text else []
    return [cell.strip().strip('"').lower() for cell in (lines[0] if lines else "").replace(",", "\t").split("\t")]


def _row(builder: MapBuilder, row: dict[str, str], named: str | None, number: int, *, aliases: bool) -> None:
    position = row.get("_address") or row.get("address") or ""
    name = row.get("name") or row.get("description") or f"Register {position}"
    address = whole_in(position)
    if address is None:
        builder.note(f"row {number}: address {position!r} is not known")
        return
    area = named or "holding"
    for base, logical in _BASES:
        if address >= base and named in (None, logical) and address - base < 0x10000 and aliases:
            area, address = logical, address - base
            break
    word = (row.get("type") or "").lower()
    kind, order = _TYPES.get(word, (None, None)) if word else ("u16", None)
    if area in ("coil", "discrete"):
        kind, order = "bool", None
    if kind is None:
        builder.note(f"row {number}: {name}: type {word!r} is no type of a map")
        return
    if (formula := row.get("formula", "")) not in ("", "x"):
        builder.note(f"row {number}: {name}: formula {formula[:60]!r} is not carried")
    factor, offset = row.get("factor", ""), row.get("offset", "")
    plain = kind in ("bool", "text")
    builder.add(
        {
            "area": area,
            "address": address,
            "name": name,
            "type": kind,
            "order": order,
            "length": row.get("len") if kind == "text" else None,
            "scale": None if plain else factor or None,
            "offset": None if plain else offset or None,
            "unit": row.get("unit"),
            "access": "rw" if row.get("wp") == "true" or row.get("cw") == "true" else None,
            "description": row.get("description"),
        },
        f"row {number}: {name}",
    )
