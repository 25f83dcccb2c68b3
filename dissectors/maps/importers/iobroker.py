"""What a table of ioBroker means as a whole: its area by the file's name, addresses that are all logical numbers."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final

from .source import MapSource, whole_in

_AREAS: Final = (("dis", "discrete"), ("coil", "coil"), ("input", "input"), ("hold", "holding"))
_BASES: Final = ((400001, "holding"), (300001, "input"), (40001, "holding"), (30001, "input"), (10001, "discrete"))


def adapted(source: MapSource, records: Iterator[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    """The rows, with areas and addresses apart; logical addresses (40001) name the area, else the file does."""
    named = next((area for word, area in _AREAS if word in source.stem.lower()), None)
    rows = [{key: cell for key, cell in row.items() if cell} for row in records]
    spots = [_spot(whole_in(row["_address"]) or 0, named) for row in rows if "_address" in row]
    aliases = all(spots) and bool(spots)
    telling = (
        ("the table does not say its area: where addresses do not either, holding registers are taken", named is None),
        ("addresses were taken for aliases (40001), as all of them could be", aliases),
    )
    words = [text for text, holds in telling if holds]
    for at, row in enumerate(rows):
        position = row.get("_address", row.get("address", ""))
        row["area"], row["place"] = (aliases and _spot(whole_in(position) or 0, named)) or (named, position)
        row["what"] = f"row {row['row']}: {row.get('name', row.get('description', f'Register {position}'))}"
        formula = row.get("formula", "x")
        notes = [f"formula {formula[:60]!r} is not carried"] * (formula != "x")
        yield {**row, "notes": notes, "of file": words * (at == 0)}


def _spot(number: int, named: str | None) -> tuple[str, int] | None:
    """Area and address of a logical number; None where it is none of the file's area."""
    fits = ((area, number - base) for base, area in _BASES if named in (None, area) and 0 <= number - base < 0x10000)
    return next(fits, None)
