"""The cells of a map: a column is one entry of `COLUMNS`, from its text to what `MappedValue` holds and back.

A cell that cannot be read raises `CellError`, which says what was expected; who reads the file adds where.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

from dissectors.values import ORDERS, ValueFormError, harmless, physical

from .model import (
    ANY_LENGTH,
    AREA_WORDS,
    BIT_AREAS,
    DIGIT_OF_AREA,
    VALUE_TYPES,
    DeviceSignature,
    MapArea,
    MappedValue,
)

_LAST_ADDRESS: Final = 0xFFFF
_LONGEST: Final = 125  # registers: no answer carries more ([1] 6.3)
_LAST_FUNCTION: Final = 127  # ([1] 4.1)
_NAME_LENGTH: Final = 200
_TEXT_LENGTH: Final = 1000
_LONGEST_NUMBER: Final = 40  # digits
_LAST_STATE: Final = (1 << 64) - 1
_AREA_OF_DIGIT: Final = {digit: area for area, digit in DIGIT_OF_AREA.items()}
_TYPE_WORDS: Final = {
    "uint16": "u16", "int16": "s16", "uint32": "u32", "int32": "s32", "uint64": "u64", "int64": "s64",
    "float": "f32", "float32": "f32", "double": "f64", "float64": "f64", "string": "text", "bitfield": "bits",
    "bit": "bool", "boolean": "bool", "bcd": "bcd16",
}  # fmt: skip


class CellError(ValueError):
    """What a cell should have held: `column` and `expected`."""

    def __init__(self, column: str, text: object, expected: str) -> None:
        super().__init__(f"{column} is {str(text)[:60]!r}: expected {expected}")
        self.column = column


@dataclass(frozen=True, slots=True)
class Column:
    """A column: its JSON Schema, what it means to a reader, and what `MappedValue` holds of it: `attribute`, which
    `read` makes of a cell that holds something and `written` makes one of; without `read`, others decide with it."""

    name: str
    schema: Mapping[str, Any]
    help: str
    attribute: str
    read: Callable[[str, object], Any] | None = None
    written: Callable[[Any], str] = str


def area_and_address(area: object, address: object, base: int = 0) -> tuple[MapArea, int]:
    """Area and zero-based address. Where `area` is empty the address must be a logical one, which names it."""
    text = _cell(address).replace(" ", "").replace("_", "")
    chosen = area_of(area) if _cell(area) else None
    prefix = re.fullmatch(r"([0134])x(\d+)", text, re.IGNORECASE)
    if chosen is None or (prefix and prefix[1] != "0"):
        try:
            digit, number = physical(text)
        except ValueFormError:
            raise CellError("address", text, "a logical address (4x108, 40108, 400108), as area is empty") from None
        named = _AREA_OF_DIGIT[digit[0]]
        if chosen not in (None, named):
            raise CellError("address", text, f"an address of area {chosen}")
        return named, number
    number = whole_number("address", text)
    number -= base
    if not 0 <= number <= _LAST_ADDRESS:
        raise CellError("address", text, f"{base} to {_LAST_ADDRESS + base}")
    return chosen, number


def area_of(area: object) -> MapArea:
    """The area that a word means."""
    named = AREA_WORDS.get(_cell(area).lower().replace("_", " "))
    if named is None:
        raise CellError("area", area, "coil, discrete, input or holding")
    return named


def type_of(kind: object, area: MapArea) -> str:
    """The type that a word means; the area's own where there is none."""
    word = _cell(kind).lower()
    if not word:
        return "bool" if area in BIT_AREAS else "u16"
    word = _TYPE_WORDS.get(word, word)
    if word not in VALUE_TYPES:
        raise CellError("type", kind, f"one of {', '.join(VALUE_TYPES)}")
    if area in BIT_AREAS and word != "bool":
        raise CellError("type", kind, f"bool in area {area}")
    return word


def order_of(order: object, default: str = "ABCD") -> str:
    """The word and byte order."""
    word = _cell(order).upper()
    if not word:
        return default
    if word not in ORDERS:
        raise CellError("order", order, f"one of {', '.join(ORDERS)}")
    return word


