"""Tables of registers: workbooks, CSV, columns that blanks part, HTML, Markdown."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import compress
from typing import Final

from ..headings import HEADING_ROWS, has_heading
from ..model import MapError
from ..sheets import MapSheet, ways_in
from ..written import area_words
from .source import ImportedMap, MapSource
from .tables import chart_of

NAME = "a table"
_MOST_ROWS: Final = 30_000


def read(source: MapSource) -> list[ImportedMap] | None:
    """The table, or each sheet that has one; cut in the way that tells most."""
    ways = (_charts_of(source, sheets) for sheets in _ways(source))
    return max(filter(None, ways), key=lambda charts: sum(one.facts for one in charts), default=None)


def _ways(source: MapSource) -> Iterator[list[MapSheet]]:
    """A workbook as it is; the ways in which a text is a table by how it starts."""
    ways = ways_in(source.data, source.text, source.name, _MOST_ROWS)
    if source.is_workbook:
        yield from ways
        return
    try:
        starts = ways_in(source.data, source.text, source.name, HEADING_ROWS)
        are_tables = [any(has_heading(one.rows) for one in sheets) for sheets in starts]
    except MapError:
        return
    if any(are_tables):
        yield from compress(ways, are_tables)


def _charts_of(source: MapSource, sheets: Sequence[MapSheet]) -> list[ImportedMap]:
    charts = [(area_words(one.name), chart_of(source, one, one.name if len(sheets) > 1 else "")) for one in sheets]
    parts = [one for _, one in charts if one is not None]
    areas = {area for area, one in charts if one is not None} - {None}
    return [_of_one_device(source, parts)] if len(parts) > 1 and len(areas) == len(parts) else parts


def _of_one_device(source: MapSource, parts: Sequence[ImportedMap]) -> ImportedMap:
    """Sheets that are named after one area each, as one map."""
    rows = tuple(row for part in parts for row in part.chart.rows)
    notes = dict.fromkeys(note for part in parts for note in part.notes)
    told = f"{len(parts)} sheets, an area each, were taken for one device"
    return ImportedMap(replace(parts[0].chart, device=source.stem, rows=rows), (told, *notes))
