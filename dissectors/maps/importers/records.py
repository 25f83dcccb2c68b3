"""Registers as records of JSON, YAML, TOML, INI, XML or sources, of whatever program: keys are read as headings are."""

from __future__ import annotations

from ..records import record_sheets
from ..sheets import MapSheet
from .source import ImportedMap, MapSource, refused
from .spreadsheet import chart_of, has_heading

NAME = "records of registers"


def _sheet_of(source: MapSource) -> MapSheet | None:
    """The first sheet of records of which one column is of addresses and another of names."""
    return next(filter(has_heading, record_sheets(source)), None)


def recognises(source: MapSource) -> bool:
    """Whether there are such records."""
    return _sheet_of(source) is not None


def read(source: MapSource) -> list[ImportedMap]:
    """One map of all records."""
    sheet = _sheet_of(source)
    imported = chart_of(source, sheet) if sheet is not None else None
    if imported is None:
        keys = next((", ".join(sheet.rows[0][:5]) for sheet in record_sheets(source)), "an address")
        raise refused(source, NAME, f"a key that names each record, beside {keys}")
    return [imported]