def length_of(length: object, kind: str) -> int:
    """Registers that a value takes."""
    usual = VALUE_TYPES[kind]
    if not _cell(length):
        if not usual:
            raise CellError("length", "", f"how many registers the {kind} takes")
        return usual
    number = whole_number("length", length)
    if not 1 <= number <= _LONGEST:
        raise CellError("length", length, f"1 to {_LONGEST} registers")
    if kind not in ANY_LENGTH and number != usual:
        raise CellError("length", length, f"{usual}, as a {kind} takes")
    return number


def names_of(values: object) -> dict[int, str]:
    """Names of states or bits, from `0=off; 1=on` or from a mapping."""
    if isinstance(values, Mapping):
        pairs = [(_cell(key), _cell(name)) for key, name in values.items()]
    else:
        pairs = []
        for part in re.findall(r"(?:\\.|[^;|\n])+", str(values)):
            if part.strip():
                state, mark, name = part.partition("=")
                if not mark:
                    raise CellError("values", values, "states with names, such as 0=off; 1=on")
                pairs.append((state.strip(), re.sub(r"\\([;|=\\])", r"\1", name.strip())))
    states = {whole_number("values", state): one_line(name) for state, name in pairs}
    if beyond := [state for state in states if abs(state) > _LAST_STATE]:
        raise CellError("values", beyond[0], "states that a register can hold")
    return states


_WHOLE: Final = (
    (re.compile(r"(-?\d+)(?:\.0+)?"), 10),
    (re.compile(r"0[xX]([0-9A-Fa-f]+)"), 16),
    (re.compile(r"([0-9][0-9A-Fa-f]*)[hH]"), 16),
)


def whole_number(column: str, value: object) -> int:
    """A whole number, decimal or hex (0x6B, 6Bh); `107.0`, as spreadsheets write it, is one too."""
    if isinstance(value, int) and not isinstance(value, bool):
        return value
    text = _cell(value)[: _LONGEST_NUMBER + 1]
    forms = ((pattern.fullmatch(text), base) for pattern, base in _WHOLE)
    number = next((int(match[1], base) for match, base in forms if match), None)
    if number is None or len(text) > _LONGEST_NUMBER:
        raise CellError(column, value, "a whole number, decimal or hex (0x6B)")
    return number


def whole_in(value: object) -> int | None:
    """A whole number, decimal or hex, None where it is none."""
    try:
        return whole_number("address", value)
    except CellError:
        return None


def count_in(value: object, usual: int = 0) -> int:
    """A whole number other than 0; the usual one where there is none."""
    return whole_in(value) or usual


def number_text(number: float | None) -> str:
    """A number as a cell has it: the shortest that reads the same; nothing for None."""
    if number is None:
        return ""
    return str(int(number)) if number == int(number) and abs(number) < 1e15 else repr(float(number))


def signature_of(text: object) -> DeviceSignature:
    """The header's `match`: `server_id: TEXT; register: holding 40000 = 0x5375 0x6E53; poll: input 0 72`."""
    found: dict[str, list[Any]] = {"server_id": [], "identification": [], "register": [], "poll": []}
    for key, rest in _clauses(text):
        kind = _CLAUSES.get(key, key)
        if kind not in found:
            raise CellError("match", key, "server_id, identification, register or poll")
        found[kind].append(_READ_AS[kind](rest))
    return DeviceSignature(*map(tuple, found.values()))


def _clauses(text: object) -> Iterator[tuple[str, str]]:
    """The keys of a signature with what they say, each once."""
    if isinstance(text, Mapping):
        for key, listed in text.items():
            yield from ((str(key), _cell(one)) for one in (listed if isinstance(listed, list) else [listed]))
        return
    for part in filter(str.strip, str(text or "").split(";")):
        key, mark, rest = part.partition(":")
        if not mark:
            raise CellError("match", part, "server_id:, identification:, register: or poll:")
        yield key.strip(), rest.strip()


def _constant(text: str) -> tuple[MapArea, int, tuple[int, ...]]:
    where, _, words = text.partition("=")
    area, (address,) = _spot(where, 1)
    return area, address, tuple(whole_number("match", word) for word in words.split())


def _poll(text: str) -> tuple[MapArea, int, int]:
    area, (address, quantity) = _spot(text, 2)
    return area, address, quantity


