"""The words of tables in manuals: what cells mean, in English, Russian, German and Chinese."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Final

from .cells import CellError, area_of
from .model import MapArea
from .tablecells import together

_RAISED: Final = re.compile("([⁻-]?)([⁰¹²³⁴⁵⁶⁷⁸⁹]+)")
_SUPERSCRIPTS: Final = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹", "0123456789")
_MEASURE: Final = (
    r"[mkMGµμnмкМГ]?(?:VAr?h?|[Vv]arh?|Wh?|V|Ah?|Hz|Ohms?|Ω|Pa|bar|вар[·*]?ч?|ВА[·*]?ч?|Вт[·*]?ч?|В|А[·*]?ч?|Гц|Ом|Па|бар|"
    r"s|с|l|л|m|м|g|г|t|т)|[°º]\s?[CFС]|℃|°|deg ?C|%|‰|rpm|об/мин|min|мин|h|ч|ppm|p[Hh]|lx|лк|dB|дБ|"
    r"(?:[mм][3³]|l|л|kg|кг|t|т)/(?:h|ч|s|с|min|мин)|[mм][3³]|[mм]/[sс]|Гкал(?:/ч)?|Gcal(?:/h)?"
)
_NAMED_MEASURE: Final = re.compile(
    rf"(?P<name>.*\S)\s*(?:,\s*(?P<plain>{_MEASURE})|[(\[]\s*(?P<held>{_MEASURE})\s*[)\]])"
)
STEP: Final = r"(?:1|0?[.,]0*[125])(?!\d)"  # of a raw value
_NAMED_STEP: Final = re.compile(
    rf"(?P<name>.*\S)\s*[(\[]\s*(?:[x×*]?\s*(?P<step>{STEP})(?:\s*(?P<unit>{_MEASURE})|(?<=[.,]\d)|(?<=[.,]\d\d)|(?<=[.,]\d{{3}}))|"
    rf"(?P<of>{_MEASURE})\s*[x×*]\s*(?P<times>10{{1,4}}))\s*[)\]]"
)
_SAID: Final = re.compile(
    r"(?P<word>(?:units?|resolution|scale|lsb|ед\.? ?изм\.?|единица|шаг|цена|дискретность|"
    rf"einheit|auflösung|单位|分辨率)\s*[:=]?\s*)?[x×*]?\s*(?P<step>{STEP})?\s*(?P<unit>{_MEASURE})?[.;]?",
    re.IGNORECASE,
)
_TIMES: Final = re.compile(
    r"扩大\s*(10{1,4})\s*倍|\b(10{1,4}) times (?:the )?(?:actual|real)|(?:actual|real) value\s*[x×*]\s*(10{1,4})(?!\d)|"
    r"(?:умнож|увелич)\w* (?:на|в) (10{1,4})(?!\d)"
)
_NO_UNIT: Final = ("-", "--", "–", "—", "/", "n/a", "N/A", "None")
WIDE_SIGNS: Final = str.maketrans("（）：；，＝／", "():;,=/")
_FUNCTIONS: Final[Mapping[int, MapArea]] = {1: "coil", 5: "coil", 15: "coil", 2: "discrete", 3: "holding", 6: "holding",
                                            16: "holding", 4: "input"}  # fmt: skip
_READS: Final = r"read|чт|les|lez|lect|lett|leit|odcz|读"
_WRITES: Final = r"writ|зап|schreib|schrijv|[eé]cri|escr|scritt|zapis|写"
_CODE: Final = re.compile(
    r"\b(?:functions?|fc|funktion|функци\w*)\W{0,3}(?:code\W{0,3})?(?:0x)?(\d{1,2})h?\b(?!\s*(?:[,/&+\d]|and\b|und\b|и\b))"
)
"""One function, not the list of those that a device has."""


def scale_of(cells: Mapping[str, str]) -> str | None:
    """The factor of a row: `0,1`, `/10`, `x0.1`, `1:10`, `10^-1`; the divisor or the power of ten of another column."""
    text = cells.get("scale", "").lower().replace(",", ".").replace("×", "x").replace("*", "x")
    text = re.sub(r"(?<!\d)\.(?=\d)", "0.", text)
    text = _RAISED.sub(lambda up: f"^{'-' if up[1] else ''}{up[2].translate(_SUPERSCRIPTS)}", text)
    divisor, power = cells.get("divisor", ""), cells.get("power", "")
    if re.fullmatch(r"[1-6](\.0)?", places := cells.get("decimals", "")):
        return f"1/{10 ** int(places[0])}"
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
    text = text.translate(WIDE_SIGNS)
    pairs = (
        re.findall(r"\"b?(\d+)\"\s*:\s*\"([^\"]+)\"", text)
        or re.findall(r"(\d+)\s*[=:–-]\s*([^;,\n|]+?)\s*(?=[;,\n|]|$|\s\d{1,3}\s*[=:–-]\s*[^\W\d])", text)
        or [(state, name) for name, state in re.findall(r"([^\W\d][^;,\n|()=]*?)\s*\((\d+)\)\s*(?=[;,\n|]|$)", text)]
    )
    return "; ".join(f"{state}={name.strip()}" for state, name in pairs) if len(pairs) > 1 else None


def has_only_states(text: str) -> bool:
    """Whether a remark is a list of states from 0 or 1 on: `0 - off, 1 - on`, `0: 4800, 1: 9600`."""
    parts = [part.strip() for part in re.split(r"[;,\n|]", text.translate(WIDE_SIGNS)) if part.strip()]
    states = [re.fullmatch(r"(\d+)\s*(?:[=:]\s*\S.*|[–-]\s*[^\W\d].*)", part) for part in parts]
    return len(states) > 1 and all(states) and states[0] is not None and int(states[0][1]) < 2


def measure_in(name: str) -> tuple[str, str]:
    """A name without the unit of measure that stands behind it, and that unit: `Voltage L1, V`, `Ток [А]`."""
    match = _NAMED_MEASURE.fullmatch(name)
    return (match["name"], match["plain"] or match["held"]) if match else (name, "")


def step_in(name: str) -> tuple[str, str | None, str]:
    """A name without the step in brackets behind it, that step and its unit: `Voltage (0.1 V)`, `Ток (А x 100)`."""
    match = _NAMED_STEP.fullmatch(name)
    if match is None:
        return name, None, ""
    step = match["step"].replace(",", ".") if match["step"] else f"1/{match['times']}"
    return match["name"], step, match["unit"] or match["of"] or ""


def step_said(remark: str) -> tuple[str | None, str]:
    """The step and the unit that a remark names and nothing else: `0,1 °C`, `Unit: 0.01 A`, `单位0.1V`; or the times
    that it says a raw value is the real one: `10 times the actual value`, `扩大10倍`."""
    if (times := _TIMES.search(remark.lower())) is not None:
        return f"1/{next(filter(None, times.groups()))}", ""
    match = _SAID.fullmatch(remark.translate(WIDE_SIGNS))
    if match is None or not (match["step"] or match["word"] or re.search("[%°℃VAWВАHГ]", match["unit"] or "")):
        return None, ""
    return match["step"] and match["step"].replace(",", "."), match["unit"] or ""


def writable_of(text: str) -> str | None:
    """The same out of a column that says whether one can write: `yes`, `no`, `WR`, `RD`."""
    word = text.lower()
    if re.fullmatch(r"y(es)?|true|1|да|ja|\+|[wx✓]|wr|r/?w", word):
        return "rw"
    return "r" if re.fullmatch(r"no?|false|0|нет|nein|-|rd?|ro", word) else None


def access_of(text: str) -> str | None:
    """r, w or rw out of `R/W`, `read only`, `чтение/запись`, `L/E`, `只读`."""
    word = text.lower()
    letters = re.sub(r"[^a-zа-я]", "", word)
    if not word:
        return None
    reads, writes = bool(re.search(_READS, word)), bool(re.search(_WRITES, word))
    if not (reads or writes):
        writes = bool(re.search("[wз]" if "ro" in letters else "[wзs]|^le$", letters))
        reads = bool(re.search("[rчl]", letters.replace("wr", "w")))
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
        (r"discrete|дискретн\w* вход|контакт|离散", "discrete"),
        (r"coil|дискретн\w* выход|флаг|线圈", "coil"),
        (r"holding|регистр\w* хранения|выходн\w* регистр|halteregister|保持", "holding"),
        (r"input|входн\w* регистр|регистр\w* ввода|eingangsregister|输入寄存器", "input"),
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
    if not {"scale", "divisor", "power", "decimals"} & set(cells):
        match = re.fullmatch(r"(?:[x×*]\s*)?(\d+(?:[.,]\d+)?)\s*[x×*]?\s*([^\d\s].*)?", measure)
        if match and float(match[1].replace(",", ".")):
            return match[1].replace(",", "."), match[2] or ""
    return scale_of(cells), measure
