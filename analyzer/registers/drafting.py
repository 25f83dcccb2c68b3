"""Register maps that are made here: out of traffic and out of the user's own word; and the differences of two maps.

The user's word overrules maps and values, and teaches what is inferred of the rest. It is kept as the interface keeps
it (`f32 CDAB`, `s16`, `text`), by unit, area and address.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, replace
from typing import Final

from dissectors.maps.cells import CellError, cells_of, signature_text, value_of
from dissectors.maps.model import MappedValue, RegisterMap

from ..languages import column_name
from .roles import RegisterValue
from .telling import made_up_name, place_words

_SKIPPED = ("other",)
_SURENESS = "confidence"  # a column that only inferred maps have


def drafted_map(values: Sequence[RegisterValue], device: str, source: str) -> RegisterMap:
    """A map of what was inferred of one unit: names are addresses, with how sure and why beside them."""
    orders = [value.order for value in values if value.order and value.changes]
    order = max(set(orders), key=orders.count) if orders else "ABCD"
    rows = [_drafted_row(value) for value in values if value.kind not in ("unknown",)]
    return RegisterMap(device, tuple(rows), word_order=order, source=source)


def _drafted_row(value: RegisterValue) -> MappedValue:
    kind = value.type if value.kind != "constant" else f"u{16 * value.words}"
    return MappedValue(
        area=value.area,
        address=value.address,
        name=value.name or made_up_name(value.role or value.kind, value.area, value.address),
        type=kind,
        order=value.order or "ABCD",
        length=value.words,
        scale=value.scale or 1.0,
        unit=value.unit_of_measure or "",
        access="rw" if value.role == "setpoint" else "",
        description=value.why,
        other={_SURENESS: f"{value.confidence:.2f}"},
    )


def map_differences(one: RegisterMap, other: RegisterMap) -> Iterator[str]:
    """What differs, a line each: header, values that only one has, values that changed. Of a value that was inferred,
    beside one that a person wrote, only what it says counts: its name is made up, what it leaves empty nobody knew."""
    for field in fields(RegisterMap):
        if field.name not in ("rows", *_SKIPPED) and getattr(one, field.name) != getattr(other, field.name):
            was, now = (_header_text(chart, field.name) for chart in (one, other))
            yield f"{column_name(field.name)}: {was!r} -> {now!r}"
    left, right = _by_place(one), _by_place(other)
    for key in sorted({*left, *right}):
        before, after = left.get(key), right.get(key)
        where = place_words(key[0], key[1])
        if after is None and before is not None:
            yield f"- {where} {before.name} ({before.type})"
        elif before is None and after is not None:
            yield f"+ {where} {after.name} ({after.type})"
        elif before is not None and after is not None and (changed := list(_changes(before, after))):
            yield f"* {where} {after.name}: {', '.join(changed)}"


def _changes(before: MappedValue, after: MappedValue) -> Iterator[str]:
    """The columns of a value that differ."""
    old, new = cells_of(before, "ABCD"), cells_of(after, "ABCD")
    drafts = [cells for row, cells in ((before, old), (after, new)) if _SURENESS in row.other]
    skipped = {_SURENESS, "description"} if drafts else set()
    if len(drafts) == 1:
        skipped |= {"name", *(name for name in (*old, *new) if not drafts[0].get(name))}
    for name in dict.fromkeys([*old, *new]):
        was, now = old.get(name, ""), new.get(name, "")
        if was != now and name not in skipped:
            yield f"{column_name(name)} {was!r} -> {now!r}"


def _header_text(chart: RegisterMap, name: str) -> str:
    return signature_text(chart.match) if name == "match" else str(getattr(chart, name))


def _by_place(chart: RegisterMap) -> dict[tuple[str, int, int], MappedValue]:
    """Rows by area, address and their number at that address."""
    by_address: dict[tuple[str, int, int], MappedValue] = {}
    for row in chart.rows:
        turn = 0
        while (row.area, row.address, turn) in by_address:
            turn += 1
        by_address[row.area, row.address, turn] = row
    return by_address


Place = tuple[int, str, int]  # unit, area, address
SAID: Final = "said_by"  # the key of `MappedValue.other` that marks such a row
_AS: Final = {"hex": "u16", "text": "text"}


def with_own_words(charts: Mapping[int, RegisterMap], words: Mapping[Place, str]) -> dict[int, RegisterMap]:
    """The maps of units, those with a word of the user's holding it in place of what they had in its registers."""
    revised = dict(charts)
    for (unit, area, address), text in sorted(words.items()):
        row = _own_row(area, address, text)
        if row is None:
            continue
        chart = revised.get(unit, RegisterMap("", ()))
        at = chart.at(row.area, row.address)
        if at is not None and (at.address, at.length) == (row.address, row.length):
            row = replace(row, name=at.name, unit=at.unit, scale=at.scale, offset=at.offset)
        rest = [one for one in chart.rows if one.area != row.area or one.end <= row.address or one.address >= row.end]
        revised[unit] = replace(chart, rows=(*rest, row))
    return revised


def _own_row(area: str, address: int, text: str) -> MappedValue | None:
    kind, _, order = text.partition(" ")
    cells = {"area": area, "address": address, "name": "yours", "type": _AS.get(kind, kind), "order": order}
    lengths = {"text": 2, "bits": 1}
    try:
        row = value_of({**cells, **({"length": lengths[kind]} if kind in lengths else {})})
    except CellError:
        return None  # of another version, or written by hand
    return replace(row, name="", other={SAID: "you"})
