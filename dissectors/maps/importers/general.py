"""What no program made: tables, records and lines of registers, and our own forms."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

from ..cells import COLUMN_NAMES
from ..headings import HEADING_ROWS, has_heading
from ..lines import line_sheets
from ..model import MapError, MappedValue
from ..records import mappings, record_sheets
from ..sheets import MapSheet, ways_in
from ..table import read_table
from ..vocabulary import expression
from ..written import area_words
from .builder import ImportedMap
from .source import MapSource
from .tables import chart_of

_MOST_ROWS: Final = 30_000  # of a table
_MOST_LINES: Final = 20_000
_OWN_COLUMNS: Final = {"address", "name", "area", "type"}
COHERENT: Final = 7.0  # marks of maps: 7.9 and more; of pages of prose, of lists of other numbers: 6.9 and less
_COVERED, _SHORT, _TOLD, _RISING, _DISTINCT = 6.0, 2.0, 1.5, 1.0, 3.0  # weights
_WORDS: Final = 4  # of a short name
_LETTERS: Final = 40
Charts = list[ImportedMap]


def _own(source: MapSource) -> Charts | None:
    """The map as it stands, where YAML has a list `registers` or a table a row of our column names."""
    if isinstance(source.yaml, Mapping):
        from ..yamlform import read_yaml

        rows = source.yaml.get("registers")
        keys = {key for row in mappings(rows) for key in row}
        fits = {"area", "address"} <= keys or (source.json is None and keys <= {*COLUMN_NAMES})  # JSON: other programs
        return [ImportedMap(read_yaml(source.text, source.name))] if isinstance(rows, list) and fits else None
    lines = filter(str.strip, source.text.lower().splitlines())
    head = next((line for line in lines if not line.lstrip(' "').startswith("#")), "")
    is_own = {name.strip(' "') for name in expression("[,;\t]").split(head)} >= _OWN_COLUMNS
    return [ImportedMap(read_table(source.text, source.name))] if is_own else None


def _records(source: MapSource) -> Charts | None:
    """One map of records, read in the way that tells most: keys are read as headings are."""
    return _best(_charts(source, record_sheets(source)))


def _lines(source: MapSource) -> Charts | None:
    """One map of all lines, read in the way that tells most."""
    return _best(_charts(source, line_sheets(source.text, _MOST_LINES)))


def _table(source: MapSource) -> Charts | None:
    """The table, or each sheet that has one; cut in the way that tells most."""
    try:
        ways = [*ways_in(source.data, source.text, source.name, _MOST_ROWS)]
    except MapError:
        if source.is_workbook:
            raise
        return None  # no CSV
    tables = [one for one in ways if source.is_workbook or any(has_heading(sheet.rows[:HEADING_ROWS]) for sheet in one)]
    return _best(_charts_of(source, sheets) for sheets in tables)


def _charts(source: MapSource, sheets: Iterable[MapSheet]) -> Iterator[Charts]:
    for sheet in sheets:
        yield [*filter(None, [chart_of(source, sheet)])]


def _best(ways: Iterable[Charts]) -> Charts | None:
    return max(filter(None, ways), key=facts_of_all, default=None)


def facts_of_all(charts: Sequence[ImportedMap]) -> int:
    """How much maps tell."""
    return sum(one.facts for one in charts)


def _charts_of(source: MapSource, sheets: Sequence[MapSheet]) -> Charts:
    """The maps of sheets; those that are named after one area each are of one device."""
    charts = [(area_words(one.name), chart_of(source, one, one.name if len(sheets) > 1 else "")) for one in sheets]
    parts = {area: one for area, one in charts if one is not None}
    found = [one for _, one in charts if one is not None]
    if not 1 < len(found) == len(parts.keys() - {None}):
        return found
    rows = tuple(row for part in found for row in part.chart.rows)
    notes = dict.fromkeys(note for part in found for note in part.notes)
    told = f"{len(found)} sheets, an area each, were taken for one device"
    return [ImportedMap(replace(found[0].chart, device=source.stem, rows=rows), (told, *notes))]


def coherence(charts: Sequence[ImportedMap], text: str) -> float:
    """How well what was read of a text hangs together as a map: prose has numbers beside words, too. Each mark is a
    share, from 0 to 1, with its weight; registers have most of them, numbers in prose have few."""
    rows = [row for one in charts for row in one.chart.rows]
    lines = len({*filter(None, map(str.strip, text.splitlines()))})
    places = [(row.area, row.address) for row in rows]
    steps = [after > before for before, after in pairwise(places) if before[0] == after[0]]
    return (
        _COVERED * min(1.0, len(rows) / max(1, lines))
        + _SHORT * _share([len(row.name.split()) <= _WORDS and len(row.name) <= _LETTERS for row in rows])
        + _TOLD * _share([_tells(row) for row in rows])
        + _RISING * _share(steps)
        + _DISTINCT * len({*places}) / max(1, len(rows))
    )


def _tells(row: MappedValue) -> bool:
    """Whether a value has more than its name: a unit, a scale, a type, states."""
    return any((row.unit, row.scale != 1, row.type != "u16", row.values))


def _share(marks: Sequence[bool]) -> float:
    return sum(marks) / max(1, len(marks))


@dataclass(frozen=True, slots=True)
class Reader:
    """A form of maps: what it is called, and what reads it."""

    NAME: str
    read: Callable[[MapSource], Charts | None]


READERS: Final[Mapping[str, Reader]] = {
    "own": Reader("a map of our own form", _own),
    "records": Reader("records of registers", _records),
    "spreadsheet": Reader("a table", _table),
    "lines": Reader("lines of registers", _lines),
}
