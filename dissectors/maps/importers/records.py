"""Registers as records of JSON, YAML, TOML, INI or C, of whatever program: their keys are read as headings are."""

from __future__ import annotations

from ..records import record_sheet
from .source import ImportedMap, MapSource, refused
from .spreadsheet import chart_of, has_heading

NAME = "records of registers"


def recognises(source: MapSource) -> bool:
    """Records of which one column is of addresses and another of names."""
    sheet = record_sheet(source)
    return sheet is not None and has_heading(sheet)


def read(source: MapSource) -> list[ImportedMap]:
    """One map of all records."""
    sheet = record_sheet(source)
    imported = chart_of(source, sheet) if sheet is not None else None
    if imported is None:
        keys = ", ".join(sheet.rows[0][:5]) if sheet is not None else "an address"
        raise refused(source, NAME, f"a key that names each record, beside {keys}")
    return [imported]
