"""Tables of registers: workbooks, CSV, columns that blanks part, HTML, Markdown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from ..model import MapError
from ..sheets import sheets_in
from ..written import area_words
from .source import ImportedMap, MapSource
from .tables import HEADING_ROWS, chart_of, has_heading

NAME = "a table"
_MOST_ROWS: Final = 70_000


def read(source: MapSource) -> list[ImportedMap] | None:
    """The table, or each sheet that has one."""
    if not source.is_workbook and not _starts_as_table(source):
        return None
    sheets = sheets_in(source.data, source.text, source.name, _MOST_ROWS)
    charts = [(area_words(one.name), chart_of(source, one, one.name if len(sheets) > 1 else "")) for one in sheets]
    parts = [one for _, one in charts if one is not None]
    areas = {area for area, one in charts if one is not None} - {None}
    if len(parts) > 1 and len(areas) == len(parts):
        return [_of_one_device(source, parts)]
    return parts or None


def _starts_as_table(source: MapSource) -> bool:
    try:
        return any(map(has_heading, sheets_in(source.data, source.text, source.name, HEADING_ROWS)))
    except MapError:
        return False


def _of_one_device(source: MapSource, parts: Sequence[ImportedMap]) -> ImportedMap:
    """Sheets that are named after one area each, as one map."""
    rows = tuple(row for part in parts for row in part.chart.rows)
    notes = dict.fromkeys(note for part in parts for note in part.notes)
    told = f"{len(parts)} sheets, an area each, were taken for one device"
    return ImportedMap(replace(parts[0].chart, device=source.stem, rows=rows), (told, *notes))
