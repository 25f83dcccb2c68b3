"""Registers as records of JSON, YAML, TOML, INI, XML or sources, of whatever program: keys are read as headings are."""

from __future__ import annotations

from ..records import record_sheets
from .source import ImportedMap, MapSource
from .tables import first_chart

NAME = "records of registers"


def read(source: MapSource) -> list[ImportedMap] | None:
    """One map of all records."""
    return first_chart(source, record_sheets(source))
