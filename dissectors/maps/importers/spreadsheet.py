"""Tables out of manuals: CSV, TSV or XLSX with columns of any names, in English, Russian or German.

Columns are told by their headings, the heading row by how many it has. A type that the table does not name follows from
the number of registers. Addresses that begin with 1 are left as they stand unless all of them are logical (40001 on):
which base a manual counts from is for the user to say (`address_base`).
"""

from __future__ import annotations

import io
import re
import zipfile
from collections.abc import Iterable, Mapping, Sequence
from typing import Final

from ..cells import CellError, area_of, one_line
from ..model import MapArea, MapError
from ..table import csv_rows
from .source import ImportedMap, MapBuilder, MapSource, refused, whole_in

NAME = "a table"
_ZIP: Final = b"PK\x03\x04"
_LOOK: Final = 60  # rows in which a heading is sought
_HEADING: Final = 60  # characters
_CELL: Final = 1000  # characters
_MOST_ROWS, _MOST_COLUMNS, _UNPACKED = 70_000, 100, 256 << 20  # of a sheet; bytes of a workbook
_HEADINGS: Final[Mapping[str, str]] = {
    "area": r"area|table|register type|reg\.? ?type|function|fc|func|код функции|функция|область|тип регистра|"
    r"таблица|funktion|registertyp|bereich",
    "address": r"address|addr|adr|register|reg|offset ?\(hex\)|hex|dec|modbus|адрес|регистр|номер регистра|№|"
    r"adresse|registeradresse|register-?nr",
    "name": r"name|parameter|signal|variable|tag|quantity|measurement|object|description|наименование|название|"
    r"параметр|имя|величина|описание|bezeichnung|messgr|größe|beschreibung",
    "type": r"(data ?)?type|format|datatype|data format|тип( данных)?|формат|datentyp|typ",
    "length": r"length|len|size|words|count|quantity of reg|registers|number of registers|nr\.? of reg|длина|размер|"
    r"количество|кол-во|кол\.|länge|anzahl",
    "scale": r"scale|factor|multiplier|resolution|coefficient|gain|множитель|коэфф|масштаб|цена|дискрет|"
    r"skalierung|faktor|auflösung|multiplikator",
    "divisor": r"divisor|divider|делитель|teiler",
    "offset": r"offset|смещение|сдвиг",
    "unit": r"units?|uom|eng\.? ?units?|measure|ед\.?( ?изм\.?)?|единиц|размерность|einheit",
    "values": r"values|enum|states|options|значени|состояни|werte|zustände",
    "access": r"access|r/w|rw|mode|permission|attribute|доступ|чтение|режим|zugriff",
    "min": r"min(imum)?|lower|мин\w*|untergrenze",
    "max": r"max(imum)?|upper|макс\w*|obergrenze",
    "order": r"(byte|word) ?order|endian\w*|порядок|byte-?reihenfolge",
    "description": r"description|comment|remark|note|remarks|notes|описание|примечани\w*|комментари\w*|"
    r"beschreibung|bemerkung|kommentar",
    "group": r"group|section|category|группа|раздел|gruppe",
}
_TYPES: Final = (
    (r"u(nsigned)?[ _-]?(int|short|word)?[ _-]?64|uint64|qword|unsigned long long", "u64"),
    (r"s?(igned)?[ _-]?int[ _-]?64|long long|s64|i64", "s64"),
    (r"double|float ?64|f64|real ?64|lreal", "f64"),
    (r"float|real|single|ieee|f32|fp32|с плавающей|плав|вещ", "f32"),
    (r"bcd", "bcd16"),
    (r"u(nsigned)?[ _-]?(int|long)?[ _-]?32|uint32|udint|dword|unsigned long|ulong|u32|беззнак\w* 32", "u32"),
    (r"(signed )?s?int(eger)?[ _-]?32|dint|long|s32|i32|знак\w* 32", "s32"),
    (r"bit ?(field|map|mask)|flags?|битов\w*|маска|bits", "bits"),
    (r"bool\w*|bit|coil|бит|discrete", "bool"),
    (r"string|text|char|ascii|строк\w*|текст|zeichen", "text"),
    (r"enum\w*|перечисл\w*|list", "enum"),
    (r"u(nsigned)?[ _-]?(int|short|word|integer)?[ _-]?(16)?|uint|word|ushort|слово|беззнак\w*", "u16"),
    (r"(signed )?(int|short|integer|sint)[ _-]?(16)?|s16|i16|signed|знак\w*|целое", "s16"),
)
_FUNCTIONS: Final[Mapping[int, MapArea]] = {1: "coil", 5: "coil", 15: "coil", 2: "discrete", 3: "holding", 6: "holding",
                                            16: "holding", 4: "input"}  # fmt: skip