def signature_text(match: DeviceSignature) -> str:
    """The header line that `signature_of` reads."""
    return "; ".join(
        [f"server_id: {text}" for text in match.server_id]
        + [f"identification: {text}" for text in match.identification]
        + [f"register: {area} {at} = {' '.join(map(str, words))}" for area, at, words in match.registers]
        + [f"poll: {area} {at} {quantity}" for area, at, quantity in match.polls]
    )


def _spot(text: str, count: int) -> tuple[MapArea, list[int]]:
    """An area and so many numbers."""
    words = text.split()
    if len(words) != count + 1:
        raise CellError("match", text, "an area and addresses, such as input 0 72")
    return area_of(words[0]), [whole_number("match", word) for word in words[1:]]


_CLAUSES: Final = {"registers": "register", "polls": "poll"}
_READ_AS: Final[Mapping[str, Callable[[str], Any]]] = {
    "server_id": lambda text: one_line(text),
    "identification": lambda text: one_line(text),
    "register": _constant,
    "poll": _poll,
}


def _access(column: str, cell: object) -> str:
    word = _cell(cell).lower().replace("/", "")
    word = {"ro": "r", "wo": "w", "read": "r", "write": "w", "readwrite": "rw", "wr": "rw"}.get(word, word)
    if word not in ("", "r", "w", "rw"):
        raise CellError(column, cell, "r, w or rw")
    return word


def _formula(column: str, cell: object) -> str:
    from .formulas import FORMULA_EXPECTED, FormulaError, formula_of

    text = _text(column, cell)
    try:
        formula_of(text)
    except FormulaError:
        raise CellError(column, text, FORMULA_EXPECTED) from None
    return text


def _writers(column: str, cell: object) -> tuple[int, ...]:
    codes = [whole_number(column, part) for part in re.split(r"[\s,;]+", _cell(cell)) if part]
    if wrong := [code for code in codes if not 1 <= code <= _LAST_FUNCTION]:
        raise CellError(column, wrong[0], f"function codes, 1 to {_LAST_FUNCTION}")
    return tuple(codes)


def _factor(column: str, cell: object) -> float:
    factor = fraction(column, cell)
    if factor == 0:
        raise CellError(column, 0, "a number other than 0")
    return factor


def fraction(column: str, cell: object) -> float:
    """A number, also one with a decimal comma, or two with a bar between them."""
    text = _cell(cell)
    above, bar, below = text.replace(",", ".").partition("/")
    try:
        number = float(above) / float(below) if bar else float(above)
    except (ValueError, ZeroDivisionError, OverflowError):
        number = math.nan
    if not math.isfinite(number):
        raise CellError(column, cell, "a number")
    return number


def other_texts(cells: Mapping[str, object], known: Collection[str]) -> dict[str, str]:
    """What nobody declared, as it stands: columns or header lines that are not `known`."""
    plain = {one_line(key): value for key, value in cells.items() if key not in known and value not in (None, "")}
    return {key: one_line(_cell(value))[:_TEXT_LENGTH] for key, value in plain.items() if key and not _nested(value)}


def one_line(text: object) -> str:
    """A text on one line; what does not print as itself is written as its escape."""
    return harmless(" ".join(str(text).split()))


def _text(column: str, cell: object) -> str:
    if _nested(cell):
        raise CellError(column, type(cell).__name__, "a text")
    return one_line(_cell(cell))[:_TEXT_LENGTH]


def _holds(cell: object) -> bool:
    return bool(cell.strip()) if isinstance(cell, str) else cell is not None


def _nested(value: object) -> bool:
    return isinstance(value, dict | list | tuple | set)


def _cell(value: object) -> str:
    if isinstance(value, str):
        return value.strip()
    if value is None or _nested(value):
        return ""
    return hex(value) if isinstance(value, int) and abs(value) >> 64 else str(value).strip()


def states_text(values: Mapping[int, str]) -> str:
    """The cell that `names_of` reads."""
    return "; ".join(f"{state}={_escaped(name)}" for state, name in values.items())


def _escaped(name: str) -> str:
    return re.sub(r"([;|=\\])", r"\\\1", name)


