"""The words of tables in manuals: what headings and cells mean, in English, Russian and German."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Final

from .cells import CellError, area_of
from .model import MapArea
from .tableaddresses import together

_HEADING: Final = 60  # characters
_HEADINGS: Final[Mapping[str, str]] = {
    "area": r"area|table|register type|reg\.? ?type|function|fc|func|код функции|функция|область|тип регистра|"
    r"таблица|funktion|registertyp|bereich",
    "address": r"(start(ing)? |first |begin |нач\w* |modbus )?(address|addr|adr|register|reg|адрес|регистр)|"
    r"offset ?\(hex\)|hex|dec|modbus|номер регистра|(start|anfangs|register)?adresse|register-?nr",
    "end": r"(end(ing)?|last|кон\w*|посл\w*) (address|addr|adr|register|reg|адрес|регистр)|endadresse",
    "name": r"name|parameter|signal|variable|tag|quantity|measurement|object|description|наименование|название|"
    r"параметр|имя|величина|описание|bezeichnung|messgr\w*|größe|beschreibung",
    "type": r"(data ?)?type|format|datatype|data format|тип( данных)?|формат|datentyp|typ",
    "length": r"length|len|size|words|count|quantity of reg|registers|number of registers|nr\.? of reg|длина|размер|"
    r"количество|кол-во|кол\.|länge|anzahl",
    "scale": r"scal(e|ing)|factor|multiplier|resolution|coefficient|gain|множитель|коэфф\w*|масштаб|цена|дискрет|"
    r"skalierung|faktor|auflösung|multiplikator",
    "divisor": r"divisor|divider|делитель|teiler",
    "offset": r"offset|смещение|сдвиг",
    "unit": r"units?|uom|eng\.? ?units?|measure|ед\.?( ?изм\.?)?|единиц\w*|размерность|einheit",
    "values": r"values|enum|states|options|значени\w*|состояни\w*|werte|zustände",
    "access": r"access|r/w|rw|mode|permission|attribute|доступ|чтение|режим|zugriff",
    "range": r"(value |data |setting )?range|limits|диапазон|пределы|wertebereich|messbereich|grenzen",
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


def headings(row: Sequence[str]) -> dict[str, int]:
    """Columns by what their headings mean, empty where the row is no heading."""
    columns: dict[str, int] = {}
    used: set[int] = set()
    texts = [" ".join(cell.lower().split()).strip(" :.") for cell in row]
    if "№" in texts and not any(_means(text, "address", exact=False) for text in texts):
        texts[texts.index("№")] = "address"
    if "registers" in texts and not any(_means(text, "address", exact=True) for text in texts):
        texts[texts.index("registers")] = "address"  # beside an address it is how many
    if not any(_means(text, "address", exact=False) for text in texts):
        return {}
    for exact in (True, False):
        for column in _HEADINGS:
            for at, text in enumerate(texts):
                if column not in columns and at not in used and _means(text, column, exact=exact):
                    columns[column] = at
                    used.add(at)
    if "name" not in columns and "description" in columns:
        columns["name"] = columns.pop("description")
    return columns if {"address", "name"} <= set(columns) and len(columns) >= 2 else {}


def _means(text: str, column: str, *, exact: bool) -> bool:
    """Whether a heading means a column: by all of it, or by how it begins."""
    if not text or len(text) > _HEADING:
        return False
    pattern = _HEADINGS[column]
    exactly = text == column or re.fullmatch(pattern, text) is not None
    return exactly or (not exact and re.match(rf"(?:{pattern})\b", text) is not None)


def type_of(text: str, length: int | None) -> tuple[str, int | None]:
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
        digits = re.search(r"\d+", word)
        length = max(1, int(digits[0]) // 2) if digits else 1
    if kind == "bool":
        kind = "bits"
    return kind or "u16", length


def order_of(text: str) -> str | None:
    word = re.sub(r"\b(ab|cd|ba|dc)[ -](ab|cd|ba|dc)\b", r"\1\2", text.lower())
    match = re.search(r"\b(abcd|cdab|badc|dcba)\b", word)
    if match:
        return match[1].upper()
    digits = re.search(r"\b(1234|3412|2143|4321|3210|1032|0123|2301)\b", word)
    if digits:
        return {"1234": "ABCD", "3412": "CDAB", "2143": "BADC", "4321": "DCBA", "3210": "ABCD", "1032": "CDAB",
                "0123": "DCBA", "2301": "BADC"}[digits[1]]  # fmt: skip
    if re.search(r"(big|msb|high|старш\w*).*(endian|first|впер)", word) and "swap" not in word:
        return "ABCD"
    if re.search(r"(low|lsw|little|младш\w*).*(first|word|swap|впер)|word swap|swapped", word):
        return "CDAB"
    return None


def scale_of(cells: Mapping[str, str]) -> str | None:
    text = cells.get("scale", "").lower().replace(",", ".").replace("×", "x").replace("*", "x")
    divisor = cells.get("divisor", "")
    if divisor and re.fullmatch(r"\d{1,12}(\.\d{1,12})?", divisor) and float(divisor):
        return f"1/{divisor}"
    match = re.search(r"(?P<divide>[/÷:]\s*)?(?P<number>\d+(\.\d+)?(e-?\d+)?)(\s*/\s*(?P<below>\d+))?", text)
    if not match or float(match["number"]) == 0:
        return None
    if match["divide"]:
        return f"1/{match['number']}"
    if re.fullmatch(r"10\s*\^\s*-?\d\d?", text.strip()):
        return f"{10.0 ** int(text.partition('^')[2]):g}"
    return f"{match['number']}/{match['below']}" if match["below"] else match["number"]


def values_of(text: str) -> str | None:
    pairs = re.findall(r"(\d+)\s*[=:–-]\s*([^;,\n|]+)", text)
    return "; ".join(f"{state}={name.strip()}" for state, name in pairs) if len(pairs) > 1 else None


def access_of(text: str) -> str | None:
    word = text.lower().replace(" ", "")
    if not word:
        return None
    reads, writes = bool(re.search(r"r|ч|l", word)), bool(re.search(r"w|з|s", word))
    return "rw" if reads and writes else "w" if writes else "r" if reads else None


def is_function(heading: str) -> bool:
    """Whether a column of areas has function codes."""
    return re.search(r"func|\bfc\b|функц|funktion", heading.lower()) is not None


def area_of_cell(text: str, *, function: bool = False) -> MapArea | None:
    """The area that a cell names, by words, by its digit (4 for 4x), or by the code of a `function` that reads it."""
    word = re.sub(r"\.0$", "", text.strip().lower())
    if not word:
        return None
    try:
        if not (function and re.fullmatch(r"\d", word)):
            return area_of(word)
    except CellError:
        pass
    return area_words(word) or next(
        (_FUNCTIONS[int(number, 16)] for number in re.findall(r"(?<![0-9a-f])(?:0x)?0?([0-9a-f])h?\b", word)
         if int(number, 16) in _FUNCTIONS),
        None,
    )  # fmt: skip


def area_words(text: str) -> MapArea | None:
    word = text.lower()
    patterns: tuple[tuple[str, MapArea], ...] = (
        (r"discrete|дискретн\w* вход|контакт", "discrete"),
        (r"coil|дискретн\w* выход|флаг", "coil"),
        (r"holding|регистр\w* хранения|выходн\w* регистр|halteregister", "holding"),
        (r"input|входн\w* регистр|регистр\w* ввода|eingangsregister", "input"),
    )
    return next((area for pattern, area in patterns if re.search(pattern, word)), None)


def plain_number(text: str) -> str | None:
    """A number of a cell, with decimal comma or gaps at its thousands; None where it is none."""
    text = together(text).replace("\u2212", "-").replace("- ", "-")
    return text.replace(",", ".") if re.fullmatch(r"[-+]?\d+([.,]\d+)?", text) else None


def limits_of(cells: Mapping[str, str]) -> tuple[str | None, str | None]:
    """Least and greatest value, from their columns or from one range such as `0...100` or `-10 to 10`."""
    low, high = plain_number(cells.get("min", "")), plain_number(cells.get("max", ""))
    number = r"[-+\u2212]?\d+(?:[.,]\d+)?"
    span = re.match(
        rf"\W*?({number})\s*(?:\.{{2,3}}|…|to|bis|до|~|÷|–|—|-)\s*({number})(?![\d.,])",
        together(cells.get("range", "")),
    )
    if low is None and high is None and span and ("=" not in cells.get("range", "")):
        low, high = plain_number(span[1]), plain_number(span[2])
    if low is not None and high is not None and float(low) > float(high):
        return None, None
    return low, high


def unit_of(cells: Mapping[str, str]) -> tuple[str | None, str | None]:
    """Scale and unit of measure; where no column has a scale it may stand before the unit (`0.1 V`, `x0,01 A`)."""
    measure = cells.get("unit", "")
    if "scale" not in cells and "divisor" not in cells:
        match = re.fullmatch(r"(?:[x×*]\s*)?(\d+(?:[.,]\d+)?)\s*[x×*]?\s*([^\d\s].*)?", measure)
        if match and float(match[1].replace(",", ".")):
            return match[1].replace(",", "."), match[2] or ""
    return scale_of(cells), measure