def recognises(source: MapSource) -> bool:
    """A workbook, or a table with a heading."""
    if source.data.startswith(_ZIP):
        return source.suffix in (".xlsx", ".xlsm", "")
    try:
        return source.is_text and any(_headings(row) for row in _rows_of_text(source.text, source.name, _LOOK))
    except MapError:
        return False


def read(source: MapSource) -> list[ImportedMap]:
    """The table, or each sheet that has one."""
    sheets = (
        _sheets(source) if source.data.startswith(_ZIP) else [("", _rows_of_text(source.text, source.name, _MOST_ROWS))]
    )
    found = [_sheet(source, name, rows) for name, rows in sheets]
    kept = [one for one in found if one is not None]
    if not kept:
        raise refused(source, "a table of registers", "a row of headings such as address, name, type, unit")
    return kept


def _sheet(source: MapSource, sheet: str, rows: Sequence[Sequence[str]]) -> ImportedMap | None:
    """The map of one sheet; a later row of headings begins the next table of it."""
    builder = MapBuilder(source.name, device=f"{source.stem} {sheet}".strip())
    columns: dict[str, int] = {}
    area: MapArea | None = None
    group = ""
    for number, row in enumerate(rows, 1):
        cells = [cell for cell in row if cell]
        if headings := _headings(row):
            columns = headings
            continue
        if not columns or not cells:
            area = _area_words(" ".join(cells)) or area
            continue
        if len(cells) == 1:
            group, area = cells[0], _area_words(cells[0]) or area
            continue
        _row(builder, {key: row[at].strip() for key, at in columns.items() if at < len(row)}, area, group, number)
    if builder.rows:
        builder.note("columns were told by their headings: look the map over, its address base above all")
    return builder.built() if columns else None


def _row(builder: MapBuilder, cells: dict[str, str], area: MapArea | None, group: str, number: int) -> None:
    place = cells.get("address", "")
    numbers = re.findall(r"0[xX][0-9A-Fa-f]+|[134]x\d+|\b[0-9A-Fa-f]+[hH]\b|\d+", place)
    if not numbers:
        builder.note(f"row {number}: {place[:30]!r} is no address")
        return
    first = whole_in(numbers[0])
    last = whole_in(numbers[1]) if len(numbers) == 2 else None
    named = _area_of_cell(cells.get("area", "")) or area
    address: object = first
    prefixed = bool(re.fullmatch(r"[134]x\d+", numbers[0], re.IGNORECASE))
    in_digits = first is not None and re.fullmatch(r"[34]\d{4,5}", numbers[0]) and _logical(named, first)
    if prefixed or in_digits:
        address, named = numbers[0], None
    elif named is None:
        named = "holding"
    length = whole_in(cells.get("length")) or (last - first + 1 if last is not None and first is not None else None)
    kind, length = _type_of(cells.get("type", ""), length)
    name = cells.get("name") or cells.get("description") or f"Register {place}"
    if not cells.get("name") and not cells.get("description"):
        builder.note(f"row {number}: no name")
    builder.add(
        {
            "area": named,
            "address": address,
            "name": " ".join(name.split()),
            "type": "bool" if named in ("coil", "discrete") else kind,
            "order": _order_of(cells.get("order", "") + " " + cells.get("type", "")),
            "length": length if kind in ("text", "bits", "enum") else None,
            "scale": _scale_of(cells) if kind not in ("text", "bits", "enum", "bool") else None,
            "offset": cells.get("offset") if re.fullmatch(r"-?\d+([.,]\d+)?", cells.get("offset", "")) else None,
            "unit": cells.get("unit"),
            "values": _values_of(cells.get("values", "")) if kind in ("enum", "bits", "u16") else None,
            "access": _access_of(cells.get("access", "")),
            "min": _plain_number(cells.get("min", "")),
            "max": _plain_number(cells.get("max", "")),
            "description": cells.get("description") if cells.get("name") else None,
            "group": cells.get("group") or group,
        },
        f"row {number}: {name[:40]}",
    )


