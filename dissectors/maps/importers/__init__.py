"""Register maps out of what other programs and spreadsheets have: one file a format.

A program's format is data, `NAME.toml`, which `programs` reads; any other is one of `general`. A format has a `NAME`
and `read(source)`, which gives a map a device, or None of a file that is of another format. They are listed in
`FORMATS`, the surest first; of the last, which read what no program made, the one counts that reads most. What a format
says and a map cannot is told in the notes, never dropped without a word. `source` is the file to read, `builder` what
makes a map of its rows.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Final, NoReturn

from ..headings import HEADING_ROWS
from ..model import MapError
from .builder import ImportedMap
from .general import COHERENT, READERS, Reader, coherence, facts_of_all
from .programs import Program, data_of
from .source import MapSource

_OF_PROGRAMS: Final = data_of("programs")  # by what stands in each of their files
_GENERAL: Final = ("records", "spreadsheet", "lines")  # of no program: the one that reads most
_ENOUGH: Final = {"lines": 3.7}  # facts of a row with which a format is not asked
_FEW: Final = 4  # rows that are enough to say so
FORMATS: Final = (*_OF_PROGRAMS, "own", *_GENERAL)


def map_format(name: str) -> Program | Reader:
    """One format by name."""
    if name not in FORMATS:
        raise MapError(f"no map format {name!r}: choose from {', '.join(FORMATS)}")
    return READERS.get(name) or Program(name)


def import_maps(file: str, data: bytes, *, name: str | None = None) -> list[ImportedMap]:
    """The maps in a file, its format found by content or given by name; MapError says why there are none."""
    source = MapSource(file, data)
    if name is not None:
        return _read(source, (name,)) or _raised(MapError(f"{file}: is not {map_format(name).NAME}"))
    wrong = []
    for program, sign in {**_OF_PROGRAMS, "own": ""}.items():
        try:
            found = _read(source, (program,) * (sign in source.text))
        except MapError as error:
            wrong.append(error)
            continue
        if found:
            return found
    if wrong:
        return _read_otherwise(source, wrong[0])
    return _coherent(source, _read(source, _GENERAL)) or _raised(MapError(_why_none(source)))


def _coherent(source: MapSource, found: list[ImportedMap]) -> list[ImportedMap]:
    """The maps, if they hang together as such."""
    if found and coherence(found, source.text) < COHERENT:
        raise MapError(
            f"{source.name}: reads as prose: the numbers beside its words do not form a register map; "
            f"--input-format {_GENERAL[-1]} reads them nevertheless"
        )
    return found


def _read_otherwise(source: MapSource, why: MapError) -> list[ImportedMap]:
    """What has the signs of a form, but no registers in it, as what no program made; it is said why it is not of that
    form."""
    try:
        found = _coherent(source, _read(source, _GENERAL))
    except MapError:
        found = []
    return [replace(one, notes=(*one.notes, f"not of the form that it looks like: {why}")) for one in found] or _raised(
        why
    )


def _raised(why: MapError) -> NoReturn:
    raise why


def _read(source: MapSource, candidates: Sequence[str]) -> list[ImportedMap]:
    """The maps in a file by the one of these formats that tells most; none where it is of none of them."""
    ways = [*_ways(source, candidates)]
    said, read = max(ways, key=lambda way: facts_of_all(way[1]), default=("", []))  # of as many, the first
    filled = [replace(one, notes=(*one.notes, *source.notes)) for one in read if one.chart.rows]
    if ways and not filled:
        why = next((f": {one.notes[0]}" for one in read if one.notes), "")
        raise MapError(f"{source.name}: read as {said}, but it has no registers{why}")
    return filled


def _why_none(source: MapSource) -> str:
    """Why a file has no map that any format reads."""
    included = f"it has no registers itself, only the files it includes do: give {', '.join(source.included)}"
    reasons = (
        source.problem,
        included * bool(source.included),
        "not a known register map: a table needs a heading row such as address, name, type in its first "
        f"{HEADING_ROWS} rows; --input-format chooses one of {', '.join(FORMATS)}",
    )
    return f"{source.name}: {next(filter(None, reasons))}"


def _ways(source: MapSource, candidates: Sequence[str]) -> Iterator[tuple[str, list[ImportedMap]]]:
    """What formats make of a file; lines only where no other tells enough of its rows."""
    most = 0.0
    for name in candidates:
        form = map_format(name)
        read = form.read(source) if most < _ENOUGH.get(name, most + 1) else None
        if read is not None:
            yield form.NAME, read
            rows = sum(len(one.chart.rows) for one in read)
            most = max(most, facts_of_all(read) * (rows >= _FEW) / max(1, rows))
