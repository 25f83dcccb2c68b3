"""The headings of tables in manuals: which column holds what, in English, Russian, German and Chinese.

Those of the Romance languages, Polish, Czech, Dutch, Turkish and Japanese are known, too.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Final

from .model import AREA_WORDS
from .tablewords import STEP, WIDE_SIGNS, area_words

_HEADING: Final = 60  # characters
_HEADINGS: Final[Mapping[str, str]] = {
    "area": r"area|table|register type|reg\.? ?type|object type|function|fc|fn|func|код функции|функция|область|"
    r"тип регистра|таблица|funktion|registertyp|registerart|bereich|fonction|funci[oó]n|funzione|功能码|寄存器类型",
    "address": r"(start(ing)? |first |begin |нач\w* |modbus |plc |modico[nm] |physical |protocol )?"
    r"(add?ress?|addr|adr|register|reg|адрес|регистр)|"
    r"coils?|discrete inputs?|(holding|input) registers?|(входной|выходной) регистр|(holding|input)register|"
    r"(№ |номер )?(адрес|регистр|рег)|offset ?\(hex\)|hex|dec|modbus|номер регистра|reg\.? ?(#|no|nr)\.?|"
    r"(start|anfangs|register)?adresse|register-?nr|direcci[oó]n|indirizzo|adresa?|endereço|registr[eo]|rejestr|"
    r"адреса|アドレス|レジスタ|(寄存器|暫存器|起始|首|数据|通讯|协议|modbus)*(地址|位址|编号)|寄存器|暫存器",
    "end": r"(end(ing)?|last|кон\w*|посл\w*) (address|addr|adr|register|reg|адрес|регистр)|endadresse",
    "name": r"name|(parameter|variable|signal|register|data|point|tag|channel) ?name|parameter|signal|variable|tag|"
    r"quantity|measurement|object|description|наименование|название|параметр|имя|величина|описание|содержимое|назва|"
    r"bezeichnung|messgr\w*|größe|beschreibung|contents?|item|title|meaning|designation|label|point|channel|var|désignation|libellé|nom|grandeur|paramètre|nombre|parámetro|magnitud|descripción|"
    r"descrizione|nome|parametro|grandezza|nazwa|opis|parametr|descrição|název|popis|"
    r"omschrijving|naam|açıklama|"
    r"(参数|信号|变量|数据|寄存器)?(名称?|名稱|含义)|参数|信号|变量|项目|内容",
    "type": r"(data ?)?type|format|fmt|datatype|data format|тип( данных)?|формат|datentyp|typ( danych)?|"
    r"tipo( d[ei] dat[oi]s?)?|type de données?|"
    r"veri tipi|データ型|型|(数据)?(类型|格式)|資料型態|類型",
    "octets": r"((data )?(length|size|len),? ?[(\[]?(in )?)?bytes?[)\]]?|(number|no\.?) of bytes|octets|字节数|"
    r"(длина|размер|кол\w*),? ?[(\[]?байт\w*[)\]]?|байт\w*",
    "width": r"bits|(size|width|length|len),? ?[(\[]?(in )?bits[)\]]?|width|разрядность|位数",
    "bit": r"bit( ?(no|nr|number|position|pos|#))?\.?|(№ |номер )?бита?",
    "decimals": r"decimals?|decimal (places|point|digits)|dp|знак\w* после (запятой|точки)|nachkommastellen|"
    r"小数位数?|小数点",
    "signed": r"signed|sign|знак(овость|овый)?|vorzeichen|符号",
    "length": r"length|len|size|words|word (len\w*|count)|regs|count|registers|quantity|"
    r"(number|nr|no|quantity)\.? of .{0,24}reg\w*|длина|размер|количество|кол-во|кол\.|"
    r"länge|anzahl|longueur|longitud|lunghezza|(寄存器)?(长度|数量|个数)|字数",
    "scale": r"scal(e|ing)|factor|multiplier|mult|res(olution)?|coefficient|gain|множ\w*|коэфф\w*|масштаб|цена|дискрет|"
    r"skalierung|faktor|auflösung|multiplikator|coeff?|facteur|échelle|escala|"
    r"fattore|scala|mnożnik|skala|fator|násobek|çarpan|倍率|(比例|缩放)?(系数|因子)|比例|分辨率",
    "divisor": r"divisor|divider|times|делитель|teiler|diviseur|divisore|dzielnik|除数",
    "offset": r"offset(?! ?[(\[]?(in )?(bytes?|words?|reg|addr|hex|dec))|смещение|сдвиг|偏移量",
    "unit": r"units?|uom|eng\.? ?units?|measure|ед\.?( ?изм\.?)?|[ео]диниц\w*|размерность|einheit|"
    r"unité|unidad(es)?|unità|jednostka|unidade|jednotka|eenheid|birim|单位|單位|単位",
    "values": r"values|enum|states|options|mapping|значени\w*|состояни\w*|werte|zustände",
    "access": r"access|r/w|rw|rd/wr|read|operation|mode|permission|attribute|доступ|чтение|ч/з|режим|"
    r"чт\w*\W{0,2}зап\w*|zugriff|lesen|accès|acceso|accesso|dostęp|acesso|toegang|操作|读写\w*|权限|属性|访问\w*",
    "writable": r"writ(e?able|e)|beschreibbar|schreibbar|запись",
    "range": r"(value |data |setting )?range|limits|диапазон|пределы|wertebereich|messbereich|grenzen|"
    r"plage|rango|intervallo|zakres|(取值|数据)?范围|量程",
    "min": r"min(imum)?|lower|мин\w*|untergrenze|最小值?",
    "max": r"max(imum)?|upper|макс\w*|obergrenze|最大值?",
    "order": r"(byte|word) ?order|endian\w*|(byte |word )?swap( type| mode)?|порядок|byte-?reihenfolge|字节序|字序",
    "description": r"description|comment|remark|note|remarks|notes|описание|примечани\w*|комментари\w*|"
    r"beschreibung|bemerkung|kommentar|remarque|commentaire|observaciones|comentarios?|uwagi|说明|备注|描述",
    "group": r"group|section|category|группа|раздел|gruppe|分组",
}
_ENDINGS: Final[Mapping[str, str]] = {
    "address": r"adresse|address|адрес",
    "name": r"name|bezeichnung|наименование|название",
    "type": r"format|typ|type",
    "scale": r"faktor|factor|множитель|коэффициент",
    "unit": r"einheit|units?",
    "range": r"bereich|range|диапазон",
    "description": r"说明|备注",
    "access": r"zugriff|access|доступ",
}
"""How longer headings end: `Datenformat`, `Skalierungsfaktor`, `Modbus-Adresse`, `Data name`."""
_NUMERALS: Final = r"^(?:dec\w*|hex\w*|modbus|дес\w*|шестн\w*)$"
"""Headings that say how the numbers below one are written."""
_CODES: Final = re.compile(r"(?:fc|func\w*)?\W*(?:0x)?\d{1,2}h?(?:\W+(?:0x)?\d{1,2}h?){0,7}\W*")


def headings(row: Sequence[str], below: Sequence[Sequence[str]] = ()) -> dict[str, int]:
    """Columns by what their headings mean, and the cells `below` them; empty where the row is no heading."""
    columns: dict[str, int] = {}
    used: set[int] = set()
    texts = [_plain(cell) for cell in row]
    texts = ["" if _is_empty_name(at, text, below) else text for at, text in enumerate(texts)]
    if (area := _area_column(texts, below)) is not None:
        texts[area] = "area"
    if (access := _access_column(texts, below)) is not None:
        texts[access] = "access"
    if (step := _step_column(texts, below)) is not None:
        texts[step] = "scale"
    if "№" in texts and not any(_means(text, "address", exact=False) for text in texts):
        texts[texts.index("№")] = "address"
    if not any(map(_is_address, texts)):
        names = {"start": "address", "end": "end address"} if {"start", "end"} <= set(texts) else {"offset": "address"}
        texts = [names.get(text, text) for text in texts]
    if "registers" in texts and not any(_means(text, "address", exact=True) for text in texts):
        texts[texts.index("registers")] = "address"  # beside an address it is how many
    if not any(map(_is_address, texts)):
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
    if "address" in columns and "name" not in columns and (other := _other_name(texts, columns, below)) is not None:
        columns = {**{column: at for column, at in columns.items() if at != other}, "name": other}
    return columns if {"address", "name"} <= set(columns) and len(columns) >= 2 else {}


def filled(rows: Sequence[Sequence[str]], at: int) -> list[str]:
    """The cells of a column that hold something."""
    return [cell for row in rows if at < len(row) and (cell := row[at].strip())]


def _other_name(texts: Sequence[str], columns: Mapping[str, int], below: Sequence[Sequence[str]]) -> int | None:
    """The column that names values where none is headed so: `Value`, or `Function` above words that are no area's."""
    if re.match(r"coil|discrete", texts[columns["address"]]) and (at := columns.get("area")) is not None:
        cells = [row[at] for row in below if row[at:] and row[at]]
        return None if any(area_words(cell) or _CODES.fullmatch(cell.lower()) for cell in cells) else at
    free = (at for at, text in enumerate(texts) if text in ("value", "wert", "значение", "valeur", "valor", "valore"))
    return next((at for at in free if at not in columns.values()), None)