def _logical(named: MapArea | None, number: int) -> bool:
    """Whether 40108 is a logical number: where the row says nothing else, or the same."""
    digit = str(number)[0]
    return named is None or (named == "holding" and digit == "4") or (named == "input" and digit == "3")


def _headings(row: Sequence[str]) -> dict[str, int]:
    """Columns by what their headings mean, empty where the row is no heading."""
    found: dict[str, int] = {}
    used: set[int] = set()
    texts = [" ".join(cell.lower().split()).strip(" :.") for cell in row]
    if not any(_means(text, "address", exact=False) for text in texts):
        return {}
    for exact in (True, False):
        for column in _HEADINGS:
            for at, text in enumerate(texts):
                if column not in found and at not in used and _means(text, column, exact=exact):
                    found[column] = at
                    used.add(at)
    if "name" not in found and "description" in found:
        found["name"] = found.pop("description")
    return found if {"address", "name"} <= set(found) and len(found) >= 2 else {}


def _means(text: str, column: str, *, exact: bool) -> bool:
    """Whether a heading means a column: by all of it, or by how it begins."""
    if not text or len(text) > _HEADING:
        return False
    pattern = _HEADINGS[column]
    whole = text == column or re.fullmatch(pattern, text) is not None
    return whole or (not exact and re.match(rf"(?:{pattern})\b", text) is not None)


