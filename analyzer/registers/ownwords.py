"""The user's own word about registers: it overrules maps and values, and teaches what is inferred of the rest.

A word is kept as the interface keeps it (`f32 CDAB`, `s16`, `text`), by unit, area and address.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

from dissectors.maps.cells import CellError, value_of
from dissectors.maps.model import MappedValue, RegisterMap

Place = tuple[int, str, int]  # unit, area, address
SAID: Final = "said_by"  # the key of `MappedValue.other` that marks such a row
_AS: Final = {"hex": "u16", "text": "text"}


def with_own_words(charts: Mapping[int, RegisterMap], words: Mapping[Place, str]) -> dict[int, RegisterMap]:
    """The maps of units, those with a word of the user's holding it in place of what they had in its registers."""
    revised = dict(charts)
    for (unit, area, address), text in sorted(words.items()):
        row = _row(area, address, text)
        if row is None:
            continue
        chart = revised.get(unit, RegisterMap("", ()))
        at = chart.at(row.area, row.address)
        if at is not None and (at.address, at.length) == (row.address, row.length):
            row = replace(row, name=at.name, unit=at.unit, scale=at.scale, offset=at.offset)
        rest = [one for one in chart.rows if one.area != row.area or one.end <= row.address or one.address >= row.end]
        revised[unit] = replace(chart, rows=(*rest, row))
    return revised


def _row(area: str, address: int, text: str) -> MappedValue | None:
    kind, _, order = text.partition(" ")
    cells = {"area": area, "address": address, "name": "yours", "type": _AS.get(kind, kind), "order": order}
    lengths = {"text": 2, "bits": 1}
    try:
        row = value_of({**cells, **({"length": lengths[kind]} if kind in lengths else {})})
    except CellError:
        return None  # of another version, or written by hand
    return replace(row, name="", other={SAID: "you"})