_NUMBER: Final = {"type": ["number", "string"]}
_WHOLE_OR_TEXT: Final = {"type": ["integer", "string"]}
_TEXT: Final = {"type": "string"}
COLUMNS: Final[tuple[Column, ...]] = (
    Column("area", {"enum": ["coil", "discrete", "input", "holding"]}, "which of the four tables", "area"),
    Column("address", _WHOLE_OR_TEXT, "decimal, hex (0x6B), 4x108, or 40108 where area is empty", "address"),
    Column("name", {**_TEXT, "minLength": 1}, "what people call it", "name"),
    Column("type", {"enum": list(VALUE_TYPES)}, "how the registers are read; u16 if empty, bool in coil and discrete",
           "type"),
    Column("order", {"enum": list(ORDERS)}, "where the bytes A (most significant) to D go; the header's if empty",
           "order"),
    Column("length", _WHOLE_OR_TEXT, "registers, of a text, an enum, bits or a time", "length"),
    Column("scale", _NUMBER, "value = raw * scale + offset", "scale", _factor, number_text),
    Column("offset", _NUMBER, "value = raw * scale + offset", "offset", fraction, number_text),
    Column("scale_register", _WHOLE_OR_TEXT, "address whose signed value is a power of ten", "scale_address", None,
           number_text),
    Column("unit", _TEXT, "unit of measure", "unit", _text),
    Column("values", {"type": ["object", "string"]}, "names of states or bits: 0=off; 1=on", "values",
           lambda _, cell: names_of(cell), states_text),
    Column("access", {"enum": ["r", "w", "rw"]}, "read, write or both", "access", _access),
    Column("written_by", _WHOLE_OR_TEXT, "functions that write it, where not all do: 16", "written_by", _writers,
           lambda codes: " ".join(map(str, codes))),
    Column("formula", _TEXT, "how it follows from others: [Offset] + raw / 65535 * [Gain]", "formula", _formula),
    Column("min", _NUMBER, "least plausible value, in the unit", "minimum", fraction, number_text),
    Column("max", _NUMBER, "greatest plausible value, in the unit", "maximum", fraction, number_text),
    Column("description", _TEXT, "more words", "description", _text),
    Column("group", _TEXT, "a heading to list it under", "group", _text),
)  # fmt: skip
COLUMN_NAMES: Final = tuple(column.name for column in COLUMNS)


def value_of(cells: Mapping[str, object], *, base: int = 0, order: str = "ABCD") -> MappedValue:
    """The value of one row's cells by column name; CellError where one cannot be read."""
    area, address = area_and_address(cells.get("area"), cells.get("address"), base)
    if not (name := _text("name", cells.get("name"))):
        raise CellError("name", "", "a name")
    kind = type_of(cells.get("type"), area)
    length = length_of(cells.get("length"), kind)
    if address + length > _LAST_ADDRESS + 1:
        raise CellError("address", cells.get("address"), f"that {length} registers end by {_LAST_ADDRESS}")
    scale_cell = cells.get("scale_register")
    value = MappedValue(
        area=area,
        address=address,
        name=name[:_NAME_LENGTH],
        type=kind,
        order=order_of(cells.get("order"), order),
        length=length,
        scale_address=area_and_address(area, scale_cell, base)[1] if _cell(scale_cell) else None,
        other=other_texts(cells, COLUMN_NAMES),
        **{
            column.attribute: column.read(column.name, cells[column.name])
            for column in COLUMNS
            if column.read is not None and _holds(cells.get(column.name))
        },
    )
    if value.minimum is not None is not value.maximum and value.minimum > value.maximum:
        raise CellError("max", cells.get("max"), f"at least min, {value.minimum:g}")
    return value


def cells_of(value: MappedValue, order: str = "ABCD") -> dict[str, str]:
    """The cells of one value, those that say nothing new left empty; addresses count from 0."""
    usual = {"order": order, "length": str(VALUE_TYPES[value.type]), "scale": "1", "offset": "0"}
    cells = {column.name: column.written(getattr(value, column.attribute)) for column in COLUMNS}
    return {**{key: "" if cell == usual.get(key) else cell for key, cell in cells.items()}, **value.other}