def _is_empty_name(at: int, text: str, below: Sequence[Sequence[str]]) -> bool:
    """Whether a column of names has none."""
    return len(below) > 1 and _means(text, "name", exact=True) and not any(row[at:] and row[at] for row in below)


def _is_address(text: str) -> bool:
    return _means(text, "address", exact=False) or re.search(rf"\w (?:{_ENDINGS['address']})$", text) is not None


def _plain(cell: str) -> str:
    """A heading in small letters, its signs those of ASCII."""
    return " ".join(cell.translate(WIDE_SIGNS).lower().split()).strip(" :.")


def merged_headings(row: Sequence[str], second: Sequence[str]) -> list[str] | None:
    """The headings of two rows as one: where the second says more of columns that the first has together (`Address`
    over `Dec` and `Hex`), or what the first leaves out. None where the second is no heading."""
    texts = [_plain(cell) for cell in second]
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
    """The column headed `type`, of whatever, whose cells are areas (AI, DO, holding), if one is."""
    for at, text in enumerate(texts):
        meant = _means(text, "type", exact=False)
        if not meant and re.search(rf"(?:{_ENDINGS['type']})$", text) is None:
            continue
        cells = [cell.lower() for cell in filled(below, at)]
        if cells and all(cell in AREA_WORDS for cell in cells) and (meant or not all(map(str.isdigit, cells))):
            return at
    return None