def _type_of(text: str, length: int | None) -> tuple[str, int | None]:
    """The type that a cell means, and the registers that it takes."""
    word = " ".join(text.lower().replace("_", " ").split())
    kind = next((kind for pattern, kind in _TYPES if re.fullmatch(pattern, word)), None)
    if kind is None:
        kind = next((kind for pattern, kind in _TYPES if word and re.match(rf"(?:{pattern})", word)), None)
    if kind in ("u16", "s16", None) and length in (2, 4):
        kind = f"{'s' if kind == 's16' else 'u'}{16 * length}"
    if kind == "f32" and length == 4:
        kind = "f64"
    if kind == "bcd16" and length == 2:
        kind = "bcd32"
    if kind == "text" and length is None:
        found = re.search(r"\d+", word)
        length = max(1, int(found[0]) // 2) if found else 1
    if kind == "bool":
        kind = "bits"
    return kind or "u16", length


def _order_of(text: str) -> str | None:
    word = text.lower()
    found = re.search(r"\b(abcd|cdab|badc|dcba)\b", word)
    if found:
        return found[1].upper()
    digits = re.search(r"\b(1234|3412|2143|4321|3210|1032|0123|2301)\b", word)
    if digits:
        return {"1234": "ABCD", "3412": "CDAB", "2143": "BADC", "4321": "DCBA", "3210": "ABCD", "1032": "CDAB",
                "0123": "DCBA", "2301": "BADC"}[digits[1]]  # fmt: skip
    if re.search(r"(low|lsw|little|младш\w*).*(first|word|swap|впер)|word swap|swapped", word):
        return "CDAB"
    return None


def _scale_of(cells: Mapping[str, str]) -> str | None:
    text = cells.get("scale", "").lower().replace(",", ".").replace("×", "x").replace("*", "x")
    divisor = cells.get("divisor", "")
    if divisor and re.fullmatch(r"\d{1,12}(\.\d{1,12})?", divisor) and float(divisor):
        return f"1/{divisor}"
    found = re.search(r"(?P<divide>[/÷:]\s*)?(?P<number>\d+(\.\d+)?(e-?\d+)?)(\s*/\s*(?P<below>\d+))?", text)
    if not found or float(found["number"]) == 0:
        return None
    if found["divide"]:
        return f"1/{found['number']}"
    if re.fullmatch(r"10\s*\^\s*-?\d\d?", text.strip()):
        return f"{10.0 ** int(text.partition('^')[2]):g}"
    return f"{found['number']}/{found['below']}" if found["below"] else found["number"]


def _values_of(text: str) -> str | None:
    pairs = re.findall(r"(\d+)\s*[=:–-]\s*([^;,\n|]+)", text)
    return "; ".join(f"{state}={name.strip()}" for state, name in pairs) if len(pairs) > 1 else None


def _access_of(text: str) -> str | None:
    word = text.lower().replace(" ", "")
    if not word:
        return None
    reads, writes = bool(re.search(r"r|ч|l", word)), bool(re.search(r"w|з|s", word))
    return "rw" if reads and writes else "w" if writes else "r" if reads else None


def _area_of_cell(text: str) -> MapArea | None:
    word = text.strip().lower()
    if not word:
        return None
    try:
        return area_of(word) if not re.fullmatch(r"\d", word) else None
    except CellError:
        pass
    return _area_words(word) or next(
        (_FUNCTIONS[int(number, 16)] for number in re.findall(r"(?<![0-9a-f])(?:0x)?0?([0-9a-f])h?\b", word)
         if int(number, 16) in _FUNCTIONS),
        None,
    )  # fmt: skip


def _area_words(text: str) -> MapArea | None:
    word = text.lower()
    patterns: tuple[tuple[str, MapArea], ...] = (
        (r"discrete|дискретн\w* вход|контакт", "discrete"),
        (r"coil|дискретн\w* выход|флаг", "coil"),
        (r"holding|регистр\w* хранения|выходн\w* регистр|halteregister", "holding"),
        (r"input|входн\w* регистр|регистр\w* ввода|eingangsregister", "input"),
    )
    return next((area for pattern, area in patterns if re.search(pattern, word)), None)


def _plain_number(text: str) -> str | None:
    return text.replace(",", ".") if re.fullmatch(r"-?\d+([.,]\d+)?", text.strip()) else None


def _rows_of_text(text: str, file: str, most: int) -> list[list[str]]:
    lines = text.splitlines()[:most]
    head = "\n".join(lines[:_LOOK])
    delimiter = max("\t;,|", key=head.count)
    rows = csv_rows(lines, delimiter, file)
    return [[cell.strip()[:_CELL] for cell in row[:_MOST_COLUMNS]] for _, row in rows]


def _sheets(source: MapSource) -> list[tuple[str, list[list[str]]]]:
    try:
        import openpyxl
    except ImportError as error:
        raise MapError(
            f"{source.name}: a workbook needs openpyxl: pip install 'rtuscope[xlsx]', or save it as CSV"
        ) from error
    try:
        with zipfile.ZipFile(io.BytesIO(source.data)) as packed:
            if sum(part.file_size for part in packed.infolist()) > _UNPACKED:
                raise MapError("too large once unpacked")
        book = openpyxl.load_workbook(io.BytesIO(source.data), read_only=True, data_only=True)
        sheets = []
        for sheet in book.worksheets:
            rows = sheet.iter_rows(values_only=True, max_row=_MOST_ROWS, max_col=_MOST_COLUMNS)
            sheets.append((sheet.title, _cells_of(rows)))
    except Exception as error:  # a damaged workbook raises whatever its parts do
        raise MapError(f"{source.name}: no readable workbook: {one_line(error)}") from error
    return sheets if len(sheets) > 1 else [("", rows) for _, rows in sheets]


def _cells_of(rows: Iterable[Sequence[object]]) -> list[list[str]]:
    return [["" if cell is None else str(cell).strip()[:_CELL] for cell in row] for row in rows]
