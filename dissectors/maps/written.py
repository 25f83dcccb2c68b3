"""What single cells of tables in manuals say: addresses, types, factors, units, states, limits.

Addresses as they are printed: 40001-40002, 0x10, 001Fh, 1A, 4x108, 1 000, 40012.3. A type is read by its parts,
wherever they stand in it: what is held, of how many bits, with a sign or without. The words are in `vocabulary.toml`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Final, cast

from .cells import CellError, area_of
from .model import BIT_AREAS, MapArea
from .vocabulary import WIDE_SIGNS, expression, form, meaning, meet, tidied, vocabulary

_NUMBER: Final = re.compile(
    r"0[xX][0-9A-Fa-f]+|[0134][xX]\d+|\b[0-9][0-9A-Fa-f]*[hH]\b|\b[A-Fa-f][0-9A-Fa-f]*[hH]\b|\d+"
)
_PARTS: Final = re.compile(r"\s*(?:-|–|—|…|\.{2,3}|to|[,;/&])\s*")
_FUNCTIONS: Final[Mapping[int, MapArea]] = {1: "coil", 5: "coil", 15: "coil", 2: "discrete", 3: "holding", 6: "holding",
                                            16: "holding", 4: "input"}  # fmt: skip
_LONGEST: Final = 1000  # characters of a title
_LOGICAL_DIGITS: Final = 5  # at least
_READING: Final = frozenset({1, 2, 3, 4})
_READING_ONLY: Final = frozenset({2, 4})  # of areas that nobody can write

_LONGER: Final = {("f32", 4): "f64", ("bcd16", 2): "bcd32"}


_LOGICAL: Final = (r"[0134]\d{4,5}", r"[0134]\d{4,5}|[1-9]\d{0,3}")
"""Logical numbers; beside those of discrete inputs also of coils that spreadsheets took their zeros from."""


@dataclass(frozen=True, slots=True)
class AddressForm:
    """How a column of addresses is written: hexadecimal without a mark, which its heading may say; with bits behind a
    point; all as logical numbers (00001, 10001, 30001, 40001), or some as no logical number is (30000, 50001); some
    with the digit of their area before an x (4x0001), so that 0x0005 is a coil; all of five digits, 0 or 1 first.
    `base` is what its heading counts plain ones from."""

    is_hex: bool = False
    is_said: bool = False
    has_bits: bool = False
    is_logical: bool = False
    is_plain: bool = False
    has_prefixes: bool = False
    is_digital: bool = False
    base: int = 0

    def logical_digits(self, area: MapArea | None) -> str:
        """The digits that lead a logical number of an area; none where no number is one."""
        if self.is_plain:
            return ""
        every = self.is_logical or (self.is_digital and area in BIT_AREAS)
        return ("34", "0134")[every]


@dataclass(frozen=True, slots=True)
class TableAddress:
    """`first` and, of a range, `last`; `text` the first as it is read elsewhere; `prefixed` one such as 4x108."""

    text: str
    first: int
    last: int | None = None
    bit: str = ""
    prefixed: bool = False

    def moved(self, base: int) -> TableAddress:
        """The address that lies so far behind a base."""
        return replace(self, first=self.first + base, text=str(self.first + base)) if base else self


def address_form(heading: str, cells: Sequence[str]) -> AddressForm:
    """The form of a column: by its heading, and by what all of its cells are."""
    cells = list(filter(None, map(together, cells)))
    parts = [part for cell in cells for part in _PARTS.split(cell)]
    bare = [part for part in parts if form("bare_hex", part)]
    letters = [part for part in bare if expression(r"(?=.*\d).*[A-Fa-f].*").fullmatch(part.rstrip("hH"))]
    is_said = bool(form("hex_heading", heading.lower()))
    is_hex = is_said or (bool(letters) and len(bare) > 0.8 * len(parts))
    numbers = list(filter(str.isdecimal, parts))
    bits = [int(behind["bit"]) for cell in cells if (behind := form("bit_behind", cell))]
    return AddressForm(
        is_hex,
        is_said,
        has_bits=any(bits),
        is_logical=_any_like(r"[34].*", numbers) and _all_like(_LOGICAL[_any_like("10{3,4}[1-9]", numbers)], numbers),
        is_plain=_is_plain(heading, numbers),
        has_prefixes=_any_like(r"[134][xX]\d+", parts),
        is_digital=_all_like(r"[01](?!0000)\d{4}", numbers),
        base=int(bool(form("from_one", heading)) and not _any_like(r"(0x)?0+h?", parts)),
    )


def _is_plain(heading: str, numbers: Sequence[str]) -> bool:
    """Whether numbers are addresses as they stand. Logical numbers begin near the first of their area; what is all far
    from it (33057) is none, unless its heading calls it a number, nor is what a sentence calls an address of the
    protocol."""
    is_near = bool(form("numbered", heading.lower())) or _any_like(r"[34]0?0[0-4]\d\d", numbers)
    is_said = bool(form("in_protocol", heading)) and not _any_like(r"[34]0?0001", numbers)
    return is_said or _any_like(r"[34]0{4}|[256789]\d{4}" + r"|[34]\d{4}" * (not is_near), numbers)


def _all_like(pattern: str, texts: Sequence[str]) -> bool:
    return bool(texts) and all(map(expression(pattern).fullmatch, texts))


def _any_like(pattern: str, texts: Sequence[str]) -> bool:
    return any(map(expression(pattern).fullmatch, texts))


@lru_cache(maxsize=4096)
def address_of(cell: str, form_of: AddressForm) -> TableAddress | None:
    """The address in a cell; None where there is none."""
    cell = together(cell)
    behind = form("bit_behind", cell * form_of.has_bits)
    cell, bit = tidied("place", behind.get("place", cell)), behind.get("bit", "")
    if form_of.is_hex:
        cell = expression(r"(?<![0-9A-Za-z])([0-9A-Fa-f]{1,4})[hH]?(?![0-9A-Za-z])").sub(r"0x\1", cell)
    numbers = _NUMBER.findall(cell)
    if not numbers:
        return None
    numbers[0] = numbers[0].zfill(_LOGICAL_DIGITS * form_of.is_logical)
    first, *others = map(_whole, numbers)
    prefixed = expression(rf"[{'0' * form_of.has_prefixes}134][xX]\d+").fullmatch(numbers[0]) is not None
    last = others[0] if len(others) == 1 and others[0] >= first else None
    return TableAddress(numbers[0].lower(), first, last, bit, prefixed)


@lru_cache(maxsize=8192)
def numbers_in(cell: str) -> Sequence[int]:
    """The numbers of a cell as addresses have them, bare hexadecimal ones too."""
    cell = together(cell)[:40]
    return [_whole(number) for number in _NUMBER.findall(cell)]


def together(cell: str) -> str:
    """A cell whose numbers have no gaps at their thousands."""
    return cell if cell.isdecimal() else tidied("numbers", cell.strip())


def _whole(text: str) -> int:
    if text[:2] in ("0x", "0X") or text[-1] in "hH":
        return int(text.rstrip("hH"), 16)
    return int(text[2:] if text[1:2] in ("x", "X") else text)


@lru_cache(maxsize=4096)
def type_of(text: str, length: int | None) -> tuple[str, int | None]:
    """The type that a cell means, and the registers that it takes, of which another column may speak."""
    word = tidied("type", tidied("code", text).lower())
    width = _product(meaning("bits", tidied("width", word)))
    held = meaning("type", tidied("held", word))
    words = max(1, width // 16) if width else length or 0
    match held:
        case "text":
            return "text", length or max(1, int((re.findall(r"\d+", word) or ["2"])[0]) // 2)
        case "bits" | "bool" | "enum":
            return held.replace("bool", "bits"), words if width > 16 else length
        case None:
            words = int(meaning("words", word) or words)
            sign = (meaning("sign", word) or "u")[0]
            return f"{sign}{16 * words if words in (2, 4) else 16}", length
        case _:
            return _LONGER.get((held, words), held), length


def _product(text: str | None) -> int:
    """Bits, of `2*16`; 0 where nothing speaks of them."""
    count, _, of_each = (text or "0*0").partition("*")
    return int(count) * int(of_each)


def order_of(text: str) -> str | None:
    """The word and byte order that a text names; None where it names none, or one that could be several."""
    order = meaning("order", text)
    return order.upper() if order else None


def access_of(cells: Mapping[str, str]) -> str | None:
    """r, w or rw out of `R/W`, `read only`, `чтение/запись`, `L/E`, `只读`; of a column whether one can write, too."""
    return meaning("access", tidied("access", cells.get("access", ""))) or meaning(
        "writable", cells.get("writable", "")
    )


@lru_cache(maxsize=4096)
def area_of_cell(text: str, *, function: bool = False) -> MapArea | None:
    """The area that a cell names, by words, by its digit (4 for 4x), or by the code of a `function` that reads it."""
    word = text.strip().lower().removesuffix(".0")
    if not function:
        try:
            return area_of(word)
        except CellError:
            pass
    codes = [int(code, 16) for code in re.findall(r"(?<![0-9a-f])(?:0x)?0?([0-9a-f])h?\b", word)]
    return area_words(word) or next(map(_FUNCTIONS.__getitem__, filter(_FUNCTIONS.__contains__, codes)), None)


def area_words(text: str) -> MapArea | None:
    """The area of which a title speaks, by its words or by the functions that it names, if all are of one."""
    named = cast("MapArea | None", meaning("area", text))
    areas = {_FUNCTIONS[code] for code in functions_in(text)}
    return named or (areas.pop() if len(areas) == 1 else None)


@lru_cache(maxsize=1024)
def functions_in(text: str) -> Sequence[int]:
    """The functions that a text names and that read or write data."""
    meet(text)
    named = expression(vocabulary()["functions"]).finditer(text[:_LONGEST])
    parts = (part for said in named for part in _NUMBER.findall(said["behind"] or said["before"]))
    return [code for code in map(_whole, parts) if code in _FUNCTIONS]


def access_said(text: str, *, codes: bool = False) -> str:
    """What a title says of the access to all rows below it, by words or functions; of a cell of `codes`, by these."""
    said = meaning("said_access", text * (not codes))
    functions = set(functions_in(f"{'fc ' * codes}{text}"))
    read, written = functions & _READING, functions - _READING
    reads = functions != set() and (functions <= _READING_ONLY) == codes  # who says that inputs are read says no more
    return said or (f"{'r' * bool(read)}w" if written else "r" * reads)


@lru_cache(maxsize=4096)
def values_of(text: str) -> str | None:
    """States with names as a map writes them, where a cell has more than one."""
    text = text.translate(WIDE_SIGNS)
    ways = (expression(like) for like in vocabulary()["states"])
    pairs = next(filter(None, ([*like.finditer(text)] for like in ways)), [])
    return "; ".join(f"{pair['state']}={pair['name'].strip()}" for pair in pairs) if len(pairs) > 1 else None


@lru_cache(maxsize=4096)
def has_only_states(text: str) -> bool:
    """Whether a remark is a list of states: `0 - off, 1 - on`, `0: 4800, 1: 9600`."""
    text = text.translate(WIDE_SIGNS)
    parts = list(filter(None, map(str.strip, expression(r"[;,\n|]").split(text))))
    states = [form("listed_state", part).get("state", "") for part in parts]
    return (len(states) > 1 and _all_like(r"\d+", states)) or form("listed_states", text) != {}


def bits_of(text: str, kind: str) -> dict[int, str]:
    """The bits that a remark names, where it names some of a word: `bit 0: running, bit 3: alarm`."""
    if kind not in ("u16", "u32", "bits"):
        return {}
    found = {int(said["bit"]): said["name"] for said in expression(vocabulary()["bits"]).finditer(text)}
    return found if len(found) > 1 else {}


def states_in(cells: Mapping[str, str], kind: str, name: str) -> tuple[str, str | None]:
    """A row's name, and the names of its states or bits: out of their column, the range, the remark, or behind it."""
    remark, span = cells.get("description") or cells.get("unit", ""), cells.get("range", "")
    behind = form("states_behind", name)
    ways = (
        (name, cells.get("values", ""), kind in ("enum", "bits", "u16", "s16")),
        (name, span, has_only_states(span)),
        (name, remark, kind in ("enum", "bits") or has_only_states(remark)),
        (behind.get("name", name), behind.get("states", ""), has_only_states(behind.get("states", ""))),
    )
    named = ((called, values_of(text)) for called, text, is_list in ways if is_list)
    return next((way for way in named if way[1]), (name, None))