def _access_column(texts: Sequence[str], below: Sequence[Sequence[str]]) -> int | None:
    """The column headed `type` whose cells are R, W, R/W, if one is."""
    for at, text in enumerate(texts):
        cells = filled(below, at) if _means(text, "type", exact=False) else []
        if cells and all(re.fullmatch("r/?[wo]?|wo?|w/r", cell.lower()) for cell in cells):
            return at
    return None


def _step_column(texts: Sequence[str], below: Sequence[Sequence[str]]) -> int | None:
    """The column headed `accuracy` whose cells are steps (0.1, 0.01, 1) and no shares of a reading, if one is."""
    for at, text in enumerate(texts):
        cells = filled(below, at) if text in ("accuracy", "precision", "精度") else []
        if cells and all(re.fullmatch(STEP, cell) for cell in cells):
            return at if any(cell != "1" for cell in cells) else None
    return None


def _means(text: str, column: str, *, exact: bool) -> bool:
    """Whether a heading means a column: by all of it, or by how it begins."""
    if not text or len(text) > _HEADING:
        return False
    if column == "name" and re.search(r"\b(no|nr|number|num|id)$|[#№]$", text):
        return False
    pattern = _HEADINGS[column]
    exactly = text == column or re.fullmatch(pattern, text) is not None
    return exactly or (not exact and re.match(rf"(?:{pattern})\b", text) is not None)
