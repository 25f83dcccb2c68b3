"""The words of tables in manuals: what headings and cells mean, in English, Russian and German."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Final

from .cells import CellError, area_of
from .model import AREA_WORDS, MapArea
from .tablecells import together

_HEADING: Final = 60  # characters
_HEADINGS: Final[Mapping[str, str]] = {
    "area": r"area|table|register type|reg\.? ?type|function|fc|func|код функции|функция|область|тип регистра|"
    r"таблица|funktion|registertyp|bereich",
    "address": r"(start(ing)? |first |begin |нач\w* |modbus )?(address|addr|adr|register|reg|адрес|регистр)|"
    r"(№ |номер )?(адрес|регистр|рег)|offset ?\(hex\)|hex|dec|modbus|номер регистра|"
    r"(start|anfangs|register)?adresse|register-?nr",
    "end": r"(end(ing)?|last|кон\w*|посл\w*) (address|addr|adr|register|reg|адрес|регистр)|endadresse",
    "name": r"name|parameter|signal|variable|tag|quantity|measurement|object|description|наименование|название|"
    r"параметр|имя|величина|описание|bezeichnung|messgr\w*|größe|beschreibung",
    "type": r"(data ?)?type|format|datatype|data format|тип( данных)?|формат|datentyp|typ",
    "length": r"length|len|size|words|word (len\w*|count)|count|quantity of reg|registers|number of registers|"
    r"nr\.? of reg|длина|размер|"
    r"количество|кол-во|кол\.|länge|anzahl",
    "scale": r"scal(e|ing)|factor|multiplier|resolution|coefficient|gain|множитель|коэфф\w*|масштаб|цена|дискрет|"
    r"skalierung|faktor|auflösung|multiplikator",
    "divisor": r"divisor|divider|делитель|teiler",
    "offset": r"offset|смещение|сдвиг",
    "unit": r"units?|uom|eng\.? ?units?|measure|ед\.?( ?изм\.?)?|единиц\w*|размерность|einheit",
    "values": r"values|enum|states|options|mapping|значени\w*|состояни\w*|werte|zustände",
    "access": r"access|r/w|rw|read|mode|permission|attribute|доступ|чтение|режим|zugriff|lesen",
    "range": r"(value |data |setting )?range|limits|диапазон|пределы|wertebereich|messbereich|grenzen",
    "min": r"min(imum)?|lower|мин\w*|untergrenze",
    "max": r"max(imum)?|upper|макс\w*|obergrenze",
    "order": r"(byte|word) ?order|endian\w*|(byte |word )?swap( type| mode)?|порядок|byte-?reihenfolge",
    "description": r"description|comment|remark|note|remarks|notes|описание|примечани\w*|комментари\w*|"
    r"beschreibung|bemerkung|kommentar",
    "group": r"group|section|category|группа|раздел|gruppe",
}
_ENDINGS: Final[Mapping[str, str]] = {
    "address": r"adresse|address|адрес",
    "name": r"name|bezeichnung|наименование|название",
    "type": r"format|typ|type",
    "scale": r"faktor|factor|множитель|коэффициент",
    "unit": r"einheit|units?",
    "range": r"bereich|range|диапазон",
}
"""How longer headings end: `Datenformat`, `Skalierungsfaktor`, `Modbus-Adresse`, `Data name`."""
_RAISED: Final = re.compile("([⁻-]?)([⁰¹²³⁴⁵⁶⁷⁸⁹]+)")
_SUPERSCRIPTS: Final = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹", "0123456789")
_MEASURE: Final = (
    r"[mkMGµμnмкМГ]?(?:VAr?h?|[Vv]arh?|Wh?|V|Ah?|Hz|Ohms?|Ω|Pa|bar|вар[·*]?ч?|ВА[·*]?ч?|Вт[·*]?ч?|В|А[·*]?ч?|Гц|Ом|Па|бар|"
    r"s|с|l|л|m|м|g|г|t|т)|°\s?[CFС]|deg ?C|%|‰|rpm|об/мин|min|мин|h|ч|ppm|p[Hh]|lx|лк|dB|дБ|"
    r"(?:[mм][3³]|l|л|kg|кг|t|т)/(?:h|ч|s|с|min|мин)|[mм][3³]|[mм]/[sс]|Гкал(?:/ч)?|Gcal(?:/h)?"
)
_NAMED_MEASURE: Final = re.compile(
    rf"(?P<name>.*\S)\s*(?:,\s*(?P<plain>{_MEASURE})|[(\[]\s*(?P<held>{_MEASURE})\s*[)\]])"
)
_NO_UNIT: Final = ("-", "--", "–", "—", "/", "n/a", "N/A", "None")
_NUMERALS: Final = r"^(?:dec\w*|hex\w*|modbus|дес\w*|шестн\w*)$"
"""Headings that say how the numbers below one are written."""
_FUNCTIONS: Final[Mapping[int, MapArea]] = {1: "coil", 5: "coil", 15: "coil", 2: "discrete", 3: "holding", 6: "holding",
                                            16: "holding", 4: "input"}  # fmt: skip
_CODE: Final = re.compile(
    r"\b(?:functions?|fc|funktion|функци\w*)\W{0,3}(?:code\W{0,3})?(?:0x)?(\d{1,2})h?\b(?!\s*(?:[,/&+\d]|and\b|und\b|и\b))"
)
"""One function, not the list of those that a device has."""


def headings(row: Sequence[str], below: Sequence[Sequence[str]] = ()) -> dict[str, int]:
    """Columns by what their headings mean, and the cells `below` them; empty where the row is no heading."""
    columns: dict[str, int] = {}
    used: set[int] = set()
    texts = [" ".join(cell.lower().split()).strip(" :.") for cell in row]
    if (area := _area_column(texts, below)) is not None:
        texts[area] = "area"
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
    if len(columns) > 1 and not any(text[:1].isdecimal() for text in texts):  # a row of values is no heading
        for column, ending in _ENDINGS.items():
            for at, text in enumerate(texts):
                if column not in columns and at not in used and re.search(rf"(?:{ending})$", text):
                    columns[column] = at
                    used.add(at)
    if "name" not in columns and "description" in columns:
        columns["name"] = columns.pop("description")
    return columns if {"address", "name"} <= set(columns) and len(columns) >= 2 else {}


def merged_headings(row: Sequence[str], second: Sequence[str]) -> list[str] | None:
    """The headings of two rows as one: where the second says more of columns that the first has together (`Address`
    over `Dec` and `Hex`), or what the first leaves out. None where the second is no heading."""
    texts = [" ".join(cell.lower().split()).strip(" :.") for cell in second]
    known = [any(_means(text, column, exact=True) for column in _HEADINGS) for text in texts]
    if sum(known) < 2 or any(re.search(r"\d", text) for text in texts):
        return None
    width = max(len(row), len(second))
    above = [*row, *[""] * (width - len(row))]
    below = [*second, *[""] * (width - len(second))]
    own = {at for at, is_known in enumerate(known) if is_known and not re.search(_NUMERALS, texts[at])}
    both = [
        low if at in own else f"{high} {low}".strip() for at, (high, low) in enumerate(zip(above, below, strict=True))
    ]
    return both if len(headings(both)) > max(len(headings(row)), len(headings(second))) else None


def _area_column(texts: Sequence[str], below: Sequence[Sequence[str]]) -> int | None:
    """The column headed `type` whose cells are areas (AI, DO, holding), if one is."""
    for at, text in enumerate(texts):
        cells = [row[at].strip().lower() for row in below if at < len(row) and row[at].strip()]
        if _means(text, "type", exact=False) and cells and all(cell in AREA_WORDS for cell in cells):
            return at
    return None


def _means(text: str, column: str, *, exact: bool) -> bool:
    """Whether a heading means a column: by all of it, or by how it begins."""
    if not text or len(text) > _HEADING:
        return False
    pattern = _HEADINGS[column]
    exactly = text == column or re.fullmatch(pattern, text) is not None
    return exactly or (not exact and re.match(rf"(?:{pattern})\b", text) is not None)


def scale_of(cells: Mapping[str, str]) -> str | None:
    """The factor of a row: `0,1`, `/10`, `x0.1`, `1:10`, `10^-1`; the divisor or the power of ten of another column."""
    text = cells.get("scale", "").lower().replace(",", ".").replace("×", "x").replace("*", "x")
    text = _RAISED.sub(lambda up: f"^{'-' if up[1] else ''}{up[2].translate(_SUPERSCRIPTS)}", text)
    divisor, power = cells.get("divisor", ""), cells.get("power", "")
    if divisor and re.fullmatch(r"\d{1,12}(\.\d{1,12})?", divisor) and float(divisor):
        return f"1/{divisor}"
    if re.fullmatch(r"[-\u2212]?\d", power):
        return f"{10.0 ** int(power.replace(chr(0x2212), '-')):g}"
    if raised := re.search(r"\b10\s*(?:\^|xx)\s*(-?\d)\b", text):
        return f"{10.0 ** int(raised[1]):g}"
    match = re.search(
        r"(?P<divide>[/÷:]\s*)?(?P<number>(?:^-)?\d+(\.\d+)?(e-?\d+)?)(\s*[/:]\s*(?P<below>\d+(\.\d+)?))?", text
    )
    if not match or float(match["number"]) == 0 or float(match["below"] or 1) == 0:
        return None
    if match["divide"]:
        return f"1/{match['number']}"
    return f"{match['number']}/{match['below']}" if match["below"] else match["number"]


def values_of(text: str) -> str | None:
    """States with names as a map writes them, where a cell has more than one."""
    pairs = re.findall(r"(\d+)\s*[=:–-]\s*([^;,\n|]+?)\s*(?=[;,\n|]|$)", text)
    return "; ".join(f"{state}={name.strip()}" for state, name in pairs) if len(pairs) > 1 else None


def has_only_states(text: str) -> bool:
    """Whether a remark is a list of states from 0 or 1 on: `0 - off, 1 - on`, `0: 4800, 1: 9600`."""
    parts = [part.strip() for part in re.split(r"[;,\n|]", text) if part.strip()]
    states = [re.fullmatch(r"(\d+)\s*(?:[=:]\s*\S.*|[–-]\s*[^\W\d].*)", part) for part in parts]
    return len(states) > 1 and all(states) and states[0] is not None and int(states[0][1]) < 2


def measure_in(name: str) -> tuple[str, str]:
    """A name without the unit of measure that stands behind it, and that unit: `Voltage L1, V`, `Ток [А]`."""
    match = _NAMED_MEASURE.fullmatch(name)
    return (match["name"], match["plain"] or match["held"]) if match else (name, "")


def access_of(text: str) -> str | None:
    """r, w or rw out of `R/W`, `read only`, `чтение/запись`."""
    word = (
        text.lower()
        .replace(" ", "")
        .replace("only", "")
        .replace("write", "w")
        .replace("schreib", "s")
        .replace("wr", "w")
    )
    if not word:
        return None
    reads, writes = bool(re.search(r"r|ч|l", word)), bool(re.search(r"w|з|s", word))
    return "rw" if reads and writes else "w" if writes else "r" if reads else None


def is_powers(cells: Sequence[str]) -> bool:
    """Whether a column of factors has powers of ten, as SunSpec: small whole numbers, some below 0."""
    given = [cell.strip().replace("\u2212", "-") for cell in cells if cell.strip() not in ("", *_NO_UNIT)]
    return all(re.fullmatch(r"-?\d", cell) for cell in given) and any(re.fullmatch("-[1-9]", cell) for cell in given)


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
    """The area of which a title speaks, by its words or by the one function that it names."""
    word = text.lower()
    patterns: tuple[tuple[str, MapArea], ...] = (
        (r"discrete|дискретн\w* вход|контакт", "discrete"),
        (r"coil|дискретн\w* выход|флаг", "coil"),
        (r"holding|регистр\w* хранения|выходн\w* регистр|halteregister", "holding"),
        (r"input|входн\w* регистр|регистр\w* ввода|eingangsregister", "input"),
    )
    named = next((area for pattern, area in patterns if re.search(pattern, word)), None)
    code = _CODE.search(word)
    return named or (_FUNCTIONS.get(int(code[1])) if code else None)


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
    if measure in _NO_UNIT:
        measure = ""
    if not {"scale", "divisor", "power"} & set(cells):
        match = re.fullmatch(r"(?:[x×*]\s*)?(\d+(?:[.,]\d+)?)\s*[x×*]?\s*([^\d\s].*)?", measure)
        if match and float(match[1].replace(",", ".")):
            return match[1].replace(",", "."), match[2] or ""
    return scale_of(cells), measure
