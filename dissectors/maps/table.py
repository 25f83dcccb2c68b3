"""Maps as a flat table: CSV, what spreadsheets write. Lines `# key: value` before the column names are the header.

Read as people have it: comma, semicolon or tab; a byte order mark; header lines with the delimiters that a spreadsheet
adds. Unknown header keys and columns are kept. Written so that reading gives the same map, and so that no spreadsheet
runs a cell as a formula: such a text gets an apostrophe, which reading takes away.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Final

from dissectors.values import FORMULA_STARTS

from .cells import (
    COLUMN_NAMES,
    CellError,
    cells_of,
    one_line,
    order_of,
    other_texts,
    signature_of,
    signature_text,
    value_of,
    whole_number,
)
from .model import MapError, MappedValue, RegisterMap

HEADER_KEYS: Final = (
    "device",
    "vendor",
    "version",
    "address_base",
    "word_order",
    "match",
    "source",
    "licence",
)
_NUMBER: Final = re.compile(r"[-+]?\d+(\.\d+)?(e[-+]?\d+)?", re.IGNORECASE)
_FORMULA: Final = re.compile(rf"(^|[;\t])('*[{re.escape(''.join(FORMULA_STARTS))}])")
_NEEDED: Final = ("address", "name")
_WRITTEN: Final = frozenset({"area", "address", "name", "type"})  # columns that `write_table` writes always
_OTHERS: Final = "`rtuscope map import` reads the tables of makers and other programs"


def read_table(text: str, file: str) -> RegisterMap:
    """The map in a CSV text; MapError names file, row, column and what was expected."""
    lines = text.removeprefix("\ufeff").splitlines()
    header: dict[str, str] = {}
    begin = len(lines)
    for number, line in enumerate(lines):
        bare = _bared(_unquoted(line.strip()))
        if bare.startswith("#"):
            key, mark, value = bare.lstrip("# ").partition(":")
            if mark and key.strip():
                header[key.strip().lower()] = value.strip().rstrip(",;\t").strip().strip('"')
        elif bare.strip(",;\t "):
            begin = number
            break
    if begin == len(lines) or lines[begin].lstrip()[:1] in ("{", "["):
        raise MapError(f"{file}: not a table: expected a row of column names (address, name, type ...): {_OTHERS}")
    delimiter = max(",;\t", key=lines[begin].count)
    numbered = ((begin + number, row) for number, row in csv_rows(lines[begin:], delimiter, file))
    _, names = next(numbered)
    columns = [_bared(name.strip()).lower() for name in names]
    for needed in _NEEDED:
        if needed not in columns:
            present = one_line(", ".join(filter(None, columns)))[:200]
            raise MapError(f"{file}: row {begin + 1}: no column {needed!r}: choose from {present}: {_OTHERS}")
    try:
        return assembled(header, _cells_by_column(numbered, columns), file)
    except MapError as error:
        if _WRITTEN.issubset(columns):
            raise
        raise MapError(f"{error}: {_OTHERS}") from error


def csv_rows(lines: Sequence[str], delimiter: str, file: str) -> Iterator[tuple[int, list[str]]]:
    """The rows of a CSV text, each with the number of its last line; MapError where it is none."""
    rows = csv.reader((f"{line}\n" for line in lines), delimiter=delimiter)
    try:
        for row in rows:
            yield rows.line_num, row
    except csv.Error as error:
        raise MapError(f"{file}: row {rows.line_num}: not CSV: {error}") from error


def write_table(chart: RegisterMap) -> str:
    """The CSV text of a map."""
    out = io.StringIO()
    for key, value in header_of(chart).items():
        out.write(_csv_cell(_guarded(f"# {one_line(key.replace(':', ' '))}: {one_line(value)}")) + "\n")
    rows = [cells_of(row, chart.word_order) for row in chart.rows]
    extra = dict.fromkeys(name for row in rows for name in row if name not in COLUMN_NAMES)
    wanted = [name for name in COLUMN_NAMES if name in _WRITTEN or any(row[name] for row in rows)]
    for cells in ({name: name for name in (*wanted, *extra)}, *rows):
        out.write(",".join(_csv_cell(_guarded(cells.get(name, ""))) for name in (*wanted, *extra)) + "\n")
    return out.getvalue()


def _csv_cell(cell: str) -> str:
    """A cell as it stands whole whichever of the usual delimiters a spreadsheet takes."""
    return '"' + cell.replace('"', '""') + '"' if re.search('[,;\t"]', cell) else cell


def _unquoted(line: str) -> str:
    """A header line as it was before `_quoted`, or a spreadsheet, put it between quotes."""
    quoted = re.fullmatch(r'"((?:[^"]|"")*)"[,;\t]*', line)
    return (quoted[1].replace('""', '"') if quoted else line.strip('"')).strip()


def _guarded(cell: str) -> str:
    """A cell that no spreadsheet runs as a formula, not even one that cuts at semicolons; numbers stay numbers."""
    return cell if _NUMBER.fullmatch(cell) else _FORMULA.sub(r"\1'\2", cell)


def _bared(cell: str) -> str:
    """A cell without the apostrophes that `_guarded` put into it."""
    return _FORMULA.sub(lambda begin: begin[1] + begin[2].removeprefix("'"), cell)


def header_of(chart: RegisterMap) -> dict[str, str]:
    """The header block, empty lines left out."""
    header = {
        "device": chart.device,
        "vendor": chart.vendor,
        "version": chart.version,
        "address_base": "0",
        "word_order": chart.word_order,
        "match": signature_text(chart.match),
        "source": chart.source,
        "licence": chart.licence,
        **chart.other,
    }
    return {key: value for key, value in header.items() if value}


def assembled(header: Mapping[str, object], rows: Iterator[tuple[int, Mapping[str, object]]], file: str) -> RegisterMap:
    """A map out of a header and numbered rows of cells."""
    where = f"{file}: header"
    try:
        base = whole_number("address_base", header.get("address_base", 0) or 0)
        if base not in (0, 1):
            raise CellError("address_base", base, "0 or 1")
        order = order_of(header.get("word_order"))
        match = signature_of(header.get("match"))
        device, vendor, version, source, licence = (
            one_line(header.get(key) or "") for key in ("device", "vendor", "version", "source", "licence")
        )
        values: list[MappedValue] = []
        names: dict[tuple[str, int, str], int] = {}
        for number, cells in rows:
            where = f"{file}: row {number}"
            value = value_of(cells, base=base, order=order)
            before = names.setdefault((value.area, value.address, value.name), number)
            if before != number:
                raise CellError("name", value.name, f"one row a value: row {before} has it at {value.address} already")
            values.append(value)
        where = f"{file}: formulas"
        _names_are_known(values)
    except CellError as error:
        raise MapError(f"{where}: {error}") from error
    if not values:
        raise MapError(f"{file}: no rows: expected one per value")
    return RegisterMap(
        device=device,
        rows=tuple(values),
        vendor=vendor,
        version=version,
        word_order=order,
        match=match,
        source=source,
        licence=licence,
        other=other_texts(header, HEADER_KEYS),
    )


def _names_are_known(values: Sequence[MappedValue]) -> None:
    """CellError where a formula names a value that the map has not."""
    names = {value.name for value in values}
    for value in filter(lambda value: value.formula, values):
        from .formulas import formula_of

        if unknown := [name for name in formula_of(value.formula).names if name not in names]:
            raise CellError("formula", unknown[0], "the name of a value of this map")


def _cells_by_column(
    rows: Iterator[tuple[int, list[str]]], columns: Sequence[str]
) -> Iterator[tuple[int, Mapping[str, object]]]:
    for number, row in rows:
        if any(cell.strip() for cell in row) and not row[0].lstrip().startswith("#"):
            named = dict(zip(columns, row, strict=False))
            named.pop("", None)
            yield number, {key: _bared(cell.strip()) for key, cell in named.items()}
